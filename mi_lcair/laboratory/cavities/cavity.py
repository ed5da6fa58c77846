"""Effective emissivity of a cavity and its uncertainty, by the method that its walls allow."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mi_lcair.errors import InputError, errors_of
from mi_lcair.estimate import Contribution, Estimate, deviation, slope
from mi_lcair.laboratory.cavities import paths, rings
from mi_lcair.laboratory.cavities.description import SIGMA, CavityDescription, ViewTable
from mi_lcair.laboratory.cavities.rings import gouffe
from mi_lcair.laboratory.cavities.shape import PROFILE_RINGS, CavityWall, OwnMesh, Shape
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.materials import hemispherical_emissivity
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.results import Result, contributions, entry, summary_of
from mi_lcair.sections import Table

# The effective emissivity of a cavity, as a result
# -------------------------------------------------

METHODS = {"rings": "radiosity of diffuse rings", "paths": "paths of the renderer"}


@dataclass(frozen=True, repr=False)
class Cavity(Result):
    """Effective emissivity of a cavity by wavelength, with its uncertainty.

    It is the mean radiance of the rays of the view, divided by the radiance of a blackbody at the
    reference temperature.

    Attributes
    ----------
    name : str
    shape : Shape or OwnMesh
    wavelengths_um : ndarray, shape (w,)
    wall_emissivity : ndarray, shape (w,)
        Hemispherical emissivity of the wall.
    estimate : Estimate
        Effective emissivity, (w,); with a temperature profile it may exceed 1. The
        contribution "numerical error" is that of the computation. All are independent.
    reference : float
        Temperature of the reference [K].
    method : str
        "rings" or "paths".
    gouffe : ndarray, shape (w,)
        Gouffé's emissivity, which holds for an isothermal diffuse cavity seen from all directions.
    view : ViewTable
    depths, kelvin : ndarray, shape (n,)
        Temperature of the wall by depth [m, K].
    remarks : tuple of str
    """

    name: str
    shape: Shape | OwnMesh = entry("shape", "kind")
    wavelengths_um: np.ndarray
    wall_emissivity: np.ndarray
    estimate: Estimate
    reference: float = entry("reference_K")
    method: str
    gouffe: np.ndarray
    view: ViewTable = entry()
    depths: np.ndarray = entry("depths_m")
    kelvin: np.ndarray = entry("wall_K")
    remarks: tuple[str, ...] = ()

    kind = "cavity"
    drawn_by = "mi_lcair.show.pictures.cavity:figure"
    computed = {"view": "seen"}

    @property
    def effective(self) -> np.ndarray:
        """Effective emissivity, (w,)."""
        return self.estimate.value

    @property
    def sigma(self) -> np.ndarray:
        """Combined standard uncertainty, with the error of the computation, (w,)."""
        return self.estimate.standard_error

    @property
    def numerical(self) -> np.ndarray:
        """Standard error of the computation, (w,)."""
        return self.estimate["numerical error"].contribution

    @property
    def first(self) -> Estimate:
        """The effective emissivity at the first wavelength."""
        return self.estimate.reduced(lambda values: float(values[0]))

    @property
    def seen(self) -> str:
        """The view in words."""
        view = self.view
        spot = "aperture" if view.spot_m is None else f"spot of {view.spot_m:g} m"
        if view.distance_m is not None:
            return f"{spot} from {view.distance_m:g} m"
        if view.direction == "hemisphere":
            return f"{spot}, all directions"
        return (
            f"{spot}, {f'{view.angle_deg:g} degrees from the axis' if view.angle_deg else 'normal'}"
        )

    def summary(self) -> str:
        """One line with the effective emissivity at the first wavelength."""
        text = f"effective emissivity of {self.name}, {self.seen}: {self.first}"
        if np.ptp(self.effective) == 0:
            return text
        return f"{text} at {self.wavelengths_um[0]:g} um"

    def facts(self) -> Iterator[Any]:
        """The effective emissivity by wavelength, the method, and the budget."""
        coldest, hottest = self.kelvin.min(), self.kelvin.max()
        wall = f"{coldest:g} K" if coldest == hottest else f"{coldest:g} to {hottest:g} K"
        yield summary_of(self)
        yield "shape", f"{self.shape.kind.replace('_', ' with ')}, {self.shape.depth:g} m deep"
        yield "view", self.seen
        yield "wall", f"{wall}, compared with a blackbody of {self.reference:g} K"
        yield "method", METHODS[self.method]
        yield Table.of(self.columns())
        if len(self.estimate.contributions) > 1:
            yield contributions(self.first)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each wavelength."""
        return {
            "wavelength_um": self.wavelengths_um,
            "wall_emissivity": self.wall_emissivity,
            "effective_emissivity": self.effective,
            "sigma": self.sigma,
            "numerical_error": self.numerical,
            "gouffe": self.gouffe,
        }


BAND = "2-14"  # band in which the renderer traces grey walls, which any band would do
UNITS = {"emissivity": "1", "specular": "1", "angle_deg": "degrees"}
LIMITS = {"emissivity": (1e-6, 1.0), "specular": (0.0, 1.0)}


def measured(cavity: CavityDescription, sampling: Sampling) -> Cavity:
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
            f"{traced} paths give half of a 95 % interval of {half:.2g}, more than the tolerance "
            f"of {sampling.tolerance:g}"
        )
    for quantity in SIGMA:
        if quantity not in cavity.sigma:
            continue
        known = cavity.value_of(quantity)
        sigma = deviation(quantity, cavity.sigma[quantity], known or 0.0)
        limits = np.array(LIMITS.get(quantity, (-np.inf, np.inf)))
        largest = cavity.reference if quantity.endswith("_K") else min(np.ptp(limits), known or 1.0)
        if sigma > largest:
            raise InputError(f"sigma: {quantity} = {sigma:g}; must be at most {largest:g}")

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


def is_diffuse(cavity: CavityDescription) -> bool:
    """Whether rings hold for the cavity: a diffuse body of revolution."""
    is_grey = all(isinstance(surface, float) for surface in cavity.surfaces())
    return not isinstance(cavity.shape, OwnMesh) and is_grey and not cavity.wall.specular


def wall_emissivity(cavity: CavityDescription) -> np.ndarray:
    """Hemispherical emissivity of the wall at each wavelength."""
    return np.array(
        [
            surface
            if isinstance(surface, float)
            else hemispherical_emissivity(surface.name, band_of(surface.band))
            for surface in cavity.surfaces()
        ]
    )


def areas(cavity: CavityDescription) -> tuple[float, float, float]:
    """Areas s, S and S0 of thesis Table 3.3 [m^2]."""
    shape = cavity.shape
    is_own = isinstance(shape, OwnMesh)
    s = shape.aperture_area if is_own else np.pi * shape.aperture**2
    return s, shape.wall_area + s, np.pi * shape.depth**2


def effective_emissivity(cavity: CavityDescription, method: str, sampling: Sampling) -> tuple:
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


def traced_emissivity(cavity: CavityDescription, surface, emission, sampling: Sampling) -> tuple:
    """Effective emissivity, its standard error and the number of paths, by the renderer.

    surface: emissivity of the wall, or a `NamedMaterial`. emission: spectral radiance of
    blackbodies at temperatures [K], as a ratio to that at the reference.
    """
    is_own = isinstance(cavity.shape, OwnMesh)
    is_isothermal = cavity.is_isothermal
    wall = (
        cavity.shape.triangles
        if is_own
        else CavityWall.of_shape(cavity.shape, 1 if is_isothermal else PROFILE_RINGS)
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
