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
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area

OF_DIFFUSE = 22.5  # width of a cell that resolves diffuse reflection [degrees]
# Width of a cell that resolves bare aluminium [degrees]: 80 cells over 20, thesis Figure 3.19
OF_LOBE = 0.25


@dataclass(frozen=True)
class Problem:
    """A scene whose intensity through the window of its orthographic sensor is known.

    Attributes
    ----------
    name
        Name in the charts.
    scene
        The loaded scene.
    independent
        The same scene with Mitsuba's independent sampler, or None.
    bounces
        Number of reflections that a method has to count.
    points
        Least number of points on the visible facets from which the deterministic methods start.
    diffuse
        Whether every surface is Lambertian.
    ambient
        Temperature of the surroundings [K], for `closure = ambient`; None without surroundings.
    answer
        Intensity of the model's facets through the window [W/sr].
    source
        How the answer is known.
    standard_error
        Standard error of `answer` [W/sr]; 0 for a closed form.
    """

    name: str
    scene: Scene
    independent: Scene | None
    bounces: int
    points: int
    diffuse: bool
    ambient: float | None = None
    answer: float = 0.0
    source: str = ""
    standard_error: float = 0.0

    @property
    def resolution_deg(self) -> float:
        """Width in degrees of the coarsest grid of directions that resolves the reflection."""
        return OF_DIFFUSE if self.diffuse else OF_LOBE

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
    is_random: bool = True


def emitted(si, scene, active=True) -> mi.Float:
    """Radiance that the surfaces at `si` emit toward the origins of their rays [W m^-2 sr^-1]."""
    return si.emitter(scene, active).eval(si, active)[0]
