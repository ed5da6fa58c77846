"""Radiance and intensity of each facet of the model, from the same paths as the image."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, log2
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.charts import facets_section
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import known_band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.recorders.radiance import BOUNCE_CHANNELS, MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.facets import WRITERS, FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import UNSEEN, Totals, edge_share, student_factor
from mi_lcair.rendering.window import toward_sensor
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import Table

EDGE_ON = 1e-6  # cosine below which the projected area of a facet is only rounding error
ROUNDING = 1e-4  # by which the radiance of a black facet may exceed that of a blackbody
FEW = 30  # smallest expected number of samples on a facet that gives a visible fraction


@dataclass(frozen=True, repr=False)
class FacetResults(Result):
    """Table of what each facet of the model sends to the sensor.

    Attributes
    ----------
    scene_name, band : str
        Names of the scene and of its band.
    table : dict of str to ndarray, shape (facets,)
        Values of the model's facets, not of its background, by name with unit. A missing value is
        NaN: a facet that the sensor does not see has no radiance. The sum of intensity_W_sr is the
        target's intensity. mean_cosine is that of the front side. visible_fraction is an estimate
        from the samples, and its noise may lift it above 1.
    triangles, triangle_facet : ndarray, shapes (T, 3, 3) and (T,)
        Corners of the model's triangles [m], and the number of the facet of each.
    """

    scene_name: str
    band: str
    table: dict[str, np.ndarray] = entry("columns")
    triangles: np.ndarray = entry()
    triangle_facet: np.ndarray = entry()

    kind = "facets"
    saved_by = WRITERS

    def summary(self) -> str:
        """One line with the number of facets and the intensity of the brightest one."""
        intensity, error = (self.table[f"{name}_W_sr"] for name in ("intensity", "standard_error"))
        seen = np.count_nonzero(self.table["samples"])
        text = f"facets of {self.scene_name}, {self.band}: {seen} of {len(intensity)} seen"
        if not seen:
            return text
        k = int(np.argmax(intensity))
        return (
            f"{text}, brightest {self.table['facet'][k]} with {intensity[k]:.6g} +- "
            f"{error[k]:.2g} W/sr (standard error)"
        )

    def facts(self, scene: "Scene | None" = None, sensor: int = 0) -> Iterator[Any]:
        """The facets in one line, and on their model.

        scene: the loaded scene they were made from. The model is seen at first from its sensor with
        the number `sensor`.
        """
        yield summary_of(self)
        toward = None if scene is None else toward_sensor(scene.sensor(sensor))
        model = self.triangles, self.triangle_facet
        yield from facets_section(self.table, model, toward, known_band(self.band)).parts


class FacetSums:
    """Sums over the paths whose first hit is each facet.

    A render adds to the sums, and `results` turns them into a table.
    """

    def __init__(self, table: FacetTable, max_bounces: int):
        self.table = table
        self.bounces = min(max_bounces + 1, MAX_BOUNCE_CHANNELS)
        self.number = table.number
        self.samples = 0
        self.hits, self.weights, self.closure = (np.zeros(table.count) for _ in range(3))
        self.by_bounce = None
        self.by_randomisation = None  # sums of the radiance, (randomisations, facets)

    def add(self, facet, L, weight, by_bounce, launch: Launch) -> None:
        """Add the samples of a launch.

        Parameters
        ----------
        facet : mitsuba.UInt32
            Facet that each path hits first.
        L : mitsuba.Float
            Radiance of each path, W m^-2 sr^-1.
        weight : mitsuba.Float
            Weight of each path.
        by_bounce : ByBounce
            Radiance of each path by number of reflections.
        launch : Launch
            The launch, of one window.
        """
        facet, L = facet.numpy(), L.numpy().astype(np.float64)
        index = np.flatnonzero((facet < self.table.count) & np.isfinite(L))
        facet, count = facet[index].astype(np.int64), self.table.count
        shape = (launch.randomisations, count)

        def of_paths(values) -> np.ndarray:
            """Values of the paths that hit a facet, which may be a constant."""
            return np.broadcast_to(values.numpy(), len(L))[index]

        weight = of_paths(weight)
        sums = np.bincount(
            index // launch.points * count + facet, weight * L[index], np.prod(shape)
        )
        bounces = [
            np.bincount(facet, weight * of_paths(values), count)
            for values in by_bounce.entries()[: self.bounces]
        ]
        if self.by_bounce is None:
            self.by_bounce, self.by_randomisation = np.zeros((len(bounces), count)), np.zeros(shape)
        self.hits += np.bincount(facet, minlength=count)
        self.weights += np.bincount(facet, weight, count)
        self.closure += np.bincount(facet, weight * of_paths(by_bounce.closure), count)
        self.by_bounce += bounces
        self.by_randomisation += sums.reshape(shape)
        self.samples += len(L)

    def results(self, scene, totals: Totals, window_area: float, direction) -> FacetResults:
        """The table of results.

        Parameters
        ----------
        scene : Scene
        totals : Totals
            Those of the window, from the same paths.
        window_area : float
            Area of the sensor's window, m^2.
        direction : ndarray, shape (3,)
            Unit vector toward the sensor.
        """
        table, per_sample = self.table, window_area / self.samples
        mean_cosine = mean_cosines(table, direction)
        projected = table.area * mean_cosine
        total = self.by_randomisation.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            visible = np.where(
                mean_cosine > EDGE_ON, self.weights * per_sample / projected, 0 * mean_cosine
            )
            # The visible fraction is unknown for a facet that is seen from behind, or so nearly
            # edge-on that it gets too few samples.
            visible[(self.hits > 0) & (projected < FEW * per_sample)] = np.nan
            radiance, closure, by_bounce = (
                sums / self.weights for sums in (total, self.closure, self.by_bounce)
            )
        # The sum is R times the mean of the R randomisations
        R = len(self.by_randomisation)
        scatter = np.sqrt(R) * self.by_randomisation.std(axis=0, ddof=1) * per_sample
        # All randomisations may agree on a facet's points, and miss a part of a point
        of_part = edge_share(R) * R * np.nan_to_num(radiance) * per_sample
        # The few paths that hit a facet may have missed the brightest source that it reflects. A
        # facet that no path has hit is assumed to be as bright as the brightest path.
        draws = totals.unmet_sums["draws"][0] * self.hits / max(self.hits.sum(), 1)
        largest = totals.largest_unmet("target", draws)
        largest = np.where(
            self.hits > 0,
            largest * reflectances(table, scene, by_bounce[0]),
            np.maximum(largest, totals.highest["target"]),
        )
        missed = np.fmin(projected, UNSEEN * per_sample) * largest / student_factor(np.inf)
        error = np.hypot(np.where(self.hits > 0, np.maximum(scatter, of_part), 0), missed)
        bounces = {
            f"bounce{k:02d}_W_m2_sr": by_bounce[k]
            if k < BOUNCE_CHANNELS - 1
            else by_bounce[k:].sum(axis=0)
            for k in range(1, min(len(by_bounce), BOUNCE_CHANNELS))
        }
        columns = {
            **table.columns(),
            "mean_cosine": mean_cosine,
            "visible_fraction": visible,
            "samples": self.hits.astype(int),
            "radiance_W_m2_sr": radiance,
            "emitted_W_m2_sr": by_bounce[0],
            **bounces,
            "closure_W_m2_sr": closure,
            "intensity_W_sr": total * per_sample,
            "standard_error_W_sr": error,
        }
        of_model = table.type == "model"
        is_of_model = of_model[table.triangle_facet]
        return FacetResults(
            scene.name,
            scene.band.name,
            {name: values[of_model] for name, values in columns.items()},
            table.triangles[is_of_model],
            table.triangle_facet[is_of_model],
        )


def reflectances(table: FacetTable, scene, emitted: np.ndarray) -> np.ndarray:
    """Largest reflectance of each facet: 1 minus its emission as a share of a blackbody's.

    emitted: radiance that each facet emits, NaN for one that no path has met [W m^-2 sr^-1]. It is
    1 where this does not tell, as behind a plume or for a facet that is too cold.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = emitted / in_band_radiance(scene.band, table.temperature)
    return np.where((share > 0) & (share < 1 + ROUNDING), np.clip(1 - share, 0, 1), 1.0)


def mean_cosines(table: FacetTable, direction: np.ndarray) -> np.ndarray:
    """Mean cosine between the normals of each facet and `direction`, shape (facets,).

    It is averaged over the facet's area. It is 0 where the facet is seen from behind, and NaN for
    a shape that is not a mesh.
    """
    p0, p1, p2 = np.moveaxis(table.triangles, 1, 0)
    projected = np.maximum(0.5 * np.cross(p1 - p0, p2 - p0) @ direction, 0)
    sums = np.bincount(table.triangle_facet, projected, table.count)
    faceted = np.bincount(table.triangle_facet, minlength=table.count) > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(faceted, sums / table.area, np.nan)


# Hemispherical view of a facet: what it sees over theta and phi (thesis 3.2.4)
# -----------------------------------------------------------------------------
# The view holds the solid angle and the view factor of every other facet, and a map.

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
    drawn_by = "mi_lcair.show.pictures.hemispherical_view:figure"

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
    emitters = tracer.emitters
    hit = nearest_hit(tracer.scene, emitters.sheets, emitters.spawn_ray(si, direction))
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
