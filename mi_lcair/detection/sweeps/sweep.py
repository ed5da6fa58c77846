"""The table of signatures that `sweep` returns."""

import json
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

import mi_lcair
from mi_lcair.detection.approximations import (
    averaged_plumes,
    multiplied_light,
    share_of_reflections,
    shares_of_light,
)
from mi_lcair.detection.detection_range import largest_ranges
from mi_lcair.detection.irradiance import AirOfLight, LineOfSources
from mi_lcair.detection.setting import Sightline
from mi_lcair.detection.sweeps.subject import (
    AreasFolder,
    Batch,
    Conditions,
    Line,
    Subject,
    Value,
    Views,
    lines_of,
    loaded,
)
from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate
from mi_lcair.files import resumable
from mi_lcair.physics.air.atmosphere import LineOfSight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.physics.imager import Detector
from mi_lcair.plugins.emission.source import Source
from mi_lcair.progress import Progress
from mi_lcair.rendering.reflections import counts, followed_row, share_left_out
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import RESOLUTION, View
from mi_lcair.results import Result, entry, extremes, summary_of
from mi_lcair.sections import LongTable, unit_of
from mi_lcair.signatures.effective_areas import temperatures_of
from mi_lcair.signatures.trend import Trend, measure_rows
from mi_lcair.signatures.view_areas import ViewAreas
from mi_lcair.tasks import computed, exclusively

if TYPE_CHECKING:
    import xarray

GROUPS_K = "temperature."  # beginning of the names of conditions that are temperatures


