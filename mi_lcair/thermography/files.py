"""Files of a temperature: the image in kelvin."""

import numpy as np

from mi_lcair.files import replacing
from mi_lcair.formats import tiff
from mi_lcair.rendering.images.exr import write_exr as write_channels
from mi_lcair.thermography.temperature_result import Temperature


def write_tif(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as a TIFF of 32-bit floats, NaN for nothing."""
    text = f"object temperature (K) of {temperature.name}"
    tiff.write(path, np.atleast_2d(temperature.kelvin), text)


def write_exr(path, temperature: Temperature) -> None:
    """Write the temperatures and their standard uncertainties [K] as an EXR, 0 for nothing."""
    images = {"temperature.Y": temperature.kelvin, "sigma_K.Y": temperature.sigma}
    channels = {name: np.nan_to_num(np.atleast_2d(values)) for name, values in images.items()}
    write_channels(path, channels, {"band": temperature.band.name, "scene": temperature.name})


def write_csv(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as text, a row of pixels a line, nan for nothing."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        for row in np.atleast_2d(temperature.kelvin):
            file.write(",".join(f"{value:.9g}" for value in row) + "\n")
