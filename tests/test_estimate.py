"""Estimates: what contributes to their errors, by hand, and how they are written."""

import numpy as np
import pytest

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate, slope, uncertain, with_error
from tests.knowing.budgets.formula import inputs

VALUES = {"a": 10.0, "b": 20.0, "c": 30.0}
COVARIANCE = [[4.0, 1.8, 0], [1.8, 1.0, 0], [0, 0, 0.25]]
STATED = inputs(VALUES, COVARIANCE, [[0, 1], [2]])
DERIVATIVE, ERRORS = np.array([3.0, -2.0, 8.0]), np.array([0.1, 0.2, np.nan])


def test_shares_of_groups_and_of_other_errors():
    """Of a and b: 9 x 4 + 4 x 1 - 2 x 3 x 2 x 1.8 = 18.4; of c: 16; of the noise: 1.5^2."""
    noises = [Contribution("none", 0.0), Contribution("noise", 1.5)]
    found = Estimate.of(7.0, "W/sr", noises + STATED.contributions(DERIVATIVE, ERRORS))
    rows = found.contributions
    assert [row.quantity for row in rows] == ["a & b", "c", "noise", "none"]
    assert [row.contribution for row in rows] == pytest.approx([18.4**0.5, 4.0, 1.5, 0.0])
    assert [row.share for row in rows] == pytest.approx([18.4 / 36.65, 16 / 36.65, 2.25 / 36.65, 0])
    assert found.standard_error == pytest.approx(36.65**0.5) and str(found) == "7 +- 6.1 W/sr"
    group, single = rows[:2]
    assert [member.quantity for member in group.members] == ["a", "b"]
    assert [member.contribution for member in group.members] == pytest.approx([6.0, -2.0])
    assert [member.share for member in group.members] == [None, None]
    assert (single.value, single.sigma, single.sensitivity, single.unit) == (30, 0.5, 8, "K")
    assert group.members[1].sensitivity_error == 0.2 and group.value is None
    assert np.isnan(single.sensitivity_error) and single.members == ()
    assert group.members[0].sensitivity_error == 0.1
    table = found.columns()
    assert table["quantity"].tolist() == ["a & b", "a", "b", "c", "noise", "none"]
    assert table["is_member"].tolist() == [False, True, True, False, False, False]
    assert table["contribution_W_sr"] == pytest.approx([18.4**0.5, 6, -2, 4, 1.5, 0])


def test_errors_that_cancel():
    """A correlation of 1 with opposite contributions, and nothing at all."""
    small = inputs({"a": 1.0}, [[1e-6]]).contributions(np.ones(1), np.zeros(1))
    assert Estimate.of(1.0, "K", small).contributions[0].share == 1
    opposite = inputs({"a": 1.0, "b": 1.0}, [[1, 1], [1, 1]], [[0, 1]])
    for derivative, expected in (([2.0, -2.0], 0), ([2.0, 3.0], 5)):
        rows = opposite.contributions(np.array(derivative), np.zeros(2))
        (row,) = Estimate.of(1.0, "K", rows).contributions
        assert (row.contribution, row.share) == pytest.approx((expected, float(expected > 0)))


def test_arrays_and_their_reduction():
    """Errors of three pixels from a slope that changes its sign, and from noise."""
    slopes, noise = np.array([-1.0, 2.0, 3.0]), np.full(3, 4.0)
    rows = [Contribution("noise", noise), Contribution.of("x", 2.0, slopes)]
    found = Estimate.of(np.array([10.0, 20.0, 40.0]), "K", rows)
    np.testing.assert_allclose(found.standard_error, np.sqrt(16 + 4 * slopes**2))
    assert [row.quantity for row in found.contributions] == ["noise", "x"]
    middle = found.reduced(lambda values: float(np.median(values)))
    assert middle.value == 20 and middle.standard_error == pytest.approx(32**0.5)
    assert middle["x"].contribution == 4 and middle["x"].sensitivity == 2
    assert middle["x"].share == middle["noise"].share == pytest.approx(0.5)
    table = found.columns()
    assert table["contribution_K"].tolist() == [[4, 4, 4], [-2, 4, 6]]
    np.testing.assert_array_equal(table["sensitivity"], [[np.nan] * 3, slopes])
    np.testing.assert_array_equal(table["sigma"], [np.nan, 2])
    last = found.reduced(lambda values: float(values[0]))
    assert last["x"].contribution == -2 and last.contributions[0].quantity == "noise"
    mean = found["x"].through(np.mean)
    assert mean.contribution == pytest.approx(8 / 3) and mean.sigma == 2
    with pytest.raises(KeyError):
        found["y"]


