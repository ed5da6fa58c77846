"""Picture of the channels of a radiance image, with colour bars in physical units."""

from dataclasses import dataclass, replace
from math import ceil, sqrt
from typing import Unpack

import numpy as np

from mi_lcair.charts import Scale
from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.errors import InputError, check_known
from mi_lcair.formats import has_value, quantity_of_channel
from mi_lcair.sections import heading, typeset_unit

# Limits of colour scales: robust against few hot pixels, common to panels, or given
# ----------------------------------------------------------------------------------
# Pictures and pages have the same rule.

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


# Colour maps by the beginning of a channel's name; OTHER_MAP for others
MAPS = {
    **dict.fromkeys(("temperature", "mean_temperature"), "gray"),
    **dict.fromkeys(("range", "stderr"), "viridis"),
    **dict.fromkeys(SIGNED, "RdBu_r"),
}
OTHER_MAP = "inferno"
NOTHING = {"grey": "0.6", "blue": "steelblue"}  # colours of pixels without a value
LARGEST = 1e37  # largest value that is drawn; differences and ratios of larger ones overflow
SMALLEST = 1e-45  # smaller values are drawn as 0, as in Float32
LEFT, RIGHT, BOTTOM, TOP = 0.75, 1.25, 0.55, 0.4  # margins of an image, inches
BAR = 0.15  # width of the colour bar, and its distance from the image, inches


@dataclass(frozen=True)
class Channel:
    """A channel to draw: its name, its pixels (H, W), its quantity and unit, and its scale."""

    name: str
    values: np.ndarray
    quantity: tuple[str, str]
    is_log: bool

    @property
    def has_value(self) -> np.ndarray:
        """Which pixels have a value that can be drawn."""
        known = has_value(self.name, self.values)
        return known & (self.values > 0) if self.is_log else known


def channel_quantity(name: str) -> tuple[str, str]:
    """Quantity of a channel of a radiance image, and its unit as it is printed."""
    quantity, unit = quantity_of_channel(name)
    return quantity, typeset_unit(unit)


def column_quantity(name: str) -> tuple[str, str]:
    """Quantity of a column of a table, and its unit, "" for a number without one."""
    quantity, unit = heading(name)
    return quantity, typeset_unit(unit)


