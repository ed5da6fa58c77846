"""Measured images and masks, checked against a scene."""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, in_band_slope
from mi_lcair.rendering.images.measured import TEMPERATURE, check_kelvin, read_values

NETD_K = 300.0  # temperature of the blackbody at which a NETD is stated, K


def measured_radiance(measurement, band: Band, size: tuple[int, int]) -> tuple:
    """The radiance of each pixel of a measurement, and which pixels count.

    Parameters
    ----------
    measurement : Measurement
    band : Band
        Band of the scene.
    size : tuple of int
        Height and width of the scene's film.

    Returns
    -------
    radiance : ndarray, shape (H, W)
        In-band radiance, W m^-2 sr^-1.
    sigma : ndarray, shape (H, W), or None
        Standard deviation of `sigma_image`, W m^-2 sr^-1.
    counts : ndarray of bool, shape (H, W)
        Pixels that are finite, not masked and not saturated.

    Raises
    ------
    InputError
        For a file that cannot be read, another size, band or unit, and if no pixel counts.
    """
    path, sigma = measurement.image, None
    values, quantity, counts = values_that_count(
        measurement, measurement.channel, measurement.quantity, band, size
    )
    check_counts(path, counts)
    if measurement.sigma_image is not None:
        sigma, _ = read_values(measurement.sigma_image, measurement.channel, quantity, band)
        check_size(measurement.sigma_image, sigma, size)
        if not (sigma[counts] > 0).all():
            raise InputError(
                f"{measurement.sigma_image}: a standard deviation is not positive; mask its pixel"
            )
    if quantity == TEMPERATURE:
        check_kelvin(path, values[counts])
        kelvin = np.where(counts, values, 300.0)
        if sigma is not None:
            sigma = sigma * in_band_slope(band, kelvin)
        values = in_band_radiance(band, kelvin)
    return values, sigma, counts


def values_that_count(measurement, channel, quantity, band: Band, size: tuple[int, int]) -> tuple:
    """Scaled values of a measured image, their quantity, and which are finite, not saturated and
    not masked.

    channel, quantity: those of the file. size: height and width of the film.
    """
    values, quantity = read_values(measurement.image, channel, quantity, band)
    values = values * measurement.scale
    check_size(measurement.image, values, size)
    counts = np.isfinite(values)
    if measurement.saturation is not None:
        counts &= values < measurement.saturation
    if measurement.mask is not None:
        mask, _ = read_values(measurement.mask, None, "mask", band)
        check_size(measurement.mask, mask, size)
        counts &= np.isfinite(mask) & (mask != 0)
    return values, quantity, counts


def check_counts(path, counts: np.ndarray) -> None:
    """Raise InputError if no pixel of an image counts."""
    if not counts.any():
        raise InputError(
            f"{path}: all pixels are masked, saturated or not finite; at least one must count"
        )


def noise_of_netd(band: Band, radiance, netd_mK: float) -> np.ndarray:
    """Standard deviation of the radiance of pixels, for a NETD that is stated at NETD_K.

    A camera's variance is a constant part (electronics, dark current, warm optics) and shot noise,
    which is proportional to the radiance. Their shares are not known. With L0 the radiance of
    NETD_K, the variance max(1, L / L0) is at least as large for any shares, and the same at L0.
    """
    share = np.maximum(np.asarray(radiance) / in_band_radiance(band, NETD_K), 1.0)
    return in_band_slope(band, NETD_K) * netd_mK * 1e-3 * np.sqrt(share)


def check_radiance(path, values: np.ndarray, predicted: np.ndarray, band: Band) -> None:
    """Raise InputError for a measured radiance that is a temperature, or of another unit.

    predicted: radiance of the same pixels by the scene as it was loaded.
    """
    measured, expected = float(np.median(values)), float(np.median(predicted))
    kelvin = float(brightness_temperature(band, expected)) if expected > 0 else np.nan
    if abs(measured - kelvin) < 0.1 * kelvin and measured > 3 * expected:
        raise InputError(
            f"{path}: median radiance {measured:.4g} W m^-2 sr^-1, where the scene has "
            f"{expected:.4g} and an apparent temperature of {kelvin:.4g} K; give quantity = "
            "'apparent_temperature' if these are kelvin"
        )
    if expected > 0 and not 1e-2 < measured / expected < 1e2:
        raise InputError(
            f"{path}: median radiance {measured:.4g}, where the scene has {expected:.4g} "
            "W m^-2 sr^-1; check unit, band and scale"
        )


def check_size(path, values: np.ndarray, size: tuple[int, int]) -> None:
    """Raise InputError for an image that is not of the size (height, width) of the film."""
    if values.shape != tuple(size):
        raise InputError(
            f"{path}: has {values.shape[1]} x {values.shape[0]} pixels, and the scene's film "
            f"{size[1]} x {size[0]}; render the scene at the size of the image"
        )
