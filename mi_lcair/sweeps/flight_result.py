"""The table of a flight that `flight` returns, and when its target is detected."""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.detection.scenario import Scenario
from mi_lcair.results import Result, entry
from mi_lcair.results.charts import Curve, LineCharts, lines_of


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
        Number of renders for the camera's frames, the other frames being as before with new noise;
        None without frames.
    """

    scenario: Scenario = entry()
    table: dict[str, np.ndarray] = entry("columns")
    views: int
    missed: int
    seconds: float = entry("time_s")
    rendered: int | None = entry("rendered_frames", default=None)

    kind = "flight"
    computed = {"interpolation_error": "interpolation_error"}

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
            return "no noise of the sensor is given"
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
        found = {"scenario_name": self.scenario.name, "detected_from_s": first}
        return found | {"detected_from_95_s": interval} | super().entries()

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
            title=f"{self.scenario.name}, {self.scenario.sensor.band}",
        )
        if snr:
            least = np.full(len(columns["snr"]), self.scenario.sensor.snr)
            needed = Curve("detection", least, "", 1)
            chart = drawn.charts[1]
            drawn.charts[1] = replace(chart, curves=[*chart.curves, needed], is_log=True)
        return drawn

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each moment."""
        return self.table
