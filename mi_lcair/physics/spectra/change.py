"""Change of the spectrum of a material, by a scale, an offset, a slope and values at nodes."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

CHANGES = {"scale": ("1", 1.0), "offset": ("1", 0.0), "slope": ("1/um", 0.0)}  # unit, unchanged
NODES = 9  # even wavelengths of a band at which a spectrum can be changed


@dataclass(frozen=True)
class Change:
    """What a surface absorbs, a, becomes scale a + offset + slope (lambda - centre) + c(lambda).

    It is the emissivity of a grey surface, epsilon of Sandford and Robertson, and 1 - F of the
    facets of a rough surface. Results are clipped to what the surface can absorb.

    band_um: limits of the band [um], of which `centre` is the middle. scale, offset: dimensionless.
    slope: 1/um. nodes: values of c, a cubic spline, at `nodes_um`, (NODES,).
    """

    band_um: tuple[float, float] = (0.0, 1.0)
    scale: float = 1.0
    offset: float = 0.0
    slope: float = 0.0
    nodes: tuple[float, ...] = (0.0,) * NODES

    @property
    def is_none(self) -> bool:
        return self == Change(self.band_um)

    @property
    def nodes_um(self) -> np.ndarray:
        """Even wavelengths [um], (NODES,)."""
        return np.linspace(*self.band_um, NODES)

    def of(self, wavelengths_um: np.ndarray, absorbed: np.ndarray, most) -> np.ndarray:
        """The changed values (n, ...) of `absorbed` at wavelengths (n,), clipped to 0..most."""
        if self.is_none:
            return absorbed
        return np.clip(self.unclipped(wavelengths_um, absorbed), 0, most)

    def unclipped(self, wavelengths_um: np.ndarray, absorbed: np.ndarray) -> np.ndarray:
        added = self.offset + self.slope * (wavelengths_um - np.mean(self.band_um))
        if any(self.nodes):
            added += CubicSpline(self.nodes_um, self.nodes)(wavelengths_um)
        return self.scale * absorbed + added.reshape(-1, *[1] * (absorbed.ndim - 1))

    def replaced(self, name: str, value: float) -> "Change":
        """The change with another value of one of CHANGES, or of a node by its number."""
        if name in CHANGES:
            return replace(self, **{name: value})
        nodes = list(self.nodes)
        nodes[int(name)] = value
        return replace(self, nodes=tuple(nodes))

    def bounds(self, name: str, wavelengths_um, absorbed, most) -> tuple[float, float]:
        """Range of one number, see `replaced`, in which nothing is clipped, the others held.

        The other arguments are those of `of`, before the change.
        """
        base = self.replaced(name, 0.0).unclipped(wavelengths_um, absorbed)
        rate = self.replaced(name, 1.0).unclipped(wavelengths_um, absorbed) - base
        moves = abs(rate) > 1e-12
        ends = np.sort([(end - base)[moves] / rate[moves] for end in (0.0, most)], axis=0)
        return float(ends[0].max(initial=-np.inf)), float(ends[1].min(initial=np.inf))
