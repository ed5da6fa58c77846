"""Bins of a band: hat functions of wavelength by which spectral materials are rendered.

A reflectance is sum_k c_k hat_k(lambda), with hats on even nodes. The coefficients are a
least-squares fit of the reflectance, clipped to 0..1, since values at the nodes would be worse by
orders of magnitude. Of radiation with the spectrum S, the part sum_k c_k m_k of the in-band
radiance is reflected, with the shares m_k = int S R hat_k dlambda / int S R dlambda and the
response R of the band.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy

from mi_lcair.physics.bands import Band
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from mi_lcair.physics.spectra.parameters import SAMPLES, SpectralParameters

COUNTS = (16, 32, 64)  # numbers of bins; the first whose binning error is small is taken
SMALL_ERROR = 2e-4  # allowed relative binning error where no tolerance says another
OF_TOLERANCE = 0.1  # allowed binning error, as a fraction of a tolerance
ANGLES_DEG = (0, 45, 60, 75)  # angles at which the binning error is projected
# Weights of the trapezoid rule on the grid of a band, in its steps
TRAPEZOIDS = np.append(np.append(0.5, np.ones(SAMPLES - 2)), 0.5)


@dataclass(frozen=True)
class Binning:
    """What decides on the number of bins of a render.

    recorded: number of bins whose spectral radiance is recorded; 0 for none. allowed: relative
    error that the bins may cause if their number is free. filters: transmittances between the scene
    and the result, at the grid of the band, see `filter_of`. reflections: largest number of them.
    """

    recorded: int = 0
    allowed: float = SMALL_ERROR
    filters: tuple[tuple[float, ...], ...] = ()
    reflections: int = 1


def filter_of(band: Band, detector: Band, wavelengths_um, transmittance) -> tuple[float, ...]:
    """A detector's response times the transmittance of air, at the grid of a band.

    wavelengths_um, transmittance: rows of the air; none for vacuum.
    """
    grid = Bins(band, COUNTS[0]).grid_um
    response = detector.response_at(grid)
    if len(wavelengths_um):
        response = response * np.interp(grid, wavelengths_um, transmittance)
    return tuple(response.tolist())


@dataclass(frozen=True, eq=False)
class Bins:
    """Hat functions on even nodes of a band.

    band: the band. count: number of hats.
    """

    band: Band
    count: int

    @cached_property
    def grid_um(self) -> np.ndarray:
        """Fine wavelengths [um], (SAMPLES,), at which spectra are integrated."""
        return np.linspace(self.band.lower_um, self.band.upper_um, SAMPLES)

    @cached_property
    def nodes_um(self) -> np.ndarray:
        """The nodes [um], (count,)."""
        return np.linspace(self.band.lower_um, self.band.upper_um, self.count)

    def hats(self, wavelengths_um: np.ndarray) -> np.ndarray:
        """The hats at wavelengths [um], (wavelengths, count)."""
        places = (wavelengths_um - self.band.lower_um) / (self.nodes_um[1] - self.nodes_um[0])
        return hats_at(places, self.count)

    def coefficients(self, values: np.ndarray) -> np.ndarray:
        """Coefficients (count, ...) of values on the grid (SAMPLES, ...), clipped to 0..1."""
        inverse, weighted = projection(self.count)
        of_hats = weighted @ values.reshape(SAMPLES, -1)
        return np.clip(inverse @ of_hats, 0, 1).reshape(self.count, *values.shape[1:])

    def means(self, spectrum: np.ndarray) -> np.ndarray:
        """Means of a spectrum on the grid (SAMPLES,), weighted with each hat, (count,)."""
        hats = grid_hats(self.count)
        return (spectrum * TRAPEZOIDS) @ hats / (TRAPEZOIDS @ hats)

    @cached_property
    def weights(self) -> np.ndarray:
        """Relative weights of the grid in an integral over the band, with its response."""
        return self.band.response_at(self.grid_um) * TRAPEZOIDS

    def shares(self, spectra: np.ndarray) -> np.ndarray:
        """Share of each bin in the in-band radiance of spectra on the grid (..., SAMPLES).

        They add up to 1; they are 0 for a spectrum without radiance in the band.
        """
        of_bin = (spectra * self.weights) @ grid_hats(self.count)
        total = of_bin.sum(axis=-1, keepdims=True)
        return np.divide(of_bin, total, out=np.zeros_like(of_bin), where=total > 0)


def hats_at(places: np.ndarray, count: int) -> np.ndarray:
    """The hats at places counted in nodes from the first one, (places, count)."""
    return np.maximum(1 - abs(np.subtract.outer(places, np.arange(count))), 0)


@lru_cache(maxsize=16)
def grid_hats(count: int) -> "scipy.sparse.csr_array":
    """The hats on the grid of any band, (SAMPLES, count); two of them overlap at each wavelength.

    Products with a dense matrix would take longer, and much longer where other processes run.
    """
    return scipy.sparse.csr_array(hats_at(np.linspace(0, count - 1, SAMPLES), count))


@lru_cache(maxsize=16)
def projection(count: int) -> "tuple[np.ndarray, scipy.sparse.csr_array]":
    """The matrices (count, count) and (count, SAMPLES) of the least-squares fit on any grid."""
    hats = grid_hats(count)
    weighted = scipy.sparse.csr_array(hats.multiply(TRAPEZOIDS[:, None]).T)
    return np.linalg.inv((weighted @ hats).toarray()), weighted


def reflectances(spectrum: SpectralParameters, wavelengths_um: np.ndarray) -> np.ndarray:
    """Numbers in which the reflectance of a material is linear, (wavelengths, numbers).

    Sandford and Robertson's: absorbed (epsilon + rho_d) / G and floor rho_d / G; grey: the
    reflectance; microfacet: the Fresnel reflectance at ANGLES_DEG; known by angle: the reflectance
    there. All lie in 0..1.
    """
    if spectrum.by_angle is not None:
        return spectrum.facet_reflectance(wavelengths_um, np.cos(np.radians(ANGLES_DEG)))
    given = spectrum.at(wavelengths_um)
    if spectrum.model.name == "grey":
        return 1 - given["emissivity"][:, None]
    if spectrum.model.name == "microfacet":
        return spectrum.facet_reflectance(wavelengths_um, np.cos(np.radians(ANGLES_DEG)))
    G = of_falloff(spectrum)
    return np.stack([given["epsilon"] + given["rho_d"], given["rho_d"]], axis=1) / G


def of_falloff(spectrum: SpectralParameters) -> float:
    """G(b) of Sandford and Robertson, Eq 2.18."""
    from drjit.llvm.ad import Float64

    return float(sr.G(Float64(spectrum.common["b"]))[0])


def emissivities(spectrum: SpectralParameters, numbers: np.ndarray) -> np.ndarray:
    """Emissivities (..., angles) at ANGLES_DEG from `reflectances` (..., numbers)."""
    if spectrum.by_angle is not None:
        return 1 - numbers
    if spectrum.model.name == "grey":
        return np.repeat(1 - numbers, len(ANGLES_DEG), axis=-1)
    if spectrum.model.name == "microfacet":
        return (1 - numbers) * (1 - spectrum.common["rho_d"] * (1 - numbers))
    theta, b = np.radians(ANGLES_DEG), spectrum.common["b"]
    g = 1 / (1 + (b * np.tan(theta)) ** 2)
    return (numbers[..., :1] - numbers[..., 1:]) * g


def binning_error(
    bins: Bins, materials: list[SpectralParameters], spectra: np.ndarray, reflections: int = 1
) -> float:
    """Largest error of emitted and reflected radiance that the bins cause, relative.

    For sources of these spectra on the grid (sources, SAMPLES): emission of each material relative
    to itself, emission of one material reflected by another relative to the emission, reflection of
    each source relative to the source, and the radiance in a closed room of one material from the
    emission of another up to a number of reflections, at ANGLES_DEG.
    """
    exact, binned = [], []
    for material in materials:
        numbers = reflectances(material, bins.grid_um)
        exact.append(emissivities(material, numbers))
        binned.append(emissivities(material, bins.coefficients(numbers)))
    exact, binned = np.stack(exact), np.stack(binned)  # (materials, wavelengths, angles)
    fine = spectra * bins.weights
    total = fine.sum(axis=-1)
    shares, fine = bins.shares(spectra), fine / np.where(total > 0, total, 1)[:, None]
    emitted = np.einsum("sl,mla->sma", fine, exact)
    error = abs(np.einsum("sk,mka->sma", shares, binned) - emitted)
    errors = [error, error / np.maximum(emitted, 1e-3)]

    def in_room(emissivity):  # sum of the powers of the reflectance
        absorbed = 1 - (1 - emissivity) ** (reflections + 1)
        many = np.full_like(emissivity, reflections + 1)
        return np.divide(absorbed, emissivity, out=many, where=emissivity > 0)

    for k, other in enumerate(exact):
        room = np.einsum("sl,mla,la->sma", fine, exact, in_room(other))
        of_bins = np.einsum("sk,mka,ka->sma", shares, binned, in_room(binned[k]))
        errors.append(abs(of_bins - room) / np.maximum(room, 1e-3))
        twice = np.einsum("sl,mla,la->sma", fine, exact, 1 - other)
        of_bins = np.einsum("sk,mka,ka->sma", shares, binned, 1 - binned[k])
        errors.append(abs(of_bins - twice) / np.maximum(emitted, 1e-3))
    return float(np.max(errors))


def bins_for(
    band: Band, materials: list[SpectralParameters], spectra, counts=COUNTS, binning=Binning()
) -> tuple[Bins, float]:
    """The first of some counts whose binning error is allowed, or the last; its error.

    spectra: function of wavelengths [um]: the spectral radiances of the sources (sources, n).
    binning: the allowed error, and filters through which the sources are seen too.
    """
    radiances = spectra(Bins(band, COUNTS[0]).grid_um)
    radiances = np.concatenate([radiances, *(radiances * row for row in binning.filters)])
    for count in counts:
        bins = Bins(band, count)
        error = binning_error(bins, materials, radiances, binning.reflections)
        if error <= binning.allowed:
            break
    return bins, error
