"""Claims of the commands that read a table beside the scene: scenarios, sweeps and cavities.

A flight and a camera's image belong to the scenarios.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.claims import planck
from docs.studies.claims.case import Case
from docs.studies.claims.scene_file import PIXELS
from docs.studies.claims.witness import Claim, Witness, student
from mi_lcair.detection.camera.optics import OVERSAMPLING

RANGE = 1e4  # of a contrast, in sizes of the scene
PARALLEL = 1e-3  # relative error of the assumption that the rays of a frame are parallel
FRAME, WIDE = 32, 72  # pixels of a frame before the optics, and of one that holds what they spread
PIXEL, PITCH_UM = 0.625, 20.0  # width of a pixel in sizes of the scene, and on the detector
PUPIL = {"aplanatic": 0, "thin": 1}  # lenses, whose pupils fill pi / (4 N^2 + this) steradians
FAR = 30  # pixels from the target to the border of the wide frame, and less than a camera follows
FLOWN = 1e4  # metres of a flight's range at most, whose heights end at 100 km
TURN_DEG, RATE_HZ = 30.0, 3.0  # turn of a flight's line of sight a second, moments a second
NOT_DIFFUSE = 1e-6  # specular part that makes the renderer trace a cavity instead of rings


def directions(azimuths_deg, elevations_deg) -> np.ndarray:
    """Unit vectors toward the observer, (V, 3)."""
    azimuth, elevation = np.radians(azimuths_deg), np.radians(elevations_deg)
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


SCENARIO = """# An adverse case.
[target]
scene = "adverse.xml"
{where}
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
OBSERVER = """[observer]
range_m = {range_m!r}
azimuth_deg = {azimuth!r}
elevation_deg = {elevation!r}
"""
FLIGHT = """[flight]
path = "path.csv"
ground_m = {ground!r}
rate_hz = {rate!r}
"""
PATH = "time_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,temperature.{group}\n"


@dataclass(frozen=True)
class Written:
    """A scenario in a void.

    path: its file. behind: temperature of the background [K]. tolerance: that of the render.
    """

    path: Path
    behind: float
    tolerance: float

    @staticmethod
    def beside(scene, witness: Witness, rng, tolerance: float, where: str) -> "Written":
        """The scenario of a case's scene. where: its table [observer] or [flight], and [camera]."""
        path, behind = scene.path.with_name("adverse.toml"), float(rng.uniform(200, 300))
        text = SCENARIO.format(
            where=where,
            background=behind,
            band=witness.case.band,
            pixels=PIXELS,
            tolerance=tolerance,
            max_spp=witness.most_spp,
        )
        path.write_text(text, encoding="utf-8")
        return Written(path, behind, tolerance)

    def irradiance(self, case: Case, direction, range_m: float, radiances: dict) -> float:
        """Exact contrast irradiance of the target [W m^-2]."""
        intensity, projected = case.view(direction, radiances, case.materials)
        return (intensity - projected * case.background_radiance(self.behind)) / range_m**2


def observer(case: Case, rng) -> tuple[str, float, np.ndarray]:
    """Table [observer] of a random view, its range [m] and its direction."""
    range_m = RANGE * case.file.place.scale
    azimuth, elevation = float(rng.uniform(0, 360)), float(rng.uniform(5, 85))
    text = OBSERVER.format(range_m=range_m, azimuth=azimuth, elevation=elevation)
    (direction,) = directions([azimuth], [elevation])
    return text, range_m, direction


