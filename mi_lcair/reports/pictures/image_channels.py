"""Picture of the channels of a radiance image, with colour bars in physical units."""

from dataclasses import dataclass
from math import ceil, sqrt
from typing import Unpack

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.errors import InputError, unknown
from mi_lcair.formats.channels import has_value
from mi_lcair.formats.channels import quantity_of as quantity_of_channel
from mi_lcair.reports.pictures.colour_scale import (
    DIFFERENCE,
    SIGNED,
    WHOLE,
    Limits,
    limits_of_channel,
)
from mi_lcair.results.cells import heading, typeset_unit
from mi_lcair.results.charts import Scale

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
        limits |= {channel.name: common_limits for channel in group}
    return limits


def check_cmap(name: str | None) -> None:
    """Raise InputError for a colour map that Matplotlib does not have."""
    from matplotlib import colormaps

    if name is not None and name not in colormaps:
        raise unknown("colour map", name, [known for known in colormaps if known[-2:] != "_r"])


def drawable(name: str, values: np.ndarray) -> np.ndarray:
    """The values, with those below SMALLEST set to 0.

    Raises InputError if a value exceeds LARGEST. `name` is that of the channel.
    """
    size = np.abs(np.where(np.isfinite(values), values, 0))
    if size.max(initial=0) > LARGEST:
        raise InputError(f"{name}: holds {size.max():g}; values up to {LARGEST:g} can be drawn")
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
