"""Detection range: the ranges at which the signal of a target reaches snr * nei."""

from dataclasses import dataclass

import numpy as np
import scipy

from mi_lcair.detection.irradiance import Irradiance, LineOfSources
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.imager import Detector
from mi_lcair.results import Result
from mi_lcair.signatures.view_areas import ViewAreas

STEPS = 80  # ranges that are searched, in equal ratios
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

    kind = "detection_range"
    computed = {"largest_m": "largest_m"}

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
        value, error = irradiance.at(air.path(range_m))["total"].pair
        return detector.signal(value), detector.signal(error)

    if air.is_vacuum:  # the signal falls as 1 / range^2
        value, error = signal(1.0)
        end = float(np.sqrt(abs(value) / least))
        if end <= nearest_m:
            return DetectionRange([], None, False)
        return DetectionRange([(nearest_m, end)], end * error / abs(value) / 2, False)

    ranges = searched_ranges(air, nearest_m)
    last = float(ranges[-1])
    values = np.array([signal(range_m)[0] for range_m in ranges])
    crossings = []
    # The levels +least and -least are searched one after the other. A signal that changes its sign
    # within a step crosses both levels there.
    for sign in (1, -1):
        above = sign * values >= least
        crossings += [
            scipy.optimize.brentq(
                lambda r: sign * signal(r)[0] - least, ranges[k], ranges[k + 1], rtol=1e-10
            )
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


def searched_ranges(air: Atmosphere, nearest_m: float) -> np.ndarray:
    """Rising ranges, m, from `nearest_m` to the end of an atmosphere's table.

    Raises InputError if the table ends before `nearest_m`.
    """
    last = float(air.ranges_m[-1])
    if last <= nearest_m:
        raise InputError(
            f"atmosphere '{air.name}': its last range, {last:g} m, lies within the target's "
            f"radius of {nearest_m:.4g} m"
        )
    knots = air.ranges_m[air.ranges_m > nearest_m]  # ranges at which the slope jumps
    return np.unique(np.concatenate([np.geomspace(nearest_m, last, STEPS), knots]))


def largest_ranges(
    line: LineOfSources, areas: ViewAreas, detector: Detector, air: Atmosphere, nearest_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Largest detection range of many views along lines of sight of one elevation.

    As `detection_range`, but between the searched ranges the irradiance for each amount, times the
    square of the range, is interpolated over the logarithm of range.

    Parameters
    ----------
    line : LineOfSources
    areas : ViewAreas
        Effective areas of the V views.
    detector, air, nearest_m
        As for `detection_range`.

    Returns
    -------
    largest_m, standard_error_m : ndarray, shape (V,)
        Ranges, m: 0 for a target that is never detected. The standard error is NaN for such a
        target, and for one that is still detected where the atmosphere's table ends.
    """
    least = detector.snr * detector.nei / detector.optics_transmittance
    if air.is_vacuum:
        per_amount = line.per_amount(air.path(1.0))
        value, error = areas.estimates(per_amount[4], per_amount[1], 0.0).pair
        ends = np.sqrt(np.abs(value) / least)
        seen = ends > nearest_m
        error = np.divide(
            ends * error, 2 * np.abs(value), out=np.full_like(ends, np.nan), where=seen
        )
        return np.where(seen, ends, 0.0), error
    ranges = searched_ranges(air, nearest_m)
    table = np.array([line.per_amount(air.path(r))[[4, 1]] * r**2 for r in ranges])
    between = scipy.interpolate.PchipInterpolator(np.log(ranges), table)
    values = table[:, 0] @ areas.amounts.T / ranges[:, None] ** 2
    above = np.abs(values) >= least
    last = len(ranges) - 1 - np.argmax(above[::-1], axis=0)
    largest, errors = np.zeros(len(last)), np.full(len(last), np.nan)
    for view in np.flatnonzero(above.any(axis=0)):
        k, amounts = last[view], areas.amounts[view]
        if k == len(ranges) - 1:
            largest[view] = ranges[-1]
            continue

        def beyond(range_m, sign=np.sign(values[k, view]), amounts=amounts) -> float:
            return sign * (between(np.log(range_m))[0] @ amounts) / range_m**2 - least

        end = scipy.optimize.brentq(beyond, ranges[k], ranges[k + 1], rtol=1e-10)
        step = SLOPE_STEP * end
        slope = (beyond(end + step) - beyond(end - step)) / (2 * step)
        total, of_target = between(np.log(end)) / end**2
        error = areas.of_views([view]).estimates(total, of_target, 0.0).standard_error[0]
        largest[view], errors[view] = end, error / abs(slope)
    return largest, errors
