"""Picture of two images side by side with one scale, and of their difference."""

from typing import Unpack

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.formats import or_nan
from mi_lcair.show.pictures import image_channels
from mi_lcair.show.pictures.image_channels import DIFFERENCE, Scale, channel_quantity


def figure(
    images: tuple[dict[str, np.ndarray], dict[str, np.ndarray]],
    names: tuple[str, str],
    title: str = "",
    *,
    window_m: tuple[float, float] | None = None,
    **scale: Unpack[Scale],
):
    """Figure with a row for each channel: both images with one scale, and second minus first.

    Parameters
    ----------
    images : tuple of dict of str to ndarray, shape (H, W)
        Channels of both images, with the same names.
    names : tuple of str
        Names of the images in the titles.
    title, window_m, **scale
        As for `image_channels.figure`. Limits are those of the images. A difference has a scale of
        its own, with 0 in its middle, and is linear.

    Raises
    ------
    InputError
        If the images differ in size.
    """
    channels, quantities = {}, {}
    for channel, first in images[0].items():
        second = images[1][channel]
        if first.shape != second.shape:
            sizes = " and ".join(f"{w} x {h}" for h, w in (first.shape, second.shape))
            raise InputError(
                f"{' and '.join(names)}: have {sizes} pixels; compare those of one size"
            )
        change = or_nan(channel, second).astype(float) - or_nan(channel, first)
        known = change[np.isfinite(change)]
        mean, rms = (known.mean(), np.sqrt(np.mean(known**2))) if known.size else (np.nan, np.nan)
        what, unit = channel_quantity(channel)
        for name, values in zip(names, (first, second)):
            channels[f"{channel}: {name}"] = values
            quantities[f"{channel}: {name}"] = what, unit
        label = f"{DIFFERENCE}.{channel}: mean {mean:.3g}, rms {rms:.3g}"
        channels[label], quantities[label] = change, (f"second - first, {what}", unit)
    return image_channels.figure(
        channels, title, quantity=quantities.get, window_m=window_m, columns=3, **scale
    )
