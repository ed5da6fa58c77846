"""The landing airliner by day: the sun is added to what the night has, and nothing else changes."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.api.intensities import signature
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun import sunlight

SUN = {"light": "day", "sun_azimuth_deg": 60, "sun_elevation_deg": 45}


def seen(**parameters):
    """Signature from the left side, which the sun lights, in MWIR."""
    scene = mi_lcair.load(
        "a340_landing", position=2, resolution=64, max_bounces=2, sky="midlat_summer_clear",
        **parameters,
    )  # fmt: skip
    return scene, signature(scene, spp=256)


@pytest.fixture(scope="module")
def night():
    return seen()[1]


@pytest.fixture(scope="module")
def day():
    return seen(**SUN)


def test_the_sun_is_added(night, day):
    _, by_day = day
    assert "sun" not in night.scene.by_group and by_day.scene.by_group["sun"] > 0
    for group, intensity in night.scene.by_group.items():
        error = np.hypot(night.scene.by_group_error[group], by_day.scene.by_group_error[group])
        assert by_day.scene.by_group[group] == pytest.approx(intensity, abs=6 * error), group


def test_irradiance_of_the_bundled_air(day):
    scene, _ = day
    expected = sunlight("midlat_summer", 45).in_band_radiance(band("MWIR"))
    assert mi_lcair.parameters(scene)["sun.irradiance"].value == pytest.approx(expected, rel=1e-6)


def test_the_sun_lights_one_side(day):
    """From the left a sun on the right adds less."""
    _, right = seen(**SUN | {"sun_azimuth_deg": -60})
    assert right.scene.by_group["sun"] < 0.7 * day[1].scene.by_group["sun"]
