"""Picture of a rendered image."""

from typing import Unpack

import numpy as np

from mi_lcair.errors import check_known
from mi_lcair.rendering.images.render_result import Render
from mi_lcair.reports.pictures import image_channels
from mi_lcair.reports.pictures.image_channels import Scale

DEFAULT = ("Y", "temperature.Y")


def figure(
    render: Render, channels=DEFAULT, *, outlines: np.ndarray | None = None, **scale: Unpack[Scale]
):
    """Figure with one panel for each channel, see `image_channels.figure`.

    channels: names of channels of the image. outlines: number of the facet in each pixel. scale:
    options of the colour scales. Raises InputError if the image has no such channel.
    """
    return image_channels.figure(
        named_channels(render.channels, channels, render.scene_name),
        f"{render.scene_name}, {render.band.label}",
        outlines=outlines,
        window_m=render.window_m,
        **scale,
    )


def named_channels(known: dict, channels, scene_name: str) -> dict:
    """The named channels of `known`; raises InputError for a name that it does not have."""
    names = [channels] if isinstance(channels, str) else list(channels)
    check_known(f"channel of the image of {scene_name}", known, *names)
    return {name: known[name] for name in names}
