"""Distributions of quantities: moments, products and sums in closed form, and what is refused."""

import numpy as np
import pytest
from scipy import stats

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.estimate import Distribution, check_distribution
from mi_lcair.knowing.budgets.budget import check, second_order
from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.monte_carlo import monte_carlo
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from tests.knowing.budgets.formula import Formula, quantity
from tests.knowing.budgets.plate_scene import plate_scene


def stated(entries, **values) -> Inputs:
    """Inputs of quantities with these values and uncertainties."""
    known = {name: quantity(name, value) for name, value in values.items()}
    return Inputs.of(Uncertainties.read({"sigma": entries}), known, "the formula")


def moments(density, lower, upper):
    """Mean and standard deviation of a density, by the trapezoidal rule."""
    x = np.linspace(lower, upper, 400_001)
    weights = density(x) / np.trapezoid(density(x), x)
    mean = np.trapezoid(weights * x, x)
    return mean, np.sqrt(np.trapezoid(weights * (x - mean) ** 2, x))


def gauss(x, mean, sigma):
    return np.exp(-(((x - mean) / sigma) ** 2) / 2)


@pytest.mark.parametrize("seed", range(8))
def test_moments(seed):
    """Those of the densities that the words state, computed apart."""
    rng = np.random.default_rng(seed)
    value, width = rng.uniform(1, 9), rng.uniform(0.1, 0.9)
    lower, upper = value - rng.uniform(0.2, 2), value + rng.uniform(0.2, 2)

    def triangle(start, end):
        return lambda x: np.minimum((x - start) / (value - start), (end - x) / (end - value))

    factor = 1 + width
    logarithmic = lambda x: gauss(np.log(x), np.log(value), np.log(factor)) / x  # noqa: E731
    near, one, far = (value - width, value + width), np.ones_like, value - 12 * width
    cases = [
        ({"uniform": width}, one, *near),
        ({"uniform": f"{100 * width / value} %"}, one, *near),
        ({"uniform": [lower, upper]}, one, lower, upper),
        ({"triangular": width}, triangle(*near), *near),
        ({"triangular": [lower, upper]}, triangle(lower, upper), lower, upper),
        ({"lognormal": factor}, logarithmic, value / factor**9, value * factor**9),
        ({"normal": width, "upper": upper}, lambda x: gauss(x, value, width), far, upper),
        (
            {"normal": 2.0, "lower": lower, "upper": upper},
            lambda x: gauss(x, value, 2),
            lower,
            upper,
        ),
    ]
    for table, density, start, end in cases:
        law = Distribution.of("x", table, value).law
        mean, sigma = moments(density, start, end)
        assert (law.mean(), law.std()) == pytest.approx((mean, sigma), rel=1e-4), table
        assert stated({"x": table}, x=value).sigma[0] == pytest.approx(sigma, rel=1e-4)


def spread(f, inputs, slopes):
    """Checks, and the distributions to the second order and from 4000 draws."""
    number = Formula(f, dict(zip(inputs.names, inputs.values)))
    sigma = float(np.sqrt(slopes @ inputs.covariance @ slopes))
    checks = check(number, inputs, slopes, sigma)
    curved = second_order(number, checks, sigma, inputs.distributions)
    return sigma, curved, monte_carlo(number, inputs, slopes, 0.0, 4000, 1)


def test_the_sum_of_two_uniforms_is_triangular():
    """GUM supplement 1, 9.2.3, for two: the interval is narrower than that of a normal result."""
    both = stated({"a": {"uniform": 1.0}, "b": {"uniform": [-1.0, 1.0]}}, a=0.0, b=0.0)
    sigma, curved, drawn = spread(lambda a, b: a + b, both, np.ones(2))
    truth = stats.triang(0.5, -2, 4)
    assert sigma == pytest.approx(truth.std()) == pytest.approx(np.sqrt(2 / 3))
    assert curved.shift == pytest.approx(0, abs=1e-3)
    assert curved.sigma == pytest.approx(sigma, rel=1e-3)
    assert curved.interval == pytest.approx(truth.interval(0.95), abs=5e-3)
    assert drawn.sigma == pytest.approx(sigma, abs=4 * drawn.sigma_error + 1e-9)
    assert drawn.interval == pytest.approx(truth.interval(0.95), abs=0.06)
    assert stats.kstest(drawn.results, truth.cdf).pvalue > 1e-3


