"""The intensity of a scene's target as a number with an uncertainty budget."""

import numpy as np

from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.rendering.parameters.values import parameters_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.sensitivity.common_numbers import CommonNumbers
from mi_lcair.signatures.effective_areas import PARTS
from mi_lcair.uncertainty.numbers.number import Linear, Number


class IntensityNumber(Number):
    """Intensity of a scene's target toward an orthographic sensor, W/sr.

    Parameters
    ----------
    scene : Scene
    part : str
        "target", or "scene" for all in the sensor's window.
    sampling : Sampling
        As for `CommonNumbers`.
    """

    unit = "W/sr"

    def __init__(self, scene, sampling: Sampling, part: str = "target"):
        self.title = f"intensity of the {part}"
        self.part, self.scene, self.what = part, scene, scene.name
        self.known = parameters_of(scene)
        self.numbers = CommonNumbers(scene, sampling, has_spectra(scene), part)

    def linear(self, total, areas, quantities):
        name = None if self.part == "scene" else self.part
        if areas is None or areas.nodes_um.size:
            mean, error = total.mean(name)[0], total.standard_error(name)[0]
            area = self.numbers.area
            return Linear(np.ones(1), np.array([mean * area]), np.array([[(error * area) ** 2]]))
        p = PARTS.index(self.part)
        factors = np.array([source.in_band_radiance(areas.band) for source in areas.sources])
        # What a closure adds belongs to no source
        closure = total.mean(f"{self.numbers.prefix}closure")[0] * self.numbers.area
        covariance = np.zeros((len(factors) + 1,) * 2)
        covariance[:-1, :-1] = areas.covariance[p, :-1, :-1]
        return Linear(np.append(factors, 1.0), np.append(areas.area[p], closure), covariance)


def has_spectra(scene) -> bool:
    """Whether all sources of a scene have a spectrum, so that a render can resolve them."""
    if scene.band.is_total:
        return False
    return all(is_thermal(emitter) and emitter.has_spectrum for emitter in scene.mi.emitters())
