"""What each facet of the model sends to the sensor, from the same paths as the image."""

import csv
from dataclasses import dataclass

import numpy as np

from mi_lcair.files import replacing
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.render import BOUNCE_CHANNELS
from mi_lcair.table import safe_cell

BATCHES = 8  # of each pass: their scatter tells the standard errors
EDGE_ON = 1e-6  # cosine below which a facet shows nothing but rounding errors
FEW = 30  # samples that a facet must expect for its visible fraction to be told


@dataclass(frozen=True)
class FacetResults:
    """What each facet sends to the sensor, as a table.

    columns: name (with its unit) -> one value for each facet of the model (not of its background),
    NaN where there is none: a facet out of sight has no radiance. The column intensity_W_sr sums to
    the target's intensity. mean_cosine is that of the front; visible_fraction an estimate from the
    samples, which may exceed 1 by its noise.
    """

    columns: dict[str, np.ndarray]

    def write(self, path) -> None:
        """The table as a CSV; cells without a value are `nan`."""
        with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            for row in zip(*self.columns.values()):
                writer.writerow(map(cell, row))


def cell(value) -> object:
    """A value as the table holds it; names come from the user's files."""
    if isinstance(value, float):
        return f"{value:.9g}"
    return safe_cell(value) if isinstance(value, str) else value


class FacetSums:
    """Sums over the paths that meet each facet first; a render adds to them, `results` ends them."""

    def __init__(self, table: FacetTable):
        self.table = table
        self.number = table.number
        self.samples = 0
        self.hits, self.total, self.closure, self.mean, self.scatter = (
            np.zeros(table.count) for _ in range(5)
        )
        self.by_bounce = None
        self.batches, self.weight = 0, 0.0
        self.sweep, self.sweep_spp = np.zeros((BATCHES, table.count)), np.zeros(BATCHES)

    def add(self, facet, L, channels, spp: int, first: int) -> None:
        """Adds the samples of a run of pixels, `spp` consecutive ones each, from pixel `first` on."""
        if first == 0:
            self.end_sweep()
        facet, L = facet.numpy(), L.numpy().astype(np.float64)
        index = np.flatnonzero((facet < self.table.count) & np.isfinite(L))
        facet, count = facet[index].astype(np.int64), self.table.count
        batches = min(BATCHES, spp)
        batch_of = np.arange(spp) * batches // spp  # of the samples of a pixel
        sums = np.bincount(
            batch_of[index % spp] * count + facet, L[index], batches * count
        ).reshape(batches, count)
        self.sweep[:batches] += sums
        self.sweep_spp[:batches] = np.bincount(batch_of)
        self.total += sums.sum(axis=0)
        self.hits += np.bincount(facet, minlength=count)
        self.closure += np.bincount(facet, channels.closure.numpy()[index], count)
        bounces = [
            np.bincount(facet, values.numpy()[index], count) for values in channels.by_bounce
        ]
        if self.by_bounce is None:
            self.by_bounce = np.zeros((len(bounces), count))
        self.by_bounce += bounces
        self.samples += len(L)

    def end_sweep(self) -> None:
        """The batches of one pass over all pixels become observations of each facet's sum per
        sample of a pixel.
        """
        for sums, spp in zip(self.sweep, self.sweep_spp):
            if spp:
                difference = sums / spp - self.mean
                self.scatter += difference**2 * (self.weight * spp / (self.weight + spp))
                self.mean += difference * (spp / (self.weight + spp))
                self.weight += spp
                self.batches += 1
        self.sweep[:], self.sweep_spp[:] = 0, 0

    def results(self, window_area: float, direction: np.ndarray) -> FacetResults:
        """The table. window_area: of the sensor [m^2]; direction: unit vector toward it."""
        self.end_sweep()
        table, per_sample = self.table, window_area / self.samples
        mean_cosine = mean_cosines(table, direction)
        projected = table.area * mean_cosine
        with np.errstate(divide="ignore", invalid="ignore"):
            visible = np.where(
                mean_cosine > EDGE_ON, self.hits * per_sample / projected, 0 * mean_cosine
            )
            # seen from behind, or so nearly edge-on that samples say nothing of the share
            visible[(self.hits > 0) & (projected < FEW * per_sample)] = np.nan
            radiance, closure, by_bounce = (
                sums / self.hits for sums in (self.total, self.closure, self.by_bounce)
            )
            error = (
                np.sqrt(self.scatter / (self.batches - 1) / self.weight)
                * window_area
                / (self.samples / self.weight)
            )
        if self.batches < 2:
            error = np.full(table.count, np.nan)
        bounces = {
            f"bounce{k:02d}_W_m2_sr": by_bounce[k]
            if k < BOUNCE_CHANNELS - 1
            else by_bounce[k:].sum(axis=0)
            for k in range(1, min(len(by_bounce), BOUNCE_CHANNELS))
        }
        columns = {
            "facet": np.arange(table.count),
            "type": table.type,
            "group": table.group,
            "material": table.material,
            "temperature_K": table.temperature,
            "area_m2": table.area,
            "mean_cosine": mean_cosine,
            "visible_fraction": visible,
            "samples": self.hits.astype(int),
            "radiance_W_m2_sr": radiance,
            "emitted_W_m2_sr": by_bounce[0],
            **bounces,
            "closure_W_m2_sr": closure,
            "intensity_W_sr": self.total * per_sample,
            "standard_error_W_sr": error,
        }
        return FacetResults(
            {name: values[table.type == "model"] for name, values in columns.items()}
        )


def mean_cosines(table: FacetTable, direction: np.ndarray) -> np.ndarray:
    """Cosine between each facet's normal and `direction`, 0 from behind, averaged over its area;
    NaN for what is no mesh.
    """
    p0, p1, p2 = np.moveaxis(table.triangles, 1, 0)
    projected = np.maximum(0.5 * np.cross(p1 - p0, p2 - p0) @ direction, 0)
    sums = np.bincount(table.triangle_facet, projected, table.count)
    faceted = np.bincount(table.triangle_facet, minlength=table.count) > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(faceted, sums / table.area, np.nan)
