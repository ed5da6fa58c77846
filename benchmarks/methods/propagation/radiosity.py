"""Classical radiosity for diffuse scenes (thesis 3.5.2).

Patches are equal parts of the scene's triangles. The view factor F_ij is the share of the rays from
patch i that hit patch j. The rays have cosine-distributed directions and start from points spread
over the patch. Points and directions are those of the lattice sampler. Each patch has its own
randomisation. B = E + rho F B is solved by a Neumann series of N terms, one for each bounce. The
radiance of a patch is B / pi. The intensity sums it over the projected visible areas. Surfaces are
one-sided.
"""

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.sparse import csr_array

from benchmarks.methods.propagation.primary import part_corners, part_index, visible_points
from benchmarks.methods.propagation.problem import Method, Problem, emitted
from mi_lcair.plugins.samplers.lattice import Lattice

ABOVE = 2**-13  # height of a ray that meets a patch from above, relative to the scene


def intensity(problem: Problem, patches: int, rays: int, seed: int) -> tuple[float, int]:
    """Compute the intensity by radiosity.

    Parameters
    ----------
    problem
        Scene and sensor; all surfaces are diffuse.
    patches
        Approximate number of patches.
    rays
        Rays from each patch, for its view factors.
    seed
        Seed of the lattice's shifts.

    Returns
    -------
    tuple[float, int]
        Intensity [W/sr] and number of rays traced.
    """
    corners, divisions, owner = parts_of(problem, patches)
    points = visible_points(problem, len(corners), corners, owner)
    with problem.prepared() as (scene, emitters):
        E, rho = at_middles(scene, corners)
        F = view_factors(scene, emitters, problem.triangles, corners, divisions, rays, seed)
    B, term = E.copy(), E
    for _ in range(problem.bounces):
        term = rho * (F @ term)
        B += term
    return float(points.by_triangle(len(B)) @ B / np.pi), len(corners) * rays + points.cast


def parts_of(problem: Problem, patches: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """About so many patches: corners (P, 3, 3) [m], divisions (T,) and triangles (P,)."""
    triangles, area = problem.facets.triangles, problem.triangles.area
    divisions = np.maximum(1, np.round(np.sqrt(patches * area / area.sum()))).astype(int)
    owner = np.repeat(np.arange(len(divisions)), divisions**2)
    corners = np.empty((len(owner), 3, 3))
    for n in np.unique(divisions):
        corners[divisions[owner] == n] = part_corners(triangles[divisions == n], n)
    return corners, divisions, owner


def at_middles(scene, corners) -> tuple[np.ndarray, np.ndarray]:
    """Emitted exitance [W m^-2] and reflectance of each patch, evaluated at its middle."""
    si = middles(scene, corners)
    rho = si.bsdf().eval_diffuse_reflectance(si)[0]
    return np.pi * emitted(si, scene).numpy().astype(float), rho.numpy().astype(float)


def middles(scene, corners) -> mi.SurfaceInteraction3f:
    """The middles of the patches, seen along their normals."""
    normal = normals(corners)
    above = corners.mean(axis=1) + ABOVE * np.abs(corners).max() * normal
    return scene.ray_intersect(mi.Ray3f(mi.Point3f(above.T), mi.Vector3f(-normal.T)))


def normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of the patches, (P, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def view_factors(scene, emitters, triangles, corners, divisions, rays: int, seed: int) -> csr_array:
    """Compute the view factors F_ij between patches, as a sparse matrix (P, P).

    F_ij is the share of the radiation from patch i, a Lambertian emitter, that hits the front of
    patch j.

    Parameters
    ----------
    scene, emitters
        What `Problem.prepared` gives.
    triangles
        Table that finds the triangle of a hit.
    corners : (P, 3, 3)
        Corners of the patches [m].
    divisions : (T,)
        For each triangle, the number n for which it has n^2 patches.
    rays
        Rays from each patch.
    seed
        Seed of the lattice's shifts.
    """

    def cosine(k, u):
        return mi.warp.square_to_cosine_hemisphere(u)

    fan = Fan(rays, seed, cosine)
    known, patch, receiver, _ = sent(scene, emitters, triangles, corners, divisions, fan)
    return csr_array(
        (np.full(known.sum(), 1 / rays), (patch[known], receiver[known])),
        shape=(len(corners), len(corners)),
    )


class Fan(NamedTuple):
    """The rays that leave each patch.

    rays: their number. seed: of the lattice's shifts. direction: a function of the number of a
    patch's ray and of two random numbers, which gives its direction in the patch's frame.
    """

    rays: int
    seed: int
    direction: Callable[[mi.UInt32, mi.Point2f], mi.Vector3f]


def sent(
    scene, emitters, triangles, corners, divisions, fan: Fan
) -> tuple[np.ndarray, np.ndarray, np.ndarray, mi.Vector3f]:
    """Trace rays from all patches, see `view_factors`.

    Returns whether each ray hits a patch's front, the patches that send and receive it, and the
    direction back in the receiver's frame.
    """
    (rays, seed, direction), patches = fan, len(corners)
    first = np.cumsum(divisions**2) - divisions**2
    index = dr.arange(mi.UInt32, patches * rays)
    patch, k = index // dr.opaque(mi.UInt32, rays), index % dr.opaque(mi.UInt32, rays)
    sampler, normal = Lattice.at(patch, k, dr.opaque(mi.UInt32, seed)), normals(corners)
    p0, p1, p2 = (
        dr.gather(mi.Point3f, mi.Point3f(corners[:, corner].T), patch) for corner in range(3)
    )
    uv = mi.warp.square_to_uniform_triangle(sampler.next_2d())
    si = dr.zeros(mi.SurfaceInteraction3f, patches * rays)
    si.p = p0 + uv.x * (p1 - p0) + uv.y * (p2 - p0)
    si.n = dr.gather(mi.Normal3f, mi.Normal3f(normal.T), patch)
    si.sh_frame = mi.Frame3f(si.n)

    ray = emitters.spawn_ray(si, si.to_world(direction(k, sampler.next_2d())))
    pi = scene.ray_intersect_preliminary(ray)
    hit = pi.compute_surface_interaction(ray)
    triangle, known = triangles.find(pi.shape, pi.prim_index, pi.is_valid())
    known &= hit.wi.z > 0
    n = dr.gather(mi.UInt32, mi.UInt32(divisions.astype(np.uint32)), triangle, known)
    receiver = dr.gather(mi.UInt32, mi.UInt32(first.astype(np.uint32)), triangle, known)
    receiver += part_index(pi.prim_uv, n)
    there = mi.Frame3f(dr.gather(mi.Normal3f, mi.Normal3f(normal.T), receiver, known))
    back = there.to_local(-ray.d)
    dr.eval(known, patch, receiver, back)
    return known.numpy(), patch.numpy(), receiver.numpy(), back


def run(problem: Problem, effort: int, seed: int) -> tuple[float, int]:
    """Run radiosity with `effort` rays in total.

    There are as many patches as rays from each patch. The errors from patches and from rays then
    decrease together.
    """
    patches = max(round(effort**0.5), len(problem.facets.triangles))
    return intensity(problem, patches, max(1, effort // patches), seed)


def efforts(problem: Problem) -> list[int]:
    """Numbers of rays that are tried."""
    return [4**k for k in range(6, 13)] if problem.diffuse else []


RADIOSITY = Method("radiosity", "3.5.2", run, efforts)
