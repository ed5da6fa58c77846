"""Uncertainty budget of an intensity or of a contrast."""

import json
import pickle
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mi_lcair.declared import Bounds, percent
from mi_lcair.derivatives.images import DerivativeImages, differentiate_image, facet_matrix
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import rendered_as, setting_of
from mi_lcair.errors import InputError, errors_of
from mi_lcair.estimate import Contribution, Distribution, Estimate, in_unit
from mi_lcair.knowing.budgets import contrast_number
from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.monte_carlo import MonteCarlo, monte_carlo
from mi_lcair.knowing.budgets.number import Number
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from mi_lcair.physics.blackbody import in_band_slope
from mi_lcair.plugins.emission.source import rounded
from mi_lcair.rendering.images.render import render_image
from mi_lcair.rendering.motions.pose import declare
from mi_lcair.rendering.parameters.values import checked
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.results import Result, contributions, entry
from mi_lcair.sections import Section, Table
from mi_lcair.table import LARGEST, read_table
from mi_lcair.tasks import kept

# Maps of an uncertainty budget: derivatives of each pixel, and its standard uncertainty
# --------------------------------------------------------------------------------------


def budget_image(
    scene: Scene, inputs: Inputs, sampling: Sampling
) -> tuple[dict[str, np.ndarray], dict]:
    """Channels and header of an image with the derivatives of every pixel.

    Parameters
    ----------
    scene : Scene
    inputs : Inputs
        The uncertain quantities, such as `Budget.inputs` of the same scene.
    sampling : Sampling
        Without a tolerance.

    Returns
    -------
    channels : dict
        Those of `render`, a channel d.NAME.Y for each quantity (W m^-2 sr^-1 per unit of the
        quantity), and sigma.Y, the standard uncertainty of the radiance from all quantities.
    header : dict
        That of `render`, with the names and the covariance of the quantities.
    """
    image = render_image(scene, replace(sampling, progress=None))
    of_radiance = differentiate_image(scene, inputs.names, sampling)
    derivatives = {
        f"d.{name}.Y": column.astype(np.float32)
        for name, column in zip(inputs.names, of_radiance.derivative)
    }
    sigma = np.sqrt(variance(of_radiance, inputs.covariance)).astype(np.float32)
    stated = {
        "uncertain": json.dumps(inputs.names),
        "covariance": json.dumps(inputs.covariance.tolist()),
    }
    return image.channels | derivatives | {"sigma.Y": sigma}, image.header | stated


def variance(images: DerivativeImages, covariance: np.ndarray) -> np.ndarray:
    """Variance of the radiance of each pixel, (height, width).

    The square of a noisy derivative would be too large on average. Products of independent
    randomisations are right on average, and only they are used if there are several.
    """

    def quadratic(d):
        return np.einsum("khw,kl,lhw->hw", d, covariance, d, optimize=True)

    count = len(images.derivatives)
    squares = count**2 * quadratic(images.derivative)
    if count == 1:
        return squares
    same = sum(quadratic(column.astype(float)) for column in images.derivatives)
    return np.maximum(squares - same, 0) / (count * (count - 1))


# Independent errors of the temperatures of single facets
# -------------------------------------------------------

LEAST_SPP = 16  # samples per pixel, 2 for each of the matrix's randomisations


