"""Effective emissivity of a cavity and its uncertainty, by the method that its walls allow."""

from dataclasses import replace

import numpy as np

from mi_lcair.cavities import paths, rings
from mi_lcair.cavities.cavity_result import Cavity
from mi_lcair.cavities.description import SIGMA, Description
from mi_lcair.cavities.gouffe import gouffe
from mi_lcair.cavities.walls import PROFILE_RINGS, OwnMesh, Wall
from mi_lcair.errors import errors_of
from mi_lcair.estimate import Contribution, Estimate, deviation, slope
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.materials import hemispherical_emissivity
from mi_lcair.rendering.sampling import Sampling

BAND = "2-14"  # band in which the renderer traces grey walls, which any band would do
UNITS = {"emissivity": "1", "specular": "1", "angle_deg": "degrees"}
LIMITS = {"emissivity": (1e-6, 1.0), "specular": (0.0, 1.0)}


def measured(cavity: Description, sampling: Sampling) -> Cavity:
    """The effective emissivity of a cavity with its budget.

    Diffuse walls of a body of revolution are solved by rings, all others by the renderer.
    Each sensitivity is the difference between the results at plus and minus one standard
    uncertainty (JCGM 100:2008, 5.1.3, note 2), of the same random numbers.
    """
    method = "rings" if is_diffuse(cavity) else "paths"
    value, error, traced = effective_emissivity(cavity, method, sampling)
    repeated = replace(sampling, paths=traced, tolerance=None, max_spp=None) if traced else sampling
    contributions, remarks = [Contribution("numerical error", error)], []
    if traced and (half := paths.INTERVAL * error.max()) > sampling.tolerance:
        remarks.append(
            f"{traced} paths end with half an interval of {half:.2g}, more than the tolerance of "
            f"{sampling.tolerance:g}"
        )
    for quantity in SIGMA:
        if quantity not in cavity.sigma:
            continue
        known = cavity.value_of(quantity)
        sigma = deviation(quantity, cavity.sigma[quantity], known or 0.0)
        limits = np.array(LIMITS.get(quantity, (-np.inf, np.inf)))

        def changed(change, name=quantity):
            return effective_emissivity(cavity.changed(name, change), method, repeated)[0]

        with errors_of(f"sigma: {quantity} = {sigma:g}"):
            of_quantity = slope(changed, 0.0, sigma, limits - (known or 0.0))
        unit = UNITS.get(quantity, quantity.rpartition("_")[2])
        contributions.append(Contribution.of(quantity, sigma, of_quantity, value=known, unit=unit))
    return Cavity(
        name=cavity.name,
        shape=cavity.shape,
        wavelengths_um=cavity.wavelengths_um,
        wall_emissivity=wall_emissivity(cavity),
        estimate=Estimate.of(value, "1", contributions),
        reference=cavity.reference,
        method=method,
        gouffe=gouffe(wall_emissivity(cavity), *areas(cavity)),
        view=cavity.seen,
        depths=np.linspace(0, cavity.shape.depth, 101),
        kelvin=cavity.temperature(np.linspace(0, cavity.shape.depth, 101)),
        remarks=tuple(remarks),
    )


def is_diffuse(cavity: Description) -> bool:
    """Whether rings hold for the cavity: a diffuse body of revolution."""
    is_grey = all(isinstance(surface, float) for surface in cavity.surfaces())
    return not isinstance(cavity.shape, OwnMesh) and is_grey and not cavity.wall.specular


def wall_emissivity(cavity: Description) -> np.ndarray:
    """Hemispherical emissivity of the wall at each wavelength."""
    return np.array(
        [
            surface
            if isinstance(surface, float)
            else hemispherical_emissivity(surface.name, band_of(surface.band))
            for surface in cavity.surfaces()
        ]
    )


def areas(cavity: Description) -> tuple[float, float, float]:
    """Areas s, S and S0 of thesis Table 3.3 [m^2]."""
    shape = cavity.shape
    is_own = isinstance(shape, OwnMesh)
    s = shape.aperture_area if is_own else np.pi * shape.aperture**2
    return s, shape.wall_area + s, np.pi * shape.depth**2


def effective_emissivity(cavity: Description, method: str, sampling: Sampling) -> tuple:
    """Effective emissivity and its numerical error by wavelength, and the number of paths.

    method: "rings" or "paths". Returns arrays of shape (w,); paths is None for rings.
    """
    wavelengths, reference = cavity.wavelengths_um, cavity.reference
    scale = spectral_radiance(wavelengths, reference)
    value, error = np.empty((2, len(wavelengths)))
    traced = None
    surfaces = cavity.surfaces()
    for number, surface in enumerate(surfaces):
        if surface in surfaces[:number]:
            continue
        index = [k for k, of_wavelength in enumerate(surfaces) if of_wavelength == surface]

        def emission(kelvin, index=index):
            return spectral_radiance(wavelengths[index], np.reshape(kelvin, (-1, 1))) / scale[index]

        if method == "rings":
            value[index], error[index] = rings.effective_emissivity(
                cavity.shape,
                surface,
                lambda depths: emission(cavity.temperature(depths)),
                cavity.view,
            )
        else:
            value[index], error[index], traced = traced_emissivity(
                cavity, surface, emission, sampling
            )
    return value, error, traced


def traced_emissivity(cavity: Description, surface, emission, sampling: Sampling) -> tuple:
    """Effective emissivity, its standard error and the number of paths, by the renderer.

    surface: emissivity of the wall, or a `Material`. emission: spectral radiance of blackbodies at
    temperatures [K], as a ratio to that at the reference.
    """
    is_own = isinstance(cavity.shape, OwnMesh)
    is_isothermal = cavity.is_isothermal
    wall = (
        cavity.shape.triangles
        if is_own
        else Wall.of_shape(cavity.shape, 1 if is_isothermal else PROFILE_RINGS)
    )
    band, radiator = BAND, {}
    if isinstance(surface, float):
        radiator = {"emissivity": surface}
        lowest = surface
        bsdf = {
            "type": "blendbsdf",
            "weight": cavity.wall.specular,
            "diffuse": {"type": "diffuse", "reflectance": _uniform(1 - surface)},
            "mirror": {
                "type": "conductor",
                "material": "none",
                "specular_reflectance": _uniform(1 - surface),
            },
        }
    else:
        band = BAND if surface.band == "any" else surface.band
        lowest = hemispherical_emissivity(surface.name, band_of(band)) / 2
        bsdf = {"type": "material", "material": surface.name, "band": band}
    kelvin, excess = None, None
    if not is_isothermal:
        kelvin = paths.rounded(cavity.temperature(np.clip(wall.depths(), 0, cavity.shape.depth)))

        def excess(temperature):
            shape = emission(300.0)[0]
            return np.full_like(shape, -1) if temperature is None else emission(temperature)[0] - 1

    scene = paths.scene_of_wall(wall, bsdf, radiator, kelvin, paths.reflections(lowest), band)
    return paths.effective_emissivity(scene, cavity.view, excess, sampling)


def _uniform(value: float) -> dict:
    return {"type": "spectrum", "value": value}
