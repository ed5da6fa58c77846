"""Problems on which propagation methods are compared, and the interface of a method.

A problem is a scene whose intensity through the window of its sensor is known.
"""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import TriangleTable, is_faceted
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area


@dataclass(frozen=True)
class Problem:
    """A scene whose intensity through the window of its orthographic sensor is known.

    Attributes
    ----------
    name
        Name in the charts.
    scene
        The loaded scene.
    answer
        Intensity of the model's facets through the window [W/sr].
    standard_error
        Standard error of `answer` [W/sr]; 0 for a closed form.
    source
        How the answer is known.
    bounces
        Number of reflections that a method has to count.
    points
        Least number of points on the visible facets from which the deterministic methods start.
    resolution_deg
        Width in degrees of the coarsest grid of directions that resolves the reflection.
    ambient
        Temperature of the surroundings [K], for `closure = ambient`; None without surroundings.
    diffuse
        Whether every surface is Lambertian.
    independent
        The same scene with Mitsuba's independent sampler, or None.
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
    independent: Scene | None = None

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

    @contextmanager
    def prepared(self):
        """Context in which emission and reflection can be evaluated and rays traced.

        It gives Mitsuba's scene and the table of emitters, whose `spawn_ray` starts a ray off a
        surface.
        """
        with self.scene.prepared() as tracer:
            yield self.scene.mi, tracer.emitters


@dataclass(frozen=True)
class Method:
    """A method that computes the intensity of a problem.

    Attributes
    ----------
    name
        Name in the charts.
    section
        Section of the thesis that describes it, or "" for a method of this project.
    run
        run(problem, effort, seed) returns the intensity [W/sr] and the number of rays traced.
    efforts
        efforts(problem) returns the efforts worth a try in ascending order, or an empty list where
        the method does not apply. Each method has its own unit of effort, such as paths.
    is_random
        Whether the result depends on the seed.
    """

    name: str
    section: str
    run: Callable[[Problem, int, int], tuple[float, int]]
    efforts: Callable[[Problem], list[int]]
    is_random: bool


def emitted(si, scene, active=True) -> mi.Float:
    """Radiance that the surfaces at `si` emit toward the origins of their rays [W m^-2 sr^-1]."""
    return si.emitter(scene, active).eval(si, active)[0]
