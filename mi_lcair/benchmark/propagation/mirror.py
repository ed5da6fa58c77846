"""The specular assumption (thesis 3.5.1): all of the reflectance rho(theta) in the mirror
direction.

With one bounce this is the original LCAIR: a facet's own emission, and rho(theta) times the
emission of what its mirror ray meets (Eq 3.8).
"""

import drjit as dr
import mitsuba as mi

from mi_lcair.benchmark.propagation.primary import visible_points
from mi_lcair.benchmark.propagation.problem import Method, Problem, emitted


def intensity(problem: Problem, bounces: int, count: int) -> tuple[float, int]:
    """Intensity [W/sr] after so many mirror bounces, looked at from about `count` points, and the
    rays that it took.
    """
    points = visible_points(problem, count)
    rays = points.cast
    with problem.prepared() as (scene, emitters):
        ray, beta, L, active = points.ray, mi.Float(1), mi.Float(0), mi.Bool(True)
        for bounce in range(bounces + 1):
            si = scene.ray_intersect(ray, active)
            L += beta * emitted(si, scene, active)
            # HDR(theta) where the BSDF is that of a reflection model
            beta *= si.bsdf().eval_diffuse_reflectance(si, active)[0]
            active &= si.is_valid() & (beta > 0)
            if bounce < bounces:
                ray = emitters.spawn_ray(si, si.to_world(mi.reflect(si.wi)))
                traced = dr.count(active)
                dr.eval(ray, beta, L, active, traced)
                rays += int(traced[0])
        return float(dr.sum(mi.Float64(points.area * L))[0]), rays


def method(name: str, bounces) -> Method:
    """bounces(problem): how many."""
    return Method(
        name,
        "3.5.1",
        lambda problem, effort, seed: intensity(problem, bounces(problem), effort),
        lambda problem: [problem.points * 4**k for k in range(4)],
        is_random=False,
    )


SINGLE = method("mirror, one bounce", lambda problem: 1)
MULTIPLE = method("mirror, N bounces", lambda problem: problem.bounces)
