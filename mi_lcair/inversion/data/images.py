"""Measured images and masks from EXR, TIFF, PNG, CSV and NPY files, checked against a scene."""

import io
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.files import read_bytes, read_text
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.rendering.images.exr import read_exr
from mi_lcair.table import SEPARATORS

PICTURES = (".tif", ".tiff", ".png")
SUFFIXES = (".exr", *PICTURES, ".csv", ".npy")
COLDEST, HOTTEST = 30.0, 6000.0  # limits of an apparent temperature, K
NETD_K = 300.0  # temperature of the blackbody at which a NETD is stated, K
TEMPERATURE = "apparent_temperature"


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
    path = measurement.image
    values, quantity = read_values(path, measurement.channel, measurement.quantity, band)
    values = values * measurement.scale
    check_size(path, values, size)
    counts = np.isfinite(values)
    if measurement.saturation is not None:
        counts &= values < measurement.saturation
    if measurement.mask is not None:
        mask, _ = read_values(measurement.mask, None, "mask", band)
        check_size(measurement.mask, mask, size)
        counts &= np.isfinite(mask) & (mask != 0)
    if not counts.any():
        raise InputError(
            f"{path}: all pixels are masked, saturated or not finite; at least one must count"
        )
    sigma = None
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
            sigma = sigma * slope(band, kelvin)
        values = in_band_radiance(band, kelvin)
    return values, sigma, counts


def slope(band: Band, temperature, step: float = 1e-3) -> np.ndarray:
    """Derivative of the in-band radiance of a blackbody with respect to its temperature
    [W m^-2 sr^-1 K^-1].
    """
    high, low = (in_band_radiance(band, np.asarray(temperature) + d) for d in (step, -step))
    return (high - low) / (2 * step)


def noise_of_netd(band: Band, radiance, netd_mK: float) -> np.ndarray:
    """Standard deviation of the radiance of pixels, for a NETD that is stated at NETD_K.

    A camera's variance is a constant part (electronics, dark current, warm optics) and shot noise,
    which is proportional to the radiance. Their shares are not known. With L0 the radiance of
    NETD_K, the variance max(1, L / L0) is at least as large for any shares, and the same at L0.
    """
    share = np.maximum(np.asarray(radiance) / in_band_radiance(band, NETD_K), 1.0)
    return slope(band, NETD_K) * netd_mK * 1e-3 * np.sqrt(share)


def check_kelvin(path, values: np.ndarray) -> None:
    """Raise InputError for values that are no apparent temperatures in kelvin."""
    bad = ~((values >= COLDEST) & (values <= HOTTEST))
    if bad.any():
        raise InputError(
            f"{path}: apparent temperature {values[bad][0]:g}; must lie in {COLDEST:g}.."
            f"{HOTTEST:g} K (degrees Celsius need 273.15 more; a radiance needs quantity = "
            "'radiance')"
        )


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


def read_values(path: str, channel: str | None, quantity: str | None, band: Band) -> tuple:
    """Values (H, W) of an image file, Float64, and what they are.

    `quantity` is what the user says about it; an EXR file need not be told. Raises InputError.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: is no image that can be read; use {', '.join(SUFFIXES)}")
    if suffix == ".exr":
        return from_exr(path, channel, quantity, band)
    if channel is not None:
        raise InputError(f"{path}: channel = '{channel}' goes with an EXR file only")
    if quantity is None:
        raise InputError(
            f"{path}: does not say what it holds; give quantity = 'radiance' (W m^-2 sr^-1) or "
            "'apparent_temperature' (K)"
        )
    read = {".csv": from_csv, ".npy": from_npy}.get(suffix, from_picture)
    values = read(path)
    if values.ndim != 2:
        raise InputError(
            f"{path}: has {values.ndim} dimensions; an image has height and width only"
        )
    return values.astype(float), quantity


def from_exr(path: str, channel: str | None, quantity: str | None, band: Band) -> tuple:
    """A channel of an EXR file; its header must not name another band."""
    channels, header = read_exr(path)
    channel = channel or ("Y" if "Y" in channels or len(channels) > 1 else next(iter(channels)))
    if channel not in channels:
        raise unknown(f"channel of {path}", channel, channels)
    stated = header.get("band")
    if quantity != "mask" and isinstance(stated, str) and stated != band.name:
        raise InputError(f"{path}: is of band {stated}, and the scene of band {band.name}")
    if quantity is None:
        quantity = TEMPERATURE if channel == "temperature.Y" else "radiance"
    return channels[channel].astype(float), quantity


def from_npy(path: str) -> np.ndarray:
    """The array in a NumPy file."""
    try:
        values = np.load(io.BytesIO(read_bytes(path)), allow_pickle=False)
    except MemoryError:
        raise InputError(f"{path}: states a size that does not fit into the memory") from None
    except (ValueError, EOFError) as error:
        raise InputError(f"{path}: is no NumPy array: {error}") from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
        raise InputError(f"{path}: holds no array of real numbers")
    return values


def from_csv(path: str) -> np.ndarray:
    """The rows of numbers in a text file, one row of pixels a line."""
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    lines = [(number, line) for number, line in enumerate(lines, 1) if not line.startswith("#")]
    if not lines:
        raise InputError(f"{path}: holds no numbers")
    separator = next((mark for mark in SEPARATORS if mark in lines[0][1]), ",")
    rows = []
    for number, line in lines:
        cells = line.rstrip("\r\n").rstrip(separator).split(separator)
        if separator != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            rows.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            raise InputError(
                f"{path}, line {number}: is no row of numbers; an image has no header line"
            ) from None
        if len(rows[-1]) != len(rows[0]):
            raise InputError(
                f"{path}, line {number}: {len(rows[-1])} numbers where the first row has "
                f"{len(rows[0])}"
            )
    return np.array(rows)


def from_picture(path: str) -> np.ndarray:
    """The first page of a TIFF or PNG file, read by Pillow, which Matplotlib brings."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(read_bytes(path))) as picture:
            if len(picture.getbands()) == 4 or picture.mode in ("P", "LA"):
                picture = picture.convert("L")
            values = np.asarray(picture)
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{path}: is no image that can be read: {error}") from None
    if values.ndim == 3 and (values == values[..., :1]).all():
        values = values[..., 0]  # a grey picture stored in colour
    if values.ndim == 3:
        raise InputError(f"{path}: is a picture in colour; measured images have one channel")
    return values
