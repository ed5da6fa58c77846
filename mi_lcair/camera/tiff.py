"""Frames as a TIFF file with 16 bits in a pixel."""

from pathlib import Path

import numpy as np

from mi_lcair.files import replacing


def write_tiff(path: str | Path, frames: np.ndarray, description: str = "") -> None:
    """Write frames, uint16 (n, H, W), as the pages of a TIFF file, completely or not at all.

    description: text of the file's tag ImageDescription, in ASCII. Raises InputError if the file
    cannot be written.
    """
    from PIL import Image  # Matplotlib needs it too

    pages = [Image.fromarray(np.ascontiguousarray(frame, dtype=np.uint16)) for frame in frames]
    text = description.encode("ascii", "replace").decode()
    with replacing(path) as partial:
        pages[0].save(
            partial,
            format="TIFF",
            save_all=True,
            append_images=pages[1:],
            compression="tiff_adobe_deflate",
            description=text,
        )
