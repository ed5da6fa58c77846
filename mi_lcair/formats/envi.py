"""Spectral images as ENVI files: a text header, and the numbers of one band after another."""

from pathlib import Path

import numpy as np

from mi_lcair.files import together, write_bytes


def write(path: str | Path, cube: np.ndarray, wavelengths_um: np.ndarray, description: str) -> None:
    """Write FILE.hdr and FILE.img, both or none.

    Parameters
    ----------
    path : path-like
        The header, FILE.hdr.
    cube : ndarray, shape (wavelengths, H, W)
        Stored as float32, band sequential, with the lowest byte first.
    wavelengths_um : ndarray, shape (wavelengths,)
        Even wavelengths. Their distance is the full width at half maximum of the channels.
    description : str
        What the values are, and their unit.
    """
    bands, lines, samples = cube.shape
    wavelengths_um = np.asarray(wavelengths_um, dtype=float)
    listed = ", ".join(f"{x:.9g}" for x in wavelengths_um)
    widths = ", ".join([f"{wavelengths_um[1] - wavelengths_um[0]:.9g}"] * bands)
    entries = {
        "description": f"{{{description}}}",
        "samples": samples,
        "lines": lines,
        "bands": bands,
        "header offset": 0,
        "file type": "ENVI Standard",
        "data type": 4,
        "interleave": "bsq",
        "byte order": 0,
        "wavelength units": "Micrometers",
        "wavelength": f"{{{listed}}}",
        "fwhm": f"{{{widths}}}",
    }
    text = "".join(f"{name} = {value}\n" for name, value in entries.items())
    with together():
        write_bytes(Path(path), f"ENVI\n{text}".encode())
        write_bytes(Path(path).with_suffix(".img"), cube.astype("<f4").tobytes())
