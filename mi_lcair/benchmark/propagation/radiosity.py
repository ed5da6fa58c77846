"""Classical radiosity (thesis 3.5.2) for diffuse scenes: facets in patches, view factors by casting
rays, a Neumann series.

Patches are equal parts of the scene's triangles. From each, rays go out cosine-weighted from points
spread over it (a Kronecker sequence in four dimensions, turned by the seed); F_ij is the share that
meets patch j. B = E + rho F B is summed up to N terms, N bounces, and the sensor sees B / pi of
each patch over the area that it sees of it. Surfaces are one-sided.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.sparse import csr_array

from mi_lcair.benchmark.propagation.primary import part_corners, part_index, visible_points
from mi_lcair.benchmark.propagation.problem import Method, Problem, emitted

STEPS = 1 / 1.1673039782614187 ** np.arange(
    1, 5
)  # 1 / the root of x^5 = x + 1: the golden ratio of four dimensions


def intensity(problem: Problem, patches: int, rays: int, seed: int) -> tuple[float, int]:
    """Intensity [W/sr] with about so many patches and so many rays from each, and the rays that it
    took.
    """
    table = problem.facets
    sides = np.linalg.norm(
        np.cross(
            table.triangles[:, 1] - table.triangles[:, 0],
            table.triangles[:, 2] - table.triangles[:, 0],
        ),
        axis=1,
    )
    divisions = np.maximum(1, np.round(np.sqrt(patches * sides / sides.sum()))).astype(int)
    first = np.concatenate([[0], np.cumsum(divisions**2)])
    corners, owner = np.empty((first[-1], 3, 3)), np.repeat(np.arange(len(divisions)), divisions**2)
    for n in np.unique(divisions):
        corners[divisions[owner] == n] = part_corners(table.triangles[divisions == n], n)

    points = visible_points(problem, len(corners), corners, owner)
    with problem.prepared() as (scene, emitters):
        E, rho = at_middles(scene, emitters, corners)
        F = view_factors(scene, emitters, problem.triangles, corners, divisions, first, rays, seed)
    B, term = E.copy(), E
    for _ in range(problem.bounces):
        term = rho * (F @ term)
        B += term
    seen = np.bincount(points.triangle.numpy(), points.area.numpy().astype(float), minlength=len(B))
    return float(seen @ B / np.pi), len(corners) * rays + points.cast


def at_middles(scene, emitters, corners) -> tuple[np.ndarray, np.ndarray]:
    """Exitance by emission [W m^-2] and reflectance of each patch, from its middle."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    above = corners.mean(axis=1) + 32 * float(emitters.least_offset[0]) * normal
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(above.T), mi.Vector3f(-normal.T)))
    rho = si.bsdf().eval_diffuse_reflectance(si)[0]
    return np.pi * emitted(si, scene).numpy().astype(float), rho.numpy().astype(float)


def view_factors(
    scene, emitters, triangles, corners, divisions, first, rays: int, seed: int
) -> csr_array:
    """F_ij, the share of what leaves patch i evenly that meets the front of patch j; (P, P),
    sparse.
    """
    patches = len(corners)
    index = dr.arange(mi.UInt32, patches * rays)
    patch, k = index // dr.opaque(mi.UInt32, rays), index % dr.opaque(mi.UInt32, rays)
    turn = np.random.default_rng(seed).random((4, patches))
    sequence = np.outer(STEPS, np.arange(1, rays + 1)) % 1

    def coordinate(axis):
        x = dr.gather(mi.Float, mi.Float(sequence[axis]), k) + dr.gather(
            mi.Float, mi.Float(turn[axis]), patch
        )
        return x - dr.floor(x)

    a, b, c, d = (coordinate(axis) for axis in range(4))
    p0, p1, p2 = (
        dr.gather(mi.Point3f, mi.Point3f(corners[:, corner].T), patch) for corner in range(3)
    )
    uv = mi.warp.square_to_uniform_triangle(mi.Point2f(a, b))
    si = dr.zeros(mi.SurfaceInteraction3f, patches * rays)
    si.p = p0 + uv.x * (p1 - p0) + uv.y * (p2 - p0)
    si.n = mi.Normal3f(dr.normalize(dr.cross(p1 - p0, p2 - p0)))
    si.sh_frame = mi.Frame3f(si.n)
    wo = mi.warp.square_to_cosine_hemisphere(mi.Point2f(c, d))

    ray = emitters.spawn_ray(si, si.to_world(wo))
    pi = scene.ray_intersect_preliminary(ray)
    hit = pi.compute_surface_interaction(ray)
    triangle, known = triangles.find(pi.shape, pi.prim_index, pi.is_valid())
    known &= hit.wi.z > 0
    n = dr.gather(mi.UInt32, mi.UInt32(divisions.astype(np.uint32)), triangle, known)
    other = dr.gather(mi.UInt32, mi.UInt32(first.astype(np.uint32)), triangle, known) + part_index(
        pi.prim_uv, n
    )
    dr.eval(known, patch, other)
    met = known.numpy()
    return csr_array(
        (np.full(met.sum(), 1 / rays), (patch.numpy()[met], other.numpy()[met])),
        shape=(patches, patches),
    )


def run(problem: Problem, effort: int, seed: int) -> tuple[float, int]:
    """effort: rays; as many patches as rays from each, so that the errors of both fall together."""
    patches = max(round(effort**0.5), len(problem.facets.triangles))
    return intensity(problem, patches, max(1, effort // patches), seed)


RADIOSITY = Method(
    "radiosity",
    "3.5.2",
    run,
    lambda problem: [4**k for k in range(6, 13)] if problem.diffuse else [],
    is_random=True,
)
