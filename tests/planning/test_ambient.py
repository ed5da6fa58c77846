"""The closure `ambient` by invented probes."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.planning.ambient import ambient_closure
from tests.planning.probes import FULL, LWIR, SCATTER, Probes, probe


def B(T):
    return float(in_band_radiance(LWIR, T))


def test_the_temperature_that_gives_the_mean():
    """Half of the radiance is followed; the rest is 0.4 B(T), and T is 320 K."""
    whole = 20.0 + 0.4 * B(320)
    reference = probe(whole, 0.01)
    first = float(brightness_temperature(LWIR, whole))

    def give(settings):
        assert settings.ambient_temperature == pytest.approx(first)
        closure = np.full((64, 1), 0.4 * B(first))
        return probe(value=20.0 + 0.01 * SCATTER + closure, closure=closure)

    probes = Probes(give)
    settings, error, result = ambient_closure(probes, FULL, reference, range(3), 1e-3)
    assert settings == replace(
        FULL, max_bounces=0, closure="ambient", ambient_temperature=settings.ambient_temperature
    )
    assert settings.ambient_temperature == pytest.approx(320, abs=0.01)
    assert error == pytest.approx(0, abs=1e-6) and len(probes.asked) == 1
    assert result.mean == pytest.approx(whole)
    np.testing.assert_allclose(result.closure, 0.4 * B(320), rtol=1e-4)


def test_reflections_are_added_until_the_error_is_small():
    """After n reflections the closure is off by 2^-n of 8 % in half of the randomisations."""
    sides = np.where(np.arange(64) % 2, 1, -1)[:, None]

    def give(settings):
        closure = 1 + 0.08 * 2.0**-settings.max_bounces * sides * SCATTER.std()
        return probe(value=1 + closure, closure=closure)

    probes = Probes(give)
    error_of = lambda n: 1.998 * 0.04 * 2.0**-n * np.sqrt(64 / 63) * SCATTER.std() / 8
    found = ambient_closure(probes, FULL, probe(2.0), range(9), 1.05 * error_of(3))
    assert found[0].max_bounces == 3 and found[1] == pytest.approx(error_of(3), rel=1e-3)
    assert ambient_closure(probes, FULL, probe(2.0), range(3), 1.05 * error_of(3)) is None


def test_scenes_without_such_a_temperature():
    """Nothing is missing, the closure adds nothing, or it would be too hot."""
    ones = np.ones((64, 1))
    for value, closure in ((2 * ones, 0.5 * ones), (0.5 * ones, 0 * ones)):
        probes = Probes(lambda settings, v=value, c=closure: probe(value=v, closure=c))
        assert ambient_closure(probes, FULL, probe(1.0), range(2), 0.5) is None
        assert len(probes.asked) == 2
    hot = Probes(lambda settings: probe(value=0.5 * ones, closure=1e-9 * ones))
    assert ambient_closure(hot, FULL, probe(1.0), range(1), 1.0) is None