@dataclass(frozen=True, repr=False)
class Sweep(Result):
    """Signatures over a table of conditions.

    Attributes
    ----------
    conditions : Conditions
        Conditions of the sweep.
    table : dict of str to ndarray, shape (cases,)
        Quantities of each case by name with the unit. The names with standard_error are standard
        errors, those with half_width half of the 95 % intervals.
    views : int
        Number of views that the cases need.
    traced : int
        Number of views that were traced; the others were already known.
    seconds : float
        Time of the sweep, s.
    followed : str
        What the paths follow, in words.
    """

    conditions: Conditions = entry("conditions", "values")
    table: dict[str, np.ndarray] = entry()
    views: int
    traced: int
    seconds: float = entry("time_s")
    followed: str = ""

    kind = "sweep"
    heading = "Signatures by condition"
    computed = {
        "name": "conditions.name",
        "product": "conditions.base.product",
        "columns": "columns",
    }

    @property
    def missed(self) -> int:
        """Number of cases whose view did not reach the tolerance."""
        return int(np.sum(self.table["reached"] == 0))

    def summary(self) -> str:
        """One line with the conditions, the number of cases, and how many views were traced."""
        values = self.conditions.values
        axes = " x ".join(f"{len(values[name])} {name}" for name in values)
        reached = f", {self.missed} not to the tolerance" if self.missed else ""
        return (
            f"sweep {self.conditions.name}: {self.conditions.count} cases over {axes}, from "
            f"{self.views} views, {self.traced} of them traced{reached}"
        )

    def facts(self) -> Iterator[Any]:
        """The conditions in one line, the extremes of the quantities, and the table."""
        yield summary_of(self)
        if self.followed:
            yield followed_row(self.followed)
        yield extremes(self.table)
        yield LongTable(self.columns())

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each case: its conditions and its quantities."""
        places = self.conditions.places()
        return {
            name: array_of(values)[places[name]] for name, values in self.conditions.values.items()
        } | self.table

    def to_xarray(self) -> "xarray.Dataset":
        """The table as an xarray Dataset, with a dimension for each condition.

        Without product there is one dimension, case. Raises InputError if xarray is not installed.
        """
        values = {name: array_of(list_) for name, list_ in self.conditions.values.items()}
        if self.conditions.base.product:
            axes, shape = tuple(values), self.conditions.shape
            coordinates = {name: ((name,), array) for name, array in values.items()}
        else:
            axes, shape = ("case",), (self.conditions.count,)
            coordinates = {name: (("case",), array) for name, array in values.items()}
        table = {name: (axes, array.reshape(shape)) for name, array in self.table.items()}
        made = self.dataset(table, coordinates)
        for name in values:
            if name.startswith(GROUPS_K):
                made[name].attrs["units"] = "K"
            elif name.rpartition(".")[2] != name and (unit := unit_of(name)):
                made[name].attrs["units"] = unit
        return made

    def attributes(self) -> dict:
        """Attributes of the Dataset, which are the same however the sweep was computed."""
        base = self.conditions.base
        title = f"sweep {self.conditions.name}: {self.conditions.count} cases"
        return {"kind": self.kind, "title": title, "base": base.scene or base.scenario}


def array_of(values: list[Value]) -> np.ndarray:
    """Values of a condition as an array of numbers or of texts."""
    is_number = all(type(value) in (int, float) for value in values)
    return np.array(values, float) if is_number else np.array([str(value) for value in values])


# Quantities of a sweep's cases from effective areas, without another render
# --------------------------------------------------------------------------

SLOPE_STEP_K = 0.01  # step of temperature for the slope of Planck's law, K


def rows_of(
    line: Line, areas: ViewAreas, shares: np.ndarray | float = 0.0
) -> dict[str, np.ndarray]:
    """Quantities of the cases of a line by name with the unit, (cases,), without ranges.

    Parameters
    ----------
    line : Line
    areas : ViewAreas
        Effective areas toward the views of the cases, at the temperatures of the scene.
    shares : ndarray or float
        Shares of the light that may be wrong, see `terms_of`.
    """
    areas = areas.at_temperatures(line.temperatures)
    rows = of_estimates("intensity", "W_sr", areas.intensity()) if line.sight is None else {}
    if line.sight is not None:
        rows = of_sight(line.sight, areas, shares)
    return rows | {
        "projected_area_m2": areas.amounts[:, -1],
        "paths": areas.paths.astype(float),
        "reached": areas.reached.astype(float),
    }


def of_sight(
    sight: Sightline, areas: ViewAreas, shares: np.ndarray | float
) -> dict[str, np.ndarray]:
    """Quantities of a target at the end of a path, as `contrast` has them."""
    line = LineOfSources(areas, sight.detector.band, sight.air, sight.backdrop)
    _, target, path, _, _ = per_amount = line.per_amount(sight.path)
    terms = terms_of(line, sight.path, per_amount, shares)
    return {
        **of_terms(terms),
        **beside_noise(sight.detector, terms["total"]),
        **apparent_temperature(areas, sight.detector.band, target, path, sight.path.range_m),
    }


def terms_of(
    line: LineOfSources,
    along: LineOfSight,
    per_amount: np.ndarray,
    shares: np.ndarray | float = 0.0,
) -> dict[str, Estimate]:
    """The TERMS of each view at the end of a path, from those per amount there.

    Those of path and background have the error of the projected area alone.

    shares: of the light of each source, and of the hidden background, that may be wrong; see
    `shares_of_light` and `share_of_reflections`.
    """
    # An intensity that was missed arrives at most as this irradiance
    areas, at_most = line.areas, line.per_intensity(along)
    intensity, target, path, background, total = per_amount
    nothing, n = np.zeros_like(target), len(areas.sources)
    *of_light, of_hidden = np.broadcast_to(shares, n + 1)
    approximated = np.abs(areas.amounts[:, :n] @ (target[:n] * of_light))
    approximated += np.abs(areas.amounts[:, -1] * background[-1] * of_hidden)

    def uncertain(term: Estimate) -> Estimate:
        return replace(term, half_width=np.hypot(term.half_width, approximated))

    return {
        "intensity": areas.estimates(intensity, intensity, 1.0),
        "target": uncertain(areas.estimates(target, target, at_most)),
        "path": areas.estimates(path, nothing, 0.0),
        "background": areas.estimates(background, nothing, 0.0),
        "total": uncertain(areas.estimates(total, target, at_most)),
    }


def of_terms(terms: Mapping[str, Estimate]) -> dict[str, np.ndarray]:
    """Columns of the TERMS."""
    return {
        **of_estimates("intensity", "W_sr", terms["intensity"]),
        **of_estimates("target", "W_m2", terms["target"]),
        "path_W_m2": terms["path"].value,
        "background_W_m2": terms["background"].value,
        **of_estimates("contrast", "W_m2", terms["total"]),
    }


def beside_noise(detector: Detector, contrast: Estimate) -> dict[str, np.ndarray]:
    """Columns of a contrast and the noise of a detector."""
    rows = of_estimates("nei_max", "W_m2", contrast.through(detector.nei_max))
    if detector.nei is None:
        return rows
    snr = contrast.through(lambda value: np.abs(detector.signal(value)) / detector.nei)
    rows |= {"nei_ratio": detector.nei_max(contrast.value) / detector.nei}
    return rows | of_estimates("snr", "", snr)


def detection_ranges_of(line: Line, areas: ViewAreas) -> dict[str, np.ndarray]:
    """Detection ranges of the cases of a line, which is the same for all lines of a direction."""
    sight, areas = line.sight, areas.at_temperatures(line.temperatures)
    of_line = LineOfSources(areas, sight.detector.band, sight.air, sight.backdrop)
    ranges = largest_ranges(of_line, areas, sight.detector, sight.air, sight.radius_m)
    return dict(zip(("detection_range_m", "detection_range_standard_error_m"), ranges))


def apparent_temperature(
    areas: ViewAreas, band: Band, target: np.ndarray, path: np.ndarray, range_m: float
) -> dict[str, np.ndarray]:
    """Brightness temperature of the target's mean radiance at the sensor, air included.

    target, path: irradiances for each of the amounts. A view without a target has none: NaN.
    """
    projected = areas.amounts[:, -1]
    solid_angle = np.where(projected > 0, projected, np.nan) / range_m**2
    radiance = ((target + path) @ areas.amounts.T) / solid_angle
    # The radiance is a ratio: what raises the solid angle lowers it
    deviations = areas.deviations @ (target + path)
    deviations -= radiance[:, None] * areas.deviations[:, :, -1] / range_m**2
    relative = (target @ areas.amounts.T) * areas.relative
    error = np.hypot(np.sqrt(np.sum(deviations**2, axis=1)), relative) / solid_angle
    temperature = brightness_temperature(band, radiance)
    steps = temperature + SLOPE_STEP_K * np.array([[1.0], [-1.0]])
    high, low = in_band_radiance(band, steps)
    slope = (high - low) / (2 * SLOPE_STEP_K)
    return {
        "apparent_temperature_K": temperature,
        "apparent_temperature_standard_error_K": np.divide(
            error, slope, out=np.full_like(error, np.nan), where=slope > 0
        ),
    }


def of_estimates(name: str, unit: str, estimates: Estimate) -> dict[str, np.ndarray]:
    """Columns of a value, its standard error and half of its 95 % interval."""
    end = f"_{unit}" if unit else ""
    return {
        f"{name}{end}": estimates.value,
        f"{name}_standard_error{end}": estimates.standard_error,
        f"{name}_half_width{end}": estimates.half_width,
    }


# A sweep: traces the views that are not known yet, and calculates all cases from them
# ------------------------------------------------------------------------------------

Key = TypeVar("Key")
Lit = tuple[Subject, AirOfLight | None]  # a subject, and the air of its light


def measure_sweep(
    conditions: Conditions,
    folder: AreasFolder | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Signatures over a table of conditions.

    Parameters
    ----------
    conditions : Conditions
    folder : AreasFolder or None
        Where effective areas are kept, and found again.
    progress : callable or None
        Called with (views done, all views).
    """
    start = time.perf_counter()
    loaded.cache_clear()  # files may have changed since the last sweep
    sources_of.cache_clear()
    lines = list(lines_of(conditions))
    if conditions.base.detection_range:
        for line in lines:
            if line.sight is not None and line.sight.detector.nei is None:
                raise InputError(
                    "[base]: detection_range needs nei, the noise-equivalent irradiance of "
                    "[sensor] in W m^-2"
                )
    for line in lines:
        if line.temperatures:
            temperatures_of(sources_of(line.subject, line.light), line.temperatures)
    batches = planned(lines, conditions.sampling.resolution, conditions.sampling.sampling())
    views = sum(len(batch.views) for of_lit in batches.values() for batch in of_lit)
    of_lit, traced = results_of(batches, folder, progress)
    table = table_of(lines, of_lit, conditions)
    followed = dict.fromkeys(batch.followed for of_key in batches.values() for batch in of_key)
    known = views, traced, time.perf_counter() - start, ", or ".join(followed)
    return Sweep(conditions, table, *known)


