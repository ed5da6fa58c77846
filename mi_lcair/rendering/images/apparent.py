"""Apparent radiance of each pixel: the model's radiance after transmission by the atmosphere."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import polynomials, spectral_radiance
from mi_lcair.physics.spectra.bins import filter_of
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.rendering.scene import Scene

REST = "rest"  # radiance of unknown spectrum


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
    the sensor, as in a sky table. Each spectrum has its own transmittance. Light that has crossed
    air before the target, such as sunlight, gets the amounts of absorbers of both paths. Radiance
    of unknown spectrum (from `closure` or from an emitter that is not thermal) gets the mean
    transmittance of the band.

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
    air = Arrival.of(sources, band, band, atmosphere, ranges)
    path, arrives = np.zeros((2, len(share)))
    path[on] = air.path * share[on]
    arrives[on] = air.of_parts({name: values[on] for name, values in parts.items()})
    return {"apparent.Y": radiance - parts["target"] + arrives + path, "path.Y": path}


@contextmanager
def through(scene: Scene, atmosphere: Atmosphere | None, range_m: float | None) -> Iterator[None]:
    """Context manager in which the bins of wavelength are chosen for what passes the air.

    range_m: range of the model [m]. None: the longest one of the atmosphere.
    """
    integrator = scene.mi.integrator()
    before = integrator.filters
    if atmosphere is not None and not (atmosphere.is_vacuum or scene.band.is_total):
        path = atmosphere.path(atmosphere.ranges_m[-1] if range_m is None else range_m)
        air = path.wavelengths_um, path.transmittance
        integrator.filters = (filter_of(scene.band, scene.band, *air),)
    try:
        yield
    finally:
        integrator.filters = before


@dataclass(frozen=True)
class Arrival:
    """What arrives at a detector through the air, at some ranges, for the channels of a render.

    Attributes
    ----------
    in_band : dict of str to float
        In-band radiance of the render for a unit of each channel `target.source.N` or
        `target.wavelength.N`.
    arrives : mapping of str to ndarray, shape (r,)
        In-band value at the detector for a unit of each channel. Channel "rest" is the radiance
        that the others leave.
    path : ndarray, shape (r,)
        In-band path radiance at the detector.
    """

    in_band: dict[str, float]
    arrives: Mapping[str, np.ndarray]
    path: np.ndarray

    @staticmethod
    def of(
        sources: Sources,
        band: Band,
        detector: Band,
        atmosphere: Atmosphere,
        ranges_m: np.ndarray,
        extrapolate: bool = False,
    ) -> "Arrival":
        """What arrives through an atmosphere from these ranges, m.

        Parameters
        ----------
        sources : Sources
            Sources of the render, by spectrum.
        band : Band
            Band of the render.
        detector : Band
            Band of the detector, within that of the render. Its response may have any unit, such as
            electrons per radiance.
        atmosphere : Atmosphere
        ranges_m : ndarray, shape (r,)
        extrapolate : bool
            Whether ranges beyond the atmosphere's table are allowed.
        """
        x, same = atmosphere.wavelengths_um, detector is band
        spectra, in_band, at_detector = {}, {}, {}
        for k, source in enumerate(sources.list):
            if source.name is not None:
                name = f"target.source.{k}"
                spectra[name] = source.spectrum or spectral_radiance(x, source.temperature)
                in_band[name] = 1.0
                at_detector[name] = 1.0 if same else in_band_ratio(source, detector, band)
        nodes = sources.wavelengths_um
        weights, detected = (
            polynomials(nodes, rule.wavelengths_um) @ rule.weights_um for rule in (band, detector)
        )
        for k, row in enumerate(polynomials(nodes, x)):
            name = f"target.wavelength.{k}"
            spectra[name], in_band[name], at_detector[name] = row, weights[k], detected[k]
        spectra[REST] = np.ones(len(x))
        at_detector[REST] = 1.0 if same else detector.weights_um.sum() / band.weights_um.sum()
        transmittance = atmosphere.band_transmittance(
            detector, list(spectra.values()), ranges_m, extrapolate
        )
        return Arrival(
            in_band,
            {name: at_detector[name] * row for name, row in zip(spectra, transmittance)},
            atmosphere.band_path_radiance(detector, ranges_m, extrapolate),
        )

    def of_parts(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """In-band value at the detector of the model's radiance without the path.

        parts: channels by name, (r,) each, with `target` and those of `in_band`.
        """
        rest = parts["target"] - sum(
            (parts[name] * unit for name, unit in self.in_band.items()), start=0.0
        )
        known = (self.arrives[name] * parts[name] for name in self.in_band)
        return sum(known, start=self.arrives[REST] * rest)


def in_band_ratio(source: Source, detector: Band, band: Band) -> float:
    """In-band value of a source at a detector, divided by its in-band radiance in a band."""
    radiance = source.in_band_radiance(band)
    return source.in_band_radiance(detector) / radiance if radiance > 0 else 0.0
