"""Channels of a radiance image as a PNG: one panel each, with a colour bar in physical units."""

from math import ceil, sqrt
from pathlib import Path

import numpy as np

from mi_lcair.drawing import drawing, plain
from mi_lcair.errors import InputError

RADIANCE = r"W m$^{-2}$ sr$^{-1}$"
QUANTITIES = {
    "temperature": ("brightness temperature", "K"),
    "range": ("range", "m"),
    "stderr": ("standard error of radiance", RADIANCE),
}
UNITS = {
    "_W_m2_sr": RADIANCE,
    "_W_sr": r"W sr$^{-1}$",
    "_K": "K",
    "_m2": r"m$^2$",
    "_m": "m",
    "_sr": "sr",
}  # of columns
LOG_DECADES = 6
LARGEST = 1e37  # of a value that is drawn; differences and ratios of larger ones overflow
SMALLEST = 1e-45  # smaller values, which Float32 does not know, are 0
LEFT, RIGHT, BOTTOM, TOP, BAR = (
    0.75,
    1.25,
    0.55,
    0.4,
    0.15,
)  # inches around an image: axes, colour bar, titles


def channel_quantity(name: str) -> tuple[str, str]:
    """What a channel of a radiance image holds, and its unit."""
    return QUANTITIES.get(name.split(".")[0], ("radiance", RADIANCE))


def column_quantity(name: str) -> tuple[str, str]:
    """What a column of a table holds, and its unit, which ends its name; "" for a number without
    one.
    """
    suffix = next((suffix for suffix in UNITS if name.endswith(suffix)), "")
    return name.removesuffix(suffix).replace("_", " "), UNITS.get(suffix, "")


def save_picture(
    path: str | Path,
    channels: dict[str, np.ndarray],
    title: str = "",
    log: bool = False,
    quantity=channel_quantity,
) -> None:
    """Write a PNG with one panel for each of `channels` (name -> [H, W]), under a common `title`.

    Every panel has its own colour bar, whose label and unit `quantity` tells from the channel's
    name, and pixel axes; `log` makes the colours logarithmic, over six decades at most. Pixels
    without a value are grey: NaN, infinite, a range or a temperature of 0, and with `log` whatever
    is not positive. Raises InputError where the file cannot be written, and for a value beyond
    LARGEST.
    """
    channels = {name: drawable(name, values) for name, values in channels.items()}
    single = len(channels) == 1
    height, width = next(iter(channels.values())).shape
    image = np.maximum(np.array([width, height]) / max(width, height), 1 / 30) * (
        6 if single else 3.6
    )
    cell = image + (LEFT + RIGHT, BOTTOM + TOP)
    columns = min(ceil(sqrt(len(channels) * cell[1] / cell[0])), len(channels))
    rows = ceil(len(channels) / columns)
    size = cell * (columns, rows) + (0, 0 if single else TOP)

    with drawing(path, size) as figure:
        for index, (name, values) in enumerate(channels.items()):
            left, bottom = cell * (index % columns, rows - 1 - index // columns) + (LEFT, BOTTOM)
            panel = figure.add_axes((left / size[0], bottom / size[1], *image / size))
            bar = figure.add_axes(
                (
                    (left + image[0] + BAR) / size[0],
                    bottom / size[1],
                    BAR / size[0],
                    image[1] / size[1],
                )
            )
            _draw(panel, bar, name, values, log, *quantity(name))
        if single:
            panel.set_title(plain(", ".join(filter(None, (title, name)))), fontsize=11)
        else:
            figure.text(
                0.5,
                1 - 0.5 * TOP / size[1],
                plain(title),
                fontsize=11,
                ha="center",
                va="center",
            )


def drawable(name: str, values: np.ndarray) -> np.ndarray:
    """The values with those below SMALLEST set to 0; InputError for one beyond LARGEST."""
    size = np.abs(np.where(np.isfinite(values), values, 0))
    if size.max(initial=0) > LARGEST:
        raise InputError(f"{name}: holds {size.max():g}; values up to {LARGEST:g} can be drawn")
    return np.where((size > 0) & (size < SMALLEST), 0, values)


def _draw(panel, bar_axes, name: str, values: np.ndarray, log: bool, what: str, unit: str) -> None:
    """The channel's pixels in `panel`, with axes in pixels, and its colour bar, with its unit, in
    `bar_axes`.
    """
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import MaxNLocator

    kind = name.split(".")[0]
    shown = np.isfinite(values)
    if kind in ("temperature", "range"):
        shown &= values != 0
    if log:
        shown &= values > 0
    lower, upper, clipped = _limits(values[shown], log)

    panel.set_facecolor("0.6")
    picture = panel.imshow(
        np.ma.array(values, mask=~shown),
        norm=(LogNorm if log else Normalize)(lower, upper),
        aspect="auto",
        cmap="viridis" if kind in ("range", "stderr") else "inferno",
    )
    panel.set_title(plain(name), fontsize=9)
    panel.set_xlabel(
        "column (pixel)" if shown.all() else "column (pixel); grey: no value", fontsize=8
    )
    panel.set_ylabel("row (pixel)", fontsize=8)
    height, width = values.shape
    for axis, length in ((panel.xaxis, width), (panel.yaxis, height)):
        axis.set_major_locator(
            MaxNLocator(
                ceil(5 * length / max(height, width)),
                steps=[1, 2, 5, 10],
                integer=True,
                min_n_ticks=1,
            )
        )

    bar = panel.figure.colorbar(picture, cax=bar_axes, extend="min" if clipped else "neither")
    bar.set_label(f"{plain(what)} ({unit})" if unit else plain(what), fontsize=8)
    if log:
        log_ticks(bar, lower, upper)
    else:
        bar.formatter.set_useOffset(False)
    for axes in (panel, bar_axes):
        axes.tick_params(labelsize=8)
    bar_axes.yaxis.get_offset_text().set_fontsize(8)


def _limits(values: np.ndarray, log: bool) -> tuple[float, float, bool]:
    """Lower and upper end of the colour scale, and whether it clips smaller values."""
    if values.size == 0 or not values.any():
        return (0.1 if log else 0.0), 1.0, False
    lower, upper = float(values.min()), float(values.max())
    if lower == upper:
        # A scale needs an extent: centre it on the one value that there is.
        return lower - 0.05 * abs(lower), lower + 0.05 * abs(lower), False
    if log and lower < upper * 10.0**-LOG_DECADES:
        return upper * 10.0**-LOG_DECADES, upper, True
    return lower, upper, False


def log_ticks(bar, lower: float, upper: float) -> None:
    """Ticks of a logarithmic colour bar in plain numbers: decades, then 1-2-5, then even steps as
    the range shrinks.
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
