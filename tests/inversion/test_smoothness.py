"""Correlations of facets against integrals and inverses."""

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.errors import InputError
from mi_lcair.inversion import smoothness
from mi_lcair.inversion.smoothness import matern, precision
from tests.inversion.blocks import kelvin


@pytest.mark.parametrize("length", [0.3, 2.0])
def test_correlation_has_matern_s_spectrum(length):
    """That of a process of second order: density (3 / l^2 + w^2)^-2."""
    rate = 3 / length**2

    def density(w):
        return (rate + w**2) ** -2

    total = quad(density, 0, np.inf)[0]
    for distance in (0.1, 0.5, 3.0):
        part = quad(density, 0, np.inf, weight="cos", wvar=distance)[0]
        assert matern(np.array(distance), length) == pytest.approx(part / total, abs=1e-6)
    assert matern(np.array(0.0), length) == 1


def facets(name, centres, length=0.5, data=(0,)):
    return [
        kelvin(f"{name}[{k}]", name=name, kind="facet", centre=c, correlation_m=length, data=data)
        for k, c in enumerate(centres)
    ]


def test_precision_is_the_inverse_covariance_of_each_group():
    centres = np.random.default_rng(2).random((5, 3))
    unknowns = [*facets("wing", centres), kelvin(), *facets("tail", centres[:2], data=(1,))]
    sigma = np.arange(1.0, 9.0)
    covariance = np.linalg.inv(precision(unknowns, sigma))
    np.testing.assert_allclose(np.diag(covariance), sigma**2, rtol=1e-9)
    wing = covariance[:5, :5] / np.outer(sigma[:5], sigma[:5])
    distance = np.sqrt(((centres[:, None] - centres) ** 2).sum(axis=-1))
    np.testing.assert_allclose(wing, matern(distance, 0.5), atol=3e-6)
    assert abs(covariance[:6, 6:]).max() < 1e-9 and abs(covariance[5, :5]).max() < 1e-9
    assert covariance[6, 7] / (sigma[6] * sigma[7]) == pytest.approx(wing[0, 1], abs=1e-5)


def test_values_that_do_not_correlate(monkeypatch):
    assert precision([kelvin()], np.ones(1)) is None
    monkeypatch.setattr(smoothness, "MOST_FACETS", 2)
    assert precision(facets("wing", np.eye(3)[:2]), np.ones(2)).shape == (2, 2)
    with pytest.raises(InputError, match="3 unknowns; it needs at most 2: take a coarser model"):
        precision(facets("wing", np.eye(3)), np.ones(3))
