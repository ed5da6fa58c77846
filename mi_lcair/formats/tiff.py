"""TIFF images: 32-bit floating point numbers as thermography tools read them, 16-bit counts."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import replacing, write_bytes

LARGEST = 2**32 - 2**24  # bytes of a file, whose offsets have 32 bits


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


def check_fits(path: str | Path, pages: int, columns: int, rows: int) -> None:
    """Raise InputError if so many 16-bit pages are too large for one file."""
    size = 2 * pages * columns * rows
    if size > LARGEST:
        raise InputError(
            f"'{path}': {pages} pages of {columns} x {rows} pixels have {size / 2**30:.1f} GiB, "
            f"and a TIFF at most {LARGEST / 2**30:.1f}; write fewer"
        )


@contextmanager
def stack(path: str | Path) -> Iterator[Callable]:
    """Context manager that gives a function, which adds 16-bit pages (H, W) to a file.

    The file appears at the end of the block.
    """
    from PIL import Image
    from PIL.TiffImagePlugin import AppendingTiffWriter

    class Pages(AppendingTiffWriter):
        def close(self) -> None:
            if not self.f.closed:  # Python from 3.13 on closes it again when it is deleted
                super().close()

    with replacing(path) as partial, Pages(str(partial), new=True) as file:

        def add(page: np.ndarray) -> None:
            Image.fromarray(np.ascontiguousarray(page, np.uint16)).save(file, format="TIFF")
            file.newFrame()

        yield add
