"""Which points are fitted, and with which standard deviations."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.fitting.data import select, with_std
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.selection import Variant
from tests.fitting.synthetic import MODEL


def measurements(brdf, theta_i=0.3, theta_r=0.2, **more):
    brdf = np.asarray(brdf, dtype=float)
    full = lambda angle: np.broadcast_to(np.asarray(angle, float), brdf.shape)
    return Measurements(full(theta_i), full(theta_r), brdf, name="scan", **more)


def test_points_that_are_left_out():
    """Not a number, beyond 80 degrees, not above the limit; the reasons are counted."""
    data, used, dropped = select(
        measurements(
            [1.0, np.nan, 2.0, 3.0, 1e-4, 4.0],
            theta_r=np.radians([80, 0, -80.1, 0, 0, 0]),
            theta_i=np.radians([10, 10, 10, 80.1, 10, np.nan]),
        ),
        *("log", 0.0, 80, 1e-4, 1),
    )
    assert used.tolist() == [True, False, False, False, False, False]
    assert dropped == {
        "not a number": 2,
        "theta_i or theta_r beyond 80 degrees": 2,
        "brdf not above 0.0001 1/sr": 1,
    }
    assert data.points == data.rows == 1 and data.spread.tolist() == [1]


def test_a_saturated_detector():
    """Three points or more at the largest value, if they are less than a fifth."""
    for count, total, dropped in ((3, 16, 3), (2, 16, 0), (3, 15, 0)):
        brdf = np.append(np.linspace(0.1, 0.9, total - count), np.full(count, 2.0))
        data, _, reasons = select(measurements(brdf), "log", 0.0, 80, 0, 1)
        assert data.points == total - dropped
        assert reasons.get("at one largest value, as if the detector saturated", 0) == dropped


def test_standard_deviations_on_the_scale():
    """sigma / (f ln 10), at least 1 % of f."""
    brdf, sigma = np.array([2.0, 4.0, 8.0]), np.array([0.2, 0.001, np.nan])
    data, _, _ = select(measurements(brdf, sigma=sigma), "log", 0.0, 80, 0, 1)
    np.testing.assert_allclose(data.spread, [0.1 / np.log(10), *2 * [0.01 / np.log(10)]])
    assert data.has_sigma
    cube, _, _ = select(measurements(brdf, sigma=sigma), "cube_root", 0.0, 80, 0, 1)
    np.testing.assert_allclose(cube.spread[0], 0.2 * 2 ** (-2 / 3) / 3)
    # A decade of every BRDF, to first order f ln 10, in standard deviations
    np.testing.assert_allclose(data.per_decade(2 * brdf), 1 / data.spread)
    table = DirectionalData(np.zeros(2), np.full(2, 0.5), np.full(2, 0.1))
    joint = data.jointly(4.0, [table])
    np.testing.assert_allclose(joint.spread, 2 * data.spread)
    assert joint.rows == 5 and joint.per_decade(brdf)[3:].tolist() == [0, 0]
    assert joint.with_std_factor(3.0).std_factor == 3 and joint.std_factor == 1


def test_a_source_taken_as_a_point():
    data, _, _ = select(measurements([1.0, 2.0]), "log", 0.02, 80, 0, 1)
    variant = Variant(MODEL, "thesis")
    assert data.residuals(variant).instrument.disc.half_angle == 0.02
    assert data.residuals(variant, aperture=False).instrument.disc is None


def test_too_few_points():
    select(measurements([1.0, 2.0, 3.0]), "log", 0.0, 80, 0, 3)
    with pytest.raises(InputError, match="scan: 3 points to fit, fewer than the 4 parameters$"):
        select(measurements([1.0, 2.0, 3.0]), "log", 0.0, 80, 0, 4)
    with pytest.raises(InputError, match="2 points .* 4 parameters; 1 dropped: not a number"):
        select(measurements([1.0, 2.0, np.nan]), "log", 0.0, 80, 0, 4)


def test_tables_of_emissivities():
    """A standard deviation of 0.02 if none is stated, and 0.002 at least."""
    table = DirectionalData(np.array([0.0, 1.5]), np.array([0.0, 1.0]))
    assert with_std(table, "dhr").std.tolist() == [0.02, 0.02]
    assert with_std(table, "dhr").quantity == "dhr"
    table.std = np.array([0.001, 0.003])
    assert with_std(table, "emissivity").std.tolist() == [0.002, 0.003]
    for theta, value in ((0.5, 1.01), (0.5, -0.01), (np.pi / 2, 0.5), (-0.1, 0.5)):
        with pytest.raises(InputError, match="dhr: values must lie in 0..1 and angles in 0..90"):
            with_std(DirectionalData(np.array([theta]), np.array([value])), "dhr")
