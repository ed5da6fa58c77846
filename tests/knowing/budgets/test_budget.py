"""Budgets against closed forms and against their own Monte Carlo."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import truncnorm

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.knowing.budgets.budget import (
    NOISE,
    TRUNCATION,
    Budget,
    Check,
    SecondOrder,
    budget_image,
    check,
    facet_contribution,
    remarks,
    sigma_of,
    slopes_per_area,
    variance,
)
from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling
from tests.derivatives.motions.test_differences import view_of_wall
from tests.detection.disc_scenario import disc, triangles, write_disc
from tests.knowing.budgets.formula import Formula, inputs
from tests.knowing.budgets.plate_scene import (
    AREA,
    EMISSIVITY,
    TEMPERATURE,
    plate_scene,
    row,
    slope,
    triangle_areas,
)

mi.set_variant("llvm_ad_mono")


def cylinder(**parameters):
    return mi_lcair.load(
        "cylinder_ir_range", finish="gloss_black", resolution=16, spp=64, **parameters
    )


def test_a_plate_in_closed_form(tmp_path):
    """I = (1 - reflectance) A B(T), so that both contributions are known."""
    scene = plate_scene(tmp_path)
    stated = {"sigma": {"plate.temperature": 2.0, "paint.reflectance": "5 %"}}
    found = mi_lcair.budget(scene, stated, spp=1024)
    B = float(in_band_radiance(scene.band, TEMPERATURE))
    by_temperature = EMISSIVITY * AREA * slope(scene.band, TEMPERATURE) * 2
    by_paint = -AREA * B * 0.05 * (1 - EMISSIVITY)
    assert found.value == pytest.approx(EMISSIVITY * AREA * B, rel=2e-3)
    assert row(found, "plate.temperature").contribution == pytest.approx(by_temperature, rel=2e-3)
    assert row(found, "paint.reflectance").contribution == pytest.approx(by_paint, rel=2e-3)
    assert found.sigma_of_quantities == pytest.approx(np.hypot(by_temperature, by_paint), rel=2e-3)
    assert sum(row.share for row in found.rows) == pytest.approx(1)
    assert [row.share for row in found.rows] == sorted([row.share for row in found.rows])[::-1]
    assert row(found, TRUNCATION).contribution == 0  # nothing is reflected
    assert 0 < row(found, NOISE).contribution < 0.01 * found.value
    assert found.remarks == [] and all(check.holds for check in found.checks)


@pytest.mark.slow
def test_correlated_quantities_together(tmp_path):
    """With a correlation of 1 contributions add, with -1 they cancel, with 0 their squares add."""
    scene, total = plate_scene(tmp_path), {}
    sigma = {"plate.temperature": 2.0, "paint.reflectance": 0.02}
    alone = mi_lcair.budget(scene, {"sigma": sigma}, spp=64)
    a, b = (row(alone, name).contribution for name in sigma)
    for correlation in (1, 0.5, -1):
        group = [{"names": list(sigma), "correlation": correlation}]
        found = mi_lcair.budget(scene, {"sigma": sigma, "correlated": group}, spp=64)
        total[correlation] = found.sigma_of_quantities
        together = row(found, "plate.temperature & paint.reflectance")
        assert [member.quantity for member in together.members] == list(sigma)
        assert [member.contribution for member in together.members] == pytest.approx([a, b])
        assert all(member.share is None for member in together.members)
        assert sum(row.share for row in found.rows) == pytest.approx(1)
    assert a * b < 0
    assert total[1] == pytest.approx(abs(a + b), rel=1e-6)
    assert total[-1] == pytest.approx(abs(a - b), rel=1e-6)
    assert total[0.5] == pytest.approx(np.sqrt(a**2 + b**2 + a * b), rel=1e-6)


@pytest.mark.slow
def test_a_group_and_one_of_its_temperatures():
    """A common error of all temperatures beside independent ones of each."""
    names = ("self.temperature", "self@298.2.temperature")
    found = mi_lcair.budget(cylinder(), {"sigma": dict.fromkeys(names, 1.0)}, draws=100, spp=16)
    group, one = (row(found, name).contribution for name in names)
    assert 0 < one < group
    assert found.sigma_of_quantities == pytest.approx(np.hypot(group, one))
    assert found.monte_carlo.sigma == pytest.approx(
        found.sigma_of_quantities, abs=4 * found.monte_carlo.sigma_error
    )
    assert found.renders == 1


@pytest.mark.slow
def test_cylinder_against_its_monte_carlo():
    """Temperatures and all parameters of the paint."""
    stated = {
        "sigma": {
            "self.temperature": 1.0,
            "walls.temperature": 2.0,
            "gloss_black.epsilon": 0.008,
            "gloss_black.b": 0.02,
            "gloss_black.rho_d": 1e-4,
            "gloss_black.e": 5e-4,
        }
    }
    found = mi_lcair.budget(cylinder(), stated, draws=50, spp=16)
    mc = found.monte_carlo
    assert mc.outside == 0 and len(mc.results) == mc.draws == 50
    assert mc.sigma == pytest.approx(found.sigma_of_quantities, abs=3.5 * mc.sigma_error)
    assert mc.is_controlled and mc.sigma_error < 0.02 * mc.sigma
    assert mc.mean == pytest.approx(found.value, abs=4 * mc.sigma / 7)
    assert mc.interval[0] < found.value < mc.interval[1]
    checked = {check.quantity for check in found.checks}
    assert {"self.temperature", "gloss_black.epsilon", "gloss_black.b"} <= checked
    assert all(check.holds for check in found.checks) and found.remarks == []


def test_a_large_error_of_a_temperature_is_not_linear(tmp_path):
    """In MWIR 60 K of 310 K change the radiance by a factor of ten, not by the derivative."""
    scene = plate_scene(tmp_path, band="MWIR")
    found = mi_lcair.budget(scene, {"sigma": {"plate.temperature": 60.0}})
    (check,) = found.checks
    B = lambda T: EMISSIVITY * AREA * float(in_band_radiance(scene.band, T))
    assert not check.holds
    assert check.plus == pytest.approx(B(370) - B(310), rel=0.02)
    assert check.minus == pytest.approx(B(250) - B(310), rel=0.02)
    assert (
        len(found.remarks) == 1
        and "plate.temperature: the linear result is wrong" in found.remarks[0]
    )
    small = mi_lcair.budget(scene, {"sigma": {"plate.temperature": 1.0}})
    assert small.checks[0].holds and small.remarks == []


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [1e-30, 1e-10, 1e5])
def test_sensitivity_does_not_depend_on_sigma(tmp_path, sigma):
    scene = plate_scene(tmp_path)
    found = mi_lcair.budget(scene, {"sigma": {"plate.temperature": sigma}}, spp=1024)
    expected = EMISSIVITY * AREA * slope(scene.band, TEMPERATURE)
    assert row(found, "plate.temperature").sensitivity == pytest.approx(expected, rel=2e-3)


def test_a_sigma_beyond_both_bounds(tmp_path):
    scene = plate_scene(tmp_path)
    found = mi_lcair.budget(scene, {"sigma": {"plate.temperature": 1e6}})
    (check,) = found.checks
    assert (check.plus, check.minus, check.holds) == (None, None, False)
    assert any("outside its bounds" in remark for remark in found.remarks)


@pytest.mark.slow
def test_monte_carlo_stays_inside_the_bounds(tmp_path):
    """Draws of a reflectance below 0 are drawn again, and the budget says so."""
    scene = plate_scene(tmp_path)
    stated = {"sigma": {"paint.reflectance": 0.4}}
    found = mi_lcair.budget(scene, stated, draws=100)
    mc = found.monte_carlo
    assert mc.is_controlled and mc.outside > 10 and mc.sigma < 0.95 * found.sigma_of_quantities
    # The result is linear in the reflectance, whose cut-off normal distribution is known
    expected = found.sigma_of_quantities * truncnorm.std(-1, 1.5)
    assert mc.sigma == pytest.approx(expected, abs=3 * mc.sigma_error)
    assert mc.sigma_error < 0.02 * mc.sigma
    top = AREA * float(in_band_radiance(scene.band, TEMPERATURE))
    assert mc.results.min() > -0.01 * top and mc.results.max() < 1.01 * top
    assert f"{mc.outside} of {100 + mc.outside} draws were outside" in found.remarks[-1]


@pytest.mark.study
@pytest.mark.parametrize("sigma", [2.0, 8.0])
def test_error_of_the_monte_carlo_covers_the_truth(tmp_path, sigma):
    """The scatter of the standard deviation over seeds is what each of them states.

    The truth comes from quadrature of Planck's law over the normal distribution. In MWIR it is not
    that of the linear answer.
    """
    scene = plate_scene(tmp_path, band="MWIR")
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    B = in_band_radiance(scene.band, TEMPERATURE + sigma * nodes)
    weights /= weights.sum()
    truth = np.sqrt(weights @ B**2 - (weights @ B) ** 2)
    stated, misses = {"sigma": {"plate.temperature": sigma}}, []
    for seed in range(30):
        found = mi_lcair.budget(scene, stated, draws=50, seed=seed, spp=4)
        mc, scale = (
            found.monte_carlo,
            found.value / float(in_band_radiance(scene.band, TEMPERATURE)),
        )
        misses.append((mc.sigma - scale * truth) / mc.sigma_error)
        assert mc.is_controlled
    assert np.mean(np.abs(misses) < 2.01) >= 0.8 and abs(np.mean(misses)) < 0.8


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"closure": "tail"}, "closure = tail has no derivatives"),
        ({"spp": 4, "tolerance": 0.1}, "tolerance and max_spp cannot be combined"),
        ({"tolerance": -1}, "tolerance = -1; must be positive"),
        ({"draws": 3}, "must be 10 or more"),
        (
            {"stated": {"sigma": {"plate.temperatur": 1}}},
            "unknown quantity of plate 'plate.temperatur'",
        ),
    ],
)
def test_what_cannot_be_used(tmp_path, arguments, message):
    scene = plate_scene(tmp_path, arguments.pop("closure", "none"))
    stated = arguments.pop("stated", {"sigma": {"plate.temperature": 1.0}})
    with pytest.raises(InputError, match=message):
        mi_lcair.budget(scene, stated, **arguments)


def test_to_a_tolerance():
    found = mi_lcair.budget(cylinder(), {"sigma": {"self.temperature": 1.0}}, tolerance=0.002)
    assert 0 < row(found, NOISE).contribution < 0.001 * found.value and found.remarks == []


@pytest.mark.slow
def test_a_plume_before_the_sun():
    """Where the sun is drawn, paths do not give the plume's derivative, so that differences do."""
    what = {"position": 3, "band": "MWIR", "plume_transmittance": 0.7, "light": "day"}
    scene = mi_lcair.load("a340_landing", resolution=16, **what)
    stated = {"sigma": {"plume.transmittance": 0.05, "self.temperature": 2.0}}
    found = mi_lcair.budget(scene, stated, spp=1024)
    ends = []
    for value in (0.65, 0.75):
        with changed(scene, {"plume.transmittance": value}):
            ends.append(mi_lcair.sensitivities(scene, [], spp=1024).value)
    expected = (ends[1] - ends[0]) / 2
    assert row(found, "plume.transmittance").contribution == pytest.approx(expected, rel=1e-3)
    assert row(found, "self.temperature").sensitivity_error > 0
    plume = next(check for check in found.checks if check.quantity == "plume.transmittance")
    assert plume.minus < 0 < plume.plus or plume.plus < 0 < plume.minus
    assert found.second_order.shift == pytest.approx(
        sum(check.plus + check.minus for check in found.checks) / 2, abs=2e-3 * found.sigma
    )


