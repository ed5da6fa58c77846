"""Picture of the derivatives of an image."""

from typing import Unpack

from mi_lcair.reports.pictures import image_channels
from mi_lcair.reports.pictures.image_channels import Scale
from mi_lcair.reports.pictures.render import named_channels
from mi_lcair.sensitivity.derivative_images import DerivativeImages

MOST_PANELS = 9  # the radiance and derivatives that are drawn without a choice


def figure(images: DerivativeImages, channels=None, **scale: Unpack[Scale]):
    """Figure with one panel for each channel, see `image_channels.figure`.

    channels: names of channels; by default the radiance and the first derivatives. scale: options
    of the colour scales.
    """
    known = images.channels
    if channels is None:
        channels = [name for name in known if not name.startswith("stderr.")][:MOST_PANELS]
    drawn = named_channels(known, channels, images.scene_name)
    return image_channels.figure(drawn, f"{images.scene_name}, {images.band}", **scale)
