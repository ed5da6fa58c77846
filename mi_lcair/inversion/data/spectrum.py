"""A measured spectrum of a pixel or a facet: its file, and what a scene predicts for it."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.physics.spectra.change import Change
from mi_lcair.physics.spectral_table import WAVELENGTH
from mi_lcair.plugins.bsdfs.spectral_bsdf import has_spectral_materials
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.values import entries_named
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows
from mi_lcair.sensitivity.common_numbers import renders_beside
from mi_lcair.table import read_table

RADIANCE, SIGMA = "radiance_W_m2_sr_um", "sigma_W_m2_sr_um"
UNEVEN = 1e-3  # largest error of a wavelength, in distances of two wavelengths


@dataclass(frozen=True)
class MeasuredSpectrum:
    """Spectral radiance of all that a scene's sensor sees, at the bins of its band.

    bins: the bins, with nodes at the measured wavelengths. radiance, sigma: measured values and
    their standard deviations, (count,) [W m^-2 sr^-1 um^-1].
    """

    bins: Bins
    radiance: np.ndarray
    sigma: np.ndarray

    @staticmethod
    def read(path: str, sigma: float | None, scene: Scene) -> "MeasuredSpectrum":
        """The spectrum of a CSV file `wavelength_um,radiance_W_m2_sr_um`.

        Its standard deviations are `sigma` or the column `sigma_W_m2_sr_um`. Raises InputError for
        wavelengths that are not even over the scene's band.
        """
        names = (WAVELENGTH, RADIANCE, *(() if sigma else (SIGMA,)))
        columns = read_table(path, names, "spectrum").numbers(names)
        x = columns[WAVELENGTH]
        if scene.band.is_total or len(x) < 3 or not x[0] < x[-1]:
            raise InputError(f"{path}: needs three rising wavelengths or more within a band")
        bins = Bins(scene.band, len(x))
        if np.abs(bins.nodes_um - x).max() > UNEVEN * (x[-1] - x[0]) / (len(x) - 1):
            raise InputError(
                f"{path}: wavelengths {x[0]:g}..{x[-1]:g} um; they must be even over the scene's "
                f"band {scene.band.lower_um:g}-{scene.band.upper_um:g} um, its limits included"
            )
        if not has_spectral_materials(scene.mi):
            raise InputError(f"{scene.name}: a spectrum needs a material by wavelength, none is")
        sigma = np.full(len(x), sigma) if sigma else columns[SIGMA]
        if not (sigma > 0).all():
            raise InputError(f"{path}: {SIGMA} is not positive")
        return MeasuredSpectrum(bins, columns[RADIANCE], sigma)

    def predicted(self, scene: Scene, names, sampling: Sampling) -> tuple[np.ndarray, list]:
        """Spectral radiance of each randomisation, (R, count), and its columns, (count, K) each.

        A bin depends on the spectrum of a material in that bin alone. One difference with respect
        to the offset of the spectrum therefore gives the derivatives at all its nodes.
        """
        windows = Windows.whole(scene.sensor(sampling.sensor))
        measurands = Measurands.of(None, bins=self.bins.count)

        def values(total: Totals) -> np.ndarray:
            names = [f"bin.{k}" for k in range(self.bins.count)]
            return np.array([total.mean(n)[0] + spread(total.deviations(n))[0] for n in names]).T

        def slope(name: str) -> np.ndarray:
            high, low, step = renders_beside(scene, name, windows, sampling, measurands)
            return (values(high) - values(low)) / step

        radiance, slopes = values(measure(scene, windows, sampling, measurands)), {}
        columns = []
        for entry in entries_named(scene, names):
            number = entry.places[0].number if entry.kind == "spectrum" else None
            name = entry.name
            if number is not None:
                name = f"{entry.name.rpartition('.')[0]}.offset"
            if name not in slopes:
                slopes[name] = slope(name)
            share = np.ones(self.bins.count)
            if number is not None:
                unit = Change(entry.places[0].node.spectrum_change.band_um, scale=0.0)
                unit = unit.replaced(str(int(number[0])), 1.0)
                share = unit.unclipped(self.bins.nodes_um, share)
            columns.append(slopes[name] * share)
        columns = np.array(columns).reshape(len(names), *radiance.shape)
        return radiance, list(columns.transpose(1, 2, 0))


def spread(deviations: np.ndarray) -> np.ndarray:
    """Deviations of single randomisations from those that are scaled to the mean, (..., R)."""
    R = deviations.shape[-1]
    return deviations * np.sqrt(R * (R - 1))