# Independent errors of single facets against sums over them
# ----------------------------------------------------------

mi.set_variant("llvm_ad_mono")


@pytest.mark.slow
def test_independent_errors_of_facets(tmp_path):
    """The disc's n equal facets: each has the n-th part of the derivative, and squares add."""
    write_disc(tmp_path, np.full(len(triangles()), 400.0))
    scenario = disc(tmp_path, render__resolution=64, render__spp=64)
    band, areas = scenario.sensor.detector().band, triangle_areas()
    one = slope(band, 400) / 1000**2
    found = mi_lcair.budget(scenario, {"facets": {"self": 2.0}}, draws=50)
    expected = 2 * one * np.sqrt(np.sum(areas**2))
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.02)
    contribution = row(found, "self facets").contribution
    assert found.sigma_of_quantities == pytest.approx(contribution, rel=1e-12)
    assert found.monte_carlo.sigma == pytest.approx(found.sigma_of_quantities, rel=1e-6)
    # Only two of the facets, from a table
    (tmp_path / "sigma.csv").write_text("facet,sigma_K\n0,3\n7,4\n")
    found = mi_lcair.budget(scenario, {"facets": {"self": str(tmp_path / "sigma.csv")}})
    expected = one * np.hypot(3 * areas[0], 4 * areas[7])
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    "facets, message",
    [
        ({"selv": 1.0}, "unknown group 'selv'; known: self"),
        ({"self": "facet,sigma_K\n9999,1\n"}, "group self has no facet 9999"),
        ({"self": "facet,sigma_K\n0,-1\n"}, "sigma_K = -1; must lie in 0..1e"),
        ({"self": "facet,sigma_K\n0,1\n0,2\n"}, "a facet is listed twice"),
        ({"self": "number,sigma\n0,1\n"}, "the header must name facet and sigma_K"),
    ],
)
def test_facets_that_cannot_be_used(tmp_path, facets, message):
    write_disc(tmp_path, np.full(len(triangles()), 400.0))
    if isinstance(facets.get("self"), str):
        (tmp_path / "s.csv").write_text(facets["self"])
        facets = {"self": str(tmp_path / "s.csv")}
    with pytest.raises(InputError, match=message):
        mi_lcair.budget(disc(tmp_path, render__resolution=8), {"facets": facets})