def results_of(
    batches: dict[Key, list[Batch]], folder: AreasFolder | None, progress: Progress | None
) -> tuple[dict[Key, Views], int]:
    """What is traced for the batches of each key, together, and the number of views now traced."""
    everything = [batch for of_key in batches.values() for batch in of_key]
    known = {}
    if folder is not None:
        read = ((batch, folder.read(batch)) for batch in everything)
        known = {batch.key: traced for batch, traced in read if traced is not None}
    missing = [batch for batch in everything if batch.key not in known]
    views = sum(len(batch.views) for batch in everything)
    new = sum(len(batch.views) for batch in missing)
    done = views - new
    with nullcontext() if folder is None else resumable(folder.path, "*.nc"):
        for number, traced in computed([batch.run for batch in missing]):
            batch = missing[number]
            known[batch.key] = traced
            if folder is not None:
                folder.write(batch, traced)
            done += len(batch.views)
            if progress:
                progress(done, views)
    parts = {key: [known[batch.key] for batch in of_key] for key, of_key in batches.items()}
    return {key: of_key[0].joined(of_key) for key, of_key in parts.items()}, new


def planned(lines: list[Line], resolution: int, sampling: Sampling) -> dict[Lit, list[Batch]]:
    """The batches of views that the lines need, by subject and height of the light."""
    lines_of_lit: dict[Lit, list[Line]] = {}
    for line in lines:
        lines_of_lit.setdefault((line.subject, line.light), []).append(line)
    batches = {}
    for lit, some in lines_of_lit.items():
        sights = (line.sight for line in some if line.sight is not None)
        for remark in averaged_plumes(lit[0].load(), sights):
            warnings.warn(remark, stacklevel=2)
        views = list(dict.fromkeys(view for line in some for view in line.views))
        batches[lit] = Batch.of_views(*lit, views, resolution, sampling)
    return batches


