"""Claims of the commands that read a table beside the scene: scenarios, sweeps and cavities."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.case import Case
from docs.studies.claims.scene_file import PIXELS
from docs.studies.claims.witness import MOST_PATHS, Claim, Witness, student
from mi_lcair.camera.optics import OVERSAMPLING

RANGE = 1e4  # of a contrast, in sizes of the scene
PARALLEL = 1e-3  # relative error of the assumption that the rays of a frame are parallel
FRAME, WIDTH = 32, 20.0  # pixels of a frame, and its width in sizes of the scene
PITCH_UM = 20.0  # of the pixels
NOT_DIFFUSE = 1e-6  # specular part that makes the renderer trace a cavity instead of rings


def directions(azimuths_deg, elevations_deg) -> np.ndarray:
    """Unit vectors toward the observer, (V, 3)."""
    azimuth, elevation = np.radians(azimuths_deg), np.radians(elevations_deg)
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


SCENARIO = """# An adverse case.
[target]
scene = "adverse.xml"
[observer]
range_m = {range_m!r}
azimuth_deg = {azimuth!r}
elevation_deg = {elevation!r}
[atmosphere]
table = "vacuum"
[background]
temperature = {background!r}
[sensor]
band = "{band}"
[render]
resolution = {pixels}
tolerance = {tolerance!r}
max_spp = {max_spp}
"""


@dataclass(frozen=True)
class Written:
    """A scenario in a void.

    path: its file. range_m: distance [m]. direction: unit vector toward the observer. behind:
    temperature of the background [K]. tolerance: that of the render.
    """

    path: Path
    range_m: float
    direction: np.ndarray
    behind: float
    tolerance: float

    @staticmethod
    def beside(scene, case: Case, rng, tolerance: float, camera: str = "") -> "Written":
        """A scenario with a random view of a case's scene. camera: text of a table [camera]."""
        range_m, path = RANGE * case.file.place.scale, scene.path.with_name("adverse.toml")
        azimuth, elevation = float(rng.uniform(0, 360)), float(rng.uniform(5, 85))
        behind = float(rng.uniform(200, 300))
        text = SCENARIO.format(
            range_m=range_m,
            azimuth=azimuth,
            elevation=elevation,
            background=behind,
            band=case.band,
            pixels=PIXELS,
            tolerance=tolerance,
            max_spp=MOST_PATHS // PIXELS**2,
        )
        path.write_text(text + camera, encoding="utf-8")
        (direction,) = directions([azimuth], [elevation])
        return Written(path, range_m, direction, behind, tolerance)


def contrast(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The interval and the tolerance of a contrast in a void."""
    written = Written.beside(scene, case, rng, float(rng.choice([0.1, 0.03])))
    row = mi_lcair.contrast(written.path).rows[-1]
    intensity, projected = case.view(written.direction, case.radiances(), case.materials)
    behind = case.background_radiance(written.behind)
    truth = (intensity - projected * behind) / written.range_m**2
    yield witness.claim("interval, contrast", row.total.value, truth, row.half_width)
    if row.reached:
        allowed = written.tolerance * abs(truth)
        yield witness.claim("tolerance, contrast", row.total.value, truth, allowed)


def sweep(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Intervals and tolerances of the rows of a sweep over views."""
    tolerance, views = float(rng.choice([0.03, 0.01])), rng.uniform(5, 85, 2).tolist()
    conditions = {
        "base": {"scene": str(scene.path)},
        "conditions": {"azimuth_deg": rng.uniform(0, 360, 3).tolist(), "elevation_deg": views},
        "sampling": {
            "tolerance": tolerance,
            "max_spp": MOST_PATHS // PIXELS**2 // 4,
            "resolution": PIXELS,
            "seed": int(rng.integers(1000)),
        },
    }
    table = mi_lcair.sweep(conditions).columns()
    largest = table["intensity_W_sr"].max()
    for k, direction in enumerate(directions(table["azimuth_deg"], table["elevation_deg"])):
        truth, _ = case.view(direction, case.radiances(), case.materials)
        value, half_width = table["intensity_W_sr"][k], table["intensity_half_width_W_sr"][k]
        yield witness.claim("interval, sweep", value, truth, half_width)
        if table["reached"][k]:
            allowed = tolerance * max(truth, 1e-3 * largest)
            yield witness.claim("tolerance, sweep", value, truth, allowed)


def cavity(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Effective emissivity of a sphere with an opening, by rings or by paths."""
    emissivity, opening = float(rng.uniform(0.1, 0.95)), float(rng.uniform(0.05, 1.2))
    aperture = float(case.file.place.scale * np.sin(opening))
    radius, by_paths = case.file.place.scale, rng.random() < 0.5
    description = {
        "shape": {
            "kind": "sphere",
            "radius_m": radius,
            "aperture_radius_m": aperture,
        },
        "wall": {"emissivity": emissivity, "specular": NOT_DIFFUSE if by_paths else 0.0},
    }
    result = mi_lcair.cavity(description, tolerance=3e-3, seed=int(rng.integers(1000)))
    lost = (1 - np.cos(opening)) / 2  # of what leaves any point of the wall
    truth = emissivity / (1 - (1 - emissivity) * (1 - lost))
    stated = student(np.inf) * result.numerical[0] + NOT_DIFFUSE
    yield witness.claim("cavity, " + result.method, result.effective[0], truth, stated)


def camera(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Electrons of a target in a camera's frame before the optics, all pixels together."""
    imager = {
        "focal_length_mm": 1e-3 * PITCH_UM * FRAME * RANGE / WIDTH,
        "f_number": 2.0,
        "pitch_um": PITCH_UM,
        "width": FRAME,
        "height": FRAME,
        "integration_time_ms": 1.0,
        "well_Me": 1e6,
        "projection": str(rng.choice(["perspective", "orthographic"])),
    }
    table = "".join(f"{name} = {value!r}\n" for name, value in imager.items())
    tolerance = float(rng.choice([0.1, 0.03]))
    written = Written.beside(scene, case, rng, tolerance, "[camera]\n" + table.replace("'", '"'))
    exposure = mi_lcair.image(written.path).exposure
    # Electrons for a photon m^-2 sr^-1 s^-1, by the pupil's solid angle, the pixel and the time
    pitch = PITCH_UM * 1e-6
    per_radiance = np.pi / (4 * imager["f_number"] ** 2) * pitch**2 * 1e-3
    pixel_sr = (pitch / (1e-3 * imager["focal_length_mm"])) ** 2
    values = case.photons()
    intensity, projected = case.view(written.direction, values, case.materials)
    hidden = projected * planck.by_quadrature(case.band, written.behind, photons=True)
    to_electrons = per_radiance / written.range_m**2 / pixel_sr
    error = student(np.inf) * np.sqrt(np.sum(exposure.error**2)) / OVERSAMPLING**2
    value, truth = exposure.contrast.sum() / OVERSAMPLING**2, to_electrons * (intensity - hidden)
    stated = error + PARALLEL * to_electrons * (intensity + hidden)
    yield witness.claim("camera's electrons", value, truth, stated)