class Facets:
    """A number of 2 m^2 of facets at 300 K and 5 m^2 at 350 K, with slopes of 6 and 10."""

    is_linear, what, unit = True, "plate", "W/sr"
    areas = SimpleNamespace(
        sources=[
            Source("self", "300 K", 1.0, 300.0),
            Source("other", "300 K", 1.0, 300.0),
            Source("self", "350 K", 1.0, 350.0),
            Source("self", "table", 1.0),
        ]
    )

    def source_slope(self, k):
        return (6.0, 99.0, 10.0, 99.0)[k]


def test_slopes_of_facets():
    """The slope of a source is divided among its facets by their area; unseen ones have none."""
    LWIR = band("LWIR")
    matrix = SimpleNamespace(temperature=np.array([300.0, 350.0, 300.0, 320.0]), band=LWIR)
    area = np.array([0.5, 4.0, 1.5, 0.0])
    found = slopes_per_area(Facets(), "self", matrix, area)
    np.testing.assert_allclose(found, [3.0, 2.5, 3.0, 0.0])
    number = Facets()
    number.is_linear = False
    expected = [slope(LWIR, T) for T in matrix.temperature]
    np.testing.assert_allclose(slopes_per_area(number, "self", matrix, area), expected, rtol=1e-4)
    number.unit = "W m^-2"
    with pytest.raises(InputError, match="errors of single facets in a contrast need at most 64"):
        slopes_per_area(number, "self", matrix, area)


