"""Hemispherical view of a facet: what it sees over theta and phi (thesis 3.2.4).

The view holds the solid angle and the view factor of every other facet, and a map.
"""

from dataclasses import dataclass
from math import ceil, log2

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.results import Result
from mi_lcair.results.sections import Table

MAP_THETA, MAP_PHI = 360, 1440  # pixels of the map, a quarter of a degree each
MOST_NEIGHBOURS = 20  # largest number of facets in the table; the others are summed
NOTHING = -1  # number of the facet in directions without a surface


@dataclass(frozen=True, repr=False)
class HemisphericalView(Result):
    """What a facet of a scene sees.

    Both sides of a surface hide what is behind it.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    facet : int
        Number of the facet.
    facets : FacetTable
        Facets of the scene.
    neighbour : ndarray of int, shape (n,)
        Numbers of the facets that it sees, largest view factor first. The last one is NOTHING (-1),
        for directions without a surface.
    solid_angle, view_factor : ndarray, shape (n,)
        Solid angle, sr, and view factor of each neighbour, as means over the facet's area. Their
        sums are 2 pi and 1.
    map : ndarray of int, shape (MAP_THETA, MAP_PHI)
        Facet in each direction from the centre of this one. Rows are theta, 0 to 90 degrees from
        the normal; columns are phi, -180 to 180 degrees.
    rays : int
        Number of rays for each of solid angle and view factor.
    origin : tuple of float
        Origin of the loaded scene in the coordinates of its file [m].
    """

    scene_name: str
    facet: int
    facets: FacetTable
    neighbour: np.ndarray
    solid_angle: np.ndarray
    view_factor: np.ndarray
    map: np.ndarray
    rays: int
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    kind = "hemispherical_view"
    drawn_by = "mi_lcair.reports.pictures.hemispherical_view:figure"

    def summary(self) -> str:
        """One line with the number of neighbours and the largest view factor."""
        text = f"hemispherical view of facet {self.facet} of {self.scene_name}: "
        if len(self.neighbour) == 1:
            return f"{text}it sees no other facet, {self.rays} rays"
        return (
            f"{text}sees {len(self.neighbour) - 1} facets, most of facet {self.neighbour[0]} with "
            f"view factor {self.view_factor[0]:.6f}, {self.rays} rays"
        )

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each neighbour; facet -1 means a direction without a surface."""
        table, seen = self.facets, self.neighbour
        return {
            "facet": seen,
            **{
                name: np.where(seen == NOTHING, "nothing", getattr(table, name)[seen])
                for name in ("type", "group", "material")
            },
            "solid_angle_sr": self.solid_angle,
            "view_factor": self.view_factor,
        }

    def facts(self):
        """The facet and its neighbours, those with the largest view factors first."""
        table, columns = self.facets, self.columns()
        shares = np.stack([self.solid_angle, self.view_factor], axis=1)

        def texts(share) -> list[str]:
            return [f"{number:.6f}" for number in share]

        names = [columns[name][:-1][:MOST_NEIGHBOURS] for name in ("facet", "group", "material")]
        rows = [[*row, *texts(share)] for *row, share in zip(*names, shares)]
        if rest := len(shares) - 1 - len(rows):
            rows.append([f"{rest} more", "", "", *texts(shares[len(rows) : -1].sum(axis=0))])
        rows.append(["nothing", "", "", *texts(shares[-1])])
        rows.append(["all", "", "", *texts(shares.sum(axis=0))])
        yield (
            "facet",
            f"{self.facet} of {self.scene_name}: {table.type[self.facet]}, group "
            f"{table.group[self.facet]}, {table.material[self.facet]}, "
            f"{table.area[self.facet]:.6g} m^2",
        )
        yield Table(["sees", "group", "material", ("solid angle", "sr"), "view factor"], rows)

    def entries(self) -> dict:
        """Entries for JSON, with the columns."""
        table = self.facets
        return {
            "scene_name": self.scene_name,
            "facet": self.facet,
            "type": table.type[self.facet],
            "group": table.group[self.facet],
            "material": table.material[self.facet],
            "area_m2": float(table.area[self.facet]),
            "centre_m": (table.centre[self.facet] + self.origin).tolist(),
            "normal": table.normal[self.facet].tolist(),
            "rays": self.rays,
            "solid_angle_sr": float(self.solid_angle.sum()),
            "view_factor": float(self.view_factor.sum()),
            "columns": self.columns(),
        }


def hemispherical_view(
    scene: Scene, facet: int, rays: int = 2**20, seed: int = 0
) -> HemisphericalView:
    """What a facet sees, from low-discrepancy rays over its area and its hemisphere.

    Parameters
    ----------
    scene : Scene
        Scene that holds the facet.
    facet : int
        Number of the facet, from 0.
    rays : int
        Rays for the solid angles (uniform directions), and as many for the view factors
        (cosine-weighted directions). It is rounded up to a power of 2.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    HemisphericalView

    Raises
    ------
    InputError
        If there is no facet of this number, or if it is not flat or has no area.
    """
    facets = FacetTable(scene)
    if not 0 <= facet < facets.count:
        raise InputError(
            f"facet {facet} does not exist; the facets of {scene.name} are numbered from 0 to "
            f"{facets.count - 1}"
        )
    if not np.isfinite(facets.normal[facet]).all():
        raise InputError(
            f"facet {facet} of {scene.name} has no normal: it is a whole curved shape, or has no "
            "area; a facet of a mesh has a view"
        )
    sample = low_discrepancy(rays, seed)
    p, n = points(facets, facet, sample[:, :2])
    # Shares of the rays that hit each facet. Entry 0 is that of rays that hit nothing, and entry
    # k + 1 that of facet k.
    shares = []
    with scene.prepared() as tracer:
        for warp in (mi.warp.square_to_uniform_hemisphere, mi.warp.square_to_cosine_hemisphere):
            direction = mi.Frame3f(n).to_world(warp(mi.Point2f(sample[:, 2:].T)))
            shares.append(
                np.bincount(
                    1 + first_hit(tracer, facets, p, n, direction), minlength=1 + facets.count
                )
                / len(sample)
            )
        facets_around = view_map(tracer, facets, facet)
    neighbour = np.flatnonzero(shares[0] + shares[1])
    neighbour = neighbour[np.argsort(-shares[1][neighbour], kind="stable")]
    neighbour = np.append(neighbour[neighbour != 0], 0)  # NOTHING comes last
    return HemisphericalView(
        scene_name=scene.name,
        facet=facet,
        facets=facets,
        neighbour=neighbour - 1,
        solid_angle=2 * np.pi * shares[0][neighbour],
        view_factor=shares[1][neighbour],
        map=facets_around,
        rays=len(sample),
        origin=scene.origin,
    )


def low_discrepancy(count: int, seed: int) -> np.ndarray:
    """Scrambled Sobol points in the unit 4-cube, shape (n, 4), with n at least `count`.

    Two coordinates choose a point of the facet, and two a direction.
    """
    from scipy.stats.qmc import Sobol

    return Sobol(4, seed=seed).random_base2(ceil(log2(count)))


def points(facets: FacetTable, facet: int, sample: np.ndarray):
    """Uniform points on a facet, and their normals.

    Parameters
    ----------
    facets : FacetTable
        Facets of the scene.
    facet : int
        Number of the facet.
    sample : ndarray, shape (n, 2)
        Uniform random numbers between 0 and 1.

    Returns
    -------
    p : mitsuba.Point3f
        Points, m.
    n : mitsuba.Normal3f
        Normals.
    """
    corners = facets.triangles[facets.triangle_facet == facet]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    # The first number chooses a triangle by area. Its remainder is uniform again.
    cumulated = np.cumsum(area) / area.sum()
    drawn = np.minimum(np.searchsorted(cumulated, sample[:, 0], side="right"), len(area) - 1)
    within = (sample[:, 0] - np.append(0, cumulated)[drawn]) * (area.sum() / area[drawn])
    # The square root makes the points uniform over the triangle.
    root = np.sqrt(within)[:, None]
    a, b, c = np.moveaxis(corners[drawn], 1, 0)
    p = (1 - root) * a + root * ((1 - sample[:, 1:]) * b + sample[:, 1:] * c)
    return mi.Point3f(p.T), mi.Normal3f((normal / area[:, None])[drawn].T)


def first_hit(tracer, facets: FacetTable, p, n, direction) -> np.ndarray:
    """Number of the facet that each ray hits first; NOTHING where it hits none.

    The rays start at surface points `p` with normals `n`.
    """
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    si.p, si.n, si.sh_frame = p, n, mi.Frame3f(n)
    hit = tracer.scene.ray_intersect_preliminary(
        tracer.emitters.spawn_ray(si, direction), coherent=False
    )
    return facets.number(hit.shape, hit.prim_index).numpy().astype(np.int32)  # ABSENT becomes -1


def frame(facets: FacetTable, facet: int) -> np.ndarray:
    """Right-handed axes of a facet, shape (3, 3) (thesis 3.2.1.3, 3.2.1.4).

    The rows are the reference vector, the positive vector and the normal. The reference vector
    points from the centre to the facet's second vertex. The azimuth is 0 along it, and 90 degrees
    along the positive vector.
    """
    normal = facets.normal[facet]
    reference = (
        facets.triangles[np.argmax(facets.triangle_facet == facet)][1] - facets.centre[facet]
    )
    reference -= normal * (normal @ reference)
    reference /= np.linalg.norm(reference)
    return np.array([reference, np.cross(normal, reference), normal])


def view_map(tracer, facets: FacetTable, facet: int) -> np.ndarray:
    """Facets seen from the centre of a facet, shape (MAP_THETA, MAP_PHI).

    See `HemisphericalView.map`.
    """
    theta, phi = np.meshgrid(
        (np.arange(MAP_THETA) + 0.5) / MAP_THETA * np.pi / 2,
        (np.arange(MAP_PHI) + 0.5) / MAP_PHI * 2 * np.pi - np.pi,
        indexing="ij",
    )
    local = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    direction = frame(facets, facet).T @ local.reshape(3, -1)
    return first_hit(
        tracer,
        facets,
        mi.Point3f(facets.centre[facet]),
        mi.Normal3f(facets.normal[facet]),
        mi.Vector3f(direction),
    ).reshape(theta.shape)
