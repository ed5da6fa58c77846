"""Channels of radiance images: what they hold, in which unit, and where they have no value."""

import re

import numpy as np

from mi_lcair.results.cells import UNITS

RADIANCE = "W m-2 sr-1"
SPECTRAL = "S0"  # beginning of the channels of a spectral image
# Quantity and UDUNITS unit by the beginning of a channel's name. Other channels are radiances.
CHANNELS = {
    SPECTRAL: ("spectral radiance", f"{RADIANCE} um-1"),
    "temperature": ("brightness temperature", "K"),
    "range": ("range", "m"),
    "stderr": ("standard error of radiance", RADIANCE),
    f"stderr.{SPECTRAL}": ("standard error of spectral radiance", f"{RADIANCE} um-1"),
    "stderr.d": ("standard error of derivative", f"{RADIANCE} per unit"),
    "mean_temperature": ("apparent temperature without noise", "K"),
    "stderr_K": ("standard error of the rendering", "K"),
    "noise_K": ("noise of the camera", "K"),
    "speckle": ("whether the rendering's error is above the camera's noise", ""),
    "spp": ("samples of a pixel", ""),
    "electrons": ("electrons", ""),
    "counts": ("counts", ""),
    "sigma_K": ("standard uncertainty of temperature", "K"),
    "sigma": ("standard uncertainty of radiance", RADIANCE),
    "d": ("derivative of radiance", f"{RADIANCE} per unit"),
}
EMPTY_AT_0 = ("temperature", "range")  # channels in which 0 means that nothing was hit
ENDS = {unit: end for end, unit in UNITS.items()}  # ends of columns' names by unit


def spectral_channel(wavelength_um: float) -> str:
    """Channel of a spectral image at a wavelength [um], such as "S0.8075,000000nm".

    The name is that of A. Fichet, R. Pacanowski and A. Wilkie, An OpenEXR layout for spectral
    images, JCGT 10(3), 2021: Stokes component 0, and a comma as the decimal mark.
    """
    return f"{SPECTRAL}.{1000 * wavelength_um:.6f}nm".replace(".", ",").replace(",", ".", 1)


def wavelengths_of(channels) -> dict[str, float]:
    """The channels of a spectral image and their wavelengths [um], by rising wavelength."""
    known = {
        name: float(match[1].replace(",", ".")) / 1000
        for name in channels
        if (match := re.fullmatch(rf"{SPECTRAL}\.([0-9]+,[0-9]+)nm", name))
    }
    return dict(sorted(known.items(), key=lambda item: item[1]))


def quantity_of(channel: str) -> tuple[str, str]:
    """Quantity of a channel of a radiance image in words, and its unit as UDUNITS writes it."""
    first, *rest = channel.split(".")
    radiance = ("radiance", RADIANCE)
    return CHANNELS.get(".".join([first, *rest[:1]]), CHANNELS.get(first, radiance))


def column_of(channel: str) -> str:
    """Name of a channel as a column of a table, which ends in the unit if that has an end."""
    name = channel.removesuffix("Y").removesuffix(".") or "radiance"
    if name.startswith("stderr"):
        name = name.replace("stderr", "standard_error", 1)
    end = ENDS.get(quantity_of(channel)[1], "")
    return name.removesuffix(end) + end


def pixel_axes(shape, window_m=None) -> dict[str, tuple[str, np.ndarray]]:
    """Numbers of pixels, and their centres [m] in a window, by name: each with its dimension.

    row and column begin with 0 at the upper left. x_m and y_m begin in the middle of the window;
    x is to the right and y upward. shape: (H, W).
    """
    axes = {name: (name, np.arange(count)) for name, count in zip(("row", "column"), shape)}
    if window_m is not None:
        down, across = ((np.arange(count) + 0.5) / count for count in shape)
        axes["x_m"] = "column", (across - 0.5) * window_m[0]
        axes["y_m"] = "row", (0.5 - down) * window_m[1]
    return axes


def has_value(channel: str, values: np.ndarray) -> np.ndarray:
    """Which pixels of a channel have a value. NaN and infinite values are none."""
    known = np.isfinite(values)
    return known & (values != 0) if channel.split(".")[0] in EMPTY_AT_0 else known


def or_nan(channel: str, values: np.ndarray) -> np.ndarray:
    """The values of a channel, with NaN where it has no value."""
    return np.where(has_value(channel, values), values, np.nan)
