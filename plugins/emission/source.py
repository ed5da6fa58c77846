"""What radiates one spectrum in a scene: a group of emitters, or a part of it."""

from dataclasses import dataclass, field, replace

import numpy as np

from mi_lcair.physics.bands import Spectrum
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance

OTHER = "other"  # group of everything without a thermal emitter


@dataclass(frozen=True)
class Source:
    """A group of emitters, or the part of a group that radiates one spectrum.

    The spectrum is that of a blackbody at `temperature` [K], or the tabulated `spectrum`. name:
    name of the spectrum. in_band: its radiance before emissivity [W m^-2 sr^-1]. All of these are
    None for a whole group. light_of: group whose scale or temperature it has; empty for its own.
    """

    group: str
    name: str | None = None
    in_band: float | None = None
    temperature: float | None = None
    spectrum: Spectrum | None = field(default=None, compare=False)
    light_of: str = ""

    def radiance(self, wavelengths_um: np.ndarray) -> np.ndarray:
        """Spectral radiance before emissivity [W m^-2 sr^-1 um^-1]; 0 for a whole group."""
        if self.temperature is not None:
            return spectral_radiance(wavelengths_um, self.temperature)
        return 0 * wavelengths_um if self.spectrum is None else self.spectrum.at(wavelengths_um)

    def in_band_radiance(self, band) -> float:
        """Radiance in another band before emissivity [W m^-2 sr^-1]; not of a whole group."""
        if self.temperature is not None:
            return float(in_band_radiance(band, self.temperature))
        return self.spectrum.in_band_radiance(band)

    def at(self, temperature: float, band) -> "Source":
        """The same blackbody at another temperature [K]."""
        in_band = float(in_band_radiance(band, temperature))
        return replace(self, temperature=float(temperature), in_band=in_band)

    def hotter(self, by: float, band) -> "Source":
        """The source hotter by this [K]; one with a tabulated spectrum as it is."""
        return self if self.temperature is None else self.at(self.temperature + by, band)

    def scaled(self, factor: float) -> "Source":
        """The source with its tabulated spectrum multiplied by a factor."""
        spectrum = self.spectrum.scaled(factor)
        return replace(self, in_band=self.in_band * factor, spectrum=spectrum)

    @staticmethod
    def of_bin(source: "Source", number: int, light: Spectrum, band) -> "Source":
        """The part of a source in a bin of wavelength, whose spectrum is `light`."""
        name, in_band = f"{source.name} bin {number}", light.in_band_radiance(band)
        return Source(source.group, name, in_band, None, light, source.light_of)

    @staticmethod
    def of_blackbodies(group: str, band, temperatures) -> list["Source"]:
        """Sources for the temperatures [K] of the primitives of a group's shape."""
        temperatures, number = np.unique(rounded(temperatures), return_inverse=True)
        radiances = in_band_radiance(band, temperatures)
        sources = [
            Source(group, f"{kelvin(T)} K", float(L), float(T))
            for T, L in zip(temperatures, radiances)
        ]
        return [sources[k] for k in number.ravel()]


@dataclass(frozen=True, eq=False)
class BinOfSpectrum(Spectrum):
    """A spectrum in one bin of wavelength. bin_of: that spectrum; None for a blackbody's."""

    bin_of: Spectrum | None


def rounded(temperatures) -> np.ndarray:
    """Temperatures [K] without the error of Float32, 301.7 K for 301.70001 K.

    Names and comparisons of temperatures use these values.
    """
    return np.asarray(temperatures, dtype=float).round(4)


def kelvin(temperature: float) -> str:
    """A rounded temperature [K] as names show it."""
    return f"{temperature:.7g}"