@styled
def figure(
    channels: dict[str, np.ndarray],
    title: str = "",
    *,
    quantity=channel_quantity,
    window_m: tuple[float, float] | None = None,
    outlines: np.ndarray | None = None,
    columns: int | None = None,
    **scale: Unpack[Scale],
):
    """Figure with one panel and one colour bar for each channel.

    Pixels without a value are grey. These are NaN, infinite values, ranges and temperatures of 0,
    and on a logarithmic scale all values that are not positive. Single pixels that stretch a scale
    are cut off (`colour_scale`): the colour bar has an arrow there, and the panel states it.

    Parameters
    ----------
    channels : dict of str to ndarray, shape (H, W)
        Channels by name.
    title : str
        Title of the picture.
    quantity : callable
        Function that gives the quantity and the unit of a channel from its name.
    window_m : tuple of float, optional
        Width and height of the sensor's window [m], for axes in metres from its middle.
    outlines : ndarray of int, shape (H, W), optional
        Number of the facet in each pixel, for lines between the facets.
    columns : int, optional
        Number of panels in a row.
    **scale
        Options of the colour scales, see `Scale`.

    Raises
    ------
    InputError
        If a value exceeds LARGEST, or for a colour map or limits that cannot be used.
    """
    check_cmap(scale.get("cmap"))
    is_log = scale.get("log", False)
    drawn = [
        Channel(name, drawable(name, values), quantity(name), is_log and not is_difference(name))
        for name, values in channels.items()
    ]
    scales = _scales(drawn, scale)
    single = len(channels) == 1
    height, width = next(iter(channels.values())).shape
    sides = np.array([width, height] if window_m is None else window_m, dtype=float)
    image = np.maximum(sides / sides.max(), 1 / 30) * (6 if single else 3.6)
    cell = image + (LEFT + RIGHT, BOTTOM + TOP)
    columns = columns or min(ceil(sqrt(len(channels) * cell[1] / cell[0])), len(channels))
    rows = ceil(len(channels) / columns)
    size = cell * (columns, rows) + (0, 0 if single else TOP)

    figure = new_figure(size)
    for index, channel in enumerate(drawn):
        left, bottom = cell * (index % columns, rows - 1 - index // columns) + (LEFT, BOTTOM)
        panel = figure.add_axes((left / size[0], bottom / size[1], *image / size))
        bar = figure.add_axes(
            ((left + image[0] + BAR) / size[0], bottom / size[1], BAR / size[0], image[1] / size[1])
        )
        _draw(panel, bar, channel, scales[channel.name], scale.get("cmap"), window_m)
        if outlines is not None:
            _draw_outlines(panel, outlines, window_m)
    if single:
        panel.set_title(plain(", ".join(filter(None, (title, channel.name)))), fontsize=11)
    else:
        figure.text(
            0.5, 1 - 0.5 * TOP / size[1], plain(title), fontsize=11, ha="center", va="center"
        )
    return figure


def is_difference(name: str) -> bool:
    """Whether a channel is a difference of two images, on which given scales have no effect."""
    return name.split(".")[0] == DIFFERENCE


def _scales(channels: list[Channel], scale: Scale) -> dict[str, Limits]:
    """The limits of each channel by name; channels of one quantity may have the same."""
    common, part, names = scale.get("common_scale", True), scale.get("part", WHOLE), {}
    for channel in channels:
        key = channel.quantity if common else channel.name
        names.setdefault(key, []).append(channel)
    limits = {}
    for group in names.values():
        values = [channel.values[part][channel.has_value[part]] for channel in group]
        name, is_log = group[0].name, group[0].is_log
        given = () if is_difference(name) else (scale.get("vmin"), scale.get("vmax"))
        common_limits = limits_of_channel(name, values, is_log, *given)
        for channel, own in zip(group, values):
            ends = {"least": own.min(), "greatest": own.max()} if own.size else {}
            limits[channel.name] = replace(common_limits, **ends)
    return limits


def check_cmap(name: str | None) -> None:
    """Raise InputError for a colour map that Matplotlib does not have."""
    from matplotlib import colormaps

    check_known("colour map", colormaps, name)


def drawable(name: str, values: np.ndarray) -> np.ndarray:
    """The values, with those below SMALLEST set to 0.

    Raises InputError if a value exceeds LARGEST. `name` is that of the channel.
    """
    size = np.abs(np.where(np.isfinite(values), values, 0))
    if size.max(initial=0) > LARGEST:
        raise InputError(f"{name}: has {size.max():g}; values up to {LARGEST:g} can be drawn")
    return np.where((size > 0) & (size < SMALLEST), 0, values)


def _draw(panel, bar_axes, channel: Channel, limits: Limits, cmap, window_m) -> None:
    """Draw a channel in the axes `panel`, and its colour bar in `bar_axes`.

    limits: of the scale. cmap, window_m: as for `figure`.
    """
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import MaxNLocator

    what, unit = channel.quantity
    values, with_value = channel.values, channel.has_value
    height, width = values.shape
    picture = panel.imshow(
        np.ma.array(values, mask=~with_value),
        norm=(LogNorm if channel.is_log else Normalize)(limits.lower, limits.upper),
        aspect="auto",
        cmap=_map_of(channel, limits, cmap),
        extent=_extent(width, height, window_m),
        interpolation="nearest",
    )
    panel.set_title(plain(channel.name), fontsize=9)
    # Grey cannot mean "no value" where it is a colour of the scale
    away = np.abs(picture.cmap(np.linspace(0, 1, 256))[:, :3] - float(NOTHING["grey"])).max(axis=1)
    nothing = "blue" if away.min() < 0.1 else "grey"
    panel.set_facecolor(NOTHING[nothing])
    remarks = [] if with_value.all() else [f"{nothing}: no value"]
    remarks += filter(None, [limits.remark])
    across, along = ("column (pixel)", "row (pixel)") if window_m is None else ("x (m)", "y (m)")
    panel.set(xlabel="; ".join([across, *remarks]), ylabel=along)
    for axis, length in ((panel.xaxis, width), (panel.yaxis, height)):
        share = length / max(height, width)
        if window_m is not None:
            share = window_m[axis is panel.yaxis] / max(window_m)
        axis.set_major_locator(
            MaxNLocator(
                ceil(5 * share), steps=[1, 2, 5, 10], integer=window_m is None, min_n_ticks=1
            )
        )

    bar = panel.figure.colorbar(picture, cax=bar_axes, extend=limits.extend)
    bar.set_label(f"{plain(what)} ({unit})" if unit else plain(what))
    if channel.is_log:
        log_ticks(bar, limits.lower, limits.upper)
    else:
        bar.formatter.set_useOffset(False)
    bar_axes.yaxis.get_offset_text().set_fontsize(8)


def _map_of(channel: Channel, limits: Limits, given: str | None) -> str:
    """The colour map of a channel with these limits: `given`, or that of its quantity."""
    kind = channel.name.split(".")[0]
    if given and not is_difference(channel.name):
        return given
    if kind in SIGNED and limits.lower != -limits.upper:  # 0 is not in the middle
        return OTHER_MAP
    return MAPS.get(kind, OTHER_MAP)


def _extent(width: int, height: int, window_m) -> tuple[float, float, float, float]:
    """Left, right, lower and upper end of an image in its axes."""
    if window_m is None:
        return -0.5, width - 0.5, height - 0.5, -0.5
    return -window_m[0] / 2, window_m[0] / 2, -window_m[1] / 2, window_m[1] / 2


def _draw_outlines(panel, facets: np.ndarray, window_m) -> None:
    """Draw lines between pixels that show different facets (H, W)."""
    from matplotlib.collections import LineCollection

    height, width = facets.shape
    row, column = np.nonzero(facets[:, 1:] != facets[:, :-1])
    upright = np.stack([column + 1, row, column + 1, row + 1], axis=-1)
    row, column = np.nonzero(facets[1:] != facets[:-1])
    level = np.stack([column, row + 1, column + 1, row + 1], axis=-1)
    ends = np.concatenate([upright, level]).reshape(-1, 2, 2).astype(float)
    left, right, lower, upper = _extent(width, height, window_m)
    ends = (left, upper) + ends / (width, height) * (right - left, lower - upper)
    panel.add_collection(
        LineCollection(ends, colors="white", linewidths=0.4, alpha=0.7, rasterized=True),
        autolim=False,
    )


def log_ticks(bar, lower: float, upper: float) -> None:
    """Set the ticks of a logarithmic colour bar, in plain numbers.

    They are decades for more than 3 decades, 1-2-5 for more than 0.7, and otherwise even steps.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    decades = np.log10(upper / lower)
    bar.locator = (
        LogLocator()
        if decades > 3
        else LogLocator(subs=(1, 2, 5))
        if decades > 0.7
        else MaxNLocator(6)
    )
    bar.minorlocator = NullLocator()
    bar.formatter = "{x:g}"
    bar.update_ticks()
