"""The contrast of a scenario as a measured number, with its derivatives."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, holding, rendered_as, setting_of
from mi_lcair.detection.weather import in_weather, weather_quantities
from mi_lcair.errors import InputError
from mi_lcair.motions.differences import default_step, poses_around
from mi_lcair.motions.pose import known_motions, value_of
from mi_lcair.sensitivity.columns import of_plumes
from mi_lcair.sensitivity.entries import Parameter
from mi_lcair.sensitivity.sensitivities import Sensitivities
from mi_lcair.sensitivity.window import (
    differences_of,
    differentiate_intensity,
    mean_and_deviations,
    rows_of_part,
)
from mi_lcair.uncertainty.numbers.contrast_number import BEHIND, ContrastNumber
from mi_lcair.uncertainty.numbers.number import SOURCE_STEP

BEHIND_STEP = 1e-4  # relative step of the derivative of a background
PLUME_STEP = 0.02  # step of the derivative with respect to a plume's transmittance
WEATHER_SIGMA = 0.01  # standard deviation of the weather whose derivative is wanted, of its range


@dataclass(frozen=True)
class MeasuredContrast:
    """A scenario's line of sight, whose contrast was measured.

    scenario: the scenario. setting: what its contrast is computed from.
    """

    scenario: Scenario
    setting: Setting

    @staticmethod
    def of(
        source: str, entries: Mapping, motions: Mapping = MappingProxyType({})
    ) -> "MeasuredContrast":
        """The line of sight of a scenario with other entries, by dotted key, and more motions.

        Raises InputError if the scenario cannot be used.
        """
        scenario = Scenario.read(source, **entries).with_motions(motions)
        return MeasuredContrast(scenario, setting_of(scenario))

    def known(self) -> dict[str, Parameter]:
        """The weather of the air, by name."""
        return weather_quantities(self.scenario.atmosphere)

    def in_conditions(self, values: Mapping[str, float]) -> "MeasuredContrast":
        """The line of sight for values of the weather, in which its scene is lit from then on."""
        scenario = in_weather(self.scenario, values)
        setting = self.setting.through(scenario)
        setting.light.shine_on(setting.view)
        return MeasuredContrast(scenario, setting)

    def contrast(self, names, spp: int | None, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Contrast of each independent randomisation, and its derivatives.

        Parameters
        ----------
        names : sequence of str
            K parameters of the scene, or quantities of the weather.
        spp : int or None
            In place of the samples per pixel, or the tolerance, of the scenario.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        contrast : ndarray, shape (R,)
            Contrast irradiance at the sensor [W m^-2].
        columns : ndarray, shape (K, R)

        Raises
        ------
        InputError
            If no ray meets the target, or if its temperatures cannot be told apart.
        """
        sampling = replace(self.scenario.render, seed=seed)
        if spp is not None:
            sampling = replace(sampling, spp=spp, tolerance=None, tolerance_W_m2=None, max_spp=None)
        setting, motions = self.setting, known_motions(self.setting.view)
        steps = {n: default_step(setting.view, m) for n, m in motions.items() if n in names}
        if steps or any(value_of(setting.view, m) != m.rest for m in motions.values()):
            poses = [p for n, step in steps.items() for p in poses_around(setting.view, n, step)]
            setting = holding(setting, self.scenario, poses)
        with rendered_as(setting.view, sampling):
            number = ContrastNumber(replace(self.scenario, render=sampling), setting)
            number.start()
            if not number.has_weights:
                raise InputError(
                    "the target has too many temperatures for its contrast to be followed; give an "
                    "image in place of the contrast"
                )
            return self._contrast(number, names, steps)

    def _contrast(
        self, number: ContrastNumber, names, steps: dict
    ) -> tuple[np.ndarray, np.ndarray]:
        hot = [name for name in names if number.known[name].kind == "temperature"]
        stated = [name for name in names if number.is_own(name)]
        rest = [name for name in names if name not in (*hot, *stated, *steps)]
        plumes = of_plumes(number.scene, rest)
        rest = [name for name in rest if name not in plumes]
        parts = [number_of(number, rest, number.weights())]
        if hot:
            parts.append(number_of(number, hot, slope_weights(number)))
        each = [of_randomisations(part) for part in parts]
        columns = dict(zip([*rest, *hot], [row for rows in each for row in rows[1:]]))
        # The path and the hidden background go with the projected area
        total, window = number.total, number.numbers.area
        area = total.mean("target.hit")[0] + spread(total.deviations("target.hit"))[0]
        # Sky and ground around the target are behind it, too
        behind = {
            name: number.known[name].value
            for name in BEHIND
            if name in number.known and number.is_stated(name)
        }
        per_amount = number.terms(total, number.areas, behind)[1]
        of_area = (per_amount[1] - per_amount[2])[-1]
        contrast = each[0][0] + of_area * window * area
        rows = rows_of_part(number.numbers, number.weights())
        for name, step in steps.items():
            difference = differences_of(number.numbers, name).at(step)
            high, low = (
                rows(end) + of_area * mean_and_deviations(end, ["target.hit"])
                for end in difference.ends
            )
            slope = window * (high - low) / (2 * difference.step)
            columns[name] = slope[0] + spread(slope[1:])
        for name in set(behind) & set(names):
            step = BEHIND_STEP * number.known[name].value
            high, low = (
                number.linear(total, number.areas, behind | {name: behind[name] + end}).value
                for end in (step, -step)
            )
            columns[name] = columns[name] + (high - low) / (2 * step)
        for name in plumes:
            slope = number.differences([name], [PLUME_STEP])[0, 0]
            columns[name] = np.full(len(contrast), slope)
        for name in stated:
            sigma = number.known[name].upper - number.known[name].lower
            slope = number.closed_derivative(name, WEATHER_SIGMA * sigma)[0]
            columns[name] = np.full(len(contrast), slope)
        return contrast, np.array([columns[name] for name in names]).reshape(-1, len(contrast))


def number_of(number: ContrastNumber, names, weights: Mapping) -> Sensitivities:
    """The sum over the sources with these weights, from the paths of a contrast."""
    return differentiate_intensity(number.scene, names, number.numbers.repeated, weights=weights)


def slope_weights(number: ContrastNumber) -> dict:
    """Weights of the sources with which the derivatives of temperatures are those of the contrast.

    The air weighs the derivative of Planck's law otherwise than Planck's law itself.
    """
    ends = []
    for step in (SOURCE_STEP, -SOURCE_STEP):
        sources = [source.hotter(step, number.scene.band) for source in number.areas.sources]
        areas = replace(number.areas, sources=sources)
        factors = number.terms(number.total, areas, {})[1][0]
        ends.append((factors[:-1], np.array([source.in_band for source in sources])))
    (high, in_band_high), (low, in_band_low) = ends
    slope = in_band_high - in_band_low
    weights = np.divide(high - low, slope, out=np.zeros(len(slope)), where=slope > 0)
    return {
        (source.group, source.name): weight for source, weight in zip(number.areas.sources, weights)
    }


def of_randomisations(sensitivity: Sensitivities) -> np.ndarray:
    """Value and derivatives of each randomisation, (1 + K, R)."""
    return np.append(sensitivity.value, sensitivity.derivative)[:, None] + spread(
        sensitivity.deviations
    )


def spread(deviations: np.ndarray) -> np.ndarray:
    """Deviations of single randomisations from those that are scaled to the mean, (..., R)."""
    R = deviations.shape[-1]
    return deviations * np.sqrt(R * (R - 1))
