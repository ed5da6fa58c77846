"""Clear air along one line of sight: between the computed ranges, and on to the ground."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.bands import bands
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.clear_paths import ClearPaths
from mi_lcair.physics.bands import band

AIR, X = clear_air("us_standard"), bands().wavelengths_um
BANDS = [band(name) for name in ("MWIR", "LWIR")]


def line(elevation, looks_up, stated_m=None):
    return ClearPaths("air", AIR, 300.0, elevation, looks_up, stated_m)


@pytest.mark.parametrize("looks_up", [True, False])
@pytest.mark.parametrize("elevation", [0.0, 20.0])
def test_between_the_computed_ranges(looks_up, elevation):
    """In band within 0.2 % of a path that is computed itself, from 1 m to 30 km."""
    air = line(elevation, looks_up)
    for range_m in (1.0, 140.0, 2500.0, 30_000.0):
        path, exact = air.path(range_m), line(elevation, looks_up, range_m).path(range_m)
        ray = line(elevation, looks_up).ray(range_m)
        np.testing.assert_allclose(exact.amounts, ray.amounts[-1])
        for rule in BANDS:
            for name in ("transmittance", "radiance"):
                computed, expected = (rule.integral(X, getattr(p, name)) for p in (path, exact))
                assert computed == pytest.approx(expected, rel=2e-3)


def test_the_stated_range_is_met_everywhere():
    air = line(20.0, False, 3210.0)
    path = air.path(3210.0)
    transmittance, radiance = air.along(np.array([3210.0, 3300.0]), slice(None))
    np.testing.assert_allclose(transmittance[0], path.transmittance, rtol=1e-9)
    np.testing.assert_allclose(radiance[0], path.radiance, rtol=1e-9)
    (mean,) = air.band_transmittance(BANDS[0], [np.ones_like(X)], [3210.0])
    assert mean[0] == pytest.approx(BANDS[0].integral(X, path.transmittance) / 2, rel=1e-6)


@pytest.mark.parametrize("ranges", [[500.0, 4000.0], list(np.geomspace(100, 20_000, 200))])
def test_light_that_has_crossed_air(ranges):
    """Its mean transmittance at each range is that of summed amounts, also of many ranges."""
    air, light = line(5.0, True), AIR.sky(300.0, 45.0)
    for rule in BANDS:
        with_light, plain = air.band_transmittance(rule, [light, light.radiance], ranges)
        for k in (0, len(ranges) // 2, -1):
            rest = light.through(air.path(ranges[k]).amounts)
            expected = rule.integral(X, rest) / rule.integral(X, light.radiance)
            assert with_light[k] == pytest.approx(expected, rel=3e-3)
        assert np.all(with_light < plain)


@pytest.mark.parametrize("to_ground", [False, True])
def test_share_of_a_light_between_ranges(to_ground):
    """Within 0.2 % of summed amounts in band, and at the stated range exactly."""
    air, light = line(20.0, False, 3000.0), AIR.sky(0.0, 45.0)
    for range_m, tolerance in ((777.0, 2e-3), (3000.0, 1e-9), (12_345.0, 2e-3)):
        path = air.to_ground(range_m) if to_ground else air.path(range_m)
        for rule in BANDS:
            computed = rule.integral(X, path.share(light, X) * light.radiance)
            expected = rule.integral(X, light.through(path.amounts))
            assert computed == pytest.approx(expected, rel=tolerance)


def test_on_to_the_ground():
    """From the sensor past the target; the path to the target is a part of it."""
    air = line(20.0, False, 3000.0)
    for range_m in (3000.0, 2222.0):
        whole, exact = air.to_ground(range_m), line(20.0, False, range_m).to_ground(range_m)
        height = AIR.ray(300.0, 20.0, range_m).heights_km[-1] * 1000
        assert whole.range_m == pytest.approx(height / np.sin(np.radians(20)), rel=2e-3)
        for rule in BANDS:
            for name in ("transmittance", "radiance"):
                computed, expected = (rule.integral(X, getattr(p, name)) for p in (whole, exact))
                assert computed == pytest.approx(expected, rel=2e-3)
        assert np.all(whole.transmittance <= air.path(range_m).transmittance + 1e-9)
    with pytest.raises(InputError, match="goes past the ground"):
        line(20.0, True).to_ground(3000.0)
    with pytest.raises(InputError, match="goes past the ground"):
        line(0.0, False).to_ground(3000.0)


def test_ranges():
    air = line(20.0, True)
    with pytest.raises(InputError, match="range 300000 m is beyond its last one, 200000 m"):
        air.path(300_000.0)
    with pytest.warns(UserWarning, match="is beyond its last one"):
        beyond = air.path(300_000.0, extrapolate=True)
    np.testing.assert_allclose(beyond.amounts, AIR.ray(300.0, 20.0).amounts[-1], rtol=1e-6)
