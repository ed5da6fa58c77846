"""Radiance images as OpenEXR files: named float32 channels and a header."""

import io
import os
from contextlib import contextmanager, redirect_stdout
from numbers import Integral, Real
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import check_file, replacing

MAGIC = b"\x76\x2f\x31\x01"

# Attributes that describe the file itself: set by the format, not by the caller.
STRUCTURE = {
    "channels",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "lineOrder",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "tiles",
    "type",
    "version",
}


def write_exr(
    path: str | Path, channels: dict[str, np.ndarray], header: dict[str, str | int | float]
) -> None:
    """Write `channels` (name -> [H, W], stored as float32) and `header` to an OpenEXR file,
    complete or not at all.

    Floats of the header keep 7 digits (the format's own type); whole numbers beyond 31 bits are
    written as strings. Raises InputError where the file cannot be written; ValueError, a mistake of
    the caller, for values that are not finite, channels that are not one 2D shape, and names that
    the format cannot hold.
    """
    import OpenEXR

    # The package writes non-contiguous arrays wrong without a word, and changes the dictionaries
    # that it is given.
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
                f"channel '{name}' holds {np.count_nonzero(~np.isfinite(values))} NaN or infinite values"
            )
    attributes = {_checked_name(name): _attribute(name, value) for name, value in header.items()}
    attributes |= {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}

    with replacing(path) as partial:
        OpenEXR.File(attributes, pixels).write(str(partial))


def _checked_name(name: str) -> str:
    if not 0 < len(name.encode()) < 256 or "\0" in name or name in STRUCTURE:
        raise ValueError(f"an OpenEXR file cannot hold the name {name!r}")
    return name


def _attribute(name: str, value: str | int | float) -> str | int | float:
    """`value` as one of the three types that the package stores without loss (NumPy's scalars it
    refuses).
    """
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Integral):
        return int(value) if -(2**31) <= value < 2**31 else str(int(value))
    if isinstance(value, Real) and abs(value) <= float(np.finfo(np.float32).max):
        return float(value)
    raise ValueError(f"header attribute '{name}' is not a string or a finite number: {value!r}")


def read_exr(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, str | int | float]]:
    """The channels (name -> float32 [H, W]) and the header (strings and numbers only) of an OpenEXR
    file.

    Reads the files of other programs too: any channel names, half floats and whole numbers, the
    first part of several. Raises InputError for a file that is missing, damaged or not an OpenEXR
    image.
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
    """Keep off the screen what OpenEXR prints about a damaged file, in Python on stdout and in C on
    stderr.
    """
    kept = os.dup(2)
    with redirect_stdout(io.StringIO()), Path(os.devnull).open("w") as null:
        os.dup2(null.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
