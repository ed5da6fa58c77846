"""Images from EXR, TIFF, PNG, CSV and NPY files."""

import io
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, check_known
from mi_lcair.files import read_bytes, read_text
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images.exr import read_exr
from mi_lcair.table import SEPARATORS

PICTURES = (".tif", ".tiff", ".png")
SUFFIXES = (".exr", *PICTURES, ".csv", ".npy")
COLDEST, HOTTEST = 30.0, 6000.0  # limits of an apparent temperature, K
TEMPERATURE = "apparent_temperature"
OTHERWISE = (
    "degrees Celsius need 273.15 more, counts of 0.01 K need scale = 0.01; a radiance needs "
    "quantity = 'radiance'"
)


def check_kelvin(path, values: np.ndarray, otherwise: str = OTHERWISE) -> None:
    """Raise InputError for values that are no apparent temperatures in kelvin.

    otherwise: what other values need, in words.
    """
    bad = ~((values >= COLDEST) & (values <= HOTTEST))
    if bad.any():
        raise InputError(
            f"{path}: apparent temperature {values[bad][0]:g}; must lie in {COLDEST:g}.."
            f"{HOTTEST:g} K ({otherwise})"
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
    usual = next((name for name in ("Y", "temperature.Y") if name in channels), "Y")
    channel = channel or (usual if len(channels) > 1 else next(iter(channels)))
    check_known(f"channel of {path}", channels, channel)
    stated = header.get("band")
    if quantity != "mask" and isinstance(stated, str) and stated not in (band.name, band.label):
        raise InputError(f"{path}: is of band {stated}, and not of band {band.name}")
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
                f"{path}, line {number}: is no row of numbers; put # in front of a line of a header"
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

    content = io.BytesIO(read_bytes(path))
    try:
        with Image.open(content) as picture:
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