@pytest.mark.parametrize("is_linear", [True, False])
def test_contribution_of_facets(monkeypatch, is_linear):
    """Products of different randomisations of area x slope x sigma, added over the facets.

    The first pixel sees half of the first facet beside the second one.
    """
    areas = np.array([[1.0, 3.0], [1.4, 2.6], [0.6, 3.4]])
    matrices = [np.array([[a / 2, b], [a / 2, 0]]) / (10 / 4) for a, b in areas]  # 4 on 10 m^2
    matrix = SimpleNamespace(
        matrices=matrices,
        facets=np.array([0, 1]),
        temperature=np.array([300.0, 350.0]),
        band=band("LWIR"),
    )
    rendered = []
    monkeypatch.setattr(
        "mi_lcair.knowing.budgets.budget.facet_matrix",
        lambda *scene, **options: rendered.append(options) or matrix,
    )
    number = Facets()
    number.numbers = SimpleNamespace(
        sampling=SimpleNamespace(sensor=0, seed=3),
        windows=SimpleNamespace(pixels=4),
        paths=64,
        area=10.0,
    )
    number.scene, number.columns, number.is_linear = None, 0, is_linear
    found = facet_contribution(number, "self", 2.0)
    slopes = [6 / 1.0, 10 / 3.0]  # mean areas of the facets: 1 and 3 m^2
    if not is_linear:
        slopes = [slope(matrix.band, T) for T in matrix.temperature]
    effects = 2.0 * areas * slopes
    pairs = [effects[r] @ effects[s] for r in range(3) for s in range(3) if r != s]
    assert found == pytest.approx(np.sqrt(np.mean(pairs)), rel=1e-4)
    assert number.columns == 1
    number.numbers.paths = 400
    facet_contribution(number, "self", 2.0)
    stated = {"groups": ["self"], "sensor": 0, "seed": 3}
    assert rendered == [stated | {"spp": 16}, stated | {"spp": 100}]


