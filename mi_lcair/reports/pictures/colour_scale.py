"""Limits of colour scales: robust against few hot pixels, common to panels, or given.

Pictures and pages have the same rule.
"""

from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.errors import InputError

LOG_DECADES = 6  # largest extent of a logarithmic scale
# The values beyond a percentile are cut off if they stretch the scale: to more than STRETCH times
# that of the values between. Few pixels have no such percentiles.
PERCENTILES, STRETCH, FEW = (0.5, 99.5), 3.0, 200
# Temperatures of pixels on an edge, which see the object in a part of their area only, are low. At
# 64 pixels across an object they are about 4 % of its pixels.
OF_TEMPERATURE = (5.0, 99.5)
# Share of the largest error of the rendering below which the optics have blurred it from elsewhere
BLURRED = 1e-3
WHOLE = slice(None), slice(None)  # all rows and columns of an image
DIFFERENCE = "difference"  # beginning of the names of differences of two images
SIGNED = ("d", DIFFERENCE)  # that of channels whose scale has 0 in its middle: derivatives too


@dataclass(frozen=True)
class Limits:
    """Ends of a colour scale, and the least and the greatest value of the pixels."""

    lower: float
    upper: float
    least: float
    greatest: float

    @property
    def extend(self) -> str:
        """Matplotlib's name of the ends of the colour bar that get an arrow."""
        below, above = self.least < self.lower, self.greatest > self.upper
        return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]

    @property
    def remark(self) -> str:
        """What the scale leaves out, in words; "" if it leaves out nothing."""
        parts = []
        if self.least < self.lower:
            parts.append(f"scale from {self.lower:.4g}, values from {self.least:.4g}")
        if self.greatest > self.upper:
            parts.append(f"scale to {self.upper:.4g}, values to {self.greatest:.4g}")
        return "; ".join(parts)


def around_target(channels: dict) -> tuple[slice, slice]:
    """Rows and columns of the part of a camera's frame in which the target is rendered.

    A small target would lie beyond the quantiles of the whole frame. For other images it is WHOLE.
    """
    error = np.asarray(channels.get("stderr_K.Y", 0.0))
    if not (error > 0).any():
        return WHOLE
    rows, columns = np.nonzero(error > BLURRED * error.max())
    return slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)


def draw_pixels(axes, values: np.ndarray, scale: Limits, **options):
    """Draw pixels with a scale in Matplotlib's axes; options are those of imshow."""
    ends = {"vmin": scale.lower, "vmax": scale.upper}
    return axes.imshow(values, **ends, interpolation="nearest", **options)


def limits_of_channel(
    name: str,
    panels: list[np.ndarray],
    log: bool,
    vmin: float | None = None,
    vmax: float | None = None,
    weights: np.ndarray | None = None,
) -> Limits:
    """As `limits_of`, as the quantity of a channel or column `name` needs it."""
    kind = name.split(".")[0]
    percentiles = OF_TEMPERATURE if kind == "temperature" else PERCENTILES
    limits = limits_of(panels, log, vmin, vmax, percentiles, weights)
    if kind in SIGNED and vmin is None and vmax is None and limits.lower < 0 < limits.upper:
        end = max(-limits.lower, limits.upper)
        return replace(limits, lower=-end, upper=end)
    return limits


def limits_of(
    panels: list[np.ndarray],
    log: bool,
    vmin: float | None = None,
    vmax: float | None = None,
    percentiles: tuple[float, float] = PERCENTILES,
    weights: np.ndarray | None = None,
) -> Limits:
    """The limits of one scale for the values of one or more panels.

    Parameters
    ----------
    panels : list of ndarray
        Values that are drawn, without missing ones; on a logarithmic scale all are positive.
    log : bool
        Whether the scale is logarithmic. It then extends over LOG_DECADES at most.
    vmin, vmax : float, optional
        Ends that are given.
    percentiles : tuple of float
        Percentiles between which values do not count as few that stretch the scale.
    weights : ndarray, optional
        Weight of each value of every panel in the percentiles, such as the areas of facets.

    Raises
    ------
    InputError
        If the ends that are given are no scale.
    """
    if log and vmin is not None and vmin <= 0:
        raise InputError(f"vmin = {vmin:g} must be above 0 on a logarithmic scale")
    ends = [
        _ends(values, log, percentiles, weights)
        for values in panels
        if values.size and values.any()
    ]
    values = [v for v in panels if v.size]
    least = float(min((v.min() for v in values), default=0.0))
    greatest = float(max((v.max() for v in values), default=0.0))
    lower = min((end[0] for end in ends), default=0.1 if log else 0.0)
    upper = max((end[1] for end in ends), default=1.0)
    if ends and lower == upper:
        # A scale needs an extent. It is centred on the only value.
        lower, upper = lower - 0.05 * abs(lower), lower + 0.05 * abs(lower)
    lower = lower if vmin is None else vmin
    upper = upper if vmax is None else vmax
    if log and vmin is None and lower < upper * 10.0**-LOG_DECADES:
        lower = upper * 10.0**-LOG_DECADES
    if not (np.isfinite([lower, upper]).all() and lower < upper):
        given = f"vmin = {vmin}" if vmax is None else f"vmax = {vmax}"
        if vmin is not None and vmax is not None:
            given = f"vmin = {vmin:g} and vmax = {vmax:g}"
        raise InputError(
            f"{given}: the scale must rise from vmin to vmax, and would go from {lower:.6g} to "
            f"{upper:.6g}"
        )
    return Limits(lower, upper, least, greatest)


def _ends(values: np.ndarray, log: bool, percentiles, weights) -> tuple[float, float]:
    """Lower and upper end for one panel, without few values that stretch the scale."""
    least, greatest = float(values.min()), float(values.max())
    if weights is None and values.size < FEW:
        return least, greatest
    weighted = (
        {} if weights is None else {"weights": np.nan_to_num(weights), "method": "inverted_cdf"}
    )
    lower, upper = map(float, np.percentile(values, percentiles, **weighted))
    place = np.log if log else (lambda value: value)
    extent = place(upper) - place(lower)
    if not extent > 0:
        return least, greatest
    limit = (STRETCH - 1) * extent
    return (
        lower if place(lower) - place(least) > limit else least,
        upper if place(greatest) - place(upper) > limit else greatest,
    )
