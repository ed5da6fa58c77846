"""Picture of a rendered image."""

import numpy as np

from mi_lcair.errors import unknown
from mi_lcair.rendering.images.render_result import Render
from mi_lcair.reports.pictures import image_channels

DEFAULT = ("Y", "temperature.Y")


def figure(
    render: Render,
    channels=DEFAULT,
    log: bool = False,
    *,
    vmin: float | None = None,
    vmax: float | None = None,
    cmap: str | None = None,
    common_scale: bool = True,
    outlines: np.ndarray | None = None,
):
    """Figure with one panel for each channel, see `image_channels.figure`.

    Parameters
    ----------
    render : Render
    channels : sequence of str
        Names of channels of the image.
    log : bool
        Make the scales logarithmic.
    vmin, vmax, cmap, common_scale, outlines
        As in `image_channels.figure`.

    Raises
    ------
    InputError
        If the image has no such channel.
    """
    return image_channels.figure(
        chosen(render.channels, channels, render.scene_name),
        f"{render.scene_name}, {render.band.label}",
        log,
        vmin=vmin,
        vmax=vmax,
        cmap=cmap,
        common_scale=common_scale,
        outlines=outlines,
        window_m=render.window_m,
    )


def chosen(known: dict, channels, scene_name: str) -> dict:
    """The named channels of `known`; raises InputError for a name that it does not have."""
    names = [channels] if isinstance(channels, str) else list(channels)
    for name in names:
        if name not in known:
            raise unknown(f"channel of the image of {scene_name}", name, known)
    return {name: known[name] for name in names}