@lru_cache(maxsize=2)
@exclusively
def sources_of(subject: Subject, light: AirOfLight | None) -> list[Source]:
    """The sources of a subject, whose light knows the air that it has crossed."""
    scene = subject.load()
    if light is not None:
        light.shine_on(scene)
    with scene.prepared(by_spectrum=True) as tracer:
        return [source for source in tracer.emitters.sources.list if source.name is not None]


def table_of(
    lines: list[Line], of_lit: dict[Lit, ViewAreas], conditions: Conditions
) -> dict[str, np.ndarray]:
    """Quantities of all cases, by name with the unit."""
    table: dict[str, np.ndarray] = {}
    lit, areas, numbers, of_views, ranges = None, None, {}, {}, {}
    doubts = Doubts()
    for line in lines:
        if (line.subject, line.light) != lit:
            lit = line.subject, line.light
            areas = replace(of_lit[lit], sources=sources_of(*lit))
            numbers, of_views, ranges = {view: k for k, view in enumerate(areas.views)}, {}, {}
        if line.views not in of_views:  # what is derived from the areas serves many lines
            of_views[line.views] = areas.of_views([numbers[view] for view in line.views])
        of_line = of_views[line.views]
        rows = rows_of(line, of_line, doubts.shares(line.sight, areas.sources))
        if conditions.base.detection_range:
            key = line.sight.direction, line.views
            if key not in ranges:
                ranges[key] = detection_ranges_of(line, of_line)
            rows |= ranges[key]
        for name, values in rows.items():
            table.setdefault(name, np.full(conditions.count, np.nan))[line.cases] = values
    doubts.warn()
    return table


class Doubts:
    """The light behind a table that a product of transmittances changes most, over many lines."""

    def __init__(self):
        self.worst: tuple[list[Source], np.ndarray] = [], np.zeros(0)

    def shares(self, sight: Sightline | None, sources: list[Source]) -> np.ndarray | float:
        """The shares of `terms_of` on a line of sight."""
        if sight is None:
            return 0.0
        shares = shares_of_light(sight, sources)
        if np.abs(shares).max(initial=0) > np.abs(self.worst[1]).max(initial=0):
            self.worst = sources, shares
        return np.append(shares, share_of_reflections(sight))

    def warn(self) -> None:
        for remark in multiplied_light(*self.worst):
            warnings.warn(remark, stacklevel=2)


# A trend: a sweep over the aspect alone, with the parts of each intensity
# ------------------------------------------------------------------------


def measure_trend(
    scene: Scene,
    views: tuple[View, ...],
    resolution: int,
    sampling: Sampling,
    folder: AreasFolder | None = None,
    progress: Progress | None = None,
) -> Trend:
    """Intensities of a scene's model toward some views.

    Parameters
    ----------
    scene : Scene
    views : tuple of View
        Each once.
    resolution, sampling
        As for `totals_of_views`.
    folder, progress
        As for `measure_sweep`.
    """
    if len(set(views)) < len(views) or not views:
        raise InputError(
            "a trend needs views, each once; an azimuth or elevation is missing or given twice"
        )
    RESOLUTION.check(resolution, "resolution")
    subject = Subject(scene.name, given=scene)
    batches = Batch.of_views(subject, None, views, resolution, sampling, measure_rows)
    results, _ = results_of({scene.name: batches}, folder, progress)
    samples = f"spp {sampling.spp} over each view"
    if sampling.spp is None:
        most = sampling.max_spp or "default"
        samples = f"95 % interval {sampling.tolerance:g}, max_spp {most}"
    made = {
        "scene": scene.name,
        "parameters": json.dumps(scene.parameters, sort_keys=True),
        "fingerprint": batches[0].fingerprint,
        "band": scene.band.label,
        "resolution": str(resolution),
        "samples": samples,
        "seed": str(sampling.seed),
        "mi_lcair": mi_lcair.__version__,
    }
    beyond = share_left_out(scene, sampling, views)
    known = scene.band.label, sampling.tolerance, made, beyond, batches[0].followed
    trend = Trend(scene.name, results[scene.name].table, *known)
    if beyond and counts(beyond, trend.widest, sampling.tolerance):
        trend.table["reached"][:] = 0
    return trend
