"""Spectral radiance of each pixel, from sums by bin of wavelength or by source."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, shown
from mi_lcair.formats import spectral_channel
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import polynomials, spectral_radiance
from mi_lcair.physics.spectra.bins import Bins, filter_of
from mi_lcair.physics.spectral_table import LONGEST_UM
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.pixels import pixel_errors
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals

# Apparent radiance of each pixel: the model's radiance after transmission by the atmosphere
# ------------------------------------------------------------------------------------------

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
        known = (self.arrives[name] * parts[name] for name in self.in_band)
        return sum(known, start=self.arrives[REST] * self.rest(parts))

    def rest(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """Radiance of the model of unknown spectrum, from the same channels, (r,)."""
        known = (parts[name] * unit for name, unit in self.in_band.items())
        return parts["target"] - sum(known, start=0.0)


def in_band_ratio(source: Source, detector: Band, band: Band) -> float:
    """In-band value of a source at a detector, divided by its in-band radiance in a band."""
    radiance = source.in_band_radiance(band)
    return source.in_band_radiance(detector) / radiance if radiance > 0 else 0.0


MOST_BINS = 512  # wavelengths of a spectral image
BINS = Bounds(lower=2, upper=MOST_BINS)
# Header of spectral images: A. Fichet, R. Pacanowski and A. Wilkie, JCGT 10(3), 2021
LAYOUT = {"spectralLayoutVersion": "1.0", "emissiveUnits": "W.m^-2.sr^-1.um^-1"}


def even_wavelengths(text: str) -> tuple[str, int]:
    """Band and number of bins of the wavelengths START:STOP:STEP [um], such as "8:12:0.1".

    STOP is the last wavelength if steps meet it. Raises InputError for a text that is none.
    """
    try:
        start, stop, step = map(float, text.split(":"))
        count = 1 + int((stop - start) / step + 1e-6)
        last = start + (count - 1) * step
        is_usable = 0 < start < last <= LONGEST_UM and 2 <= count <= MOST_BINS
    except (ValueError, ZeroDivisionError, OverflowError):
        is_usable = False
    if not is_usable:
        raise InputError(
            f"wavelengths = {shown(text)}; must be START:STOP:STEP in um with 2 to {MOST_BINS} "
            "wavelengths, such as 8:12:0.1"
        )
    return f"{start:.9g}-{last:.9g}", count


def check_bins(scene: Scene, bins: int, errors_um: Sequence[float], atmosphere) -> None:
    """Raise InputError for a spectral image that cannot be rendered."""
    if errors_um and not bins:
        raise InputError("errors_um needs a spectral image; give its number of bins")
    if not bins:
        return
    if isinstance(bins, bool) or not isinstance(bins, Integral):
        raise InputError(f"bins = {bins!r}; must be a whole number, 2 to {MOST_BINS}")
    BINS.check(bins, "bins")
    scene.band.check_limits("bins")
    if atmosphere is not None:
        raise InputError("bins: a spectral image has no air; leave out the atmosphere")
    of_band = Bounds(lower=scene.band.lower_um, upper=scene.band.upper_um, unit="um")
    if not isinstance(errors_um, Iterable):
        raise InputError(f"errors_um = {errors_um!r} must be a sequence such as [4.2]")
    of_band.check_all(np.array(errors_um), lambda k: "errors_um")


def spectral_measurands(scene: Scene, bins: int, parts: Sequence[str]) -> Measurands:
    """What is recorded for a spectral image; parts: of its radiance in band, see `Channels`.

    Where all materials are constant in the band, the sources are enough.
    """
    if has_spectral_materials(scene.mi):
        return Measurands.of("image", bins=bins, parts=parts)
    return Measurands.of("image", by_spectrum=True, parts=parts)


def spectral_channels(
    total: Totals, bins: Bins, size: tuple[int, int], errors_um: Sequence[float]
) -> dict[str, np.ndarray]:
    """Mean spectral radiance around each node, by channel, (P,) each [W m^-2 sr^-1 um^-1].

    The radiance beyond the last reflection, of a closure, counts only for spectral materials.

    size: rows and columns of the image. errors_um: wavelengths of which the nearest nodes get
    channels of standard errors [um]; `total` must then hold its sums by randomisation.
    """
    names = [spectral_channel(wavelength) for wavelength in bins.nodes_um]
    if total.emitters.sources.by_spectrum:
        add_bins(total, bins)
    channels = {name: total.mean(f"bin.{k}") for k, name in enumerate(names)}
    for wavelength in errors_um:
        k = int(np.argmin(np.abs(bins.nodes_um - wavelength)))
        channels[f"stderr.{names[k]}"] = pixel_errors(total, size, f"bin.{k}")
    return channels


def add_bins(total: Totals, bins: Bins) -> None:
    """Add the sums of the bins to totals, from those of the sources."""
    sources, parts = total.emitters.sources, {}
    for k, source in enumerate(sources.list):
        if source.name is not None and source.in_band > 0:
            parts[f"source.{k}"] = source.radiance(bins.grid_um) / source.in_band
    basis = polynomials(sources.wavelengths_um, bins.grid_um)
    parts |= {f"wavelength.{k}": row for k, row in enumerate(basis)}
    means = {name: bins.means(spectrum) for name, spectrum in parts.items()}
    for k in range(bins.count):
        terms = (mean[k] * total.sums[name] for name, mean in means.items())
        total.sums[f"bin.{k}"] = sum(terms, start=np.zeros((len(total.valid), 1)))