def test_standard_deviations_of_facets(tmp_path):
    """One for all facets, or those of a table, in which the other facets have none."""
    facets = np.array([3, 0, 7])
    np.testing.assert_array_equal(sigma_of(facets, 2.5, "self"), [2.5, 2.5, 2.5])
    (tmp_path / "sigma.csv").write_text("facet,sigma_K\n7,3\n3,0\n")
    np.testing.assert_array_equal(sigma_of(facets, tmp_path / "sigma.csv", "self"), [0, 0, 3])


# Checks of the linear answer against formulas
# --------------------------------------------


def checked(f, derivative, values, covariance, groups=None, total=None, **bounds):
    stated = inputs(values, covariance, groups)
    derivative = np.array(derivative, dtype=float)
    total = np.sqrt(derivative @ stated.covariance @ derivative) if total is None else total
    return check(Formula(f, values, **bounds), stated, derivative, total)


def test_a_linear_number():
    """The step goes in the direction of a larger value of the quantity."""
    (found,) = checked(lambda a: 5 - 3 * a, [-3], {"a": 2.0}, [[0.25]])
    assert found.quantity == "a" and found.holds
    assert (found.linear, found.plus, found.minus) == pytest.approx((-1.5, -1.5, 1.5))


@pytest.mark.parametrize("curvature, holds", [(0.099, True), (0.101, False), (-0.101, False)])
def test_a_tenth_of_the_change_is_allowed(curvature, holds):
    """a + k a^2 at 0 with a step of 1: changes of 1 + k and -1 + k."""
    k = curvature
    (found,) = checked(lambda a: a + k * a**2, [1], {"a": 0.0}, [[1.0]])
    assert found.holds == holds
    assert (found.plus, found.minus) == pytest.approx((1 + k, -1 + k))


def test_correlated_quantities_move_together():
    """Along covariance x derivative, one standard deviation of the result far."""
    covariance, c = np.array([[4.0, 1.8], [1.8, 1.0]]), np.array([3.0, -2.0])
    (found,) = checked(
        lambda a, b: 3 * a - 2 * b + 0.5 * a * b, c, {"a": 0.0, "b": 0.0}, covariance, [[0, 1]]
    )
    a, b = covariance @ c / np.sqrt(c @ covariance @ c)
    assert found.linear == pytest.approx(np.sqrt(18.4))
    assert found.plus == pytest.approx(3 * a - 2 * b + 0.5 * a * b)
    assert found.minus == pytest.approx(-3 * a + 2 * b + 0.5 * a * b)


