"""Point-of-view hemispherical quadrature (thesis 3.5.3 and 3.5.5).

From each point a ray goes through every cell of a grid over the hemisphere. The same is done at
each surface that such a ray hits, bounce after bounce (Eqs 3.6 and 3.7). With M cells and N bounces
M^N rays start from each point.

There are three grids. `hemisphere` is even. `stratified`, the method that the thesis chose, is fine
about the mirror direction and coarse over the rest, with cells in the ratio 80^2 : 50^2. `peak` is
the fine part alone.
"""

from math import log, sqrt

import drjit as dr
import mitsuba as mi

from benchmarks.methods.propagation.hemisphere_grid import Hemisphere, Peak, Stratified
from benchmarks.methods.propagation.primary import visible_points
from benchmarks.methods.propagation.problem import Method, Problem, emitted

LANES = 2**20  # rays in flight at once
COARSEST_REST = 32  # least number of cells of `stratified` outside the peak: 22.5 degrees wide
BUDGETS = [4**k for k in range(5, 13)]  # numbers of rays that are tried
PEAK_SHARE = 80**2 / (80**2 + 50**2)  # share of `stratified`'s cells in the peak, thesis 3.3.3


def intensity(problem: Problem, grid, bounces: int, points: int) -> tuple[float, int]:
    """Compute the intensity by quadrature over directions.

    Parameters
    ----------
    problem
        Scene and sensor.
    grid
        Grid of directions, a class of `hemisphere_grid`.
    bounces
        Number of reflections that are followed.
    points
        Approximate number of points of the visible facets from which rays start.

    Returns
    -------
    tuple[float, int]
        Intensity [W/sr] and number of rays traced.
    """
    visible = visible_points(problem, points)
    with problem.prepared() as (scene, emitters):
        si = scene.ray_intersect(visible.ray)
        emission = summed(visible.area * emitted(si, scene))
        reflection, rays = reflected(scene, emitters, grid, si, visible.area, bounces)
    return emission + reflection, rays + visible.cast


def reflected(scene, emitters, grid, si, beta, bounces: int) -> tuple[float, int]:
    """Sum of the reflected radiance at `si`, each weighted by its `beta`, and the rays traced.

    Parameters
    ----------
    si
        Surface points, with directions toward the observer or toward the previous surface.
    beta
        Throughput of each point: area, BRDFs, cosines and solid angles up to it.
    bounces
        Number of reflections that are still followed.
    """
    total, rays = 0.0, 0
    if bounces == 0:
        return total, rays
    reflects = dr.compress(si.is_valid() & (beta > 0))
    at_once = max(1, LANES // grid.cells)
    # The points are worked on in batches, so that no more than LANES rays are in memory.
    for first in range(0, dr.width(reflects), at_once):
        count = min(at_once, dr.width(reflects) - first) * grid.cells
        index, cells = dr.arange(mi.UInt32, count), dr.opaque(mi.UInt32, grid.cells)
        number = index // cells + dr.opaque(mi.UInt32, first)
        parent = dr.gather(mi.UInt32, reflects, number)
        here = dr.gather(mi.SurfaceInteraction3f, si, parent)
        wo, solid_angle = grid.direction(index % cells, here.wi)
        f = here.bsdf().eval(mi.BSDFContext(), here, wo, mi.Bool(True))[0]
        beta_there = dr.gather(mi.Float, beta, parent) * solid_angle * f
        active = beta_there > 0
        there = scene.ray_intersect(emitters.spawn_ray(here, here.to_world(wo)), active)
        radiance = mi.Float64(beta_there * emitted(there, scene, active))
        if bounces > 1:
            dr.eval(there, beta_there, radiance)
        total += float(dr.sum(radiance)[0])
        deeper, more = reflected(scene, emitters, grid, there, beta_there, bounces - 1)
        total, rays = total + deeper, rays + count + more
    return total, rays


def summed(values) -> float:
    """Sum in Float64."""
    return float(dr.sum(mi.Float64(values))[0])


def plan(problem: Problem, budget: int, least: float) -> tuple[int, int, float]:
    """Divide a budget of rays among bounces, points and cells of the grid.

    There are as many bounces as possible with at least `least` cells in each grid. A coarser grid
    does not resolve the reflection. The rest of the budget goes to points and cells in equal parts.

    Returns
    -------
    tuple[int, int, float]
        Number of bounces, of points and of cells.
    """
    bounces = min(
        problem.bounces, max(1, int(log(max(budget / problem.points, 1)) / log(least) + 1e-9))
    )
    points = max(problem.points, min(budget ** (1 / (bounces + 1)), budget / least**bounces))
    return bounces, round(points), max(budget / points, 1) ** (1 / bounces)


def method(name: str, section: str, grid, least) -> Method:
    """Return quadrature on one kind of grid as a method.

    grid(cells): returns a grid of about that many cells. least(degrees): number of cells of a grid
    whose cells are that wide.
    """

    def cells_needed(problem):
        return least(problem.resolution_deg)

    def run(problem, effort, seed):
        bounces, points, cells = plan(problem, effort, cells_needed(problem))
        return intensity(problem, grid(cells), bounces, points)

    return Method(
        name,
        section,
        run,
        lambda problem: [
            budget for budget in BUDGETS if budget >= cells_needed(problem) * problem.points
        ],
        is_random=False,
    )


def stratified(cells: float) -> Stratified:
    """Stratified grid of about that many cells."""
    return Stratified(
        round(sqrt(cells * PEAK_SHARE)), max(3, round(sqrt(cells * (1 - PEAK_SHARE) / 2)))
    )


HEMISPHERE = method(
    "quadrature, hemisphere",
    "3.5.3",
    lambda cells: Hemisphere(round(sqrt(cells / 2))),
    lambda degrees: 2 * (90 / degrees) ** 2,
)
STRATIFIED = method(
    "quadrature, stratified",
    "3.5.5",
    stratified,
    lambda degrees: max((20 / degrees) ** 2 / PEAK_SHARE, COARSEST_REST / (1 - PEAK_SHARE)),
)
PEAK = method(
    "quadrature, peak only",
    "3.5.5",
    lambda cells: Peak(round(sqrt(cells))),
    lambda degrees: max((20 / degrees) ** 2, 16),
)
