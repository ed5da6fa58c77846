"""Light that has crossed air, and what is left of it after more air.

Where light crosses two paths one after the other, the amounts of absorbers add, because the lines
that the first path has blackened are the lines of the second. The product of the transmittances of
both paths is too small for light that has crossed air, and too large for light that air emits.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.spectrum import Spectrum

MOST_SHARES = 64  # transmittances of one light that are kept
SMALLEST_SHARE = 1e-9  # of the largest radiance, below which a transmittance is not computed


@dataclass(frozen=True, eq=False)
class AirLight(Spectrum):
    """Spectrum of light that has crossed air: sum of sources * transmittance(amounts).

    The emission of layers, B_1 (1 - t_1) + B_2 (t_1 - t_2) + ..., is a sum of this kind, too, with
    sources B_1, B_2 - B_1, ..., which may be negative.

    Attributes
    ----------
    sources
        Radiance of each source before the air [W m^-2 sr^-1 um^-1], (m, k).
    amounts
        Amounts of the absorbers that each source has crossed, (m, c).
    """

    sources: np.ndarray
    amounts: np.ndarray

    @staticmethod
    def of(name: str, sources: np.ndarray, amounts: np.ndarray) -> "AirLight":
        """The light of some sources (m, k) after amounts of absorbers (m, c)."""
        radiance = (sources * bands().transmittance(amounts)).sum(axis=0)
        radiance = np.maximum(radiance, 0)
        return AirLight(name, bands().wavelengths_um, radiance, sources, amounts)

    def scaled(self, factor: float) -> "AirLight":
        """The light times a factor."""
        return replace(self, radiance=self.radiance * factor, sources=self.sources * factor)

    def plus(self, other: "AirLight") -> "AirLight":
        """The sum of two lights."""
        return AirLight(
            self.name,
            self.wavelengths_um,
            self.radiance + other.radiance,
            np.vstack([self.sources, other.sources]),
            np.vstack([self.amounts, other.amounts]),
        )

    def through(self, amounts: np.ndarray) -> np.ndarray:
        """Spectrum after more air [W m^-2 sr^-1 um^-1], (k,); amounts: of its absorbers, (c,)."""
        rest = self.sources * bands().transmittance(self.amounts + amounts)
        return np.maximum(rest.sum(axis=0), 0)

    def transmittance(self, amounts: np.ndarray) -> np.ndarray:
        """Share 0..1 of the light that more air transmits, (k,); amounts: of its absorbers, (c,).

        Where there is no light, the share is that of light that has crossed no air.
        """
        key = amounts.tobytes()
        if key not in self._shares:
            if len(self._shares) > MOST_SHARES:
                self._shares.clear()
            known = self.radiance > SMALLEST_SHARE * self.radiance.max()
            plain = bands().transmittance(amounts)
            self._shares[key] = np.divide(
                self.through(amounts), self.radiance, out=plain, where=known
            )
        return self._shares[key]

    @cached_property
    def _shares(self) -> dict:
        """Transmittances for amounts, which searches and tolerances ask for again and again."""
        return {}
