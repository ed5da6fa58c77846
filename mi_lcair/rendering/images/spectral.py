"""Spectral radiance of each pixel, from sums by bin of wavelength or by source."""

from collections.abc import Sequence

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.formats.channels import spectral_channel
from mi_lcair.physics.blackbody import polynomials
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.physics.spectral_table import LONGEST_UM
from mi_lcair.plugins.bsdfs.spectral_bsdf import has_spectral_materials
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.pixels.errors import pixel_errors
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


def check_bins(scene: Scene, bins: int, errors_um: Sequence[float], atmosphere) -> None:
    """Raise InputError for a spectral image that cannot be rendered."""
    if not bins:
        if errors_um:
            raise InputError("errors_um are those of a spectral image; give its number of bins")
        return
    if not 2 <= bins <= MOST_BINS:
        raise InputError(f"bins = {bins}; must be 2 to {MOST_BINS}")
    scene.band.check_limits("bins")
    if atmosphere is not None:
        raise InputError("bins: a spectral image has no air; leave out the atmosphere")
    for wavelength in errors_um:
        if not scene.band.lower_um <= wavelength <= scene.band.upper_um:
            raise InputError(f"errors_um = {wavelength:g} um; must lie in band {scene.band.label}")


def spectral_measurands(scene: Scene, split: str | None, bins: int) -> Measurands:
    """What is recorded for a spectral image; split: of the other channels, see `Channels`.

    Where all materials are constant in the band, the sources are enough.
    """
    if has_spectral_materials(scene.mi):
        return Measurands.of(split, bins=bins)
    return Measurands.of("image", by_spectrum=True)


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
