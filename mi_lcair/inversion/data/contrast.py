"""The contrast of a scenario as a measured number, with its derivatives."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, holding, rendered_as, setting_of
from mi_lcair.detection.weather import in_weather, weather_quantities
from mi_lcair.rendering.motions.pose import known_motions, value_of
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.sensitivity.common_numbers import step_of
from mi_lcair.sensitivity.motions.differences import default_step
from mi_lcair.uncertainty.numbers.contrast_number import ContrastNumber, present

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

    @property
    def present(self) -> tuple[Scenario, Setting]:
        """Scenario and setting with the sky and the ground that the scene has now."""
        if self.scenario.surroundings is None:
            return self.scenario, self.setting
        scenario, setting, scale = present(self.scenario, self.setting)
        if not setting.sight.meets_ground:
            setting = replace(setting, backdrop=setting.backdrop.scaled(scale))
        return scenario, setting

    def contrast(
        self, names, spp: int | None, seed: int, randomisations: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Contrast of independent renders, and its derivatives, those of a budget.

        Parameters
        ----------
        names : sequence of str
            K parameters of the scene, or quantities of the weather.
        spp : int or None
            Samples per pixel of all renders together, in place of those, or of the tolerance, of
            the scenario.
        seed : int
            Seed of the random numbers of the first render.
        randomisations : int
            R renders.

        Returns
        -------
        contrast : ndarray, shape (R,)
            Contrast irradiance at the sensor [W m^-2].
        columns : ndarray, shape (K, R)

        Raises
        ------
        InputError
            If no ray meets the target.
        """
        (scenario, setting), render = self.present, self.scenario.render
        spp = spp or render.spp
        if spp is not None:
            spp = max(-(-spp // randomisations), 2)
            to_spp = {"tolerance": None, "tolerance_W_m2": None, "max_spp": None, "spp": spp}
            render = replace(render, **to_spp)
        motions = known_motions(setting.view)
        if any(value_of(setting.view, motion) != motion.rest for motion in motions.values()):
            setting = holding(setting, scenario, [])
        contrast, columns = [], []
        with rendered_as(setting.view, render):
            for number_of_render in range(randomisations):
                sampling = replace(render, seed=(seed + number_of_render) % 2**32)
                number = ContrastNumber(replace(scenario, render=sampling), setting)
                sigma = [deviation(number, name) for name in names]
                number.make_room(names, sigma)
                number.start()
                contrast.append(number.value)
                columns.append(number.derivatives(names, sigma)[0])
        return np.array(contrast), np.transpose(columns)


def deviation(number: ContrastNumber, name: str) -> float:
    """Standard deviation of a quantity for which its derivative is taken."""
    of = number.known[name]
    if of.kind == "motion":
        return default_step(number.scene, known_motions(number.scene)[name])
    if of.kind == "scenario":
        return WEATHER_SIGMA * (of.upper - of.lower)
    return step_of(of)
