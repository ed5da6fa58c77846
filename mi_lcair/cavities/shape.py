"""Shapes of cavities: bodies of revolution about the z axis, with a circular aperture at z = 0.

z is the depth below the plane of the aperture. All shapes are convex.
"""

from dataclasses import dataclass
from math import pi, radians, sqrt, tan
from typing import Literal

import numpy as np

from mi_lcair.declared import Rule, Table, entry, given, listed, rule

# What each kind takes beside radius_m and aperture_radius_m; a cone takes one of the two
TAKEN = {
    "cylinder": ("length_m",),
    "cone": ("length_m", "angle_deg"),
    "cylinder_cone": ("length_m", "angle_deg"),
    "sphere": (),
}


def of_its_kind(shape: "Shape") -> str | None:
    taken, stated = TAKEN[shape.kind], given(shape, ("length_m", "angle_deg"))
    if shape.kind == "cone":
        return None if len(stated) == 1 else "a cone needs one of length_m and angle_deg"
    needed = listed(taken) if taken else "neither length_m nor angle_deg"
    return None if stated == [*taken] else f"a {shape.kind} takes {needed} beside radius_m"


RULES = (
    Rule(of_its_kind),
    rule(
        lambda t: t.kind != "cylinder_cone" or t.cone_length < t.length_m,
        "length_m = {t.length_m:g}; must exceed the cone's {t.cone_length:g} m, which radius_m and "
        "angle_deg give",
    ),
    rule(
        lambda t: t.kind != "sphere" or t.aperture < t.radius_m,
        "a sphere needs an aperture_radius_m below its radius_m",
    ),
    rule(
        lambda t: t.aperture <= t.radius_m,
        "aperture_radius_m = {t.aperture:g}; must be at most radius_m = {t.radius_m:g}",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Shape(Table, where="[shape]", rules=RULES):
    """Shape of a cavity. Raises InputError for numbers that make none.

    Attributes
    ----------
    kind : str
        "cylinder", "cone", "cylinder_cone" or "sphere".
    radius_m : float
        Radius of the cylinder, of the cone's base, or of the sphere [m].
    length_m : float or None
        Depth of the whole cavity [m], except of a sphere.
    angle_deg : float or None
        Full apex angle of the cone [deg]. A cone has a length or an angle.
    aperture_radius_m : float or None
        Radius of the aperture [m]. Around a smaller one than the radius is a flat lid, inside of
        which is a wall too. None: the whole end is open.
    """

    kind: Literal["cylinder", "cone", "cylinder_cone", "sphere"]
    radius_m: float = entry(is_positive=True, unit="m")
    length_m: float | None = entry(None, is_positive=True, unit="m")
    angle_deg: float | None = entry(None, lower=1, upper=179, unit="degrees")
    aperture_radius_m: float | None = entry(None, is_positive=True, unit="m")

    @property
    def aperture(self) -> float:
        """Radius of the aperture [m]."""
        return self.radius_m if self.aperture_radius_m is None else self.aperture_radius_m

    @property
    def cone_length(self) -> float:
        """Length of the cone [m]."""
        if self.angle_deg is None:
            return self.length_m
        return self.radius_m / tan(radians(self.angle_deg) / 2)

    @property
    def depth(self) -> float:
        """Distance of the deepest point from the aperture's plane [m]."""
        if self.kind == "sphere":
            return self.radius_m + sqrt(self.radius_m**2 - self.aperture**2)
        return self.cone_length if self.kind == "cone" else self.length_m

    def corners(self) -> list[tuple[float, float]]:
        """Radius and depth of the corners [m], from the aperture's edge to the axis."""
        R, L = self.radius_m, self.depth
        edge = [(self.aperture, 0.0)] if self.aperture < R else []
        if self.kind == "cylinder":
            return [*edge, (R, 0.0), (R, L), (0.0, L)]
        if self.kind == "cone":
            return [*edge, (R, 0.0), (0.0, L)]
        return [*edge, (R, 0.0), (R, L - self.cone_length), (0.0, L)]

    @property
    def parts(self) -> int:
        """Number of straight parts of the wall; 1 for a sphere."""
        return 1 if self.kind == "sphere" else len(self.corners()) - 1

    def nodes(self, count: int) -> np.ndarray:
        """Radii and depths [m] of circles that divide the wall into rings, (2, n).

        They go from the aperture's edge to the axis. Each straight part of the wall has `count`
        rings, which are narrow at its ends, where the radiance changes fastest.
        """
        steps = (1 - np.cos(pi * np.arange(count + 1) / count)) / 2
        if self.kind == "sphere":
            first = np.arcsin(self.aperture / self.radius_m)
            angles = first + (pi - first) * steps
            # The depth of the centre is that of the last node less the radius
            r, z = self.radius_m * np.sin(angles), self.depth - self.radius_m * (1 + np.cos(angles))
        else:
            r, z = (
                np.concatenate([[values[0]], *(a + (b - a) * steps[1:] for a, b in pairs)])
                for values in zip(*self.corners())
                for pairs in [list(zip(values, values[1:]))]
            )
        z[0], r[-1] = 0.0, 0.0
        return np.array([r, z])

    def areas(self, nodes: np.ndarray) -> np.ndarray:
        """Areas of the rings between nodes [m^2], those of the curved wall itself."""
        r, z = nodes
        if self.kind == "sphere":
            return 2 * pi * self.radius_m * np.diff(z)
        return pi * (r[1:] + r[:-1]) * np.hypot(np.diff(r), np.diff(z))

    @property
    def wall_area(self) -> float:
        """Area of the wall [m^2]."""
        return float(self.areas(self.nodes(1)).sum())
