"""Detection range: the ranges at which the signal of a target reaches snr * nei."""

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from scipy.optimize import brentq

from mi_lcair.detection.irradiance import Irradiance
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.detector import Detector
from mi_lcair.results import Result

STEPS = 600  # ranges that are searched, in equal ratios
SLOPE_STEP = 1e-4  # step of range for the slope of the signal, relative to the range


@dataclass(frozen=True, repr=False)
class DetectionRange(Result):
    """Ranges at which a target is detected.

    Attributes
    ----------
    intervals_m : list of (float, float)
        Intervals of range, m, in rising order. The list is empty if the target is never detected.
    standard_error_m : float or None
        Standard error of the largest range, m, from the noise of the render. It is None if the
        target is never detected, or if `at_least` is true.
    at_least : bool
        Whether the atmosphere's table ends where the target is still detected.
    """

    intervals_m: list[tuple[float, float]]
    standard_error_m: float | None
    at_least: bool

    kind: ClassVar[str] = "detection_range"

    @property
    def largest_m(self) -> float | None:
        """Largest range at which the target is detected, m; None if there is none."""
        return self.intervals_m[-1][1] if self.intervals_m else None

    def summary(self) -> str:
        """One line with the intervals and the standard error of the last end."""
        if not self.intervals_m:
            return "detected at no range"
        ranges = ", ".join(f"{start:.5g}-{end:.5g} m" for start, end in self.intervals_m)
        if self.at_least:
            return f"detected at {ranges}; at least: the atmosphere's table ends there"
        return f"detected at {ranges} +- {self.standard_error_m:.2g} m (standard error)"

    def entries(self) -> dict:
        """Entries for JSON."""
        return {"largest_m": self.largest_m, **asdict(self)}

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each interval of range."""
        starts, ends = np.reshape(self.intervals_m, (-1, 2)).astype(float).T
        return {"start_m": starts, "end_m": ends}


def detection_range(
    irradiance: Irradiance, detector: Detector, air: Atmosphere, nearest_m: float
) -> DetectionRange:
    """Ranges at which a target is detected along one line of sight.

    The search ends with the atmosphere's table. In vacuum it has no end. Nothing is rendered again,
    because the intensity in this direction is the same at any range.

    Parameters
    ----------
    irradiance : Irradiance
        Irradiances of the target.
    detector : Detector
        Detector with a nei.
    air : Atmosphere
        Atmosphere along the line of sight.
    nearest_m : float
        Smallest range, m: the radius of the target.

    Returns
    -------
    DetectionRange

    Raises
    ------
    InputError
        If the detector has no nei, or if the atmosphere's table ends before `nearest_m`.
    """
    if detector.nei is None:
        raise InputError(
            "sensor: a detection range needs nei, the noise-equivalent irradiance in W m^-2"
        )
    least = detector.snr * detector.nei

    def signal(range_m) -> tuple[float, float]:
        """Signal at a range, and its standard error."""
        value, error = irradiance.at(air.path(range_m))["total"]
        return detector.signal(value), detector.signal(error)

    if air.is_vacuum:  # the signal falls as 1 / range^2
        value, error = signal(1.0)
        end = float(np.sqrt(abs(value) / least))
        if end <= nearest_m:
            return DetectionRange([], None, False)
        return DetectionRange([(nearest_m, end)], end * error / abs(value) / 2, False)

    last = float(air.ranges_m[-1])
    if last <= nearest_m:
        raise InputError(
            f"atmosphere '{air.name}': its last range, {last:g} m, lies within the target's "
            f"radius of {nearest_m:.4g} m"
        )
    knots = air.ranges_m[air.ranges_m > nearest_m]  # ranges at which the slope jumps
    ranges = np.unique(np.concatenate([np.geomspace(nearest_m, last, STEPS), knots]))
    values = np.array([signal(range_m)[0] for range_m in ranges])
    crossings = []
    # The levels +least and -least are searched one after the other. A signal that changes its sign
    # within a step crosses both levels there.
    for sign in (1, -1):
        above = sign * values >= least
        crossings += [
            brentq(lambda r: sign * signal(r)[0] - least, ranges[k], ranges[k + 1], rtol=1e-10)
            for k in np.flatnonzero(above[1:] != above[:-1])
        ]
    edges = [nearest_m, *sorted(crossings), last]
    # Between two edges the signal is above the level everywhere or nowhere: test the middle.
    intervals = []
    for start, end in zip(edges[:-1], edges[1:]):
        if abs(signal((start + end) / 2)[0]) >= least:
            intervals.append((float(start), float(end)))
    if not intervals or intervals[-1][1] == last:
        return DetectionRange(intervals, None, bool(intervals))
    end = intervals[-1][1]
    # The error of the range is the error of the signal over its slope.
    slope = (signal(end * (1 + SLOPE_STEP))[0] - signal(end * (1 - SLOPE_STEP))[0]) / (
        2 * SLOPE_STEP * end
    )
    return DetectionRange(intervals, signal(end)[1] / abs(slope), False)
