"""Scales, residuals and the Cauchy loss against closed forms."""

import numpy as np
import pytest

from mi_lcair.fitting.loss import SCALES, Cauchy, Residuals

F = np.array([[1e-4, 0.02, 3.0], [2e-4, 0.5, 80.0]])  # two surfaces, three points
DF = np.arange(12.0).reshape(2, 3, 2) + 1
BRDF, SPREAD = np.array([2e-4, 0.03, 4.0]), np.array([0.1, 0.2, 0.5])


def instrument(u):
    return F, DF


@pytest.mark.parametrize(
    ("scale", "function", "slope"),
    [
        ("log", np.log10, lambda f: 0.4342944819 / f),
        ("cube_root", lambda f: f ** (1 / 3), lambda f: f ** (-2 / 3) / 3),
        ("linear", lambda f: f, lambda f: 1 + 0 * f),
    ],
)
def test_residuals_on_each_scale(scale, function, slope):
    """(s(f) - s(measured)) / spread, and its derivative by the chain rule."""
    values, slopes = SCALES[scale](F)
    np.testing.assert_allclose(values, function(F))
    np.testing.assert_allclose(slopes, slope(F))
    residuals = Residuals(instrument, BRDF, scale, SPREAD)
    rows, derivatives = residuals(np.zeros((2, 2)))
    np.testing.assert_allclose(rows, (function(F) - function(BRDF)) / SPREAD)
    np.testing.assert_allclose(derivatives, DF * (slope(F) / SPREAD)[..., None])
    # A decade changes a point f by f ln 10 to first order
    decade = slope(BRDF) * BRDF * np.log(10) / SPREAD
    assert residuals.unit == pytest.approx(np.sqrt(np.mean(decade**2)))


def test_directional_tables_follow_the_points():
    values, slopes = np.array([[0.5, 0.6], [0.7, 0.8]]), np.ones((2, 2, 2))
    measured, std = np.array([0.4, 0.9]), np.array([0.1, 0.05])
    table = ((lambda u: (values, slopes)), measured, std)
    rows, derivatives = Residuals(instrument, BRDF, "log", SPREAD, [table])(np.zeros((2, 2)))
    assert rows.shape == (2, 5) and derivatives.shape == (2, 5, 2)
    np.testing.assert_allclose(rows[:, 3:], (values - measured) / std)
    np.testing.assert_allclose(derivatives[:, 3:], (1 / std)[None, :, None] * slopes)


@pytest.mark.parametrize("scale", SCALES)
def test_dark_points_stay_finite(scale):
    values, slopes = SCALES[scale](np.array([0.0, -1.0]))
    assert np.isfinite(values).all() and np.isfinite(slopes).all()


def test_cauchy_loss():
    """Half the square of a row is the loss c^2/2 log(1 + (r/c)^2), with its sign and derivative."""
    r, c = np.array([[-9.0, -1.0, 0.0, 1e-12, 0.5, 3.0]]), 2.0

    class Plain:
        unit = 7.0

        def __call__(self, u, lanes=None):
            return r + u, np.ones((1, 6, 1))

    robust = Cauchy(Plain(), c)
    rows, slopes = robust(np.zeros(1))
    np.testing.assert_allclose(rows**2 / 2, c**2 / 2 * np.log(1 + (r / c) ** 2), atol=1e-15)
    np.testing.assert_array_equal(np.sign(rows), np.sign(r))
    step = 1e-6
    ends = [robust(np.array([sign * step]))[0] for sign in (1, -1)]
    np.testing.assert_allclose(slopes[..., 0], (ends[0] - ends[1]) / (2 * step), rtol=1e-4)
    assert robust.unit == 7
