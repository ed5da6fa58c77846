"""Picture of the channels of a radiance image, with colour bars in physical units."""

from math import ceil, sqrt
from pathlib import Path

import numpy as np

from mi_lcair.drawing import new_figure, plain, write_figure
from mi_lcair.errors import InputError

RADIANCE = r"W m$^{-2}$ sr$^{-1}$"
QUANTITIES = {
    "temperature": ("brightness temperature", "K"),
    "range": ("range", "m"),
    "stderr": ("standard error of radiance", RADIANCE),
    "mean_temperature": ("apparent temperature without noise", "K"),
    "stderr_K": ("standard error of the rendering", "K"),
    "noise_K": ("noise of the camera", "K"),
    "electrons": ("electrons", ""),
    "counts": ("counts", ""),
    "sigma": ("standard uncertainty of radiance", RADIANCE),
    "d": ("derivative of radiance", f"{RADIANCE} per unit"),
}
# Units of the columns of a table, by the end of their name.
UNITS = {
    "_W_m2_sr": RADIANCE,
    "_W_sr": r"W sr$^{-1}$",
    "_K": "K",
    "_m2": r"m$^2$",
    "_m": "m",
    "_sr": "sr",
}
LOG_DECADES = 6  # largest extent of a logarithmic scale
LARGEST = 1e37  # largest value that is drawn; differences and ratios of larger ones overflow
SMALLEST = 1e-45  # smaller values are drawn as 0, as in Float32
LEFT, RIGHT, BOTTOM, TOP = 0.75, 1.25, 0.55, 0.4  # margins of an image, inches
BAR = 0.15  # width of the colour bar, and its distance from the image, inches


def channel_quantity(name: str) -> tuple[str, str]:
    """Quantity of a channel of a radiance image, and its unit."""
    return QUANTITIES.get(name.split(".")[0], ("radiance", RADIANCE))


def column_quantity(name: str) -> tuple[str, str]:
    """Quantity of a column of a table, and its unit, which the end of its name states.

    The unit is "" for a number without one.
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
    """Write the picture of `figure` as a .png, .svg or .pdf file."""
    write_figure(figure(channels, title, log, quantity), path)


def figure(
    channels: dict[str, np.ndarray],
    title: str = "",
    log: bool = False,
    quantity=channel_quantity,
):
    """Figure with one panel and one colour bar for each channel.

    Pixels without a value are grey. These are NaN, infinite values, ranges and temperatures of 0,
    and on a logarithmic scale all values that are not positive.

    Parameters
    ----------
    channels : dict of str to ndarray, shape (H, W)
        Channels by name.
    title : str
        Title of the picture.
    log : bool
        Make the scales logarithmic, over LOG_DECADES at most.
    quantity : callable
        Function that gives the quantity and the unit of a channel from its name.

    Raises
    ------
    InputError
        If a value exceeds LARGEST.
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

    figure = new_figure(size)
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
    return figure


def drawable(name: str, values: np.ndarray) -> np.ndarray:
    """The values, with those below SMALLEST set to 0.

    Raises InputError if a value exceeds LARGEST. `name` is that of the channel.
    """
    size = np.abs(np.where(np.isfinite(values), values, 0))
    if size.max(initial=0) > LARGEST:
        raise InputError(f"{name}: holds {size.max():g}; values up to {LARGEST:g} can be drawn")
    return np.where((size > 0) & (size < SMALLEST), 0, values)


def _draw(panel, bar_axes, name: str, values: np.ndarray, log: bool, what: str, unit: str) -> None:
    """Draw a channel in the axes `panel`, and its colour bar in `bar_axes`.

    `what` and `unit` are the quantity of the channel and its unit.
    """
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import MaxNLocator

    kind = name.split(".")[0]
    has_value = np.isfinite(values)
    if kind in ("temperature", "range"):
        has_value &= values != 0
    if log:
        has_value &= values > 0
    lower, upper, clipped = _limits(values[has_value], log)

    panel.set_facecolor("0.6")
    picture = panel.imshow(
        np.ma.array(values, mask=~has_value),
        norm=(LogNorm if log else Normalize)(lower, upper),
        aspect="auto",
        cmap="viridis" if kind in ("range", "stderr") else "inferno",
    )
    panel.set_title(plain(name), fontsize=9)
    panel.set_xlabel(
        "column (pixel)" if has_value.all() else "column (pixel); grey: no value", fontsize=8
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
    """Lower and upper end of the colour scale, and whether smaller values are clipped."""
    if values.size == 0 or not values.any():
        return (0.1 if log else 0.0), 1.0, False
    lower, upper = float(values.min()), float(values.max())
    if lower == upper:
        # A scale needs an extent. It is centred on the only value.
        return lower - 0.05 * abs(lower), lower + 0.05 * abs(lower), False
    if log and lower < upper * 10.0**-LOG_DECADES:
        return upper * 10.0**-LOG_DECADES, upper, True
    return lower, upper, False


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
