"""Panel of images: the channels of a radiance image, with a read-out of every channel."""

import numpy as np

from mi_lcair.formats.channels import or_nan
from mi_lcair.reports.page.panel import Panel
from mi_lcair.reports.pictures.colour_scale import WHOLE, around_target, limits_of_channel
from mi_lcair.reports.pictures.image_channels import channel_quantity

SEEN = "seen."


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
                    **scales(name, pixels[part]),
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


def with_gaps(name: str, pixels: np.ndarray) -> np.ndarray:
    """The pixels of a channel, as the page holds them, with NaN for those without a value."""
    return or_nan(name, pixels.astype("<f4").astype(float))


def scales(name: str, values: np.ndarray, weights=None) -> dict[str, tuple[float, float]]:
    """Ends of the linear and the logarithmic scale of a channel or column, as in pictures.

    weights: of each value, such as the areas of facets; equal ones by default.
    """
    is_known = np.isfinite(values)

    def ends(is_drawn, log: bool):
        of_drawn = None if weights is None else weights[is_drawn]
        limits = limits_of_channel(name, [values[is_drawn]], log, weights=of_drawn)
        return limits.lower, limits.upper

    return {"limits": ends(is_known, False), "log_limits": ends(is_known & (values > 0), True)}


def extent(values: np.ndarray) -> tuple[float | None, float | None]:
    """Smallest and largest value; None without any."""
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else (None, None)
