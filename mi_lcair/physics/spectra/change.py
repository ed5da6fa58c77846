"""Linear change of the spectrum of a material, by a scale, an offset and a slope."""

from dataclasses import dataclass, replace

import numpy as np

CHANGES = {"scale": ("1", 1.0), "offset": ("1", 0.0), "slope": ("1/um", 0.0)}  # unit, unchanged


@dataclass(frozen=True)
class Change:
    """What a surface absorbs becomes scale a(lambda) + offset + slope (lambda - centre).

    It is the emissivity of a grey surface, epsilon of Sandford and Robertson, and 1 - F of the
    facets of a rough surface. Results are clipped to what the surface can absorb.

    scale, offset: dimensionless. slope: 1/um. centre_um: middle of the band [um].
    """

    scale: float = 1.0
    offset: float = 0.0
    slope: float = 0.0
    centre_um: float = 0.0

    @property
    def is_none(self) -> bool:
        return (self.scale, self.offset, self.slope) == (1, 0, 0)

    def of(self, wavelengths_um: np.ndarray, absorbed: np.ndarray, most) -> np.ndarray:
        """The changed values (n, ...) of `absorbed` at wavelengths (n,), clipped to 0..most."""
        if self.is_none:
            return absorbed
        return np.clip(self.unclipped(wavelengths_um, absorbed), 0, most)

    def unclipped(self, wavelengths_um: np.ndarray, absorbed: np.ndarray) -> np.ndarray:
        x = wavelengths_um.reshape(-1, *[1] * (absorbed.ndim - 1))
        return self.scale * absorbed + self.offset + self.slope * (x - self.centre_um)

    def bounds(self, name: str, wavelengths_um, absorbed, most) -> tuple[float, float]:
        """Range of one of CHANGES in which nothing is clipped, the others held.

        The arguments are those of `of`, before the change.
        """
        rest = replace(self, **{name: 0.0})
        base = rest.unclipped(wavelengths_um, absorbed)
        rate = replace(rest, **{name: 1.0}).unclipped(wavelengths_um, absorbed) - base
        moves = abs(rate) > 1e-12
        ends = np.sort([(end - base)[moves] / rate[moves] for end in (0.0, most)], axis=0)
        return float(ends[0].max(initial=-np.inf)), float(ends[1].min(initial=np.inf))
