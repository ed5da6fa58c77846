"""Line charts of the spectrum of a pixel of a spectral image."""

import numpy as np

from mi_lcair.errors import InputError, option
from mi_lcair.formats.channels import quantity_of, wavelengths_of
from mi_lcair.physics.blackbody import spectral_temperature
from mi_lcair.reports.line_charts import figure_of
from mi_lcair.results.charts import Curve, LineChart, by_wavelength


def figure(channels: dict[str, np.ndarray], pixel: tuple[int, int], title: str):
    """Figure of the spectrum of a pixel (row, column), both from 0, beside that of the image.

    Raises InputError if the channels hold no spectrum, and for a pixel outside the image.
    """
    known = wavelengths_of(channels)
    if not known:
        raise InputError(
            f"the image has no spectral radiance; render it with {option('bins', True)}"
        )
    rows, columns = channels[next(iter(known))].shape
    row, column = pixel
    if not (0 <= row < rows and 0 <= column < columns):
        raise InputError(
            f"pixel {row},{column} is outside the image; rows are 0 to {rows - 1}, and columns "
            f"0 to {columns - 1}"
        )
    return figure_of(charts(channels, pixel), f"{title}, pixel in row {row}, column {column}")


def charts(channels: dict[str, np.ndarray], pixel: tuple[int, int]) -> list[LineChart]:
    """Spectral radiance and brightness temperature of a pixel, and of the mean of the image.

    Error bars are standard errors, where the image has them.
    """
    known = wavelengths_of(channels)
    x = np.array(list(known.values()))
    cube = np.array([channels[name] for name in known], float)
    errors = [
        channels[f"stderr.{name}"][pixel] if f"stderr.{name}" in channels else np.nan
        for name in known
    ]
    of_pixel, mean = cube[:, *pixel], cube.mean(axis=(1, 2))
    quantity, unit = quantity_of(next(iter(known)))
    names = f"row {pixel[0]}, column {pixel[1]}", "mean of the image"
    radiances = (
        Curve(names[0], of_pixel, unit, errors=np.array(errors)),
        Curve(names[1], mean, unit, 0),
    )
    temperatures = [
        Curve(curve.name, spectral_temperature(x, curve.values), "K", curve.colour)
        for curve in radiances
    ]
    return [
        by_wavelength("", x, quantity, unit, list(radiances)),
        by_wavelength("", x, "brightness temperature", "K", temperatures, is_close=True),
    ]
