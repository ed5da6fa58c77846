"""A result with an uncertainty budget: its value, and its value for other values of its inputs.

Radiance is linear in the blackbody radiance of every source. One render that records each source
therefore gives the result for all temperatures of the sources. Only parameters of materials need
another render, which repeats the same paths.
"""

import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import isclose
from types import MappingProxyType

import numpy as np

from mi_lcair.derivatives import window
from mi_lcair.derivatives.common_numbers import PARTS, CommonNumbers
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.source import rounded
from mi_lcair.plugins.recorders.radiance import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.parameters.entries import NEAREST, Parameter
from mi_lcair.rendering.parameters.values import checked
from mi_lcair.rendering.reflections import beyond_last, ending
from mi_lcair.rendering.statistics import Totals
from mi_lcair.signatures.effective_areas import EffectiveAreas, effective_areas

# Step of a derivative in closed form, in standard deviations. Its error falls with the square.
SMALL = 1e-2
# The same step in values of the quantity: shorter steps drown in rounding, longer ones leave bounds
STEPS = 1e-6, 1e-2
SOURCE_STEP = 0.01  # step of the derivative with respect to one source's temperature [K]


@dataclass(frozen=True)
class Linear:
    """A result as a sum of factors times amounts, such as radiances times effective areas.

    factors, amounts: (n,). covariance: (n, n), covariance of the amounts from the rendering.
    of_smooth: gives `smooth`; None for the value itself.
    """

    factors: np.ndarray
    amounts: np.ndarray
    covariance: np.ndarray
    of_smooth: Callable[[], np.ndarray] | None = None

    @property
    def value(self) -> float:
        return float(self.factors @ self.amounts)

    @property
    def smooth(self) -> np.ndarray:
        """What changes smoothly with all quantities, and from which the value follows, (m,)."""
        return self.of_smooth() if self.of_smooth else np.array([self.value])

    @classmethod
    def known(cls, value: float, of_smooth=None) -> "Linear":
        """A value without a noise."""
        return cls(np.ones(1), np.array([value]), np.zeros((1, 1)), of_smooth)

    @property
    def error(self) -> float:
        """Standard error of the value from the noise of the rendering."""
        return float(np.sqrt(max(self.factors @ self.covariance @ self.factors, 0)))


