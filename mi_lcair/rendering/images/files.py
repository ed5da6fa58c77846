"""Radiance images as OpenEXR files: named float32 channels and a header."""

import io
import os
from contextlib import contextmanager, redirect_stdout
from numbers import Integral, Real
from pathlib import Path

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.files import check_file, read_bytes, read_text, replacing
from mi_lcair.formats import check_channels
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images import radiometric
from mi_lcair.table import SEPARATORS

MAGIC = b"\x76\x2f\x31\x01"

# Attributes of the file format. The OpenEXR package sets them or wants a type of its own for them,
# so a caller must not set them.
STRUCTURE = {
    *("adoptedNeutral", "channels", "chromaticities", "chunkCount", "compression", "dataWindow"),
    *("displayWindow", "lineOrder", "originalDataWindow", "pixelAspectRatio"),
    *("screenWindowCenter", "screenWindowWidth", "tiles", "type", "version"),
}


def write_exr(
    path: str | Path, channels: dict[str, np.ndarray], header: dict[str, str | int | float]
) -> None:
    """Write an OpenEXR file, completely or not at all.

    Parameters
    ----------
    path : str or Path
    channels : dict
        Arrays (H, W) by name, stored as float32.
    header : dict
        Strings and numbers by name. Floats keep 7 digits, as the format stores them in single
        precision. Integers of more than 31 bits are written as strings.

    Raises
    ------
    InputError
        If the file cannot be written.
    ValueError
        If the caller gives values that are not finite, channels of different shapes, or names that
        the format does not allow.
    """
    import OpenEXR

    # The package writes wrong values for non-contiguous arrays, without an error. It also changes
    # the dictionaries that it receives.
    pixels = {
        _checked_name(name): np.ascontiguousarray(values, dtype=np.float32)
        for name, values in channels.items()
    }
    shapes = {values.shape for values in pixels.values()}
    if len(shapes) != 1 or any(len(shape) != 2 or 0 in shape for shape in shapes):
        raise ValueError(f"channels need one common shape (H, W), not {sorted(shapes)}")
    for name, values in pixels.items():
        if not np.isfinite(values).all():
            raise ValueError(
                f"channel '{name}' has {np.count_nonzero(~np.isfinite(values))} NaN or infinite "
                "values"
            )
    attributes = {_checked_name(name): _attribute(name, value) for name, value in header.items()}
    attributes |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}

    with replacing(path) as partial:
        OpenEXR.File(attributes, pixels).write(str(partial))


def window_of(header: dict) -> tuple[float, float] | None:
    """Width and height [m] of an orthographic sensor's window, from the header of its image.

    None for another sensor, and for images of other programs.
    """
    try:
        width, height = map(float, str(header.get("window_m", "")).split())
    except ValueError:
        return None
    return (width, height) if 0 < width < np.inf and 0 < height < np.inf else None


def write_render(path: str | Path, result) -> None:
    """Write the channels and the header of a result, such as a `Render`, as an OpenEXR file."""
    write_exr(path, result.channels, result.header)


def _checked_name(name: str) -> str:
    if not 0 < len(name.encode()) < 256 or "\0" in name or name in STRUCTURE:
        raise ValueError(f"an OpenEXR file cannot contain the name {name!r}")
    return name


def _attribute(name: str, value: str | int | float) -> str | int | float:
    """The value as a str, int or float of Python, which the package stores without loss.

    The package rejects NumPy's scalars. The attribute `name` is a string by the format.
    """
    if isinstance(value, str) or name == "name":
        return str(value)
    if isinstance(value, Integral):
        return int(value) if -(2**31) <= value < 2**31 else str(int(value))
    if isinstance(value, Real) and abs(value) <= float(np.finfo(np.float32).max):
        return float(value)
    raise ValueError(f"header attribute '{name}' is not a string or a finite number: {value!r}")


def read_exr(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, str | int | float]]:
    """Read the channels and the header of an OpenEXR file.

    Channels are float32 arrays (H, W) by name. The header has its strings and numbers only. Files
    of other programs can be read too: with any channel names, half floats and integers. Of a file
    with several parts, the first is read. Raises InputError for a file that is missing, damaged or
    not an OpenEXR image.
    """
    import OpenEXR

    check_file(Path(path))
    try:
        with Path(path).open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"'{path}' is not an OpenEXR image")
    except OSError as error:
        raise InputError(f"cannot read image '{path}': {error.strerror}") from error

    try:
        with _silenced():
            part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    except (RuntimeError, ValueError, IndexError, MemoryError) as error:
        raise InputError(f"'{path}' is a damaged OpenEXR image; write it anew") from error
    if part.type() not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise InputError(f"'{path}' is a deep OpenEXR image; a flat one is needed")
    channels = {name: channel.pixels.astype(np.float32) for name, channel in part.channels.items()}
    header = {
        name: value
        for name, value in part.header.items()
        if name not in STRUCTURE and isinstance(value, (str, int, float))
    }
    return channels, header


