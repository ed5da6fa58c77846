"""Absorbers along slant paths, against quadratures and closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.physics.slant.absorbers import Absorbers, terms
from mi_lcair.physics.slant.geometry import height_along

DENSITIES = (  # of a height in km
    *(lambda h, scale=scale: np.exp(-h / scale) for scale in (1, 2, 4)),
    lambda h: np.exp(h / 10),
    *(lambda h, scale=scale: np.exp(-((h / scale) ** 2)) for scale in (1.5, 2, 2.5, 3)),
)
POWERS = (0.5, 0.6, 0.7, 0.85, 1.0)


def height_km(lower_m, elevation_deg, s_km):
    return height_along(lower_m, elevation_deg, 1000 * s_km) / 1000


@pytest.mark.parametrize(
    "lower, elevation, start, end", [(50.0, 10.0, 0.0, 5.0), (300.0, 60.0, 1.0, 3.0)]
)
def test_terms_are_powers_of_amounts(lower, elevation, start, end):
    amounts = [
        quad(lambda s: density(height_km(lower, elevation, s)), start, end)[0]
        for density in DENSITIES
    ]
    values = terms(lower, elevation, 1000 * start, 1000 * end)
    expected = np.power.outer(amounts, POWERS).ravel()
    assert values == pytest.approx(expected, rel=1e-9)
    several = terms(lower, np.array([elevation, 90.0]), 1000 * start, np.full(2, 1000 * end))
    assert several.shape == (2, 40) and several[0] == pytest.approx(values, rel=1e-12)


def one_absorber(*strengths):
    """Absorbers with a scale height of 2 km: optical depths per km at sea level, (k,)."""
    coefficients = np.zeros((40, len(strengths)))
    coefficients[9] = strengths  # the second density, to the power 1
    return Absorbers(0.0, coefficients)


def depth(strength, elevation, start_km, end_km):
    return quad(lambda s: strength * np.exp(-height_km(0.0, elevation, s) / 2), start_km, end_km)[0]


def test_optical_depths():
    depths = one_absorber(0.3, 2.0).depths(np.array([5.0, 40.0]), 1000.0, np.array([4e3, 6e3]))
    for row, elevation, end in zip(depths, (5.0, 40.0), (4, 6)):
        expected = [depth(strength, elevation, 1, end) for strength in (0.3, 2.0)]
        assert row == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seen_from_below", [True, False])
def test_mean_emission(seen_from_below):
    """The emission of each height, weighted by what reaches the end from which it is seen."""
    elevation, start, end, strength = 30.0, 0.5, 6.0, 0.8

    def emission(height):
        return 5 - height / 1000

    def arriving(s):
        between = (start, s) if seen_from_below else (s, end)
        density = strength * np.exp(-height_km(0.0, elevation, s) / 2)
        return density * np.exp(-depth(strength, elevation, *between))

    weight = quad(arriving, start, end)[0]
    mean = quad(lambda s: arriving(s) * emission(1000 * height_km(0.0, elevation, s)), start, end)
    source = one_absorber(strength).source(
        np.array([elevation, elevation]),
        1000 * start,
        1000 * end,
        seen_from_below,
        lambda height: emission(height)[..., None],
    )
    assert source.shape == (2, 1)
    assert source == pytest.approx(mean[0] / weight, rel=2e-4)


def test_air_that_absorbs_nothing_shows_its_nearest_piece():
    """Its emission is that of the first of 48 pieces, whose lengths grow as squares do."""
    for seen_from_below, place in ((True, 0.5 / 48**2), (False, 1 - 0.5 / 48**2)):
        source = one_absorber(0.0).source(
            90.0, 0.0, 4000.0, seen_from_below, lambda height: height[..., None]
        )
        assert source[0, 0] == pytest.approx(4000 * place, rel=1e-9)


def test_the_fit_finds_what_can_be_described():
    elevations, lengths = (values.ravel() for values in np.meshgrid([5.0, 30.0, 90.0], [1e3, 4e3]))
    truth = np.zeros((40, 2))
    truth[[9, 26, 34], 0] = 0.3, 0.1, 0.02
    truth[15, 1] = 1.0
    depths = Absorbers(50.0, truth).depths(elevations, 0.0, lengths)
    fitted = Absorbers.fitted(50.0, elevations, lengths, depths)
    assert fitted.coefficients.shape == (40, 2) and fitted.coefficients.min() >= 0
    assert fitted.depths(elevations, 0.0, lengths) == pytest.approx(depths, rel=1e-6)


@pytest.mark.parametrize(
    "depths, weights",
    [
        ((1.0, 2.0), (np.exp(-0.5), 2 * np.exp(-1.0))),  # the change of exp(-depth / 2)
        ((30.0, 40.0), (1.0, 1.0)),  # opaque: all count little, and the same
        ((1e-5, 2e-5), (1.0, 1.0)),  # clear
    ],
)
def test_what_contradicts_itself_is_weighed(depths, weights):
    """One path with two depths: the model m makes the sum of w^2 (m / d - 1)^2 least."""
    depths, squares = np.array(depths), np.square(weights)
    fitted = Absorbers.fitted(50.0, np.full(2, 30.0), np.full(2, 2e3), depths[:, None])
    expected = (squares / depths).sum() / (squares / depths**2).sum()
    assert fitted.depths(30.0, 0.0, 2e3)[0] == pytest.approx(expected, rel=1e-6)
