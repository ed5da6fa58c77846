"""Budgets against closed forms and against their own Monte Carlo."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import truncnorm

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.uncertainty.budget import NOISE, TRUNCATION
from tests.uncertainty.plate_scene import (
    AREA,
    EMISSIVITY,
    TEMPERATURE,
    plate_scene,
    row,
    slope,
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
