"""Kinks along a motion: values at which facets of a model turn edge-on.

Up to such a value a facet shows one side, and from there on nothing or its other side. The value is
known from the vertices alone. Renders of these facets alone give their mean radiance beside it, and
with it the part of the derivative that jumps. The other facets are differentiated without them, so
that a step may reach over the kink.
"""

from dataclasses import dataclass

import numpy as np

from mi_lcair.plugins.emission.triangles import triangle_vertices
from mi_lcair.rendering.facets import facings, meshes_of_model, projected, radiances
from mi_lcair.rendering.motions.pose import ScenePose, moved

# Of the scale of a motion: values that are one, as vertices are rounded, and distance from a kink
# up to which the present value is at it
ONE_VALUE, AT_KINK = 1e-5, 1e-6
# Least jump of the intensity per scale of the motion that is looked at, as a part of the intensity
LEAST_JUMP = 1e-3
MOST_KINKS = 3  # the largest ones by a bound of their radiance


@dataclass(frozen=True)
class TurningFacets:
    """Triangles of a model that turn edge-on at one value of a motion.

    offset: distance of that value from the present one. among: whether a triangle of the model is
    one of them, (n,). toward: coefficients of their areas toward the sensor, in parts of the
    window's area, as polynomials of the distance from the present value, (3, k). shown: whether
    they emit or reflect from their backs and from their fronts, (2, k).
    """

    offset: float
    among: np.ndarray
    toward: np.ndarray
    shown: np.ndarray

    def visible(self, side: int) -> np.ndarray:
        """Whether the triangles show a side that emits or reflects below or above the kink, (k,).

        side: -1 or 1.
        """
        turns_to_front = side * self.growth(self.offset) > 0
        return np.where(turns_to_front, self.shown[1], self.shown[0])

    def growth(self, x: float) -> np.ndarray:
        """Derivatives of the areas toward the sensor at a distance from the present value, (k,)."""
        return self.toward[1] + 2 * x * self.toward[2]

    def area(self, x: float, side: int) -> float:
        """Visible area of all triangles on a side of the kink."""
        return float(self.visible(side) @ abs(self.toward.T @ [1, x, x * x]))

    def slope(self, x: float, side: int) -> float:
        """Derivative of `area`."""
        return side * float(self.visible(side) @ abs(self.growth(x)))


def areas_toward(scene, sensor, name: str, values) -> np.ndarray:
    """Areas of the model's triangles toward a sensor for values of a motion, (values, n).

    They are parts of the window's area, negative for a triangle that shows its back. Those of
    meshes follow from vertices in Float64, without moving the scene.
    """
    meshes, areas = meshes_of_model(scene), []
    faces = facings(meshes)[0]
    is_of_meshes = bool(ScenePose.of(scene).motions[name].shapes)
    for value in values:
        with moved(scene, {} if is_of_meshes else {name: value}):
            pose = ScenePose.of(scene)
            vertices = [pose.vertices(mesh, {**pose.values, name: value}) for mesh in meshes]
            corners = [v[triangle_vertices(mesh)] for mesh, v in zip(meshes, vertices)]
            areas.append(faces * projected(np.concatenate(corners), sensor))
    return np.array(areas)


def turning_facets(scene, sensor, name: str, value: float, reach: float, scale: float):
    """The triangles of a scene's model that turn edge-on within `reach` of a motion's value.

    Those whose jump may matter, at most MOST_KINKS lists of `TurningFacets`. scale: of the motion.
    """
    low, here, high = areas_toward(scene, sensor, name, value + np.array([-2, 0, 2]) * reach)
    a, b, c = here, (high - low) / (4 * reach), (high + low - 2 * here) / (8 * reach**2)
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        offsets = -2 * a / (b + np.where(b < 0, -root, root))
    meshes = meshes_of_model(scene)
    shown, radiance = facings(meshes)[1], radiances(meshes)
    visible = np.abs(a) * np.where(a > 0, shown[1], shown[0])
    # What a facet reflects is not known: it is taken for the mean radiance of the model
    total = np.abs(high - low) + np.abs(here)
    radiance = np.maximum(radiance, total @ radiance / max(total.sum(), 1e-300))
    jump = scale * np.abs(b) * radiance
    near = np.flatnonzero((np.abs(offsets) <= reach) & (jump > 0))
    near = near[np.argsort(offsets[near])]
    apart = np.flatnonzero(np.diff(offsets[near]) > ONE_VALUE * scale) + 1
    large = [k for k in np.split(near, apart) if jump[k].sum() > LEAST_JUMP * (visible @ radiance)]
    return [
        TurningFacets(
            offset=float(np.average(offsets[k], weights=jump[k])),
            among=np.isin(np.arange(len(a)), k),
            toward=np.array([a, b, c])[:, k],
            shown=shown[:, k],
        )
        for k in sorted(large, key=lambda k: -jump[k].sum())[:MOST_KINKS]
    ]


@dataclass(frozen=True)
class Kink:
    """What facets that turn edge-on at a value of a motion add to a derivative.

    facets: those that turn. radiance: by side of the kink, -1 or 1, their mean radiance there and
    its slope away from it, with the deviations of both, (2, 1 + R). share: of a value, the standard
    error that these do not show. step: distance from the kink of the farther renders.
    """

    facets: TurningFacets
    radiance: dict[int, np.ndarray]
    share: float
    step: float

    def slope(self, x: float, side: int) -> np.ndarray:
        """The derivative and its deviations at a distance from the present value, (1 + R,).

        side: of the kink. The radiance of a facet that is nearly edge-on changes with its area.
        """
        R, slope = self.radiance[side]
        away = abs(x - self.facets.offset)
        return self.facets.slope(x, side) * (R + 2 * away * slope)

    def at(self, x: float, near: float) -> np.ndarray:
        """The derivative at a distance from the present value, (1 + R,).

        It is the mean of both sides within `near` of the kink.
        """
        away = x - self.facets.offset
        if abs(away) <= near:
            return (self.slope(x, -1) + self.slope(x, 1)) / 2
        return self.slope(x, -1 if away < 0 else 1)

    @property
    def unscattered(self) -> float:
        """Standard error of a side's derivative that the deviations do not show.

        It holds a quarter of what the extrapolation to the kink changes.
        """
        errors = [
            self.facets.slope(self.facets.offset, side)
            * np.hypot(self.share * R[0], slope[0] * self.step / 4)
            for side, (R, slope) in self.radiance.items()
        ]
        return float(np.abs(errors).max())
