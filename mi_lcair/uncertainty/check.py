"""Check of the law of propagation: the result at plus and minus one standard deviation.

From these, the distribution of the result to the second order and beyond.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from mi_lcair.estimate import Distribution, in_unit
from mi_lcair.uncertainty.inputs import Inputs
from mi_lcair.uncertainty.numbers.number import Number

MATTERS = 0.01  # share of the variance from which a quantity is checked
# Difference between the change of the result and its linear estimate, relative to that estimate,
# from which the linear answer fails
FAILS = 0.1
POINTS = 17  # logarithm to base 2 of the number of points of the distribution to the second order
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
    """

    quantity: str
    linear: float
    plus: float | None
    minus: float | None
    holds: bool

    def change(self, z: np.ndarray) -> np.ndarray:
        """Change of the result for z standard deviations: a cubic, or linear without both sides."""
        a, b, c = self.linear, 0.0, 0.0
        if None not in (self.plus, self.minus):
            b, c = (self.plus + self.minus) / 2, (self.plus - self.minus) / 2 - a
        return z * (a + z * (b + z * c))

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
                "answer holds on one side only; use Monte Carlo"
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
            f"{self.quantity}: the linear answer fails: {' and '.join(sides)}, where the "
            f"derivative says +-{abs(self.linear):.3g}; use Monte Carlo"
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
        linear, changes = float(c @ step), []
        for sign in (1, -1):
            values = dict(zip(names, inputs.values[group.index] + sign * step))
            feasible = number.is_feasible(values)
            changes.append(number.at(values) - number.value if feasible else None)
        plus, minus = changes
        differences = [
            abs(change - expected)
            for change, expected in ((plus, linear), (minus, -linear))
            if change is not None
        ]
        holds = None not in changes and max(differences) <= FAILS * abs(linear)
        checks.append(Check(group.label, linear, plus, minus, holds))
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
    """

    shift: float
    sigma: float
    interval: tuple[float, float]

    def words(self, unit: str) -> str:
        """The distribution in one line."""
        low, high = self.interval
        sigma = in_unit(f"{self.sigma:.3g}", unit)
        return f"mean {self.shift:+.2g}, sigma {sigma}, about 95 % in {low:.5g}..{high:.5g}"


def second_order(
    checks: list[Check],
    value: float,
    sigma: float,
    distributions: Mapping[str, Distribution] = MappingProxyType({}),
) -> SecondOrder | None:
    """The distribution of a result to the second order and beyond.

    Along the direction of each check, the result is the cubic a z + b z^2 + c z^3 through its
    changes at z = 1 and z = -1, with the derivative a. The z are drawn from their distributions, as
    a Sobol sequence, which needs no render. What was not checked is linear and normal, and what has
    no value on one side is linear.

    Parameters
    ----------
    checks : list of Check
    value : float
        The result.
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
    rest = sigma**2 - sum(entry.linear**2 for entry in used)
    drawn = value + np.sqrt(max(rest, 0.0)) * normal[:, -1]
    for entry, z, u in zip(used, normal.T, points.T):
        if entry.quantity in distributions:
            of_entry = distributions[entry.quantity]
            z = (of_entry.law.ppf(u) - of_entry.centre) / of_entry.law.std()
        drawn += entry.change(z)
    ends = np.quantile(drawn, INTERVAL)
    return SecondOrder(float(drawn.mean() - value), float(drawn.std()), tuple(ends.tolist()))
