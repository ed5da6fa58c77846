"""Mirror reflection: the specular assumption of the thesis (3.5.1).

A surface reflects the whole reflectance rho(theta) in the mirror direction. With one bounce this is
the original LCAIR: a facet's own emission, plus rho(theta) times the emission of the surface that
its mirror ray hits (Eq 3.8).
"""

import drjit as dr
import mitsuba as mi

from benchmarks.methods.propagation.primary import visible_points
from benchmarks.methods.propagation.problem import Method, Problem, emitted


def intensity(problem: Problem, bounces: int, count: int) -> tuple[float, int]:
    """Compute the intensity with mirror reflections.

    Parameters
    ----------
    problem
        Scene and sensor.
    bounces
        Number of reflections that are followed.
    count
        Approximate number of points of the visible facets from which rays start.

    Returns
    -------
    tuple[float, int]
        Intensity [W/sr] and number of rays traced.
    """
    points = visible_points(problem, count)
    rays = points.cast
    with problem.prepared() as (scene, emitters):
        ray, beta, L, active = points.ray, mi.Float(1), mi.Float(0), mi.Bool(True)
        for bounce in range(bounces + 1):
            si = scene.ray_intersect(ray, active)
            L += beta * emitted(si, scene, active)
            # For a reflection model's BSDF this is HDR(theta).
            beta *= si.bsdf().eval_diffuse_reflectance(si, active)[0]
            active &= si.is_valid() & (beta > 0)
            if bounce < bounces:
                ray = emitters.spawn_ray(si, si.to_world(mi.reflect(si.wi)))
                traced = dr.count(active)
                dr.eval(ray, beta, L, active, traced)
                rays += int(traced[0])
        return float(dr.sum(mi.Float64(points.area * L))[0]), rays


def method(name: str, bounces) -> Method:
    """Return a method that follows `bounces(problem)` mirror reflections."""
    return Method(
        name,
        "3.5.1",
        lambda problem, effort, seed: intensity(problem, bounces(problem), effort),
        lambda problem: [problem.points * 4**k for k in range(4)],
        is_random=False,
    )


SINGLE = method("mirror, one bounce", lambda problem: 1)
MULTIPLE = method("mirror, N bounces", lambda problem: problem.bounces)