def test_only_what_matters_is_checked():
    """From a share of 1 % of the variance on."""
    f, values = (lambda a, b: a + b), {"a": 1.0, "b": 1.0}
    for sigma, names in ((0.2999, ["a"]), (0.3001, ["a", "b"])):
        found = checked(f, [1, 1], values, np.diag([1, sigma**2]), total=3.0)
        assert [one.quantity for one in found] == names


def test_bounds():
    (found,) = checked(lambda a: a, [1], {"a": 2.0}, [[9.0]], lower=0.0)
    assert (found.plus, found.minus, found.holds) == (3.0, None, False)
    assert (
        "minus one sigma is outside its bounds, so that the linear result is right on one side"
        in (found.sentence("W/sr"))
    )


def test_sentences():
    """A side whose change is known but wrong is stated beside the one without a change."""
    assert Check("a", 2.0, 3.0, -2.0, False).sentence("W/sr") == (
        "a: the linear result is wrong: plus one sigma changes the result by +3 W/sr and minus "
        "one sigma changes the result by -2 W/sr, but the derivative gives +-2; use Monte Carlo"
    )
    wrong = Check("a", -2.0, None, 2.3, False).sentence("K")
    assert "minus one sigma changes the result by +2.3 K and plus one sigma is outside" in wrong
    assert "on one side only" in Check("a", -2.0, None, 2.19, False).sentence("K")
    assert "on one side only" in Check("a", -2.0, None, 1.81, False).sentence("K")
    neither = Check("a", 2.0, None, None, False).sentence("K")
    assert "plus one sigma is outside its bounds and minus one sigma is outside" in neither


def test_a_check_in_a_table_and_along_its_direction():
    """2 z + 0.25 z^2 + 0.75 z^3 is 3 at 1 and -2.5 at -1. With one side the cubic is linear."""
    f, stated = lambda a: a * (2 + a * (0.25 + a * 0.75)), inputs({"a": 0.0}, [[1.0]])
    (found,) = check(Formula(f, {"a": 0.0}), stated, np.array([2.0]), 2.0)
    np.testing.assert_allclose(found.cubic[:, 0], [2, 0.25, 0.75])
    assert found.cells() == ["a", "+-2", "+3", "-2.5", "FAILS"]
    (one_sided,) = check(Formula(f, {"a": 0.0}, upper=0.5), stated, np.array([2.0]), 2.0)
    np.testing.assert_allclose(one_sided.cubic[:, 0], [2, 0, 0])
    one_sided = Check("a", -0.123456, None, 0.5, True)
    assert one_sided.cells() == ["a", "+-0.1235", "outside its bounds", "+0.5", "holds"]


def made(value=10.0, checks=()):
    """A budget of 10 +- 5 W/sr: 4.8 from a quantity, the rest from the rendering."""
    errors = {"lid": 4.8, NOISE: 1.4, TRUNCATION: 0.0}
    rows = [Contribution(name, error) for name, error in errors.items()]
    second = SecondOrder(0.0123, 5.1234, (1.234567, 21.0))
    stated = Estimate.of(value, "W/sr", rows), inputs({"lid": 1.0}, [[1.0]]), list(checks)
    return Budget("plate", "intensity", *stated, second, None, [], 3, 64, 0.5)


def test_a_budget_in_words():
    found = made(checks=[Check("lid", 2.0, 2.0, -2.0, True)])
    assert found.summary() == (
        "budget of plate: intensity 10 +- 5 W/sr (one standard uncertainty), most from lid (92.2 % "
        "of the variance)"
    )
    assert found.sigma_of_quantities == pytest.approx(4.8)
    first, last = found.sections()
    assert first.parts[0].rows == [
        ("intensity", "10 +- 5 W/sr (one standard uncertainty, 50 %)"),
        ("expanded", "+- 10 W/sr (k = 2, about 95 %)"),
        ("second order", "mean +0.012, sigma 5.12 W/sr, about 95 % in 1.2346..21"),
        ("renders", "3 of 64 paths"),
    ]
    assert first.parts[1].rows[0] == ["lid", "", "", "", "4.8", "92.16 %"]
    assert last.parts[0].rows == [["lid", "+-2", "+2", "-2", "holds"]]
    (only,) = made(0.0).sections()
    assert only.parts[0].rows[0] == ("intensity", "0 +- 5 W/sr (one standard uncertainty)")


