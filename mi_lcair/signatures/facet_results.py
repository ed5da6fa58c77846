"""Radiance and intensity of each facet of the model, from the same paths as the image."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair.physics.bands import known_band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.by_bounce import BOUNCE_CHANNELS, MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.facets.polygons import WRITERS
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.statistics import UNSEEN, Totals, edge_share, student_factor
from mi_lcair.rendering.window import toward_sensor
from mi_lcair.results import Result, entry
from mi_lcair.results.charts import facets_section
from mi_lcair.results.result import summary_of

if TYPE_CHECKING:
    from mi_lcair.rendering.scene import Scene

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

    def columns(self) -> dict[str, np.ndarray]:
        """The table, with a row for each facet."""
        return self.table


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
