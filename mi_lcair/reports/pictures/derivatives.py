"""Picture of the derivatives of an image."""

from mi_lcair.reports.pictures import image_channels
from mi_lcair.reports.pictures.render import chosen
from mi_lcair.sensitivity.derivative_images import DerivativeImages

MOST_PANELS = 9  # the radiance and derivatives that are drawn without a choice


def figure(
    images: DerivativeImages,
    channels=None,
    log: bool = False,
    *,
    vmin: float | None = None,
    vmax: float | None = None,
    cmap: str | None = None,
    common_scale: bool = True,
):
    """Figure with one panel for each channel, see `image_channels.figure`.

    channels: names of channels; by default the radiance and the first derivatives. The other
    options are those of `image_channels.figure`.
    """
    known = images.channels
    if channels is None:
        channels = [name for name in known if not name.startswith("stderr.")][:MOST_PANELS]
    return image_channels.figure(
        chosen(known, channels, images.scene_name),
        f"{images.scene_name}, {images.band}",
        log,
        vmin=vmin,
        vmax=vmax,
        cmap=cmap,
        common_scale=common_scale,
    )