def test_a_table_of_uncertainties_as_they_were_stated():
    """Those of a heat balance are numbers or texts; arrays have a contribution for each value."""
    rows = [Contribution("exchange", np.ones((2, 3)))]
    rows += [Contribution(name, np.ones((2, 3)), sigma=s) for name, s in (("a", 2.0), ("b", "5 %"))]
    table = Estimate.of(np.ones((2, 3)), "K", rows).columns()
    assert table["sigma"].tolist() == ["", "2.0", "5 %"]
    assert table["contribution_K"].shape == (3, 2, 3) and np.isnan(table["share"]).all()
    assert Estimate(1.0, 0.1).columns()["sigma"].shape == (0,)


@pytest.mark.parametrize(
    "estimate, text",
    [
        (Estimate(305.1234, 0.8151, "K"), "305.12 +- 0.82 K"),
        (Estimate(8123.4, 251.0, "m"), "8120 +- 250 m"),
        (Estimate(0.99312347, 3.1e-6, "1"), "0.9931235 +- 3.1e-06"),
        (Estimate(0.92), "0.92"),
        (Estimate(np.array([[294.5, 290.0]]), np.array([[1.0, 2.0]]), "K"), "290 to 294.5 K"),
        (
            Estimate(-2.91e-9, 1e-11, "W m^-2", half_width=2.36e-11),
            "-2.91e-09 +- 2.4e-11 W m^-2 (95 %)",
        ),
    ],
)
def test_words(estimate, text):
    assert str(estimate) == text


def test_digits():
    assert with_error(123456.0, 1000.0) == "123500 +- 1000"
    assert with_error(0.001, 0.5) == "0.001 +- 0.5"
    assert with_error(1 / 3, 1e-15) == "0.333333333 +- 1e-15"
    assert with_error(np.nan, 1.0) == "nan +- 1"


def test_slopes_end_at_bounds():
    assert slope(lambda x: x**2, 3.0, 0.5) == pytest.approx(6)
    assert slope(lambda x: x**2, 3.0, 0.5, (-np.inf, 3.0)) == pytest.approx(5.5)
    with pytest.raises(InputError, match="no room"):
        slope(lambda x: x, 3.0, 0.0)


@pytest.mark.parametrize(
    "given, pair",
    [
        (3, (3, 0)),
        ((0.92, 0.02), (0.92, 0.02)),
        ("0.92", (0.92, 0)),
        ("0.92 +- 0.02", (0.92, 0.02)),
        ("-4 ± 2 %", (-4, 0.08)),
        (Estimate(2.0, 0.5, "m"), (2, 0.5)),
    ],
)
def test_numbers_with_uncertainties(given, pair):
    found = uncertain(given, "range", Bounds(unit="K"))
    assert found.pair == pytest.approx(pair) and found.unit == "K"


@pytest.mark.parametrize(
    "given, message",
    [
        ("about 3", "range 'about 3' is no number; give one, such as 0.9 or"),
        ((1, 2, 3), "is no number"),
        ("3 +-", "is no number"),
        ("-1", "range = -1 K; must be 0 or more"),
        ((3, -1), r"standard uncertainty of range = -1 K; must lie in 0..1e\+12"),
    ],
)
def test_what_is_no_number_with_an_uncertainty(given, message):
    with pytest.raises(InputError, match=message):
        uncertain(given, "range", Bounds(lower=0, unit="K"))


def test_what_json_and_sentences_state():
    found = Estimate(5.0, 0.125, "K", half_width=0.25)
    assert found.as_dict() == {"value": 5, "standard_error": 0.125, "unit": "K", "half_width": 0.25}
    assert Estimate(5.0).as_dict() == {"value": 5, "standard_error": 0}
    assert found.expanded == "+- 0.25 K (k = 2, about 95 %)"
    assert Estimate(1.0, 0.01, "1").expanded == "+- 0.02 (k = 2, about 95 %)"
    scaled = found.through(lambda x: 4 * x)
    assert (scaled.value, scaled.standard_error, scaled.half_width) == (20, 0.5, 1)
    total = found.through(lambda x, y: x + y, Estimate(1.0, 0.5, half_width=1.0))
    assert (total.pair, total.half_width) == ((6, 0.625), 1.25)