@contextmanager
def _silenced():
    """Suppress OpenEXR's messages about a damaged file, on Python's stdout and C's stderr."""
    kept = os.dup(2)
    with redirect_stdout(io.StringIO()), Path(os.devnull).open("w") as null:
        os.dup2(null.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)


# Images from EXR, TIFF, PNG, CSV and NPY files
# ---------------------------------------------

PICTURES = (".tif", ".tiff", ".png")
SUFFIXES = (".exr", *PICTURES, ".csv", ".npy", *radiometric.SUFFIXES)
KELVIN = Bounds(lower=30, upper=6000, unit="K")  # of an apparent temperature
TEMPERATURE = "apparent_temperature"
DESCRIPTION = 270  # tag ImageDescription of a TIFF
COUNTED = " in a count, "  # part of the description of a TIFF of counts
OTHERWISE = (
    "degrees Celsius need 273.15 more, counts of 0.01 K need scale = 0.01; a radiance needs "
    "quantity = 'radiance'"
)


def check_kelvin(path, values: np.ndarray, otherwise: str = OTHERWISE) -> None:
    """Raise InputError for values that are no apparent temperatures in kelvin.

    otherwise: what other values need, in words.
    """
    KELVIN.check_all(values, lambda k: f"{path}: apparent temperature", f" ({otherwise})")


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
        raise InputError(f"{path}: channel = '{channel}' is possible only for an EXR file")
    if suffix in radiometric.SUFFIXES:
        if quantity not in (None, TEMPERATURE):
            raise InputError(
                f"{path}: contains apparent temperatures, not {quantity}; leave quantity out"
            )
        return radiometric.read(path).kelvin, TEMPERATURE
    if quantity is None:
        raise InputError(
            f"{path}: does not say what its values are; give quantity = 'radiance' (W m^-2 "
            "sr^-1) or 'apparent_temperature' (K)"
        )
    read = {".csv": from_csv, ".npy": from_npy}.get(suffix, from_picture)
    if suffix in PICTURES and quantity in (TEMPERATURE, "radiance"):
        check_no_counts(path)
    values = read(path)
    if values.ndim != 2:
        raise InputError(
            f"{path}: has {values.ndim} dimensions; an image has height and width only"
        )
    return values.astype(float), quantity


def from_exr(path: str, channel: str | None, quantity: str | None, band: Band) -> tuple:
    """A channel of an EXR file; its header must not name another band."""
    channels, header = read_exr(path)
    usual = next((name for name in ("Y", "temperature.Y") if name in channels), "Y")
    channel = channel or (usual if len(channels) > 1 else next(iter(channels)))
    check_channels(f"channel of {path}", channels, channel)
    stated = header.get("band")
    if quantity != "mask" and isinstance(stated, str) and stated not in (band.name, band.label):
        raise InputError(f"{path}: is of band {stated}, and not of band {band.name}")
    if quantity is None:
        quantity = TEMPERATURE if channel == "temperature.Y" else "radiance"
    return channels[channel].astype(float), quantity


def from_npy(path: str) -> np.ndarray:
    """The array in a NumPy file."""
    content = read_bytes(path)
    try:
        values = np.load(io.BytesIO(content), allow_pickle=False)
    except MemoryError:
        raise InputError(f"{path}: has a size that does not fit into memory") from None
    except Exception:  # of any kind: the header is parsed as Python
        raise InputError(f"{path}: is no NumPy array; write it by numpy.save") from None
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiub":
        raise InputError(f"{path}: contains no array of real numbers")
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
                f"{path}, line {number}: is not a row of numbers; put # in front of a header"
            ) from None
        if len(rows[-1]) != len(rows[0]):
            raise InputError(
                f"{path}, line {number}: {len(rows[-1])} numbers where the first row has "
                f"{len(rows[0])}"
            )
    return np.array(rows)


def check_no_counts(path: str) -> None:
    """Raise InputError for a TIFF of counts that `image` has written, as its description says."""
    with radiometric.opened(read_bytes(path), f"{path}: is no image that can be read") as picture:
        described = str(getattr(picture, "tag_v2", {}).get(DESCRIPTION, ""))
    if COUNTED in described:
        raise InputError(
            f"{path}: contains a camera's counts; use the EXR of the same name, whose "
            "temperature.Y has the apparent temperatures"
        )


def from_picture(path: str) -> np.ndarray:
    """The first page of a TIFF or PNG file."""
    with radiometric.opened(read_bytes(path), f"{path}: is no image that can be read") as picture:
        if len(picture.getbands()) == 4 or picture.mode in ("P", "LA"):
            picture = picture.convert("L")
        values = np.asarray(picture)
    if values.ndim == 3 and (values == values[..., :1]).all():
        values = values[..., 0]  # a grey picture stored in colour
    if values.ndim == 3:
        raise InputError(f"{path}: is a picture in colour; measured images have one channel")
    return values
