"""Uncertainty budget of an intensity or of a contrast."""

import pickle
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import rendered_as, setting_of
from mi_lcair.errors import errors_of
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.rendering.motions.pose import declare
from mi_lcair.rendering.parameters.values import checked
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.results import Result, entry
from mi_lcair.results.contributions import contributions
from mi_lcair.results.sections import Section, Table
from mi_lcair.startup.tasks import kept
from mi_lcair.uncertainty.check import Check, SecondOrder, check, second_order
from mi_lcair.uncertainty.facet_errors import facet_contribution
from mi_lcair.uncertainty.inputs import Inputs
from mi_lcair.uncertainty.monte_carlo import MonteCarlo, monte_carlo
from mi_lcair.uncertainty.numbers.contrast_number import ContrastNumber
from mi_lcair.uncertainty.numbers.derived_number import (
    ApparentTemperature,
    DetectionRangeNumber,
    Netd,
    SignalToNoise,
)
from mi_lcair.uncertainty.numbers.intensity_number import IntensityNumber
from mi_lcair.uncertainty.numbers.number import Number
from mi_lcair.uncertainty.uncertainties import Uncertainties

# What the budget of a scenario may be of
NUMBERS = {
    "contrast": ContrastNumber,
    "apparent_temperature": ApparentTemperature,
    "detection_range": DetectionRangeNumber,
    "snr": SignalToNoise,
    "netd": Netd,
}
NOISE, TRUNCATION = "noise of the rendering", "reflections left out"


