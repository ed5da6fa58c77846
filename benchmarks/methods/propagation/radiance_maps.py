"""Radiosity for any reflection model: a map of each patch's radiance in all directions (3.5.2).

The directions of a patch's hemisphere are divided into cells of equal projected solid angle, whose
radiance is constant. A ray through each cell finds the patch and the cell from which it gets its
radiance. L = E + R L is solved by a Neumann series of N terms, one for each bounce. R has the BRDF
at the middles of the cells. Its rows are scaled to the reflectance 1 - emissivity, so that a lobe
narrower than a cell keeps its energy. The maps hold the radiance toward any observer, which is read
from them. Surfaces are one-sided and isotropic.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from benchmarks.methods.propagation.primary import visible_points
from benchmarks.methods.propagation.problem import Method, Problem, emitted
from benchmarks.methods.propagation.radiosity import Fan, middles, normals, parts_of, sent
from mi_lcair.rendering.window import window

MOST_ROWS = 24  # of the cells; the BRDF of 2 x 24^2 cells has 1.3 million pairs


def direction(row, column, n: int) -> mi.Vector3f:
    """Direction at a place in n rows and 2 n columns of cells; sin^2(theta) is even."""
    sin2, phi = row / n, column * (np.pi / n)
    sin = dr.safe_sqrt(sin2)
    return mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), dr.safe_sqrt(1 - sin2))


def cell_of(w: mi.Vector3f, n: int) -> mi.UInt32:
    """Number of the cell of a direction in the local frame."""
    row = dr.minimum(mi.UInt32((1 - w.z**2) * n), n - 1)
    turned = dr.atan2(w.y, w.x) * (n / np.pi)
    column = mi.UInt32(dr.select(turned < 0, turned + 2 * n, turned)) % (2 * n)
    return row * (2 * n) + column


def middle(k: mi.UInt32, n: int) -> mi.Vector3f:
    """Direction to the middle of a cell."""
    return direction(mi.Float(k // (2 * n)) + 0.5, mi.Float(k % (2 * n)) + 0.5, n)


def radiance_maps(problem: Problem, corners, divisions, n: int, seed: int) -> np.ndarray:
    """Radiance of all patches in all cells, (P, 2 n^2) [W m^-2 sr^-1].

    Parameters
    ----------
    problem
        Scene and sensor.
    corners, divisions
        Patches, see `radiosity.parts_of`.
    n
        Rows of cells.
    seed
        Seed of the lattice's shifts.
    """
    cells, patches = 2 * n**2, len(corners)

    def through(k, u):
        return direction(mi.Float(k // (2 * n)) + u.x, mi.Float(k % (2 * n)) + u.y, n)

    with problem.prepared() as (scene, emitters):
        fan = Fan(cells, seed, through)
        known, _, receiver, back = sent(scene, emitters, problem.triangles, corners, divisions, fan)
        source = receiver.astype(np.int64) * cells + cell_of(back, n).numpy()
        source = np.where(known, source, -1).reshape(patches, cells)
        si = middles(scene, corners)
        k = dr.arange(mi.UInt32, patches * cells)
        of_cells = dr.gather(mi.SurfaceInteraction3f, si, k // cells)
        of_cells.wi = middle(k % cells, n)
        E = emitted(of_cells, scene).numpy().astype(float).reshape(patches, cells)
        kind = dr.reinterpret_array(mi.UInt32, si.bsdf()).numpy()
        kinds = {number: np.flatnonzero(kind == number) for number in np.unique(kind)}
        R = {number: reflection(si, int(of[0]), n) for number, of in kinds.items()}
    L, term = E.copy(), E
    for _ in range(problem.bounces):
        incoming = np.where(source < 0, 0.0, term.ravel()[source])
        term = np.empty_like(E)
        for number, of in kinds.items():
            term[of] = incoming[of] @ R[number].T
        L += term
    return L


def reflection(si: mi.SurfaceInteraction3f, patch: int, n: int) -> np.ndarray:
    """BRDF of a patch times the projected solid angle of a cell, (observer, source)."""
    cells = 2 * n**2
    k = dr.arange(mi.UInt32, cells**2)
    pairs = dr.gather(mi.SurfaceInteraction3f, si, dr.full(mi.UInt32, patch, cells**2))
    pairs.wi, wo, bsdf = middle(k // cells, n), middle(k % cells, n), pairs.bsdf()
    f = bsdf.eval(mi.BSDFContext(), pairs, wo)[0] / wo.z
    R = np.pi / cells * f.numpy().astype(float).reshape(cells, cells)
    has = bsdf.has_attribute("emissivity")
    emissivity = bsdf.eval_attribute_1("emissivity", pairs, has)
    reflectance = dr.select(has, 1 - emissivity, bsdf.eval_diffuse_reflectance(pairs)[0])
    wanted = reflectance.numpy().astype(float).reshape(cells, cells)[:, :1]
    total = R.sum(axis=1, keepdims=True)
    if not total.any():  # a mirror, whose `eval` is 0: all comes from the cell opposite
        number = np.arange(cells)
        R[number, number // (2 * n) * (2 * n) + (number + n) % (2 * n)] = total[:] = 1
    return R * np.divide(wanted, total, out=np.zeros_like(total), where=total > 0)


def run(problem: Problem, effort: int, seed: int) -> tuple[float, int]:
    """Run radiosity with maps and `effort` rays in total, about as many cells as patches.

    Returns the intensity [W/sr] and the number of rays traced.
    """
    corners, divisions, owner = parts_of(
        problem, max(round(effort**0.5), len(problem.facets.triangles))
    )
    n = int(np.clip(round((effort / len(corners) / 2) ** 0.5), 1, MOST_ROWS))
    points = visible_points(problem, len(corners), corners, owner)
    L = radiance_maps(problem, corners, divisions, n, seed)
    _, _, _, along = window(problem.scene.sensor(0))
    frame = mi.Frame3f(mi.Normal3f(normals(corners).T))
    cell = cell_of(frame.to_local(mi.Vector3f(*(-along).tolist())), n).numpy()
    seen = L[np.arange(len(corners)), cell]
    return float(points.by_triangle(len(corners)) @ seen), L.size + points.cast


RADIANCE_MAPS = Method(
    "radiosity, radiance maps", "3.5.2", run, lambda problem: [4**k for k in range(6, 12)]
)
