"""Base class of BSDFs whose parameters may depend on wavelength."""

from dataclasses import replace
from functools import lru_cache

import mitsuba as mi
import numpy as np

from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectra.change import CHANGES, NODES, Change
from mi_lcair.physics.spectra.parameters import SpectralParameters
from mi_lcair.plugins.derivatives import children


class SpectralBSDF(mi.BSDF):
    """A BSDF that may have a spectrum, with numbers that change it.

    measured_spectrum: parameters over wavelength; None without. spectrum: the same with the change.
    of_band: band in which the scene is rendered. change: numbers of the change, see `Change`; they
    are the parameters of the scene then, since the mean of the spectrum only decides where paths
    go.
    """

    spectrum: SpectralParameters | None = None
    measured_spectrum: SpectralParameters | None = None
    of_band: Band | None = None
    change: dict[str, mi.Float] = {}

    def take_spectrum(self, spectrum: SpectralParameters, of_band: Band) -> None:
        """Depend on wavelength."""
        self.spectrum = self.measured_spectrum = spectrum
        self.of_band = of_band
        self.change = {name: mi.Float(value) for name, (_, value) in CHANGES.items()}
        self.change["nodes"] = mi.Float(np.zeros(NODES))

    @property
    def spectrum_change(self) -> Change:
        """The change of the spectrum, from its numbers."""
        numbers = {name: float(self.change[name][0]) for name in CHANGES}
        nodes = tuple(self.change["nodes"].numpy().tolist())
        return Change((self.of_band.lower_um, self.of_band.upper_um), **numbers, nodes=nodes)

    def follow_change(self) -> None:
        """Set `spectrum` for the present numbers of the change."""
        self.spectrum = changed_spectrum(self.measured_spectrum, self.spectrum_change)


@lru_cache(maxsize=128)
def changed_spectrum(spectrum: SpectralParameters, change: Change) -> SpectralParameters:
    """A spectrum with a change, the same object for all surfaces that have it."""
    return spectrum if change.is_none else replace(spectrum, change=change)


def has_spectrum(plugin) -> bool:
    """Whether a plugin is a BSDF that depends on wavelength; None is not."""
    return isinstance(plugin, SpectralBSDF) and plugin.spectrum is not None


def is_spectral(bsdf) -> bool:
    """Whether a BSDF, or what it wraps, has a spectral material."""
    return any(map(has_spectrum, (bsdf, *children(bsdf))))


def has_spectral_materials(scene) -> bool:
    """Whether a surface of a scene has a spectral material."""
    return any(is_spectral(shape.bsdf()) for shape in scene.shapes())
