"""How far away a target is detected: the ranges at which its signal reaches snr * nei, along one
line of sight.
"""

from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import brentq

from mi_lcair.detection.irradiance import Irradiance
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import Atmosphere
from mi_lcair.physics.detector import Detector

STEPS = 600  # of the search, in equal ratios of range
SLOPE_STEP = 1e-4  # of a range, for the signal's slope there


@dataclass(frozen=True)
class DetectionRange:
    """Where a target is detected.

    intervals_m: (from, to) [m], rising; none: nowhere. standard_error_m: of the largest range, from
    the rendering; None where the atmosphere's table ends before the signal does (at_least).
    """

    intervals_m: list[tuple[float, float]]
    standard_error_m: float | None
    at_least: bool

    @property
    def largest_m(self) -> float | None:
        return self.intervals_m[-1][1] if self.intervals_m else None

    def as_dict(self) -> dict:
        return {"largest_m": self.largest_m, **asdict(self)}


def detection_range(
    irradiance: Irradiance, detector: Detector, air: Atmosphere, nearest_m: float
) -> DetectionRange:
    """From the target's own radius on (nearest_m) to the end of the atmosphere's table; vacuum has
    none.

    Nothing is rendered again: the target sends the same into this direction at any range. Raises
    InputError without a nei.
    """
    if detector.nei is None:
        raise InputError(
            "sensor: a detection range needs nei, the noise-equivalent irradiance in W m^-2"
        )
    least = detector.snr * detector.nei

    def signal(range_m) -> tuple[float, float]:
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
            f"atmosphere '{air.name}': its last range, {last:g} m, lies within the target's radius of {nearest_m:.4g} m"
        )
    knots = air.ranges_m[air.ranges_m > nearest_m]  # the slope jumps there
    ranges = np.unique(np.concatenate([np.geomspace(nearest_m, last, STEPS), knots]))
    values = np.array([signal(range_m)[0] for range_m in ranges])
    crossings = []
    for sign in (
        1,
        -1,
    ):  # apart: a signal that changes its sign within a step crosses both levels there
        above = sign * values >= least
        crossings += [
            brentq(lambda r: sign * signal(r)[0] - least, ranges[k], ranges[k + 1], rtol=1e-10)
            for k in np.flatnonzero(above[1:] != above[:-1])
        ]
    edges = [nearest_m, *sorted(crossings), last]
    intervals = []
    for start, end in zip(edges[:-1], edges[1:]):
        if abs(signal((start + end) / 2)[0]) >= least:
            intervals.append((float(start), float(end)))
    if not intervals or intervals[-1][1] == last:
        return DetectionRange(intervals, None, bool(intervals))
    end = intervals[-1][1]
    slope = (signal(end * (1 + SLOPE_STEP))[0] - signal(end * (1 - SLOPE_STEP))[0]) / (
        2 * SLOPE_STEP * end
    )
    return DetectionRange(intervals, signal(end)[1] / abs(slope), False)
