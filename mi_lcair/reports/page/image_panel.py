"""Panel of images: the channels of a radiance image, with a read-out of every channel."""

import numpy as np

from mi_lcair.formats.channels import or_nan
from mi_lcair.reports.page.arrays import rounded
from mi_lcair.reports.page.panel import Panel
from mi_lcair.reports.pictures.colour_scale import LOG_DECADES
from mi_lcair.reports.pictures.image_channels import channel_quantity

LOW, HIGH = 0.005, 0.995  # quantiles of the pixels that are the default limits of a scale
SEEN = "seen."
WHOLE = slice(None), slice(None)  # all rows and columns


def image_panel(channels: dict[str, np.ndarray], shown=(), orthographic_m=None) -> Panel:
    """The panel of an image.

    Parameters
    ----------
    channels : dict of str to ndarray, shape (H, W)
        Channels by name. NaN, infinite values and, in temperatures and ranges, 0 are no values.
    shown : sequence of str
        Names of the channels that are shown first (the first two).
    orthographic_m : tuple of float, optional
        Width and height of the window that an orthographic sensor sees, m.
    """
    values = {name: with_gaps(name, pixels) for name, pixels in channels.items()}
    part = around_target(channels)
    height, width = next(iter(values.values())).shape
    names = list(values)
    first = [name for name in shown if name in values] or names[:2]
    groups = {
        name.removeprefix(SEEN).removesuffix(".Y"): names.index(name)
        for name in names
        if name.startswith(SEEN)
    }
    return Panel(
        "image",
        {
            "width": width,
            "height": height,
            "size_m": orthographic_m,
            "channels": [
                {
                    "name": name,
                    "quantity": channel_quantity(name)[0],
                    "unit": channel_quantity(name)[1],
                    "values": pixels.ravel(),
                    "limits": limits(pixels[part]),
                    "log_limits": limits(pixels[part], log=True),
                    "extent": extent(pixels),
                }
                for name, pixels in values.items()
            ],
            "part": part != WHOLE,
            "shown": [names.index(name) for name in first],
            "seen": {"names": list(groups), "channels": list(groups.values())},
        },
        height=620,
    )


def around_target(channels: dict) -> tuple[slice, slice]:
    """Rows and columns of the part of a camera's frame that was rendered, around the target.

    A small target would lie beyond the quantiles of the whole frame. For other images it is WHOLE.
    """
    error = channels.get("stderr_K.Y")
    if error is None or not (np.asarray(error) > 0).any():
        return WHOLE
    rows, columns = np.nonzero(np.asarray(error) > 0)
    return slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)


def with_gaps(name: str, pixels: np.ndarray) -> np.ndarray:
    """The pixels of a channel with NaN for those without a value."""
    # As the page holds them, so that limits and pixels are rounded alike
    pixels = rounded(np.asarray(pixels)).reshape(pixels.shape).astype(np.float64)
    return or_nan(name, pixels)


def limits(values: np.ndarray, log: bool = False, weights=None) -> tuple[float, float]:
    """Robust limits of a scale: the LOW and HIGH quantiles of the values.

    A few very bright pixels then do not make all others dark. A logarithmic scale has at most
    LOG_DECADES. weights: of each value, such as the areas of facets; equal ones by default.
    """
    values = np.ravel(values)
    is_drawn = np.isfinite(values) & ((values > 0) | (not log))
    values = values[is_drawn]
    if not values.size:
        return (0.1, 1.0) if log else (0.0, 1.0)
    if weights is None:
        low, high = map(float, np.quantile(values, (LOW, HIGH)))
    else:
        low, high = weighted_quantiles(values, np.ravel(weights)[is_drawn])
    if low == high:
        low, high = float(values.min()), float(values.max())
    if low == high:  # a scale needs an extent; it is centred on the only value
        low, high = low - 0.05 * abs(low), high + 0.05 * abs(high) or 1.0
    return (max(low, high * 10.0**-LOG_DECADES), high) if log else (low, high)


def weighted_quantiles(values: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """The LOW and HIGH quantiles of the values, each as often as its weight says."""
    order = np.argsort(values)
    shares = np.cumsum(np.nan_to_num(weights[order]))
    places = np.searchsorted(shares, np.array([LOW, HIGH]) * shares[-1])
    low, high = values[order][np.minimum(places, len(values) - 1)]
    return float(low), float(high)


def extent(values: np.ndarray) -> tuple[float | None, float | None]:
    """Smallest and largest value; None without any."""
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else (None, None)
