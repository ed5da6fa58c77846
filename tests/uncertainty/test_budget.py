"""Budgets against closed forms and against their own Monte Carlo."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import truncnorm

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.uncertainty.budget import NOISE, TRUNCATION, result_of
from tests.detection.disc_scenario import AREA as DISC_AREA
from tests.detection.disc_scenario import disc, triangles, write_disc
from tests.uncertainty.plate_scene import AREA, EMISSIVITY, TEMPERATURE, plate_scene

mi.set_variant("llvm_ad_mono")


def row(budget, name):
    return next(row for row in budget.rows if row.quantity == name)


def slope(band, T):
    """dB/dT of a blackbody [W m^-2 sr^-1 K^-1]."""
    return float(in_band_radiance(band, T + 0.01) - in_band_radiance(band, T - 0.01)) / 0.02


def triangle_areas():
    """Areas of the disc's triangles, m^2."""
    a, b, c = np.moveaxis(triangles(), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


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
        len(found.remarks) == 1 and "plate.temperature: the linear answer fails" in found.remarks[0]
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


@pytest.mark.slow
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


def test_contrast_in_closed_form(tmp_path):
    """A blackbody disc in vacuum: contrast = A (B(T) - B(T_0)) / R^2."""
    write_disc(tmp_path)
    scenario = disc(tmp_path, render__resolution=32, render__spp=256)
    stated = {
        "sigma": {"self.temperature": 1.0},
        "scenario": {
            "background_temperature": 2.0,
            "range_m": 10,
            "transmittance": 0.02,
            "nei": 1e-9,
        },
    }
    found = mi_lcair.budget(scenario, stated)
    band = scenario.sensor.detector().band
    B = lambda T: float(in_band_radiance(band, T))
    scale, expected = DISC_AREA / 1000**2, found.value
    assert found.unit == "W m^-2"
    assert expected == pytest.approx(scale * (B(400) - B(294)), rel=3e-3)
    contributions = {
        "self.temperature": scale * slope(band, 400),
        "scenario.background_temperature": -2 * scale * slope(band, 294),
        "scenario.range_m": -2 * expected / 1000 * 10,
        "scenario.transmittance": 0.02 * scale * B(400),
        "scenario.nei": 1e-9,
    }
    for name, contribution in contributions.items():
        assert row(found, name).contribution == pytest.approx(contribution, rel=4e-3), name
    assert sum(row.share for row in found.rows) == pytest.approx(1)


@pytest.mark.slow
def test_contrast_by_sources_and_by_renders():
    """The derivative from weights of the sources is that of contrasts that are rendered anew.

    The value is that of `mi_lcair.contrast`.
    """
    scenario = Scenario.read(
        "a340_landing/position_3",
        **{"render.resolution": 32, "render.spp": 64, "render.max_bounces": "[1, 2]"},
    )
    with result_of(scenario, {}) as number:
        number.start()
        assert number.value == pytest.approx(mi_lcair.contrast(scenario).rows[-1].total.value)
        for name, step in (("bare_aluminum.epsilon", 0.02), ("bare_aluminum.b", 0.02)):
            (found,), (error,) = number.derivatives([name], [step])
            ends = [number.at({name: number.known[name].value + s}) for s in (step, -step)]
            assert found == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=4 * error)
        # Temperatures and radiances by sources, and with everything rendered
        for name, step in (("terrain.temperature", 3.0), ("sky.radiance", 0.1)):
            value = number.known[name].value + step
            total = number.numbers.render({name: value})
            rendered = number.linear(total, number.areas_of(total), {}).value
            assert number.at({name: value}) - number.value == pytest.approx(
                rendered - number.value, rel=1e-3
            )


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"closure": "tail"}, "closure = tail has no derivatives"),
        ({"spp": 4, "tolerance": 0.1}, "tolerance and max_spp choose one"),
        ({"tolerance": -1}, "tolerance = -1 must be positive"),
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
def test_independent_errors_of_facets(tmp_path):
    """The disc's n equal facets: each has the n-th part of the derivative, and squares add."""
    write_disc(tmp_path, np.full(len(triangles()), 400.0))
    scenario = disc(tmp_path, render__resolution=64, render__spp=64)
    band, areas = scenario.sensor.detector().band, triangle_areas()
    one = slope(band, 400) / 1000**2
    found = mi_lcair.budget(scenario, {"facets": {"self": 2.0}}, draws=50)
    expected = 2 * one * np.sqrt(np.sum(areas**2))
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.02)
    assert found.sigma_of_quantities == row(found, "self facets").contribution
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
        ({"self": "facet,sigma_K\n0,-1\n"}, "sigma_K -1; must be 0 or more"),
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


def test_a_scene_whose_sources_have_no_spectra(tmp_path):
    """In the band `total` everything is rendered: dI/dT = 4 I / T."""
    found = mi_lcair.budget(
        plate_scene(tmp_path, band="total"), {"sigma": {"plate.temperature": 3}}
    )
    contribution = row(found, "plate.temperature").contribution
    assert contribution == pytest.approx(4 * found.value / TEMPERATURE * 3, rel=1e-3)
    (check,) = found.checks
    assert check.holds and check.plus == pytest.approx(contribution, rel=0.05)


@pytest.mark.slow
def test_a_contrast_with_too_many_temperatures(tmp_path):
    """The derivative then comes from differences, and its error is not known."""
    temperatures = np.linspace(395, 405, len(triangles()))
    write_disc(tmp_path, temperatures)
    scenario = disc(tmp_path, render__resolution=32)
    found = mi_lcair.budget(scenario, {"sigma": {"self.temperature": 1.0}})
    slopes = [slope(scenario.sensor.detector().band, T) for T in temperatures]
    expected = DISC_AREA * np.average(slopes, weights=triangle_areas()) / 1000**2
    found_row = row(found, "self.temperature")
    assert found_row.contribution == pytest.approx(expected, rel=0.01)
    assert np.isnan(found_row.sensitivity_error)
    assert found_row.as_dict()["sensitivity_error"] is None