class Number(ABC):
    """A number that a scene gives, and what it depends on.

    It knows its quantities from the beginning. Everything else needs `start`, the first render.
    A subclass sets the attributes below and defines `linear`.

    Attributes
    ----------
    title, unit : str
        What the number is, and its unit.
    what : str
        Name of the scene or scenario.
    scene : Scene
    known : dict of str to Parameter
        All quantities on which the number depends, by name.
    numbers : CommonNumbers
        The renders.
    part : str
        Part of the radiance, "target" or "scene".
    """

    title: str
    unit: str
    what: str
    scene: object
    known: dict[str, Parameter]
    numbers: CommonNumbers
    part: str = "target"
    columns = 0  # renders of derivatives so far
    of_motions = ()  # (name, value, `Linear` for this value) of motions
    # Derivatives of `smooth` by name, (m,), where they are not those of the number
    slopes: Mapping[str, np.ndarray] = MappingProxyType({})
    signed_column: int | None = None  # of `smooth`, the contrast, if its sign is not the number's
    sent: tuple  # a function that makes the number again on a worker, and its arguments

    def __reduce__(self) -> tuple:
        make, arguments = self.sent
        return make, (pickle.dumps(arguments),)

    def make_room(self, names, sigma) -> None:
        """Let the window hold what quantities move, whose standard deviations are `sigma`.

        That of a scene's own sensor stays as it is.
        """
        return

    def start(self) -> None:
        """Render the scene once, and prepare everything that follows from that."""
        self.total = self.numbers.render()
        self.areas = areas = self.areas_of(self.total)
        # Whether the render resolves all sources separately: other temperatures need no render
        self.is_linear = areas is not None and not areas.nodes_um.size
        self.base = self.linear(self.total, areas, {})

    @property
    def renders(self) -> int:
        """Number of renders so far."""
        return self.numbers.count + self.columns

    @abstractmethod
    def linear(self, total: Totals, areas: EffectiveAreas | None, quantities: Mapping) -> Linear:
        """The result of a render, for these values of the quantities of `is_stated`."""

    @property
    def value(self) -> float:
        return self.base.value

    @property
    def error(self) -> float:
        """Standard error from the noise of the rendering, with what its scatter does not show."""
        return float(np.hypot(self.base.error, self.unscattered * self.most_of_intensity))

    @property
    def unscattered(self) -> float:
        """Error of the intensity that the scatter does not show, W/sr."""
        return self.total.unscattered_error(PARTS[self.part])[0] * self.numbers.area

    def areas_of(self, total: Totals) -> EffectiveAreas | None:
        if not self.numbers.by_spectrum:
            return None
        return effective_areas(total, self.scene, self.numbers.area)

    # ------------------------------------------------------------------ Other values of the inputs

    def at(self, values: Mapping[str, float]) -> float:
        """The number for other values of some quantities, from the same random numbers."""
        return self.linear_at(values).value

    def linear_at(self, values: Mapping[str, float]) -> Linear:
        """The same as a sum, with what the number follows from."""
        quantities = {name: value for name, value in values.items() if self.is_stated(name)}
        rest = {name: value for name, value in values.items() if not self.is_own(name)}
        for name, end, there in self.of_motions:
            if list(values) == [name] and isclose(values[name], end, rel_tol=1e-9):
                return there
        checked_names = {name: v for name, v in rest.items() if not self.is_emission(name)}
        if not checked_names:
            return self.linear(self.total, self.changed(self.areas, rest), quantities)
        total = self.numbers.render(checked_names)
        areas = self.areas_of(total)
        emission = {name: value for name, value in rest.items() if name not in checked_names}
        return self.linear(total, self.changed(areas, emission), quantities)

    # ------------------------------------------------------------------ From what is smooth

    @cached_property
    def present(self) -> np.ndarray:
        """`smooth` of the number itself."""
        return self.base.smooth

    def results(self, smooth: np.ndarray) -> np.ndarray:
        """The number for each row of what it follows from, (n, m): (n,)."""
        return smooth[:, 0]

    def slope(self, direction: np.ndarray) -> float:
        """Derivative of the number where `smooth` changes in a direction, (m,)."""
        return float(direction[0])

    @property
    def unit_change(self) -> np.ndarray:
        """Change of `smooth` that changes the number by about 1, (m,)."""
        return np.ones(1)

    def is_feasible(self, values: Mapping[str, float]) -> bool:
        """Whether the quantities can have these values together."""
        for name, value in values.items():
            bounds = self.known[name]
            if not (bounds.lower <= value <= bounds.upper) and not self.needs_render(name):
                return False
        try:
            checked(self.scene, {n: v for n, v in values.items() if self.needs_render(n)})
        except InputError:
            return False
        return True

    def is_own(self, name: str) -> bool:
        """Whether a quantity is none of the scene's."""
        return self.known[name].kind == "scenario"

    def is_stated(self, name: str) -> bool:
        """Whether `linear` takes the value of a quantity."""
        return self.is_own(name)

    def is_emission(self, name: str) -> bool:
        """Whether a change of a quantity needs no render, as it changes sources only."""
        if not self.is_linear or self.known[name].kind not in ("temperature", "radiance"):
            return False
        group, is_blackbody = name.rpartition(".")[0], self.known[name].kind == "temperature"
        # Light of the sky that air or ground has changed does not follow from a temperature alone
        return all(
            (source.temperature is not None) == is_blackbody
            for source in self.areas.sources
            if source.light_of == group
        )

    def needs_render(self, name: str) -> bool:
        return not (self.is_own(name) or self.is_emission(name))

    def changed(self, areas: EffectiveAreas | None, values: Mapping[str, float]):
        """Effective areas with sources of other temperatures and radiances."""
        if areas is None or not values:
            return areas
        sources = list(areas.sources)
        for name, value in values.items():
            was, touched = self.known[name].value, self.touched(name)
            for k in touched:
                if self.known[name].kind == "temperature":
                    sources[k] = sources[k].hotter(value - was, self.scene.band)
                else:
                    sources[k] = sources[k].scaled(value / was if was else 0.0)
        return replace(areas, sources=sources)

    def touched(self, name: str) -> list[int]:
        """Numbers of the sources that a temperature or radiance changes."""
        subject = name.rpartition(".")[0]
        group, at, _ = subject.partition("@")
        is_blackbody = self.known[name].kind == "temperature"
        return [
            k
            for k, source in enumerate(self.areas.sources)
            if (source.light_of or source.group) == group
            and (source.temperature is not None) == is_blackbody
            and (not at or source.temperature == rounded(self.known[name].value))
        ]

    # ------------------------------------------------------------------ Derivatives

    def derivatives(self, names, sigma) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the number, and their standard errors from the noise of the rendering.

        Parameters
        ----------
        names : sequence of str
            K quantities.
        sigma : sequence of float
            Their standard deviations.

        Returns
        -------
        derivative, error : ndarray, shape (K,)
        """
        result = np.zeros((2, len(names)))
        rendered = [k for k, name in enumerate(names) if self.needs_render(name)]
        if rendered:
            result[:, rendered] = self.rendered_derivatives(
                [names[k] for k in rendered], [sigma[k] for k in rendered]
            )
        for k, name in enumerate(names):
            if k not in rendered:
                result[:, k] = self.closed_derivative(name, sigma[k])
        return result[0], result[1]

    def closed_derivative(self, name: str, sigma: float) -> tuple[float, float]:
        """Derivative with respect to a quantity that needs no render, and its standard error."""
        (high, low), width = self.closed_ends(name, sigma)
        slope = replace(self.base, factors=(high.factors - low.factors) / width)
        # Amounts change only with quantities that have no noise, such as that of the sensor
        of_amounts = self.base.factors @ (high.amounts - low.amounts) / width
        return slope.value + float(of_amounts), slope.error

    def closed_ends(self, name: str, sigma: float) -> tuple[list[Linear], float]:
        """The number a small step above and below a quantity, and the width of both steps."""
        step, value = SMALL * sigma, self.known[name].value
        if value:
            step = float(np.clip(step, *(bound * abs(value) for bound in STEPS)))
        limits, ends = (self.within(name, value + step), self.within(name, value - step)), []
        for end in limits:
            quantities = {name: end} if self.is_stated(name) else {}
            rest = {} if self.is_own(name) else {name: end}
            areas = self.changed(self.areas, rest)
            ends.append(self.linear(self.total, areas, quantities))
        return ends, limits[0] - limits[1]

    def source_slope(self, k: int) -> float:
        """Derivative of the number with respect to the temperature of source number k."""
        ends = []
        for step in (SOURCE_STEP, -SOURCE_STEP):
            sources = list(self.areas.sources)
            sources[k] = sources[k].hotter(step, self.scene.band)
            ends.append(self.linear(self.total, replace(self.areas, sources=sources), {}).value)
        return (ends[0] - ends[1]) / (2 * SOURCE_STEP)

    def rendered_derivatives(self, names, sigma):
        if not self.has_weights:
            return self.differences(names, sigma)
        lacking = window.without_column(self.scene, names)
        if lacking:
            k = np.isin(names, list(lacking))
            result = np.empty((2, len(names)))
            result[:, k] = self.differences(np.array(names)[k], np.array(sigma)[k])
            result[:, ~k] = self.rendered_derivatives(np.array(names)[~k], np.array(sigma)[~k])
            return result
        sensitivity = window.differentiate_intensity(
            self.scene, names, self.numbers.repeated, self.part, self.weights()
        )
        self.columns += -(-len(names) // window.MOST_COLUMNS)
        return sensitivity.derivative, sensitivity.error[1:]

    def differences(self, names, sigma) -> np.ndarray:
        """Derivatives by differences over a standard deviation.

        Their noise is known for motions only.
        """
        slopes, errors = [], []
        for name, step in zip(names, sigma):
            if self.known[name].kind == "motion":
                slope, error = self.moved_difference(name, step)
                slopes.append(slope)
                errors.append(error)
                continue
            errors.append(np.nan)
            low, high = (self.within(name, self.known[name].value + s) for s in (-step, step))
            change = self.linear_at({name: high}).smooth - self.linear_at({name: low}).smooth
            slopes.append(self.along(name, change / (high - low)))
        return np.array([slopes, errors])

    def along(self, name: str, direction: np.ndarray) -> float:
        """Note the derivative of `smooth` with respect to a quantity; return the number's."""
        self.slopes = {**self.slopes, name: direction}
        return self.slope(direction)

    def moved_difference(self, name: str, sigma: float) -> tuple[float, float]:
        """Derivative with respect to a motion over a standard deviation, and its standard error.

        Its two renders also give the number at plus and minus that, for `at`. Their mean differs
        from the present number by the curvature, which a pilot gives.
        """
        difference = window.differences_of(self.numbers, name).at(sigma)
        self.numbers.count += 2
        step, present = difference.step, self.known[name].value
        high, low = (
            self.linear(total, self.areas_of(total), {}).smooth for total in difference.ends
        )
        mean = self.total.mean(PARTS[self.part])[0]
        factor = self.brighter / mean if mean else np.array([self.numbers.area])
        below, above = difference.one_sided
        bend = factor * (above - below) * step / 2
        for sign in (1, -1):
            smooth = self.present + sign * (high - low) / 2 + bend
            here, there = self.results(np.array([self.present, smooth]))
            moved = Linear.known(self.value + there - here, partial(np.copy, smooth))
            self.of_motions += ((name, present + sign * step, moved),)
        slope = self.along(name, (high - low) / (2 * step))
        return slope, abs(self.slope(factor)) * difference.error

    def within(self, name: str, value: float) -> float:
        """The value, or the bound of the quantity that it would cross."""
        bounds = self.known[name]
        lower = bounds.lower
        if bounds.kind == "temperature":
            lower += NEAREST * (bounds.value - lower)
        return min(max(value, lower), bounds.upper)

    @property
    def has_weights(self) -> bool:
        """Whether the number is a weighted sum over the sources, see `weights`."""
        return True

    def weights(self) -> dict | None:
        """Factor of the intensity of each source in the number; None if all of them are 1."""
        return None

    # ------------------------------------------------------------------ Reflections

    def truncation(self) -> float:
        """Estimated part of the number that further reflections would add."""
        means = self.numbers.by_reflections(self.total)
        summed = max(0, self.scene.mi.integrator().max_bounces - (MAX_BOUNCE_CHANNELS - 1))
        if not means.sum() > 0:
            return 0.0
        missing = beyond_last(means, summed) * ending(means, summed)
        closure = self.total.mean(f"{self.numbers.prefix}closure")[0] * self.numbers.area
        return float(abs((missing - closure) / means.sum() * self.of_intensity))

    @property
    def most_of_intensity(self) -> float:
        """Largest factor of an intensity in the number."""
        return 1.0

    @property
    def of_intensity(self) -> float:
        """The part of the number that is proportional to the intensity."""
        return self.value

    @property
    def brighter(self) -> np.ndarray:
        """Derivative of `smooth` with respect to the logarithm of the intensity, (m,)."""
        return np.array([self.of_intensity])
