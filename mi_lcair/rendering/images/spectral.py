"""Spectral radiance of each pixel, from sums by bin of wavelength or by source."""

import numpy as np
import scipy

from mi_lcair.errors import InputError, shown
from mi_lcair.formats.channels import spectral_channel
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.physics.spectral_table import LONGEST_UM
from mi_lcair.plugins.bins.by_bin import has_spectral_materials
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals

MOST_BINS = 512  # wavelengths of a spectral image
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


def check_bins(scene: Scene, bins: int, atmosphere: Atmosphere | None) -> None:
    """Raise InputError for a spectral image that cannot be rendered."""
    if not 2 <= bins <= MOST_BINS:
        raise InputError(f"bins = {bins}; must be 2 to {MOST_BINS}")
    if scene.band.is_total:
        raise InputError("bins: band total has no wavelengths; choose a band with limits")
    if atmosphere is not None:
        raise InputError("bins: a spectral image has no air; leave out the atmosphere")


def spectral_measurands(scene: Scene, split: str | None, bins: int) -> Measurands:
    """What is recorded for a spectral image; split: of the other channels, see `Channels`.

    Where all materials are constant in the band, the sources are enough.
    """
    if has_spectral_materials(scene.mi):
        return Measurands.of(split, bins=bins)
    return Measurands.of("target", by_spectrum=True)


def spectral_channels(total: Totals, bins: Bins) -> dict[str, np.ndarray]:
    """Mean spectral radiance around each node, by channel, (P,) each [W m^-2 sr^-1 um^-1].

    The radiance beyond the last reflection, of a closure, counts only for spectral materials.
    """
    names = [spectral_channel(wavelength) for wavelength in bins.nodes_um]
    if not total.emitters.sources.by_spectrum:
        return {name: total.mean(f"bin.{k}") for k, name in enumerate(names)}
    sources, parts = total.emitters.sources, {}
    for k, source in enumerate(sources.list):
        if source.name is not None and source.in_band > 0:
            table = source.spectrum
            radiance = (
                spectral_radiance(bins.grid_um, source.temperature)
                if table is None
                else table.at(bins.grid_um)
            )
            parts[f"source.{k}"] = radiance / source.in_band
    nodes = sources.wavelengths_um
    if nodes.size:  # the spectrum of many blackbodies is a polynomial through the nodes
        basis = scipy.interpolate.BarycentricInterpolator(nodes, np.eye(len(nodes)))(bins.grid_um)
        parts |= {f"wavelength.{k}": column for k, column in enumerate(basis.T)}
    cube = sum(np.outer(bins.means(spectrum), total.mean(name)) for name, spectrum in parts.items())
    return dict(zip(names, cube))
