"""A flight: contrast and detection against time, from views that are traced once an aspect."""

import time
from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.charts import Curve, LineCharts, lines_of
from mi_lcair.detection.flight_path import Moments
from mi_lcair.detection.irradiance import LineOfSources
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import sun_over
from mi_lcair.detection.sweeps import sweep
from mi_lcair.detection.sweeps.subject import (
    TEMPERATURE,
    AreasFolder,
    Line,
    Subject,
    loaded,
    sightline,
)
from mi_lcair.errors import InputError, errors_of
from mi_lcair.estimate import Estimate
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import Target
from mi_lcair.results import Result, entry
from mi_lcair.signatures.effective_areas import temperatures_of
from mi_lcair.signatures.view_areas import DEFAULT_TOLERANCE, ViewAreas

# The table of a flight that `flight` returns, and when its target is detected
# ----------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Flight(Result):
    """Contrast of a target against time.

    Attributes
    ----------
    scenario : Scenario
        Scenario of the flight, at its first moment.
    table : dict of str to ndarray, shape (moments,)
        Quantities of each moment by name with the unit. Half of the 95 % intervals includes what
        interpolation between aspects may add.
    views : int
        Number of moments whose view was traced.
    missed : int
        Number of views that did not reach the tolerance.
    seconds : float
        Time of the calculation, s.
    rendered : int or None
        Number of renders for the camera's frames. The other frames reuse a render with new noise.
        None without frames.
    """

    scenario: Scenario = entry()
    table: dict[str, np.ndarray] = entry("columns")
    views: int
    missed: int
    seconds: float = entry("time_s")
    rendered: int | None = entry("rendered_frames", default=None)

    kind = "flight"
    computed = {"scenario_name": "scenario.name", "interpolation_error": "interpolation_error"}

    @property
    def detections_s(self) -> tuple[float | None, float | None, float | None]:
        """Time of the first detection, and the ends of its 95 % interval, s; None for never.

        Without nei of the sensor all are None.
        """
        if "snr" not in self.table:
            return None, None, None
        snr, half_width = self.table["snr"], self.table["snr_half_width"]
        return tuple(self._first(values) for values in (snr, snr + half_width, snr - half_width))

    def _first(self, snr: np.ndarray) -> float | None:
        detected = np.flatnonzero(snr >= self.scenario.sensor.snr)
        return float(self.table["time_s"][detected[0]]) if detected.size else None

    @property
    def interpolation_error(self) -> float:
        """Largest error of interpolation, as a fraction of the irradiance of the target."""
        error, target = (self.table[f"{name}_W_m2"] for name in ("interpolation_error", "target"))
        dark = np.where(error > 0, np.inf, 0.0)
        return float(np.max(np.divide(error, target, out=dark, where=target > 0)))

    def detection(self) -> str:
        """The first detection in words."""
        first, earliest, latest = self.detections_s
        if "snr" not in self.table:
            return "the sensor's noise is not given"
        if earliest is None:
            return "not detected"
        until = "later, or never" if latest is None else f"{latest:g} s"
        at = "not detected" if first is None else f"detected from {first:g} s"
        return f"{at}, 95 % interval {earliest:g} s to {until}"

    def summary(self) -> str:
        """One line with the number of moments and views, and the first detection."""
        moments = self.table["time_s"]
        missed = f", {self.missed} not to the tolerance" if self.missed else ""
        frames = "" if self.rendered is None else f", {self.rendered} renders of the camera"
        return (
            f"flight {self.scenario.name}: {len(moments)} moments from {moments[0]:g} to "
            f"{moments[-1]:g} s from {self.views} traced views{missed}{frames}, "
            f"interpolated within {self.interpolation_error:.2g} of the target's irradiance, "
            f"{self.detection()}"
        )

    def entries(self) -> dict:
        """Entries for JSON, with the first detection and its 95 % interval."""
        first, *interval = self.detections_s
        detected = {"detected_from_s": first, "detected_from_95_s": interval}
        return super().entries() | detected

    def picture(self) -> LineCharts:
        """Contrast with its 95 % interval, ratio to the noise, and range against time."""
        snr = [["snr"]] if "snr" in self.table else []
        columns = self.table | {"range_km": self.table["range_m"] / 1e3}
        drawn = lines_of(
            columns,
            "time_s",
            ["contrast_W_m2"],
            *snr,
            ["range_km"],
            half={"contrast_W_m2": "contrast_half_width_W_m2"},
            words={"contrast_W_m2": "contrast with 95 % interval", "snr": "signal-to-noise ratio"},
            title=f"{self.scenario.name}, {self.scenario.sensor.detector().band.label}",
        )
        if snr:
            least = np.full(len(columns["snr"]), self.scenario.sensor.snr)
            needed = Curve("detection", least, "", 1)
            chart = drawn.charts[1]
            curves = [*chart.curves, needed]
            drawn.charts[1] = replace(chart, curves=curves, y_label=curves[0].name, is_log=True)
        return drawn


