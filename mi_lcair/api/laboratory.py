"""Public functions of the laboratory: temperatures, noise, cavities and the audit of energy."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np

from mi_lcair.api.scenes import scene_of
from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, check_known, errors_of, option
from mi_lcair.estimate import Estimate, parsed, uncertain
from mi_lcair.laboratory.audit import Audit, audit_flux
from mi_lcair.laboratory.cavities.cavity import Cavity, measured
from mi_lcair.laboratory.cavities.description import CavityDescription
from mi_lcair.laboratory.noise import NoiseComponents, pages_of
from mi_lcair.laboratory.regions import Region
from mi_lcair.laboratory.thermography import (
    QUANTITIES,
    ImageConditions,
    Temperature,
    temperature_of,
)
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.progress import Progress
from mi_lcair.rendering.images import radiometric
from mi_lcair.rendering.images.files import (
    SUFFIXES,
    TEMPERATURE,
    check_kelvin,
    read_exr,
    read_values,
)
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.tasks import exclusively
from mi_lcair.toml_table import LARGEST

# `temperature`, the temperature of an object from an image of a thermographic camera
# -----------------------------------------------------------------------------------

ApparentTemperatures = str | PathLike[str] | float | np.ndarray
Number = float | str | tuple[float, float] | Estimate
CHANNEL = "temperature.Y"  # channel of an EXR with apparent temperatures


class Quantities(TypedDict, total=False):
    """Quantities of a measurement, see `temperature`."""

    reflected: Number
    transmittance: Number
    air_temperature: Number
    distance: Number
    humidity: Number
    window: Number
    window_temperature: Number


def temperature(
    image: ApparentTemperatures,
    band: str | PathLike[str] | Band | None = None,
    *,
    emissivity: Number | None = None,
    sigma: float = 0.0,
    scale: float = 1.0,
    offset: float = 0.0,
    spots: Sequence[str | tuple[int, int]] = (),
    areas: Sequence[str | tuple[int, int, int, int]] = (),
    **measurement: Unpack[Quantities],
) -> Temperature:
    """Temperature of an object from apparent temperatures, with its uncertainty.

    Solves the measurement formula of thermographic cameras with Planck's law integrated over the
    band. Numbers are given as 0.92, "0.92+-0.02", "0.92+-2%" or (0.92, 0.02), with a standard
    uncertainty.

    Parameters
    ----------
    image : str, Path, float or ndarray
        Apparent temperatures [K], as a camera shows them for an emissivity of 1: a TIFF, CSV or NPY
        file, an EXR with the channel temperature.Y, an array, or one number such as 305.2 or
        "305.2+-0.5". NaN and 0 mean no value. A radiometric file of a camera, such as FLIR's JPEG,
        contains the conditions of the measurement. They are the defaults of the other arguments.
    band : str, Path or Band, optional
        Band of the camera: a name, limits such as "7.5-14", or a CSV of its response. An EXR
        contains its band. FLIR's files use the camera's own curve and air, unless a band is given.
    emissivity : number, optional
        Emissivity of the object in the band, above 0 and at most 1. Only a radiometric file may
        leave it out.
    sigma : float
        Standard uncertainty of the apparent temperatures [K], common to all pixels.
    scale : float
        Kelvin per count of the image, such as 0.01.
    offset : float
        Apparent temperature [K] of the value 0: 273.15 for an image in degrees Celsius. With an
        offset, 0 is a value.
    spots : sequence of str or pair of int
        Pixels to evaluate: column and row from 0, such as "120,80". The first region is the main
        result. For the others, their differences from it are given, too.
    areas : sequence of str or tuple of int
        Rectangles of pixels whose mean is computed: column, row, width, height.

    Other Parameters
    ----------------
    reflected : number, optional
        Apparent temperature [K] of the reflected surroundings. It may be left out for an emissivity
        of 1.
    transmittance : number, optional
        Transmittance of the air, above 0 and at most 1; 1 if neither it nor a distance is given.
    air_temperature : number, optional
        Temperature of the air [K]. The default is the temperature `reflected` if a transmittance is
        given, and the temperature of the atmosphere if a distance is given.
    distance : number, optional
        Distance of the object [m]. It replaces the transmittance, which is then computed.
    humidity : number, optional
        Relative humidity 0..0.98, used with a distance.
    window : number, optional
        Transmittance of a window before the camera, above 0 and at most 1.
    window_temperature : number, optional
        Temperature of the window [K].

    Returns
    -------
    Temperature

    Raises
    ------
    InputError
        If a number is out of bounds, if the image cannot be read, if an argument is missing or
        given twice, and if none of the apparent temperatures is possible for these conditions.
    """
    name, image, sigma = named_image(image, sigma)
    own = {"emissivity": emissivity, **measurement}
    own = {key: value for key, value in own.items() if value is not None}
    check_known("quantity", QUANTITIES, *own)
    given, camera, remarks = own, None, ()
    if str(image).lower().endswith(radiometric.SUFFIXES):
        if (scale, offset) != (1, 0):
            raise InputError(f"{name}: contains temperatures already; leave scale and offset out")
        file = radiometric.read(str(image))
        image, camera = file.kelvin, None if band else file.calibration
        band, remarks = band or file.band, file.remarks
        without = {"distance", "humidity"} if "transmittance" in own else set()
        given = {k: v for k, v in file.conditions.items() if k not in without} | own
    elif band is None and str(image).lower().endswith(".exr"):
        _, header = read_exr(Path(image))
        band = header.get("band")
    if band is None:
        example = option("band", "LWIR")
        raise InputError(
            f"{name}: its band is not known; give that of the camera, such as {example}"
        )
    if "emissivity" not in given:
        example = option("emissivity", 0.95)
        raise InputError(
            f"{name}: contains no emissivity; give that of the object, such as {example}"
        )
    band = band_of(band)
    Bounds(is_positive=True).check(scale, "scale")
    kelvin = apparent(image, band, name, scale, offset)
    quantities = {}
    for key in filter(given.__contains__, QUANTITIES):  # in the order of a budget
        with nullcontext() if key in own else errors_of(f"{name}, unless you give another one"):
            quantities[key] = uncertain(given[key], key, QUANTITIES[key])
    places = [Region.parsed("spot", spot) for spot in spots]
    places += [Region.parsed("area", area) for area in areas]
    conditions = ImageConditions(**quantities)
    result = temperature_of(kelvin, sigma, band, conditions, name, camera, tuple(places))
    return replace(result, remarks=(*result.remarks, *remarks))


def named_image(image: ApparentTemperatures, sigma: float) -> tuple:
    """Return the name of an image, the image or its number, and the uncertainty of its temperatures
    [K]."""
    size = Bounds(lower=0, upper=LARGEST, unit="K")
    size.check(sigma, "sigma")
    if np.ndim(image):
        return "an array", np.asarray(image), sigma
    try:
        number, error = parsed(str(image))
    except ValueError:
        if Path(image).suffix.lower() not in SUFFIXES:
            raise InputError(
                f"'{image}' is no temperature in K, such as 310.4, and no image that can be read; "
                f"use {', '.join(SUFFIXES)}"
            ) from None
        return Path(image).name, image, sigma
    if error and sigma:
        raise InputError(f"'{image}' gives its uncertainty already; leave sigma out")
    size.check(error, f"uncertainty of '{image}'")
    return f"{number:g} K", np.array(number), error or sigma


def apparent(
    image: ApparentTemperatures, band: Band, name: str, scale: float, offset: float
) -> np.ndarray:
    """Apparent temperatures [K] of an image, with NaN for nothing."""
    kelvin = image
    if not isinstance(image, np.ndarray):
        is_exr = str(image).lower().endswith(".exr")
        kelvin, _ = read_values(str(image), CHANNEL if is_exr else None, TEMPERATURE, band)
    is_nothing = np.equal(kelvin, 0) & (offset == 0)
    kelvin = np.where(is_nothing, np.nan, np.asarray(kelvin, float) * scale + offset)
    if np.isinf(kelvin).any():
        raise InputError(f"{name}: has infinite values; write nan where there is no temperature")
    known = np.isfinite(kelvin)
    if not known.any():
        raise InputError(f"{name}: holds no temperature")
    counts, celsius = option("scale", 0.01), option("offset", 273.15)
    check_kelvin(
        name, kelvin[known], f"{counts} for counts of 0.01 K, {celsius} for degrees Celsius"
    )
    return np.where(known, kelvin, np.nan)


# `noise_components`, the noise of frames by time, row and column
# ---------------------------------------------------------------


def noise_components(frames: str | PathLike[str] | np.ndarray) -> NoiseComponents:
    """Components of three-dimensional noise of frames of a uniform scene, in the frames' unit. The
    components are the standard deviations of NVESD's model. sigma_tvh is the noise of each pixel in
    each frame. sigma_vh, sigma_v and sigma_h are the fixed pattern of pixels, rows and columns.
    sigma_tv, sigma_th and sigma_t are the noise of rows, columns and the whole frame that changes
    from frame to frame.

    Parameters
    ----------
    frames : path-like or ndarray, shape (frames, H, W)
        TIFF whose pages are the frames, or an array of the frames. A scene that is not uniform
        appears as a fixed pattern. Subtract its mean first.

    Returns
    -------
    NoiseComponents
        A component from n independent samples has a relative standard error of 1 / sqrt(2 n). For
        sigma_t from 200 frames this is 5 %. On average the other components do not contribute to
        it.

    Raises
    ------
    InputError
        If there are fewer than two frames, rows or columns, if frames are not alike or not finite,
        or if the file cannot be read.
    """
    is_path = isinstance(frames, (str, PathLike))
    return NoiseComponents.of(pages_of(str(frames)) if is_path else frames)


# `cavity`, the effective emissivity of a cavity
# ----------------------------------------------

TOLERANCE = 2e-4  # half of the 95 % interval, where the renderer traces the cavity
MOST_PATHS = 2**27  # after which the paths end without the tolerance


@exclusively
def cavity(
    description: str | PathLike[str] | Mapping,
    *,
    tolerance: float = TOLERANCE,
    seed: int = 0,
    progress: Progress | None = None,
) -> Cavity:
    """Effective emissivity of a cavity by wavelength, with its uncertainty.

    For diffuse walls of a cylinder, a cone, a cylinder with a cone or a sphere, the wall is divided
    into rings and the radiosity equations are solved (thesis 3.5.2). All other walls are traced by
    the renderer.

    Parameters
    ----------
    description : str, path-like or dict
        TOML file with the tables [shape], [wall], [view] and [sigma], or these tables; see
        `mi_lcair.laboratory.cavities.description`.
    tolerance : float
        Half of the 95 % interval of the effective emissivity, if the renderer traces it. Cavities
        that are computed with rings have an error below 2e-5, which is printed.
    seed : int
        The same seed gives the same result.
    progress : callable or None
        Called with (paths done, expected).

    Returns
    -------
    Cavity

    Raises
    ------
    InputError
        If the description cannot be used.
    """
    sampling = Sampling(tolerance=tolerance, max_spp=MOST_PATHS, seed=seed, progress=progress)
    return measured(CavityDescription.read(description), sampling)


# `audit`, the energy audit of a scene
# ------------------------------------


@exclusively
def audit(
    scene: SceneLike,
    paths: int = 262_144,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Audit:
    """Follow photons from the emitters of a scene until they are absorbed or escape.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its emitters must all be thermal, or the sun.
    paths : int
        Number of photon paths from each emitter.
    seed : int
        Seed of the random numbers.
    progress : callable, optional
        Called with (emitters done, all emitters).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Audit

    Raises
    ------
    InputError
        If the scene has an emitter that is not thermal, if the absorption of a surface without an
        emitter is unknown, or if a number cannot be used.
    """
    return audit_flux(
        scene_of(scene, parameters), Sampling(paths=paths, seed=seed, progress=progress)
    )
