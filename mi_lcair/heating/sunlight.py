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

from mi_lcair.heating.paths import ENDS, LANES, RANDOMISATIONS, RINGS, FacetPaths, Means, points_of
from mi_lcair.heating.surfaces import SOLAR, Surfaces, hemispherical_emissivity
from mi_lcair.plugins.samplers.lattice import Lattice
from mi_lcair.rendering.scene import Scene

SHADOW_RAYS = 64  # of each facet toward each position of the sun


@dataclass(frozen=True, eq=False)
class SolarAreas:
    """Areas by which m beams of sunlight heat n facets [m^2], for each randomisation.

    The absorbed power is the area times the irradiance of the beam on a surface across it. lit:
    (RANDOMISATIONS, m, n), area across the beam that it lights. direct: of it, what is absorbed.
    reflected: area by which light that other facets, or the facet itself, have reflected is
    absorbed. onward: (n, n), of the light that a facet (row) reflects, the share that each absorbs.
    """

    lit: np.ndarray
    direct: np.ndarray
    reflected: np.ndarray
    onward: sparse.csr_array

    @property
    def absorbing(self) -> np.ndarray:
        """Area by which the facets absorb sunlight, with all reflections."""
        return self.direct + self.reflected


class Sunlight:
    """Absorption of sunlight by the facets of a scene, in the solar band.

    Attributes
    ----------
    paths : FacetPaths
    absorptance : ndarray, shape (n,)
        Hemispherical absorptance of the facets.
    of_sky : ndarray, shape (RANDOMISATIONS, n, rings)
        Absorbed power of a ring of the sky divided by pi times its radiance [m^2].
    of_ground : ndarray, shape (RANDOMISATIONS, n)
        The same of what lies below the horizon.
    remarks : list of str
    """

    def __init__(self, scene: Scene, rays: int, seed: int = 0):
        surfaces = Surfaces.of(scene, SOLAR)
        self.paths, self.seed = FacetPaths(scene, surfaces, reflected=True), seed
        table, number = self.paths.table, self.paths.number
        self.area, self.remarks = table.area[number], surfaces.remarks
        by_surface = np.array([hemispherical_emissivity(s) for s in surfaces.different])
        self.absorptance = by_surface[np.array(surfaces.of_shape)[table.shape_index[number]]]
        self.means: Means = self.paths.means(points_of(rays), seed)
        sides = sparse.csr_array(
            (self.area[self.paths.rows], (self.paths.rows, np.arange(len(self.paths.rows))))
        )
        self.of_sky = np.array([sides @ ends[:, :RINGS] for ends in self.means.ends])
        ground = RINGS + ENDS.index("ground")
        self.of_ground = np.array([sides @ ends[:, ground] for ends in self.means.ends])

    def areas(self, directions: np.ndarray, rays: int = SHADOW_RAYS) -> SolarAreas:
        """The areas for directions to the sun, unit vectors (m, 3), with `rays` a facet and sun."""
        points, rows = points_of(rays), self.paths.rows
        where = self._points(points)
        step = max(1, LANES // dr.width(where.p))
        blocks = [
            self._lit(directions[k : k + step], where, points)
            for k in range(0, len(directions), step)
        ]
        lit, absorbed = np.concatenate(blocks, axis=3) * self.area
        side = np.where(self.paths.row_sides > 0, 0, 1)
        left = (lit - absorbed)[side, :, :, rows]  # (rows, RANDOMISATIONS, m)
        reflected = [left[:, run].T @ g for run, g in enumerate(self.means.between)]
        sums = lit.sum(axis=0), absorbed.sum(axis=0), np.array(reflected)
        return SolarAreas(*sums, self.onward(lit.sum(axis=(1, 2))[side, rows]))

    def onward(self, lit: np.ndarray) -> sparse.csr_array:
        """Shares of the light that a facet (row) reflects and others absorb, (n, n).

        lit: light on each row of the paths, which weights the sides of a sheet.
        """
        rows, n = self.paths.rows, len(self.area)
        lit = np.maximum(lit, 1e-9 * self.area[rows])
        share = lit / np.bincount(rows, lit, n)[rows]
        sides = sparse.csr_array((share, (rows, np.arange(len(rows)))), shape=(n, len(rows)))
        return sides @ (sum(self.means.between) / RANDOMISATIONS)

    def _points(self, points: int) -> mi.SurfaceInteraction3f:
        """Points of each randomisation of each facet."""
        lane = dr.arange(mi.UInt32, len(self.area) * RANDOMISATIONS * points)
        points, seed = dr.opaque(mi.UInt32, points), dr.opaque(mi.UInt32, self.seed)
        run = lane // points
        sampler = Lattice.at(run, lane % points, seed, self.paths.vector)
        sample = sampler.next_2d()
        si = self.paths.parts.point(run // RANDOMISATIONS, sampler.next_1d(), sample)
        dr.eval(si)
        return si

    def _lit(self, directions: np.ndarray, where, points: int) -> np.ndarray:
        """Shares of the facets' areas across m beams, (2, 2, RANDOMISATIONS, m, n).

        First what is lit, in front and behind, then what is absorbed of it. where: from `_points`.
        """
        paths, m, n = self.paths, len(directions), len(self.area)
        lane, count = dr.arange(mi.UInt32, m * dr.width(where.p)), dr.width(where.p)
        si = dr.gather(mi.SurfaceInteraction3f, where, lane % count)
        to = dr.gather(mi.Vector3f, mi.Float(np.ravel(directions)), lane // count)
        si.wi = si.to_local(to)
        in_front, behind = paths.sides_at(si)
        lit = paths.sees_sky(si, to, in_front | behind)
        cos = dr.select(lit, dr.abs(si.wi.z), 0)
        absorbed = cos * paths.emissivity(si, lit)
        values = [dr.select(side, x, 0) for x in (cos, absorbed) for side in (in_front, behind)]
        dr.eval(values)  # in one kernel; a sum alone would trace the rays again
        sums = [dr.block_sum(value, points) for value in values]
        shares = np.reshape([total.numpy() / points for total in sums], (2, 2, m, n, -1))
        return np.moveaxis(shares.astype(float), 4, 2)