def facet_contribution(number: Number, group: str, stated: float | Path) -> float:
    """Standard uncertainty of a number from independent errors of the facets of a group.

    A facet's part of the derivative with respect to its temperature is its share of the effective
    area of all facets with that temperature. The shares come from one more render, which records
    the emitting facets. Reflections are included.

    Parameters
    ----------
    number : Number
        A number that was started.
    group : str
        Group of thermal emitters.
    stated : float or Path
        Standard deviation of every facet's temperature [K], or a CSV `facet,sigma_K`, with facets
        numbered as in `FacetTable`. Facets that it does not list have no error.

    Raises
    ------
    InputError
        If the group has no facets with temperatures, or the CSV cannot be used.
    """
    numbers = number.numbers
    pixels = numbers.windows.pixels
    matrix = facet_matrix(
        number.scene,
        groups=[group],
        sensor=numbers.sampling.sensor,
        spp=max(LEAST_SPP, numbers.paths // pixels),
        seed=numbers.sampling.seed,
    )
    sigma = sigma_of(matrix.facets, stated, group)
    number.columns += 1
    # Effective area of each facet in each randomisation, (R, facets) [m^2]
    area = np.array([m.sum(axis=0) for m in matrix.matrices]) * numbers.area / pixels
    slopes = slopes_per_area(number, group, matrix, area.mean(axis=0))
    effects = area * slopes * sigma
    count = len(effects)
    # Squares of noisy effects are too large on average; products of independent ones are not
    products = effects.sum(axis=0) ** 2 - (effects**2).sum(axis=0)
    return float(np.sqrt(max(products.sum() / (count * (count - 1)), 0.0)))


def slopes_per_area(number: Number, group: str, matrix, area: np.ndarray) -> np.ndarray:
    """Derivative of the number with respect to each temperature, per effective area of the facet.

    If the render resolves the sources separately, the derivative for each source is exact. It is
    divided among the facets of the source. Otherwise the facets radiate to the sensor directly.
    """
    if not number.is_linear:
        if number.unit != "W/sr":
            raise InputError(
                f"{number.what}: errors of single facets in a contrast need at most 64 "
                "temperatures in the scene"
            )
        return in_band_slope(matrix.band, matrix.temperature)
    slopes, temperature = np.zeros(len(area)), rounded(matrix.temperature)
    for k, source in enumerate(number.areas.sources):
        if source.group == group and source.temperature is not None:
            facets_of_source = temperature == source.temperature
            whole = area[facets_of_source].sum()
            if whole > 0:
                slopes[facets_of_source] = number.source_slope(k) / whole
    return slopes


def sigma_of(facets: np.ndarray, stated: float | Path, group: str) -> np.ndarray:
    """Standard deviation of each facet's temperature [K]."""
    if not isinstance(stated, Path):
        return np.full(len(facets), float(stated))
    table = read_table(stated, ("facet", "sigma_K"), "standard deviations")
    columns = table.numbers(("facet", "sigma_K"))
    table.check_range("sigma_K", columns["sigma_K"], Bounds(lower=0, upper=LARGEST))
    sigma = dict(zip(columns["facet"].tolist(), columns["sigma_K"].tolist()))
    if len(sigma) < len(columns["facet"]):
        raise InputError(f"{table.file}: a facet is listed twice")
    if strange := [facet for facet in sigma if facet not in facets]:
        raise InputError(f"{table.file}: group {group} has no facet {strange[0]:g}")
    return np.array([sigma.get(float(facet), 0.0) for facet in facets])


# Check of the law of propagation: the result at plus and minus one standard deviation
# ------------------------------------------------------------------------------------
# From these, the distribution of the result to the second order and beyond.

MATTERS = 0.01  # share of the variance from which a quantity is checked
# Difference between the change of the result and its linear estimate, relative to that estimate,
# from which the linear answer fails
FAILS = 0.1
POINTS = 17  # logarithm to base 2 of the number of points of the distribution to the second order
BLOCKS = 32  # into which they are divided, for the memory
INTERVAL = 0.025, 0.975  # quantiles at the ends of an interval


@dataclass(frozen=True)
class Check:
    """What one standard deviation of a quantity, or of a group of them, really changes.

    Attributes
    ----------
    quantity : str
    linear : float
        Change of the result for plus one standard deviation by the derivative.
    plus, minus : float or None
        Change of the result for plus and minus one standard deviation, from renders. None if the
        quantity cannot have such a value.
    holds : bool
        Whether all of them agree.
    cubic : ndarray, shape (3, m)
        Coefficients of z, z^2 and z^3 in the change of what the result follows from, for z standard
        deviations (`Linear.smooth`). Only the first is not 0 without both sides.
    """

    quantity: str
    linear: float
    plus: float | None
    minus: float | None
    holds: bool
    cubic: np.ndarray | None = entry(default=None, repr=False)

    def cells(self) -> list[str]:
        """The check as a row of a table."""
        changes = [
            "outside its bounds" if change is None else f"{change:+.4g}"
            for change in (self.plus, self.minus)
        ]
        linear = "holds" if self.holds else "FAILS"
        return [self.quantity, f"+-{abs(self.linear):.4g}", *changes, linear]

    def sentence(self, unit: str) -> str:
        """Why the linear answer fails, in one line."""
        inside = [change for change in (self.plus, self.minus) if change is not None]
        if len(inside) == 1 and abs(abs(inside[0]) - abs(self.linear)) <= FAILS * abs(self.linear):
            outside = "plus" if self.plus is None else "minus"
            return (
                f"{self.quantity}: {outside} one sigma is outside its bounds, so that the linear "
                "result is right on one side only; use Monte Carlo"
            )
        sides = [
            f"{word} one sigma changes the result by {change:+.3g} {unit}"
            for word, change in (("plus", self.plus), ("minus", self.minus))
            if change is not None
        ]
        lacking = [
            w for w, change in (("plus", self.plus), ("minus", self.minus)) if change is None
        ]
        sides += [f"{word} one sigma is outside its bounds" for word in lacking]
        return (
            f"{self.quantity}: the linear result is wrong: {' and '.join(sides)}, but the "
            f"derivative gives +-{abs(self.linear):.3g}; use Monte Carlo"
        )


def check(number: Number, inputs: Inputs, derivative: np.ndarray, total: float) -> list[Check]:
    """Check all quantities whose share of the variance `total`^2 exceeds MATTERS.

    Correlated quantities move together, in the direction that changes the result most within one
    standard deviation.
    """
    checks = []
    for group in inputs.groups:
        c, covariance = derivative[group.index], inputs.covariance_of(group)
        variance = float(max(c @ covariance @ c, 0.0))
        if not variance > MATTERS * total**2:
            continue
        # For one quantity this is its standard deviation, in the direction of a larger result
        step = covariance @ c / np.sqrt(variance)
        names = [inputs.quantities[k].name for k in group.index]
        if len(names) == 1:
            step = np.abs(step)
        a = sum(s * number.slopes.get(n, np.array([d])) for s, n, d in zip(step, names, c))
        linear, changes, cubic = float(c @ step), [], np.array([a, 0 * a, 0 * a])
        for sign in (1, -1):
            values = dict(zip(names, inputs.values[group.index] + sign * step))
            there = number.linear_at(values) if number.is_feasible(values) else None
            changes.append(there and (there.value - number.value, there.smooth - number.present))
        if None not in changes:
            up, down = (change for _, change in changes)
            cubic[1:] = (up + down) / 2, (up - down) / 2 - a
        plus, minus = (change and change[0] for change in changes)
        differences = [
            abs(change - expected)
            for change, expected in ((plus, linear), (minus, -linear))
            if change is not None
        ]
        holds = None not in changes and max(differences) <= FAILS * abs(linear)
        checks.append(Check(group.label, linear, plus, minus, holds, cubic))
    return checks


@dataclass(frozen=True)
class SecondOrder:
    """Distribution of a result that curves with its quantities.

    Attributes
    ----------
    shift : float
        Mean of the result less its value, in the result's unit.
    sigma : float
        Its standard deviation.
    interval : tuple of float
        Interval that holds about 95 % of the results.
    other_sign : float
        Probability that the contrast behind a ratio or a range has the other sign.
    """

    shift: float
    sigma: float
    interval: tuple[float, float]
    other_sign: float = 0.0

    def words(self, unit: str) -> str:
        """The distribution in one line."""
        low, high = self.interval
        sigma = in_unit(f"{self.sigma:.3g}", unit)
        return f"mean {self.shift:+.2g}, sigma {sigma}, about 95 % in {low:.5g}..{high:.5g}"

    def sentence(self) -> str | None:
        """Why the linear answer fails, in one line; None if the contrast keeps its sign."""
        if self.other_sign < MATTERS:
            return None
        return (
            f"the contrast has the other sign with a probability of {percent(self.other_sign)}; "
            "the second order includes this, the linear result does not"
        )


def second_order(
    number: Number,
    checks: list[Check],
    sigma: float,
    distributions: Mapping[str, Distribution] = MappingProxyType({}),
) -> SecondOrder | None:
    """The distribution of a result to the second order and beyond.

    Along the direction of each check, what the result follows from is the cubic a z + b z^2 + c z^3
    through its changes at z = 1 and z = -1, with the derivative a. The z are drawn from their
    distributions, as a Sobol sequence, which needs no render. What was not checked is linear and
    normal, and what has no value on one side is linear.

    Parameters
    ----------
    number : Number
    checks : list of Check
    sigma : float
        Its combined standard uncertainty by the law of propagation.
    distributions : mapping of str to Distribution
        Those of quantities that are not normal, by name.

    Returns
    -------
    SecondOrder or None
        None if no check has both sides, and all quantities are normal.
    """
    used = [k for k in checks if None not in (k.plus, k.minus) or k.quantity in distributions]
    if not used or not sigma > 0:
        return None
    from scipy import stats

    points = stats.qmc.Sobol(len(used) + 1, seed=0).random_base2(POINTS)
    normal = stats.norm.ppf(points)
    rest = sigma**2 - sum(term.linear**2 for term in used)
    for term, z, u in zip(used, normal.T, points.T):
        if term.quantity in distributions:
            of_entry = distributions[term.quantity]
            z[:] = (of_entry.law.ppf(u) - of_entry.centre) / of_entry.law.std()
    cubics = np.concatenate([term.cubic for term in used])
    drawn, other = [], 0
    for z in np.split(normal, BLOCKS):
        powers = z[:, :-1, None] ** [1, 2, 3]
        smooth = number.present + powers.reshape(len(z), -1) @ cubics
        smooth += np.sqrt(max(rest, 0.0)) * z[:, -1:] * number.unit_change
        drawn.append(number.results(smooth))
        if number.signed_column is not None:
            other += np.sum((smooth * number.present)[:, number.signed_column] < 0)
    drawn = np.concatenate(drawn)
    ends, shift = np.quantile(drawn, INTERVAL), float(drawn.mean() - number.value)
    return SecondOrder(shift, float(drawn.std()), tuple(ends.tolist()), float(other / len(drawn)))


# What the budget of a scenario may be of
NUMBERS = {
    "contrast": contrast_number.ContrastNumber,
    "apparent_temperature": contrast_number.ApparentTemperature,
    "detection_range": contrast_number.DetectionRangeNumber,
    "snr": contrast_number.SignalToNoise,
    "netd": contrast_number.Netd,
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
        Results at plus and minus one standard deviation of the important quantities.
    second_order : SecondOrder or None
        Mean, standard deviation and interval of the result from the checks; None without any.
    monte_carlo : MonteCarlo or None
        Distribution of the result for random quantities, if it was requested.
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
    drawn_by = "mi_lcair.show.pictures.budget:figure"
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
        curved, distribution = second_order(number, checks, sigma, inputs.distributions), None
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
            second_order=curved,
            monte_carlo=distribution,
            remarks=remarks(number, checks, curved, distribution),
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
        yield contrast_number.IntensityNumber(what, replace(sampling, progress=None))


def remarks(number: Number, checks: list[Check], *distributions) -> list[str]:
    """Limits of a budget, one line each. distributions: `SecondOrder`, `MonteCarlo`, or None."""
    total = number.total
    lines = [*invalid_remark(total.invalid, int(total.traced.sum()))]
    lines += [entry.sentence(number.unit) for entry in checks if not entry.holds]
    if number.numbers.reached is False:
        lines.append("the tolerance was not reached; see the row for the noise of the rendering")
    sentences = [of_one.sentence() for of_one in distributions if of_one is not None]
    return [*lines, *filter(None, sentences)]