@dataclass(frozen=True, repr=False)
class Budget(Result):
    """Uncertainty budget of a result.

    Attributes
    ----------
    what : str
        Name of the scene or scenario.
    title : str
        What the result is.
    estimate : Estimate
        The result with its combined standard uncertainty. The shares of the contributions add up
        to 1.
    inputs : Inputs
        The uncertain quantities with their covariance.
    checks : list of Check
        Results at plus and minus one standard deviation of what matters.
    second_order : SecondOrder or None
        Mean, standard deviation and interval of the result from the checks; None without any.
    monte_carlo : MonteCarlo or None
        Distribution of the result for random quantities, if it was asked for.
    remarks : list of str
        Limits of the budget, one line each.
    renders : int
        Number of renders.
    paths : int
        Paths of each render.
    seconds : float
        Time of the calculation, s.
    """

    what: str
    title: str
    estimate: Estimate
    inputs: Inputs
    checks: list[Check]
    second_order: SecondOrder | None
    monte_carlo: MonteCarlo | None
    remarks: list[str]
    renders: int
    paths: int
    seconds: float = entry("time_s")

    kind = "budget"
    drawn_by = "mi_lcair.reports.pictures.budget:figure"
    heading = "Uncertainty budget"

    @property
    def value(self) -> float:
        """The result."""
        return self.estimate.value

    @property
    def sigma(self) -> float:
        """Its combined standard uncertainty."""
        return self.estimate.standard_error

    @property
    def unit(self) -> str:
        """Unit of both."""
        return self.estimate.unit

    @property
    def rows(self) -> tuple[Contribution, ...]:
        """What contributes to the uncertainty, the largest share of the variance first."""
        return self.estimate.contributions

    @property
    def sigma_of_quantities(self) -> float:
        """Combined standard uncertainty from the quantities alone, as Monte Carlo finds it."""
        rows = [row for row in self.rows if row.quantity not in (NOISE, TRUNCATION)]
        return Estimate.of(self.value, self.unit, rows).standard_error

    def summary(self) -> str:
        """One line with the result and its standard uncertainty."""
        first = self.rows[0]
        return (
            f"budget of {self.what}: {self.title} {self.estimate} (one standard uncertainty), "
            f"most from {first.quantity} ({100 * first.share:.3g} % of the variance)"
        )

    def facts(self) -> Iterator[Any]:
        """The result and its uncertainty, what contributes to it, and what renders say about it."""
        relative = f", {percent(self.sigma / abs(self.value))}" if self.value else ""
        yield self.title, f"{self.estimate} (one standard uncertainty{relative})"
        yield "expanded", self.estimate.expanded
        if self.second_order is not None:
            yield "second order", self.second_order.words(self.unit)
        if self.monte_carlo is not None:
            linear = f"linear, of the quantities alone: {self.sigma_of_quantities:.3g}"
            yield "monte carlo", f"{self.monte_carlo.words(self.unit)}; {linear}"
        yield "renders", f"{self.renders} of {self.paths} paths"
        yield contributions(self.estimate)
        if self.checks:
            columns = ["rendered at", "derivative", "plus sigma", "minus sigma", "linear"]
            yield Section("Checks", [Table(columns, [check.cells() for check in self.checks])])

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each contribution, see `Estimate.columns`."""
        return self.estimate.columns()


def draw_up(
    what: Scene | Scenario,
    stated: Uncertainties,
    sampling: Sampling,
    draws: int | None = None,
    of: str = "contrast",
) -> Budget:
    """Draw up the budget of a loaded scene or of a scenario.

    Parameters
    ----------
    what : Scene or Scenario
        A scene keeps the motions of `stated`.
    stated : Uncertainties
    sampling : Sampling
        That of a scene; a scenario has its own. Its progress is called with (draws done, expected).
    draws : int or None
        Random draws from which the distribution of the result is computed.
    of : str
        What the result of a scenario is, one of NUMBERS.
    """
    start = time.perf_counter()
    if isinstance(what, Scenario):
        what = what.with_motions(stated.motions)
    elif stated.motions:
        declare(what, stated.motions)
    names = [*stated.sigma, *(name for group in stated.correlated for name in group.names)]
    with result_of(what, sampling, names, of) as number:
        number.sent = started, (what, replace(sampling, progress=None), names, of)
        inputs = Inputs.of(stated, number.known, number.what)
        number.make_room(inputs.names, inputs.sigma)
        number.start()
        rendered = {
            name: number.known[name].value for name in inputs.names if number.needs_render(name)
        }
        checked(number.scene, rendered)  # before anything else is rendered
        derivative, errors = number.derivatives(inputs.names, inputs.sigma)
        facets = {
            f"{group} facets": facet_contribution(number, group, of_group)
            for group, of_group in stated.facets.items()
        }
        others = facets | {NOISE: number.error, TRUNCATION: number.truncation()}
        rows = inputs.contributions(derivative, errors)
        rows += [Contribution(name, float(error)) for name, error in others.items()]
        estimate = Estimate.of(number.value, number.unit, rows)
        sigma = estimate.standard_error
        checks = check(number, inputs, derivative, sigma)
        distribution = None
        if draws is not None:
            independent = np.hypot.reduce([*facets.values(), 0])
            how = draws, sampling.seed, sampling.progress
            distribution = monte_carlo(number, inputs, derivative, independent, *how)
        return Budget(
            what=number.what,
            title=number.title,
            estimate=estimate,
            inputs=inputs,
            checks=checks,
            second_order=second_order(checks, number.value, sigma, inputs.distributions),
            monte_carlo=distribution,
            remarks=remarks(number, checks, distribution),
            renders=number.renders,
            paths=number.numbers.paths,
            seconds=time.perf_counter() - start,
        )


@kept
def started(recipe: bytes) -> Number:
    """The `Number` of pickled arguments of `result_of`, which a worker makes once."""
    number = (block := ExitStack()).enter_context(result_of(*pickle.loads(recipe)))
    number.start()
    number.block = block  # it stays open as long as the number is used
    return number


@contextmanager
def result_of(what: Scene | Scenario, sampling: Sampling, names=(), of: str = "contrast"):
    """Context manager that gives the `Number` of a scene or scenario.

    names: quantities that will be asked for. of: what the number of a scenario is.
    """
    if isinstance(what, Scenario):
        with errors_of(f"scenario '{what.name}'"):
            setting = setting_of(what)
            with rendered_as(setting.view, what.render):
                setting.view.mi.integrator().check_differentiable()
                yield NUMBERS[of](what, setting, names=names)
    else:
        what.mi.integrator().check_differentiable()
        yield IntensityNumber(what, replace(sampling, progress=None))


def remarks(number: Number, checks: list[Check], distribution: MonteCarlo | None) -> list[str]:
    """Limits of a budget, one line each."""
    total = number.total
    lines = [*invalid_remark(total.invalid, int(total.traced.sum()))]
    lines += [entry.sentence(number.unit) for entry in checks if not entry.holds]
    if number.numbers.reached is False:
        lines.append("the tolerance was not reached; the noise of the rendering has its own row")
    if distribution is not None and distribution.sentence():
        lines.append(distribution.sentence())
    return lines
