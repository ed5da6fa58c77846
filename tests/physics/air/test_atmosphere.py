"""Light that has crossed air: sums of sources, each after its own amounts."""

import numpy as np
import pytest

from mi_lcair.physics.air.atmosphere import AirLight
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.levels import bands

MODEL = bands()
AMOUNTS = clear_air("us_standard").ray(50.0, 20.0).amounts[[5, 20]]
MORE = clear_air("us_standard").ray(50.0, 90.0, 800.0).amounts[-1]
COUNT = len(MODEL.wavelengths_um)
SOURCES = np.array([np.linspace(1, 2, COUNT), np.linspace(3, 1, COUNT)])


@pytest.fixture
def light():
    return AirLight.of("two lamps", SOURCES, AMOUNTS)


def test_each_source_after_its_own_air(light):
    expected = SOURCES[0] * MODEL.transmittance(AMOUNTS[0])
    expected += SOURCES[1] * MODEL.transmittance(AMOUNTS[1])
    np.testing.assert_allclose(light.radiance, expected, rtol=1e-12)
    assert np.array_equal(light.wavelengths_um, MODEL.wavelengths_um) and light.name == "two lamps"


def test_amounts_of_two_paths_add(light):
    """Lines that are black after the first path take nothing from the second."""
    expected = SOURCES[0] * MODEL.transmittance(AMOUNTS[0] + MORE)
    expected += SOURCES[1] * MODEL.transmittance(AMOUNTS[1] + MORE)
    np.testing.assert_allclose(light.through(MORE), expected, rtol=1e-12)
    share = light.transmittance(MORE)
    where = light.radiance > 1e-6
    np.testing.assert_allclose(share[where], (expected / light.radiance)[where], rtol=1e-12)
    assert np.all(share[where] >= MODEL.transmittance(MORE)[where] - 1e-12)


def test_where_there_is_no_light_the_air_alone_counts():
    gap = SOURCES * (np.arange(COUNT) > 100)
    share = AirLight.of("gap", gap, AMOUNTS).transmittance(MORE)
    np.testing.assert_allclose(share[:101], MODEL.transmittance(MORE)[:101], rtol=1e-12)


def test_light_that_is_faint_beside_the_brightest_is_rounding():
    """Below 1e-9 of the largest radiance the share is that of the air alone."""
    sources = np.full((1, COUNT), 1e3)
    sources[0, 50], sources[0, 60] = 1e-9 * 1e3 * 5, 1e-9 * 1e3 / 5
    crossed = AirLight.of("faint", sources, AMOUNTS[:1])
    share, plain = crossed.transmittance(MORE), MODEL.transmittance(MORE)
    known = crossed.radiance > 1e-9 * crossed.radiance.max()
    assert known[50] and not known[60] and share[60] == plain[60] and share[50] != plain[50]


def test_scaled_and_added(light):
    double = light.scaled(2.0)
    np.testing.assert_allclose(double.radiance, 2 * light.radiance)
    np.testing.assert_allclose(double.through(MORE), 2 * light.through(MORE))
    both = light.plus(double)
    np.testing.assert_allclose(both.radiance, 3 * light.radiance)
    np.testing.assert_allclose(both.through(MORE), 3 * light.through(MORE), rtol=1e-12)
    assert both.name == "two lamps" and both.sources.shape == (4, COUNT)


def test_radiance_is_not_negative():
    """Sources of emitting layers may be negative, and rounding must not show."""
    light = AirLight.of("dark", -SOURCES, AMOUNTS)
    assert not light.radiance.any() and not light.through(MORE).any()
