"""TIFF images: 32-bit floating point numbers as thermography tools read them, 16-bit counts."""

from io import BytesIO
from pathlib import Path

import numpy as np

from mi_lcair.files import write_bytes


def write(path: str | Path, values: np.ndarray, description: str = "") -> None:
    """Write an image, or frames as the pages of one file, completely or not at all.

    Parameters
    ----------
    path : path-like
        File to write.
    values : ndarray, shape (H, W) or (frames, H, W)
        uint16 becomes 16-bit pages, compressed without loss. Any other type becomes 32-bit
        floating point pages, which are not compressed, so that every reader of such files takes
        them. NaN stays NaN.
    description : str
        Text of the file's tag ImageDescription, in ASCII: what the values are and their unit.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    from PIL import Image

    values = np.asarray(values)
    counts = values.dtype == np.uint16
    pages = [
        Image.fromarray(np.ascontiguousarray(page, np.uint16 if counts else np.float32))
        for page in values.reshape(-1, *values.shape[-2:])
    ]
    content = BytesIO()
    pages[0].save(
        content,
        format="TIFF",
        save_all=True,
        append_images=pages[1:],
        compression="tiff_adobe_deflate" if counts else None,
        description=description.encode("ascii", "replace").decode(),
    )
    write_bytes(path, content.getvalue())
