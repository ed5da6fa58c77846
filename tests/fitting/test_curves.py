"""Curves and points of a fit, which pictures and pages draw."""

import numpy as np
import pytest

from mi_lcair.fitting.curves import INCIDENCES, MOST_SCANS, POINTS, predicted, scans_of
from tests.fitting.results import fit_of, measurements


def test_each_point_stands_in_the_scan_of_its_incidence():
    data = measurements(theta_i=(20, 50))
    fit = fit_of(data)
    swept, fixed, scans = scans_of(fit, data)
    assert (swept, fixed) == ("theta_r", "theta_i")
    assert [scan.setting for scan in scans] == pytest.approx([20, 50])
    for scan in scans:
        angles = np.concatenate([scan.fitted[0], scan.left_out[0]])
        assert sorted(angles) == pytest.approx(np.arange(-80, 86, 5))
        assert scan.left_out[0] == pytest.approx([85])  # beyond 80 degrees
        expected = 0.01 + np.exp(-np.abs(scan.fitted[0] - scan.setting))
        assert scan.fitted[1] == pytest.approx(expected)


def test_residuals_are_decades_from_the_fitted_curve():
    data = measurements(theta_i=(20,))
    fit = fit_of(data)
    (scan,) = scans_of(fit, data)[2]
    angles, curve = scan.curve
    assert (len(angles), angles[0], angles[-1]) == (POINTS, -80, 85)
    at_points = np.exp(np.interp(scan.fitted[0], angles, np.log(curve)))
    assert scan.residuals == pytest.approx(np.log10(scan.fitted[1] / at_points), abs=0.02)
    direct = predicted(fit, np.radians([20.0]), np.radians([30.0]))
    assert np.exp(np.interp(30.0, angles, np.log(curve))) == pytest.approx(direct[0], rel=0.01)


def test_the_angle_with_more_values_is_swept():
    data = measurements(theta_i=range(0, 81, 2), theta_r=(10, 40))
    swept, fixed, scans = scans_of(fit_of(data), data)
    assert (swept, fixed) == ("theta_i", "theta_r")
    assert [scan.setting for scan in scans] == pytest.approx([10, 40])


def test_of_many_scans_some_are_taken_evenly():
    data = measurements(theta_i=np.linspace(0, 60, 25), theta_r=range(-80, 86, 2))
    scans = scans_of(fit_of(data), data)[2]
    settings = [scan.setting for scan in scans]
    assert len(settings) == MOST_SCANS and settings[0] == 0 and settings[-1] == pytest.approx(60)
    assert np.ptp(np.diff(settings)) <= 2.5 + 1e-9


def test_points_that_are_not_positive_have_no_place():
    data = measurements(theta_i=(20,))
    data.brdf[:2] = 0, -1
    fit = fit_of(data)
    fit.used_points[:2] = False
    fit.brdf_interval = fit.brdf_interval[2:]
    (scan,) = scans_of(fit, data)[2]
    assert len(scan.left_out[0]) == 1 and len(scan.fitted[0]) + 1 == len(data.brdf) - 2


def test_without_measurements_there_are_curves_alone():
    fit = fit_of(measurements())
    _, _, scans = scans_of(fit)
    assert [scan.setting for scan in scans] == list(INCIDENCES)
    assert all(len(scan.fitted[0]) == 0 and (scan.curve[1] > 0).all() for scan in scans)
