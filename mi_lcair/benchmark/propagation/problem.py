"""What propagation methods are compared on: scenes with a window whose intensity is known, and the
one interface of the methods.
"""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.triangles import TriangleTable, is_faceted
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area


@dataclass(frozen=True)
class Problem:
    """The intensity [W/sr] that the model's facets send through the window of a scene's
    orthographic sensor.

    answer: that intensity; its standard error, 0 for a closed form, and where it comes from.
    bounces: reflections after which nothing that matters is left. points: how many points of the
    visible facets the deterministic methods look from at least. resolution_deg: the coarsest grid
    of directions that resolves what the surfaces reflect. ambient: temperature [K] of the
    surroundings, for the closure of paths; None where nothing surrounds the model. diffuse: whether
    every surface reflects evenly in all directions.
    """

    name: str
    scene: Scene
    answer: float
    standard_error: float
    source: str
    bounces: int
    points: int
    resolution_deg: float
    ambient: float | None
    diffuse: bool

    @cached_property
    def facets(self) -> FacetTable:
        return FacetTable(self.scene)

    @cached_property
    def triangles(self) -> TriangleTable:
        """Which triangle of `facets.triangles` a hit belongs to."""
        return TriangleTable([shape for shape in self.scene.mi.shapes() if is_faceted(shape)])

    @cached_property
    def has_background(self) -> bool:
        return bool(np.any(self.facets.type != "model"))

    @cached_property
    def window_area(self) -> float:
        return window_area(self.scene.sensor(0), self.name)

    @property
    def integrator(self):
        return self.scene.mi.integrator()

    @contextmanager
    def prepared(self):
        """Within: the surfaces' emission and reflection may be evaluated and rays traced. Gives
        Mitsuba's scene and the scene's emitters, whose `spawn_ray` leaves a surface.
        """
        with self.integrator.prepared(self.scene.mi):
            yield self.scene.mi, self.integrator.emitters


@dataclass(frozen=True)
class Method:
    """A way to compute a problem's intensity.

    section: of the thesis, "" for ours. run(problem, effort, seed) -> (intensity [W/sr], rays
    traced). efforts(problem) -> the efforts worth a try, rising, none where the method does not
    apply; an effort is in the method's own words. is_random: whether the seed matters.
    """

    name: str
    section: str
    run: Callable[[Problem, int, int], tuple[float, int]]
    efforts: Callable[[Problem], list[int]]
    is_random: bool


def emitted(si, scene, active=True) -> mi.Float:
    """Radiance that what was hit emits toward the ray's origin [W m^-2 sr^-1]."""
    return si.emitter(scene, active).eval(si, active)[0]
