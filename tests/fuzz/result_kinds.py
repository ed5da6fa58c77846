"""Kinds of files that commands write and read again, and of tables of uncertainties."""

import io
import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.physics import materials
from mi_lcair.physics.bands import band
from mi_lcair.rendering.images.files import from_npy
from mi_lcair.rendering.parameters.values import apply_solution
from mi_lcair.scenes import FOLDER
from tests.fuzz.mutants import Kind

RESULTS = Path(__file__).parents[1] / "data" / "results"
JSON_WORDS = (*b'null true {} [] "" NaN 1e999 -1 [[1]] {"a":1}'.split(), b"[" * 5000)
TOML_WORDS = tuple(b"[ ] {} [[a]] = inf nan true '' 1e308 -1 {a=1} [1,2] 2026-01-01 0x10".split())


def array_bytes() -> bytes:
    file = io.BytesIO()
    np.save(file, 300 + np.arange(12.0).reshape(3, 4))
    return file.getvalue()


NPY = Kind("npy", ".npy", (array_bytes(),), from_npy, (b"descr", b"<f8", b"|O", b"(3,4)", b"(0,)"))

RADIOMETRIC = Kind(
    "radiometric",
    ".jpg",
    ((FOLDER / "examples" / "photo.jpg").read_bytes(),),
    lambda path: mi_lcair.temperature(path, spots=["10,10"]),
    (b"FLIR", b"FFF\0", b"\xff\xe1", b"\x89PNG"),
)


def use_result(path: Path) -> None:
    """Writes the page of a result's JSON."""
    with tempfile.TemporaryDirectory() as folder:
        mi_lcair.report(path, Path(folder) / "page.html")


RESULT = Kind(
    "result",
    ".json",
    tuple((RESULTS / f"{name}.json").read_bytes() for name in ("fit", "budget")),
    use_result,
    JSON_WORDS,
)
SOLUTION = Kind(
    "solution",
    ".json",
    ((RESULTS / "solution.json").read_bytes(),),
    lambda path: apply_solution(mi_lcair.load("two_plates", resolution=4), path),
    JSON_WORDS,
)
SIGMA = Kind(
    "sigma",
    ".toml",
    (
        b'[sigma]\n"plate.temperature" = 2\n"diffuse.emissivity" = 0.01\n[[correlated]]\n'
        b'names = ["plate.temperature", "diffuse.emissivity"]\ncorrelation = 0.5\n',
        b'[sigma]\n"plate.temperature" = {uniform = 2}\n',
    ),
    lambda path: mi_lcair.budget("two_plates", path, parameters={"resolution": 4}, spp=4),
    TOML_WORDS,
)
SPECTRA = {"nk.csv": b"wavelength_um,n,k\n3,1.5,0.1\n4,1.6,0.2\n5,1.5,0.1\n"}


def use_spectral(path: Path) -> None:
    for name in materials.names(path)[:4]:
        materials.material(name, band("3-5"), path)


SPECTRAL = Kind(
    "spectral",
    ".toml",
    (
        b'[panel.spectral]\nmodel = "microfacet"\nalpha = 0.1\ngamma = 2\nrho_d = 0\n'
        b'nk = "nk.csv"\n',
    ),
    use_spectral,
    TOML_WORDS,
    SPECTRA,
)

RESULT_KINDS = (NPY, RADIOMETRIC, RESULT, SOLUTION, SIGMA, SPECTRAL)
