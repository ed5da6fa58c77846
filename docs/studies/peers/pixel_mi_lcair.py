"""Electrons and signal-to-noise ratio of a pixel, in mi_lcair."""

import subprocess
import tempfile
from pathlib import Path

import mi_lcair

here = Path(__file__).parent
folder = tempfile.mkdtemp()
command = ["mi-lcair", "import", here / "pixel_plate.obj", "-o", folder, "--overwrite"]
subprocess.run(command, check=True, capture_output=True)


def run(case, effort, seed):
    image = mi_lcair.image(
        here / "pixel.toml", seed=seed, parameters={"target.scene": f"{folder}/scene.xml"}
    )
    electrons, kelvin = (image.channels[name][8, 8] for name in ("electrons.Y", "stderr_K.Y"))
    error = kelvin * (electrons - image.measures.background) / 2
    return {
        "background": (image.measures.background, None),
        "target": (float(electrons), float(error)),
        "snr": (image.measures.peak_snr, None),
    }