def contrast(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The interval and the tolerance of a contrast in a void."""
    tolerance = float(rng.choice([0.1, 0.03]))
    where, *view = observer(case, rng)
    written = Written.beside(scene, witness, rng, tolerance, where)
    row = mi_lcair.contrast(written.path).rows[-1]
    truth = written.irradiance(case, *view[::-1], case.radiances())
    yield witness.claim("interval, contrast", row.total.value, truth, row.half_width)
    if row.reached:
        allowed = tolerance * abs(truth)
        yield witness.claim("tolerance, contrast", row.total.value, truth, allowed)


def flight(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Intervals of the moments of a flight in a void, while a group warms up."""
    away, group = min(RANGE * case.file.place.scale, FLOWN), next(iter(case.temperatures))
    azimuths = rng.uniform(0, 360) + np.cumsum(rng.uniform(-TURN_DEG, TURN_DEG, 3))
    ranges = away * rng.uniform(0.5, 2, 3)
    places = -ranges[:, None] * directions(azimuths, rng.uniform(30, 60, 3))
    kelvin = case.temperatures[group] * rng.uniform(0.8, 1.2, 3)
    rows = np.column_stack([np.arange(3), places, np.zeros((3, 3)), kelvin]).tolist()
    lines = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    scene.path.with_name("path.csv").write_text(PATH.format(group=group) + lines, encoding="utf-8")
    where = FLIGHT.format(ground=-4 * away, rate=RATE_HZ)
    written = Written.beside(scene, witness, rng, float(rng.choice([0.1, 0.03])), where)
    table = mi_lcair.flight(written.path, seed=int(rng.integers(1000))).table
    to_observer = -np.column_stack([table["x_m"], table["y_m"], table["z_m"]])
    at = np.interp(table["time_s"], np.arange(3), kelvin)
    for k, (vector, T) in enumerate(zip(to_observer, at)):
        range_m = float(np.linalg.norm(vector))
        radiances = case.radiances(**{group: float(T)})
        truth = written.irradiance(case, vector / range_m, range_m, radiances)
        value, half_width = table["contrast_W_m2"][k], table["contrast_half_width_W_m2"][k]
        yield witness.claim("interval, flight", value, truth, half_width)


def sweep(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Intervals and tolerances of the rows of a sweep over views."""
    tolerance, views = float(rng.choice([0.03, 0.01])), rng.uniform(5, 85, 2).tolist()
    conditions = {
        "base": {"scene": str(scene.path)},
        "conditions": {"azimuth_deg": rng.uniform(0, 360, 3).tolist(), "elevation_deg": views},
        "sampling": {
            "tolerance": tolerance,
            "max_spp": witness.most_spp // 4,
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


def recorded(case: Case, scene, witness: Witness, rng, side: int, **optics) -> tuple:
    """An image by a camera with these entries, and the exact electrons of its target.

    Returns the image, the electrons in the whole frame of side x side pixels, their magnitude, and
    the 95 % error of the rendering.
    """
    imager = {
        "focal_length_mm": 1e-3 * PITCH_UM * RANGE / PIXEL,
        "f_number": 2.0,
        "pitch_um": PITCH_UM,
        "width": side,
        "height": side,
        "integration_time_ms": 1.0,
        "well_Me": 1e6,
        "quantum_efficiency": float(rng.uniform(0.1, 1)),
        "fill_factor": 1.0,
        "lens": str(rng.choice(list(PUPIL))),
        "roll_deg": float(rng.uniform(-180, 180)),
        "projection": str(rng.choice(["perspective", "orthographic"])),
    } | optics
    table = "".join(f"{name} = {value!r}\n" for name, value in imager.items()).replace("'", '"')
    tolerance = float(rng.choice([0.1, 0.03]))
    where, range_m, direction = observer(case, rng)
    written = Written.beside(scene, witness, rng, tolerance, where + "[camera]\n" + table)
    image = mi_lcair.image(written.path)
    # Electrons for a photon m^-2 sr^-1 s^-1, by the pupil's solid angle, the pixel and the time
    pitch = PITCH_UM * 1e-6
    per_radiance = np.pi / (4 * imager["f_number"] ** 2 + PUPIL[imager["lens"]]) * pitch**2 * 1e-3
    per_radiance *= imager["quantum_efficiency"] * imager["fill_factor"]
    pixel_sr = (pitch / (1e-3 * imager["focal_length_mm"])) ** 2
    intensity, projected = case.view(direction, case.photons(), case.materials)
    hidden = projected * planck.by_quadrature(case.band, written.behind, photons=True)
    to_electrons = per_radiance / range_m**2 / pixel_sr
    noise = student(np.inf) * np.sqrt(np.sum(image.exposure.error**2)) / OVERSAMPLING**2
    exact, size = (to_electrons * (intensity + sign * hidden) for sign in (-1, 1))
    return image, exact, size, noise


def camera(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """Electrons of a target in a camera's frame before the optics, all pixels together."""
    fill_factor = float(rng.uniform(0.3, 1))
    image, truth, size, noise = recorded(case, scene, witness, rng, FRAME, fill_factor=fill_factor)
    value = image.exposure.contrast.sum() / OVERSAMPLING**2
    yield witness.claim("camera's electrons", value, truth, noise + PARALLEL * size)


def blurred(case: Case, scene, witness: Witness, rng) -> Iterator[Claim]:
    """The same behind optics, which spread the electrons and keep their sum.

    Diffraction alone spreads them beyond the frame. The share that it sends further than r is at
    most 2 wavelength N / (pi^2 r) (Born and Wolf, Principles of Optics, 8.5.2).
    """
    N = float(rng.choice([1.0, 2.0, 4.0]))
    pixel_urad = 1e6 * PIXEL / RANGE
    optics = {
        "f_number": N,
        "jitter_urad": float(rng.uniform(0, 2)) * pixel_urad,
        "defocus_um": float(rng.uniform(-3, 3)) * PITCH_UM * N,
    }
    image, truth, size, noise = recorded(case, scene, witness, rng, WIDE, **optics)
    electrons, behind = (
        image.channels[name].astype(float) for name in ("electrons.Y", "electrons.background.Y")
    )
    lost = 2 * planck.BANDS_UM[case.band][1] * N / (np.pi**2 * FAR * PITCH_UM)
    rounding = np.finfo(np.float32).eps * (electrons + behind).sum()
    stated = noise + (PARALLEL + lost) * size + rounding
    yield witness.claim("camera's blur", (electrons - behind).sum(), truth, stated)
