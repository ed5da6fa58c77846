"""Parameters with respect to which the radiance is differentiated, by what they change.

These classes hold no type of Mitsuba, so that they are not loaded again with a variant.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class MaterialColumn:
    """A parameter of a material. surfaces: all BSDFs that share it. parameter: its name."""

    surfaces: tuple
    parameter: str


@dataclass(frozen=True)
class SourceColumn:
    """A parameter that changes only the radiance of sources, such as a temperature.

    relative: for each emitter the derivative of its radiance, divided by the radiance. It is one
    number, or one for each facet.
    """

    relative: dict