def test_a_product_of_uniforms():
    """x y with independent x and y: its variance is (m^2 + v)^2 - m^4, and P(x y < t) is known."""
    both = stated({"a": {"uniform": 0.5}, "b": {"uniform": 0.5}}, a=0.5, b=0.5)
    sigma, curved, drawn = spread(lambda a, b: a * b, both, np.full(2, 0.5))
    of_one = 1 / 12
    variance = (0.25 + of_one) ** 2 - 0.25**2
    assert sigma == pytest.approx(np.sqrt(2 * 0.25 * of_one))  # the linear answer
    assert drawn.sigma == pytest.approx(np.sqrt(variance), rel=0.03)
    product = lambda t: t - t * np.log(t)  # noqa: E731  distribution function
    assert stats.kstest(drawn.results, product).pvalue > 1e-3
    # The checks move one factor at a time, and see no curvature
    assert curved.sigma == pytest.approx(sigma, rel=2e-3)


@pytest.mark.parametrize("factor", [1.1, 1.3])
def test_a_power_of_a_log_normal(factor):
    """x^2 of a log-normal x is log-normal, with twice the logarithmic width."""
    one = stated({"a": {"lognormal": factor}}, a=3.0)
    _, curved, drawn = spread(lambda a: a**2, one, np.array([6.0]))
    truth = stats.lognorm(2 * np.log(factor), scale=9)
    assert curved.shift == pytest.approx(truth.mean() - 9, rel=0.02)
    assert curved.sigma == pytest.approx(truth.std(), rel=0.02)
    assert curved.interval == pytest.approx(truth.interval(0.95), rel=5e-3)
    assert stats.kstest(drawn.results, truth.cdf).pvalue > 1e-3


def test_a_distribution_that_is_cut_off_has_another_mean():
    """An emissivity of 0.98 +- 0.02 below 1: the mean of the result moves."""
    one = stated({"a": {"normal": 0.02, "upper": 1.0}}, a=0.98)
    sigma, curved, drawn = spread(lambda a: 5 * a, one, np.array([5.0]))
    truth = stats.truncnorm(-np.inf, 1, 0.98, 0.02)
    assert sigma == pytest.approx(5 * truth.std()) and sigma < 0.085
    assert curved.shift == pytest.approx(5 * (truth.mean() - 0.98), rel=0.01)
    assert curved.interval == pytest.approx(5 * np.array(truth.interval(0.95)), rel=2e-3)
    assert drawn.outside == 0 and drawn.results.max() <= 5


@pytest.mark.parametrize("seed", range(12))
def test_intervals_of_curved_sums_hold_what_they_claim(seed):
    """Random sums of cubics of one to five quantities: 95 % of 2^16 draws lie in the interval."""
    rng = np.random.default_rng(seed)
    names = list("abcde")[: rng.integers(1, 6)]
    tables = {
        "uniform": lambda: {"uniform": rng.uniform(0.3, 2)},
        "triangular": lambda: {"triangular": [5 - rng.uniform(0.1, 2), 5 + rng.uniform(0.1, 2)]},
        "lognormal": lambda: {"lognormal": rng.uniform(1.05, 1.25)},
        "normal": lambda: {"normal": rng.uniform(0.3, 1), "upper": 5 + rng.uniform(0, 1)},
        "plain": lambda: rng.uniform(0.3, 1),
    }
    entries = {name: tables[rng.choice(list(tables))]() for name in names}
    inputs = stated(entries, **dict.fromkeys(names, 5.0))
    b, c = rng.normal(size=(2, len(names))) * np.array([[0.15], [0.03]])
    # What hardly matters to the first order is not checked, and stays linear
    a = rng.choice([-1, 1], len(names)) * rng.uniform(0.6, 1.5, len(names))

    def f(**values):
        x = np.array([values[name] - 5 for name in names])
        return np.tensordot(a, x, 1) + np.tensordot(b, x**2, 1) + np.tensordot(c, x**3, 1)

    number = Formula(f, dict.fromkeys(names, 5.0))
    sigma = float(np.sqrt(a @ inputs.covariance @ a))
    found = second_order(number, check(number, inputs, a, sigma), sigma, inputs.distributions)
    laws = inputs.distributions
    draws = {
        name: laws[name].law.rvs(2**16, random_state=rng)
        if name in laws
        else rng.normal(5.0, entries[name], 2**16)
        for name in names
    }
    results = f(**draws)
    inside = (results >= found.interval[0]) & (results <= found.interval[1])
    # The standard error of the share is 0.0009
    assert inside.mean() == pytest.approx(0.95, abs=0.006)
    assert found.sigma == pytest.approx(results.std(), rel=0.03)
    assert found.shift == pytest.approx(results.mean(), abs=0.05 * found.sigma)


