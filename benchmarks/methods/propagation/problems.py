"""The problems of the chart of propagation methods.

They are bundled scenes. Their answer is a closed form or a far more precise render.
"""

from dataclasses import replace
from math import log2

import mitsuba as mi
import numpy as np

from benchmarks.methods.propagation import exact, path_tracing
from benchmarks.methods.propagation.problem import Problem
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import Scene, load
from mi_lcair.rendering.window import window

RANGE_WALLS = 258.0  # K: between the upper half's 263 K and the lower half's 253 K
# Facet of the cylinder, as seen from the tail, with the largest share of radiance from two or more
# reflections.
WING_ROOT_FACET = 515
BOUNCES = 10  # reflections in the reference renders
VIEW_FACTOR = "view factor in closed form"


def two_plates() -> Problem:
    """The scene two_plates, whose answer is a view factor in closed form."""
    problem = Problem("two_plates", *loaded("two_plates"), bounces=1, points=32, diffuse=True)
    answer = exact.two_plates_intensity(blackbody(problem, 800))
    return replace(problem, answer=answer, source=VIEW_FACTOR)


def open_box() -> Problem:
    """The scene open_box, whose answer is a view factor in closed form."""
    problem = Problem("open_box", *loaded("open_box"), bounces=1, points=32, diffuse=True)
    answer = exact.open_box_intensity(blackbody(problem, 800), blackbody(problem, 300))
    return replace(problem, answer=answer, source=VIEW_FACTOR)


def cavity(opening: int = 8) -> Problem:
    """The scene cavity. Its answer is the limit of many reflections in the true sphere.

    opening: number of facets removed. The facetted sphere is within 0.02 % of it.
    """
    scenes = loaded("cavity", opening=opening)
    problem = Problem("cavity", *scenes, bounces=24, points=4, diffuse=True, ambient=800.0)
    answer = exact.cavity_emissivity(opening) * blackbody(problem, 800) * 0.06**2
    source = f"sphere with {opening} of 400 facets removed, closed form"
    return replace(problem, answer=answer, source=source)


def furnace() -> Problem:
    """The scene furnace, where every pixel has the blackbody's radiance."""
    scenes = loaded("furnace")
    problem = Problem("furnace", *scenes, bounces=32, points=512, diffuse=False, ambient=300.0)
    source = "isothermal: the blackbody's radiance everywhere"
    return replace(problem, answer=blackbody(problem, 300), source=source)


def case(number: int, quick: bool) -> Problem:
    """One of the CASES; with `quick`, its reference render has fewer paths."""
    make, *paths = CASES[number]
    return make(*(paths[:1] if quick else paths[1:]))


def cylinder(paths: int) -> Problem:
    """The scene cylinder_ir_range: bare aluminium in LWIR, seen from the tail.

    paths: paths of the reference render.
    """
    return in_range("cylinder", loaded("cylinder_ir_range"), 1024, paths)


def wing_root(paths: int) -> Problem:
    """A small window inside a facet at the wing root, in the same view as `cylinder`.

    paths: paths of the reference render.
    """
    scenes = loaded("cylinder_ir_range")
    for scene in scenes:
        look_at_facet(scene, WING_ROOT_FACET)
    return in_range("wing root", scenes, 4, paths)


def in_range(name: str, scenes: list[Scene], points: int, paths: int) -> Problem:
    """A problem in the infrared range, whose answer is a render with this number of paths."""
    problem = Problem(name, *scenes, BOUNCES, points, diffuse=False, ambient=RANGE_WALLS)
    return referred(problem, paths)


def loaded(name: str, **parameters) -> list[Scene]:
    """A bundled scene with the lattice sampler, and the same with the independent sampler.

    The film has a single pixel, so that paths per pixel are paths.
    """
    return [
        load(name, resolution=1, sampler=sampler, **parameters)
        for sampler in ("lattice", "independent")
    ]


def blackbody(problem: Problem, temperature: float) -> float:
    """In-band radiance of a blackbody in the scene's band [W m^-2 sr^-1]."""
    return float(in_band_radiance(problem.scene.band, temperature))


def referred(problem: Problem, paths: int) -> Problem:
    """Return the problem with an answer computed by path tracing.

    The answer is the mean over independent seeds. Its standard error follows from their scatter.
    """
    seeds = 8

    def run(seed):
        return path_tracing.intensity(problem, paths // seeds, seed)[0]

    values = [run(1_000_000 + seed) for seed in range(seeds)]
    error = float(np.std(values, ddof=1) / np.sqrt(seeds))
    return replace(
        problem,
        answer=float(np.mean(values)),
        standard_error=error,
        source=f"path tracing, N = {problem.bounces}, 2^{log2(paths):.0f} paths",
    )


def look_at_facet(scene, facet: int) -> None:
    """Move the window of the scene's sensor to a square inside a facet that it sees.

    The direction of view stays the same.
    """
    table = FacetTable(scene)
    origin, right, up, direction = window(scene.sensor(0))
    triangles = table.triangles[table.triangle_facet == facet]
    centre = table.centre[facet]
    axes = np.stack([right / np.linalg.norm(right), up / np.linalg.norm(up)])
    edges = [(triangle[k], triangle[k - 1]) for triangle in triangles for k in range(3)]
    outer = [
        (a, b)
        for a, b in edges
        if not any(np.array_equal(a, d) and np.array_equal(b, c) for c, d in edges)
    ]
    distance = min(
        abs(np.linalg.det([axes @ (b - a), axes @ (centre - a)])) / np.linalg.norm(axes @ (b - a))
        for a, b in outer
    )
    start = centre - direction * ((centre - origin) @ direction)
    T = mi.ScalarTransform4f
    parameters = mi.traverse(scene.sensor(0))
    parameters["to_world"] = mi.Transform4f(
        T().look_at(origin=list(start), target=list(centre), up=list(axes[1]))
        @ T().scale([distance / 2, distance / 2, 1])
    )
    parameters.update()


# The problems of the chart, with the paths of their reference renders, if quick and if not
CASES = (
    (two_plates,),
    (open_box,),
    (cavity,),
    (furnace,),
    (wing_root, 2**16, 2**20),
    (cylinder, 2**18, 2**23),
)
CLOSED = (3, 4, 5)  # those whose closures are compared, beside cavities