STEP_DEG = 4.0  # largest angle between aspects that are traced at first, degrees


def measure_flight(
    scenario: Scenario,
    folder: AreasFolder | None = None,
    progress: Progress | None = None,
) -> Flight:
    """Contrast of the target of a scenario at the moments of its flight.

    Parameters
    ----------
    scenario : Scenario
        It has a table [flight].
    folder
        As for `measure_sweep`.
    progress : callable or None
        Called with (moments done, all moments).
    """
    start = time.perf_counter()
    if scenario.flight is None:
        raise InputError("has no table [flight]; give the CSV of a path in it: path = 'path.csv'")
    loaded.cache_clear()  # files may have changed since the last flight
    sweep.sources_of.cache_clear()
    aspects = Aspects(scenario, scenario.flight.moments(), folder)
    errors = aspects.refine(scenario.flight.tolerance)
    table = table_of(aspects, errors, progress)
    aspects.doubts.warn()
    return Flight(
        scenario=scenario,
        table=table,
        views=len(aspects.areas),
        missed=sum(not areas.reached.all() for areas in aspects.areas.values()),
        seconds=time.perf_counter() - start,
    )


def sampling_of(scenario: Scenario) -> Sampling:
    """The sampling of each view; raises InputError for a tolerance that only one contrast has."""
    render = scenario.render
    if render.tolerance_W_m2 is not None or render.to_noise:
        raise InputError(
            "[render]: a flight needs spp, or tolerance of each intensity; leave tolerance_W_m2 "
            "and to_noise out"
        )
    tolerance = render.tolerance
    if render.spp is None and tolerance is None:
        tolerance = DEFAULT_TOLERANCE
    return Sampling(spp=render.spp, tolerance=tolerance, max_spp=render.max_spp, seed=render.seed)


