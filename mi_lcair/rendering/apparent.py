"""A picture through the air: what of the model's radiance arrives at a sensor, pixel by pixel."""

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
    """Radiance [W m^-2 sr^-1] of each pixel as it arrives, and what of it the path itself adds:
    apparent.Y and path.Y.

    radiance: of each pixel; parts: by name, as `plugins.channels` records them with split "target"
    and by spectrum. range_m: to all of the model; None: in each pixel its own, along the first ray
    (a pixel's mean, where it shows several surfaces). Only the model is seen through the air: what
    is recorded of its background is taken to be what arrives, as a sky table says it. Each spectrum
    has its own transmittance; radiance of unknown spectrum (of `closure`, of an emitter that is not
    thermal) the band's mean. InputError for a range that the atmosphere does not cover.
    """
    share = parts["target.hit"]
    on = share > 0
    ranges = (
        np.full(on.sum(), range_m) if range_m is not None else parts["target.range"][on] / share[on]
    )
    x = atmosphere.wavelengths_um
    told = {
        f"target.source.{k}": spectrum_of(source, x)
        for k, source in enumerate(sources.list)
        if source.name is not None
    }
    in_band = {name: parts[name][on] for name in told}
    if len(nodes := sources.wavelengths_um):
        # a polynomial through the nodes is a sum of basis polynomials, each of them a spectrum
        basis = BarycentricInterpolator(nodes, np.eye(len(nodes)))
        weights = basis(band.wavelengths_um).T @ band.weights_um
        for k, weight in enumerate(weights):
            told[f"target.wavelength.{k}"] = basis(x)[:, k] if len(x) else x
            in_band[f"target.wavelength.{k}"] = parts[f"target.wavelength.{k}"][on] * weight
    told["rest"] = np.ones(len(x))
    in_band["rest"] = parts["target"][on] - sum(in_band.values())

    path, arrives = np.zeros((2, len(share)))
    path[on] = atmosphere.band_path_radiance(band, ranges) * share[on]
    arrives[on] = np.sum(
        atmosphere.band_transmittance(band, np.array(list(told.values())), ranges)
        * list(in_band.values()),
        axis=0,
    )
    return {"apparent.Y": radiance - parts["target"] + arrives + path, "path.Y": path}


def spectrum_of(source: Source, wavelengths_um) -> np.ndarray:
    return (
        spectral_radiance(wavelengths_um, source.temperature)
        if source.spectrum is None
        else source.spectrum.at(wavelengths_um)
    )
