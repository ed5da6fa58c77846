"""Numbers that are formulas of their quantities, for tests without a render."""

import numpy as np

from mi_lcair.knowing.budgets.inputs import Group, Inputs
from mi_lcair.knowing.budgets.number import Linear, Number
from mi_lcair.rendering.parameters.entries import Parameter


class Formula(Number):
    """A number f(values of all quantities) with bounds on each of them."""

    def __init__(self, f, values, lower=-np.inf, upper=np.inf):
        self.f, self.values, self.bounds = f, dict(values), (lower, upper)
        self.base = self.linear_at({})

    def linear_at(self, values):
        return Linear.known(self.f(**self.values | values))

    linear = None

    def is_feasible(self, values):
        lower, upper = self.bounds
        return all(lower <= value <= upper for value in values.values())


def quantity(name, value, unit="K", kind="temperature"):
    return Parameter(name, kind, value, unit, 0.0, np.inf)


def inputs(values, covariance, groups=None) -> Inputs:
    """The quantities {name: value}. groups: lists of their numbers; each alone by default."""
    groups = groups or [[k] for k in range(len(values))]
    names = list(values)
    return Inputs(
        [quantity(name, value) for name, value in values.items()],
        np.asarray(covariance, dtype=float),
        [Group(" & ".join(names[k] for k in group), np.array(group)) for group in groups],
    )