class Aspects:
    """Effective areas of a flight's target at some of its moments, and the terms at all moments.

    Between two moments that were traced, terms are linear in the angle by which the target has
    turned as the observer sees it. Air, range, background and temperatures are those of the moment.

    Parameters
    ----------
    scenario : Scenario
    moments : Moments
    folder
        As for `measure_sweep`.

    Attributes
    ----------
    areas : dict of int to ViewAreas
        Effective areas by number of the moment.
    """

    def __init__(self, scenario: Scenario, moments: Moments, folder: AreasFolder | None):
        self.scenario, self.moments, self.folder = scenario, moments, folder
        self.sampling, self.turned_deg = sampling_of(scenario), moments.turned_deg
        self.scene = self.subject(0).load()
        self.sun = sun_over(scenario, self.scene)
        self.lines: dict[int, Line] = {}
        self.areas: dict[int, ViewAreas] = {}
        self.doubts = sweep.Doubts()
        first = self.line(0)
        temperatures_of(sweep.sources_of(first.subject, first.light), first.temperatures)

    def subject(self, number: int) -> Subject:
        """The scene at a moment, which its attitude alone changes."""
        scenario = self.scenario.at_moment(self.moments, number)
        return Subject(f"{scenario.name} {scenario.pose}", scenario=scenario)

    def line(self, number: int) -> Line:
        """View, line of sight and temperatures of a moment."""
        if number not in self.lines:
            scenario = self.scenario.at_moment(self.moments, number)
            histories = self.moments.temperatures
            values = {f"{TEMPERATURE}{group}": float(T[number]) for group, T in histories.items()}
            with errors_of(f"at {self.moments.time_s[number]:g} s"):
                sight = sightline(scenario, self.scene, self.sun, values)
            self.lines[number] = Line(
                np.array([number]), (scenario.observer.view,), self.subject(number), *sight
            )
        return self.lines[number]

    def trace(self, numbers: list[int]) -> None:
        """Trace the views of some moments."""
        new = [number for number in dict.fromkeys(numbers) if number not in self.areas]
        lines = [self.line(number) for number in new]
        for number, line in zip(new, lines):
            target = Target.of(line.subject.load())
            below_m = float(np.max(target.centre[2] - target.points[:, 2]))
            self.moments.check_above(below_m, self.moments.attitude_deg[number])
        batches = sweep.planned(lines, self.scenario.render.resolution, self.sampling)
        of_lit, _ = sweep.results_of(batches, self.folder, None)
        for number, line in zip(new, lines):
            lit = line.subject, line.light
            areas = replace(of_lit[lit], sources=sweep.sources_of(*lit))
            self.areas[number] = areas.of_views([areas.views.index(line.views[0])])

    def terms(self, number: int, traced: int) -> dict[str, Estimate]:
        """The TERMS of a moment, if the target had the effective areas of another one."""
        line = self.line(number)
        areas, sight = self.areas[traced].at_temperatures(line.temperatures), line.sight
        amounts = LineOfSources(areas, sight.detector.band, sight.air, sight.backdrop)
        shares = self.doubts.shares(sight, areas.sources)
        return sweep.terms_of(amounts, sight.path, amounts.per_amount(sight.path), shares)

    def between(self, number: int, pair: tuple[int, int]) -> dict[str, Estimate]:
        """The TERMS of a moment between two that were traced.

        Errors are those of fully correlated renders, which is an upper bound.
        """
        low, high = (self.turned_deg[k] for k in pair)
        share = (self.turned_deg[number] - low) / (high - low) if high > low else 0.0
        first, second = (self.terms(number, k) for k in pair)
        return {
            name: first[name].through(lambda a, b: (1 - share) * a + share * b, second[name])
            for name in first
        }

    def middle(self, pair: tuple[int, int]) -> int | None:
        """The moment at the middle aspect of two; None if there is no other aspect between."""
        low, high = (self.turned_deg[k] for k in pair)
        if pair[1] - pair[0] < 2 or not high > low:
            return None
        number = int(np.searchsorted(self.turned_deg, (low + high) / 2))
        return min(max(number, pair[0] + 1), pair[1] - 1)

    def refine(self, tolerance: float) -> dict[tuple[int, int], float]:
        """Trace moments until the contrast between them is linear, to a tolerance and its noise.

        Returns for each pair of neighbouring moments how far the traced moment at its end, or in
        it, may have been from the line: the difference and its noise, as an intensity, W/sr.
        """
        steps = np.arange(0, self.turned_deg[-1], STEP_DEG)
        ends = [*np.searchsorted(self.turned_deg, steps), 0, len(self.turned_deg) - 1]
        ends = sorted(set(map(int, ends)))
        self.trace(ends)
        pairs, errors = list(zip(ends, ends[1:])), {}
        while pairs:
            middles = {pair: k for pair in pairs if (k := self.middle(pair)) is not None}
            self.trace(list(middles.values()))
            pairs = []
            for pair, k in middles.items():
                linear, traced = self.between(k, pair)["total"], self.terms(k, k)["total"]
                difference = abs(linear.value - traced.value).item()
                noise = np.hypot(linear.half_width, traced.half_width).item()
                halves = [(pair[0], k), (k, pair[1])]
                # A difference within the noise may hide one of the other sign
                at_most = (difference + noise) * self.moments.range_m[k] ** 2
                errors |= dict.fromkeys(halves, at_most)
                if difference > tolerance * abs(traced.value).item() + noise:
                    pairs += halves
        return errors


def table_of(
    aspects: Aspects, errors: dict[tuple[int, int], float], progress: Progress | None
) -> dict[str, np.ndarray]:
    """Quantities of all moments, by name with the unit."""
    moments, traced = aspects.moments, np.array(sorted(aspects.areas))
    rows = []
    for number in range(len(moments.time_s)):
        place = int(np.searchsorted(traced, number))
        is_traced = traced[place] == number
        pair = (number, number) if is_traced else tuple(map(int, traced[place - 1 : place + 1]))
        terms = aspects.between(number, pair)
        error = errors.get(pair, 0.0) / moments.range_m[number] ** 2
        total = terms["total"]
        terms["total"] = replace(total, half_width=total.half_width + error)
        line = aspects.line(number)
        rows.append(
            {
                "range_m": line.sight.path.range_m,
                "azimuth_deg": line.views[0].azimuth_deg,
                "elevation_deg": line.views[0].elevation_deg,
                "traced": float(is_traced),
                **sweep.of_terms(terms),
                "interpolation_error_W_m2": error,
                **sweep.beside_noise(line.sight.detector, terms["total"]),
            }
        )
        if progress:
            progress(number + 1, len(moments.time_s))
    table = {name: np.array([np.asarray(row[name]).item() for row in rows]) for name in rows[0]}
    return {
        "time_s": moments.time_s,
        **{name: moments.position_m[:, k] for k, name in enumerate(("x_m", "y_m", "z_m"))},
        **table,
    }