def test_remarks_of_a_budget():
    """Invalid samples, a tolerance that was not reached, and checks that fail."""
    number = SimpleNamespace(unit="W/sr", numbers=SimpleNamespace(reached=False))
    number.total = SimpleNamespace(invalid=2, traced=np.array([60.0, 40.0]))
    checks = [Check("a", 1.0, 1.0, -1.0, True), Check("b", 1.0, None, None, False)]
    invalid, failing, last = remarks(number, checks, None)
    assert invalid.startswith("2 of 100 samples") and failing.startswith("b: the linear result")
    assert last.startswith("the tolerance was not reached")
    number.numbers.reached, number.total.invalid = None, 0
    assert remarks(number, checks[:1], SimpleNamespace(sentence=lambda: "few")) == ["few"]
    assert remarks(number, [], SimpleNamespace(sentence=lambda: "")) == []


# Variances of pixels from noisy derivatives
# ------------------------------------------


class Images:
    """Derivatives (R, K, H, W) of an image, and their mean."""

    def __init__(self, derivatives):
        self.derivatives, self.derivative = derivatives, derivatives.mean(axis=0)


COVARIANCE = np.array([[4.0, -0.6], [-0.6, 0.25]])


def test_products_of_different_randomisations():
    d = np.random.default_rng(0).normal(3, 1, (3, 2, 4, 5))
    expected = np.mean(
        [
            np.einsum("khw,kl,lhw->hw", d[r], COVARIANCE, d[s])
            for r in range(3)
            for s in range(3)
            if r != s
        ],
        axis=0,
    )
    assert expected.min() > 0
    np.testing.assert_allclose(variance(Images(d), COVARIANCE), expected)


def test_one_randomisation_and_noise_alone():
    d = np.random.default_rng(0).normal(3, 1, (1, 2, 4, 5))
    np.testing.assert_allclose(
        variance(Images(d), COVARIANCE), np.einsum("khw,kl,lhw->hw", d[0], COVARIANCE, d[0])
    )
    noise = np.random.default_rng(1).normal(0, 1, (2, 2, 40, 50))
    found = variance(Images(noise), COVARIANCE)
    assert found.min() == 0 and np.mean(found == 0) == pytest.approx(0.5, abs=0.05)


@pytest.mark.slow
def test_maps_of_a_plate(tmp_path):
    """The plate is 2 m wide in a window of 4 m: eps B'(T) on the plate, 0 beside it."""
    scene = plate_scene(tmp_path)
    stated = Uncertainties.read({"sigma": {"plate.temperature": 2.0}})
    from mi_lcair.api.scenes import parameters

    channels, header = budget_image(
        scene, Inputs.of(stated, parameters(scene), "plate"), Sampling(spp=16)
    )
    expected = EMISSIVITY * slope(scene.band, TEMPERATURE)
    column = channels["d.plate.temperature.Y"]
    np.testing.assert_allclose(column[5:11, 5:11], expected, rtol=1e-3)
    np.testing.assert_allclose(channels["sigma.Y"][5:11, 5:11], 2 * expected, rtol=1e-3)
    assert not column[:3].any() and header["covariance"] == "[[4.0]]"


def test_a_motion_in_a_band():
    """The light of a hot plate on a reflector behind a gap, whose view factor is known."""
    scene = mi_lcair.load("two_plates", band="LWIR", **{"plate.x_m": -0.02})
    found = row(mi_lcair.budget(scene, {"sigma": {"plate.x_m": 1e-3}}, spp=64), "plate.x_m")
    near, far = (view_of_wall(0.2, 0.1, 0.2, gap) for gap in (0.019, 0.021))
    exact = (near - far) / 2 * float(in_band_radiance(band("LWIR"), 800.0))
    assert found.contribution == pytest.approx(exact, rel=0.01)
