"""What all results can do, their sections, and the units that names of columns end in."""

from mi_lcair.results.result import Result, entry

__all__ = ["Result", "entry"]
