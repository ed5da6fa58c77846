"""Apparent radiance of each pixel: the model's radiance after transmission by the atmosphere."""

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from mi_lcair.physics.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.plugins.emission.sources import Source, Sources


def apparent(
    radiance: np.ndarray,
    parts: dict[str, np.ndarray],
    sources: Sources,
    band: Band,
    atmosphere: Atmosphere,
    range_m: float | None,
) -> dict[str, np.ndarray]:
    """Apparent radiance of each pixel and the path radiance in it.

    The atmosphere is applied to the model only. The background radiance is assumed to be given at
    the sensor, as in a sky table. Each spectrum has its own transmittance. Radiance of unknown
    spectrum (from `closure` or from an emitter that is not thermal) gets the mean transmittance of
    the band.

    Parameters
    ----------
    radiance : numpy.ndarray
        Radiance of each pixel without the atmosphere, (P,) [W m^-2 sr^-1].
    parts : dict
        Channels by name, (P,) each, recorded with split "target" and by spectrum.
    sources : Sources
        The sources that the channels `target.source.N` belong to.
    band : Band
    atmosphere : Atmosphere
    range_m : float or None
        Range of the whole model [m]. None: each pixel's range along the first ray. It is the mean
        range of a pixel that shows several surfaces.

    Returns
    -------
    dict
        `apparent.Y` and `path.Y`, (P,) each [W m^-2 sr^-1].

    Raises
    ------
    InputError
        For a range that the atmosphere does not cover.
    """
    share = parts["target.hit"]
    on = share > 0
    ranges = (
        np.full(on.sum(), range_m) if range_m is not None else parts["target.range"][on] / share[on]
    )
    x = atmosphere.wavelengths_um
    spectra = {
        f"target.source.{k}": spectrum_of(source, x)
        for k, source in enumerate(sources.list)
        if source.name is not None
    }
    in_band = {name: parts[name][on] for name in spectra}
    if len(nodes := sources.wavelengths_um):
        # The spectrum is a polynomial through the nodes, a sum of basis polynomials. Each basis
        # polynomial is treated as one spectrum.
        basis = BarycentricInterpolator(nodes, np.eye(len(nodes)))
        weights = basis(band.wavelengths_um).T @ band.weights_um
        for k, weight in enumerate(weights):
            spectra[f"target.wavelength.{k}"] = basis(x)[:, k] if len(x) else x
            in_band[f"target.wavelength.{k}"] = parts[f"target.wavelength.{k}"][on] * weight
    spectra["rest"] = np.ones(len(x))
    in_band["rest"] = parts["target"][on] - sum(in_band.values())

    path, arrives = np.zeros((2, len(share)))
    path[on] = atmosphere.band_path_radiance(band, ranges) * share[on]
    arrives[on] = np.sum(
        atmosphere.band_transmittance(band, np.array(list(spectra.values())), ranges)
        * list(in_band.values()),
        axis=0,
    )
    return {"apparent.Y": radiance - parts["target"] + arrives + path, "path.Y": path}


def spectrum_of(source: Source, wavelengths_um) -> np.ndarray:
    """Spectral radiance of a source at some wavelengths [W m^-2 sr^-1 um^-1]."""
    return (
        spectral_radiance(wavelengths_um, source.temperature)
        if source.spectrum is None
        else source.spectrum.at(wavelengths_um)
    )
