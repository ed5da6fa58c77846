"""Sunlight that facets absorb: directly, and after reflections.

The sun's light falls on a side of a facet through shadow rays. What the facet does not absorb it
reflects, and paths in the solar band say who absorbs that light. They begin with the cosine, as if
the first reflection were diffuse; the later reflections are those of the surfaces.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.heating.paths import LANES, RANDOMISATIONS, RINGS, FacetPaths, points_of
from mi_lcair.heating.surfaces import SOLAR, Surfaces, hemispherical_emissivity
from mi_lcair.rendering.scene import Scene


@dataclass(frozen=True, eq=False)
class SolarAreas:
    """Areas by which m beams of sunlight and an even sky heat n facets [m^2].

    The absorbed power is the area times the irradiance of the beam on a surface across it. The
    areas have the R randomisations as their first axis.

    lit: (R, m, n), area across the beam that it lights. direct: of it, what is absorbed. reflected:
    area by which light that other facets, or the facet itself, have reflected is absorbed. sky,
    ground: (R, n), absorbed power by the irradiance of an even sky on a horizontal plane, and by
    that which the ground reflects. absorptance: (n,), hemispherical, of the lit sides. onward:
    (n, n), of the light that a facet (row) reflects, the share that each absorbs. remarks: on the
    materials.
    """

    lit: np.ndarray
    direct: np.ndarray
    reflected: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    absorptance: np.ndarray
    onward: sparse.csr_array
    remarks: tuple[str, ...] = ()


def solar_areas(
    scene: Scene, toward_sun: np.ndarray, rays: int, shadow_rays: int, seed: int = 0
) -> SolarAreas:
    """The absorption of sunlight by the facets of a scene, in the solar band.

    Parameters
    ----------
    scene : Scene
    toward_sun : ndarray, shape (m, 3)
        Unit vectors toward the sun.
    rays, shadow_rays : int
        Paths of each side of a facet, and rays from it toward each position of the sun.
    seed : int
    """
    surfaces = Surfaces.of(scene, SOLAR)
    paths = FacetPaths(scene, surfaces, reflected=True)
    means = paths.means(points_of(rays), seed)
    areas, area, n = means.sums(paths.areas), paths.areas.sum(axis=0), len(paths.number)
    points = points_of(shadow_rays)
    lane = dr.arange(mi.UInt32, len(paths.rows) * RANDOMISATIONS * points)
    where, side, _ = paths.starts(lane // points, lane % points, seed)
    dr.eval(where, side)
    step = max(1, LANES // dr.width(side))
    blocks = [
        lit_shares(paths, toward_sun[k : k + step], where, side, points)
        for k in range(0, len(toward_sun), step)
    ]
    lit, absorbed = np.concatenate(blocks, axis=2) * area
    # A sheet reflects from the side that is lit
    light = np.maximum(lit.sum(axis=(0, 1)), 1e-9 * area)
    share = light / np.bincount(paths.rows, light)[paths.rows]
    sides = sparse.csr_array((np.ones(len(area)), paths.areas.indices, paths.areas.indptr))

    def of_facets(values):
        return np.reshape((sides @ values.reshape(-1, len(area)).T).T, (*values.shape[:2], n))

    return SolarAreas(
        lit=of_facets(lit),
        direct=of_facets(absorbed),
        reflected=np.array([left @ g for left, g in zip(lit - absorbed, means.between)]),
        sky=areas.ends[:, :, :RINGS].sum(axis=2),
        ground=areas.ends[:, :, RINGS],
        absorptance=sides @ (share * paths.of_rows(hemispherical_emissivity)),
        onward=(sides * share) @ (sum(means.between) / RANDOMISATIONS),
        remarks=tuple(surfaces.remarks),
    )


def lit_shares(paths: FacetPaths, toward_sun: np.ndarray, where, side, points: int) -> np.ndarray:
    """Shares of the rows' areas across m beams, (2, RANDOMISATIONS, m, rows).

    First what is lit, then what is absorbed of it. where, side: from `FacetPaths.starts`.
    """
    m, count = len(toward_sun), dr.width(side)
    lane = dr.arange(mi.UInt32, m * count)
    si = dr.gather(mi.SurfaceInteraction3f, where, lane % count)
    to = dr.gather(mi.Vector3f, mi.Float(np.ravel(toward_sun)), lane // count)
    si.wi = si.to_local(to)
    lit = paths.sees_sky(si, to, si.wi.z * dr.gather(mi.Float, side, lane % count) > 0)
    cos = dr.select(lit, dr.abs(si.wi.z), 0)
    values = [cos, cos * paths.tracer.respond(si, lit)[1]]
    dr.eval(values)  # in one kernel; a sum alone would trace the rays again
    sums = [dr.block_sum(value, points).numpy() / points for value in values]
    shares = np.reshape(sums, (2, m, RANDOMISATIONS, len(paths.rows)))
    return np.moveaxis(shares.astype(float), 2, 1)
