"""What all results can do, their sections, and the units that names of columns end in."""

from mi_lcair.results.result import Result, named

__all__ = ["Result", "named"]