def test_a_row_names_the_distribution():
    both = stated({"a": {"uniform": 1.0}, "b": 2.0}, a=1.0, b=2.0)
    cut_off = stated({"c": {"normal": 1.0, "lower": 2.0}}, c=3.0)
    named = {
        row.quantity: row.distribution
        for inputs in (both, cut_off)
        for row in inputs.contributions(np.ones(2), np.zeros(2))
    }
    assert named == {"a": "uniform", "b": "", "c": "cut off"}


def test_a_plate_with_a_uniform_reflectance(tmp_path):
    """I = (1 - R) A B with R in 0.3..0.5: a uniform result, whose 95 % interval is 0.95 of it."""
    scene = plate_scene(tmp_path)
    found = mi_lcair.budget(
        scene, {"sigma": {"paint.reflectance": {"uniform": [0.3, 0.5]}}}, spp=256, draws=40
    )
    first = next(row for row in found.rows if row.quantity == "paint.reflectance")
    per_unit = found.value / 0.6
    assert first.sigma == pytest.approx(0.2 / np.sqrt(12)) and first.distribution == "uniform"
    assert first.contribution == pytest.approx(-per_unit * 0.2 / np.sqrt(12), rel=2e-3)
    ends = found.value + 0.95 * 0.1 * per_unit * np.array([-1, 1])
    assert found.second_order.interval == pytest.approx(ends, rel=5e-3)
    assert found.monte_carlo.sigma == pytest.approx(found.sigma_of_quantities, rel=5e-3)
    assert abs(found.monte_carlo.results - found.value).max() <= 0.1 * per_unit * 1.001
    text = "\n".join(str(part) for section in found.sections() for part in section.parts)
    assert "paint.reflectance (uniform)" in text


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"uniform": 1, "normal": 2}, "must have one of uniform, triangular, lognormal, normal"),
        ({"lower": 1, "upper": 2}, "must have one of"),
        ({"uniform": 1, "upper": 2}, "unknown entry of 'x' 'upper'"),
        ({"normal": 1, "low": 2}, "unknown entry of 'x' 'low'"),
        ({"uniform": [2, 1]}, "its ends must be two rising numbers"),
        ({"triangular": [1, 1]}, "its ends must be two rising numbers"),
        ({"triangular": [1, 2, 3]}, "its ends must be two rising numbers"),
        ({"uniform": [1, "2"]}, "its ends must be two rising numbers"),
        ({"uniform": [1, float("inf")]}, "its ends must be two rising numbers"),
        ({"normal": 1, "lower": 3, "upper": 2}, "its ends must be two rising numbers"),
        ({"normal": 1, "lower": True}, "its ends must be two rising numbers"),
        ({"normal": [1, 2]}, "must be a standard deviation"),
        ({"uniform": 0}, "'x: uniform' = 0; must be positive"),
        ({"uniform": "much"}, "'x: uniform' = 'much'; must be"),
        ({"uniform": {"a": 1}}, "must have one of"),
        ({"lognormal": 1}, "must be a factor above 1"),
        ({"lognormal": "5 %"}, "must be a factor above 1"),
        ({"lognormal": True}, "must be"),
    ],
)
def test_refuses_other_tables(table, message):
    with pytest.raises(InputError, match=message):
        check_distribution("x", table)


@pytest.mark.parametrize(
    ("table", "value", "message"),
    [
        ({"uniform": [1, 2]}, 3.0, "does not contain the value 3 of the quantity"),
        ({"normal": 1, "upper": 2}, 3.0, "does not contain the value 3 of the quantity"),
        ({"lognormal": 1.1}, 0.0, "does not contain the value 0 of the quantity"),
        ({"triangular": "5 %"}, 0.0, "relative to a value of 0; give a number"),
    ],
)
def test_refuses_a_value_outside(table, value, message):
    with pytest.raises(InputError, match=message):
        stated({"x": table}, x=value)


def test_correlations_are_those_of_normal_quantities():
    group = [{"names": ["a", "b"], "correlation": 0.5}]
    with pytest.raises(InputError, match="the distribution of 'b' is not normal"):
        Uncertainties.read({"sigma": {"a": 1.0, "b": {"uniform": 1.0}}, "correlated": group})
