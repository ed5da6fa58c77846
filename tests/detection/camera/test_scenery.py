"""Background of a frame by the direction of each pixel, against backgrounds of lines of sight."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.api.scenarios import image
from mi_lcair.detection.camera.electronics import electron_band
from mi_lcair.detection.camera.exposure import detector_mean
from mi_lcair.detection.camera.optics import Optics
from mi_lcair.detection.camera.scenery import Scenery
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.line_of_sight import Sight, backdrop
from mi_lcair.detection.setting import setting_of
from mi_lcair.physics.bands import band
from mi_lcair.rendering.views import View
from tests.detection.camera.plate_scenario import plate

WIDE = {"camera__focal_length_mm": 10.0, "sensor__band": "LWIR", "observer__range_m": 300}
SKY = {"background__sky": "us_standard_clear"}
GROUND = {"background__ground_temperature": 290, "background__ground_emissivity": 0.9}
AIR = {"atmosphere__table": "us_standard", "observer__height_m": 200.0}
LWIR = band("LWIR")
PIXEL = 1.5e-3  # rad


def scenery(tmp_path, elevation_deg=0.0, **changes):
    """A scenario whose camera looks up by so many degrees, and its background."""
    changes = WIDE | {"observer__elevation_deg": -float(elevation_deg)} | changes
    if changes.get("observer__height_m") and elevation_deg > 0:
        changes["observer__height_m"] = 50.0
    scenario = plate(tmp_path, 3.0, 3.0, **changes)
    setting = setting_of(scenario)
    view = View(scenario.observer.azimuth_deg, scenario.observer.elevation_deg)
    view = CameraView.of(setting.target, view, 300.0, scenario.camera)
    return scenario, Scenery.of(scenario, setting, view)


def along(scenario, elevation_deg, azimuth_deg=0.0):
    """In-band background of the same sensor along another line of sight, which looks upward."""
    observer = scenario.observer
    observer = replace(observer, elevation_deg=-elevation_deg, azimuth_deg=azimuth_deg, range_m=1.0)
    other = replace(scenario, observer=observer)
    behind = backdrop(other, other.sensor.detector(), Sight.of(other))
    return detector_mean(behind.at_sensor(1.0), LWIR)


@pytest.mark.parametrize("row", [1, 24, 40])
def test_each_pixel_sees_the_sky_at_its_own_elevation(tmp_path, row):
    scenario, behind = scenery(tmp_path, 5.0, **AIR, **SKY)
    elevation = 5.0 + np.degrees(np.arctan((24 - row - 0.5) * PIXEL))
    value = behind.at(LWIR, np.array([32.0]), np.array([row + 0.5]))
    assert value[0, 0] == pytest.approx(along(scenario, elevation), rel=2e-3)
    # Beside the middle column the elevation is less: sin of it falls with the distance
    side = behind.at(LWIR, np.array([64.0]), np.array([row + 0.5]))[0, 0]
    sine = np.sin(np.radians(elevation)) / np.hypot(
        1, 32 * PIXEL * np.cos(np.radians(elevation - 5))
    )
    assert side == pytest.approx(along(scenario, np.degrees(np.arcsin(sine))), rel=2e-3)


@pytest.mark.parametrize("row", [5, 24, 44])
def test_each_pixel_sees_the_ground_where_its_ray_meets_it(tmp_path, row):
    """Ground of 290 K through the air before it, which is warmer or colder than the ground."""
    scenario, behind = scenery(tmp_path, -6.0, **AIR, **SKY, **GROUND)
    elevation = -6.0 + np.degrees(np.arctan((24 - row - 0.5) * PIXEL))
    value = behind.at(LWIR, np.array([32.0]), np.array([row + 0.5]))
    assert value[0, 0] == pytest.approx(along(scenario, elevation), rel=2e-3)


def test_a_daytime_sky_by_azimuth(tmp_path):
    """Toward the sun on the right the MWIR sky is brighter than on the left."""
    sun = {
        "background__daytime_sky": "us_standard",
        "background__sun_azimuth_deg": 150.0,  # the camera looks toward 180
        "background__sun_elevation_deg": 12.0,
    }
    mwir = {"sensor__band": "MWIR", "camera__focal_length_mm": 1.0}
    scenario, behind = scenery(tmp_path, 10.0, **AIR, **sun | mwir)
    rule = band("MWIR")
    left, middle, right = behind.at(rule, np.array([0.0, 32.0, 64.0]), np.array([24.0]))[0]
    assert right > 1.2 * middle > 1.2 * left
    assert middle == pytest.approx(behind.level(rule), rel=1e-9)
    # 32 pixels of 15 mrad to the right, at an elevation whose sine falls likewise
    turn = np.degrees(np.arctan(0.48 / np.cos(np.radians(10))))
    up = np.degrees(np.arcsin(np.sin(np.radians(10)) / np.hypot(1, 0.48)))
    observer = replace(scenario.observer, elevation_deg=-up, azimuth_deg=-turn)
    other = replace(scenario, observer=observer)
    expected = backdrop(other, other.sensor.detector(), Sight.of(other, (150.0, 12.0)))
    assert right == pytest.approx(detector_mean(expected, rule), rel=0.02)


def optics(scenario):
    return Optics(scenario.camera, electron_band(LWIR, scenario.camera), np.ones_like)


@pytest.mark.parametrize("downward", [0.5, 0.53, 0.56])
def test_the_horizon_in_the_frame(tmp_path, downward):
    """In vacuum a sky of 250 K meets ground of 290 K between two rows, and the optics blur it."""
    changes = {"background__sky": '"250"'} | GROUND | {"background__ground_emissivity": 1.0}
    scenario, behind = scenery(tmp_path, -downward, **changes)
    row = 24 - np.tan(np.radians(downward)) / PIXEL  # of the horizon
    sharp = behind.at(LWIR, np.array([32.0]), np.arange(48) + 0.5)[:, 0]
    above = np.arange(48) + 0.5 < row
    sky, ground = sharp[0], sharp[-1]
    assert sharp[above] == pytest.approx(sky, rel=1e-12) and sky < 0.7 * ground
    assert sharp[~above] == pytest.approx(ground, rel=1e-12)
    frame = behind.image(LWIR, optics(scenario))
    assert frame.shape == (48, 64)
    # The rows rise as the edge response of the optics, whose middle is the horizon's place
    share = (frame[:, 32] - sky) / (ground - sky)
    assert share[[0, -1]] == pytest.approx([0, 1], abs=0.015)
    assert np.interp(0.5, share, np.arange(48) + 0.5) == pytest.approx(row, abs=0.03)
    assert 0.05 < share[int(row) - 1] < share[int(row) + 1] < 0.98
    # The border of the frame is no border of the background
    assert frame[:, [0, -1]] == pytest.approx(frame[:, [32, 32]], abs=2e-3 * ground)


def test_what_a_background_lacks_is_remarked(tmp_path):
    """A sky alone goes on below the horizon as above it, and the ground alone above it."""
    _, sky = scenery(tmp_path, 1.0, **AIR, **SKY)
    low = sky.at(LWIR, np.array([32.0]), np.array([24.0, 40.5, 46.5]))[:, 0]
    assert low[1] == pytest.approx(low[2], rel=1e-6) and low[0] < low[1]
    (line,) = sky.missing()
    assert "% of the pixels look at the ground, but [background] has no ground" in line
    dip = 1.0 - sky.around.horizon_deg
    share = np.mean(np.arange(48) + 0.5 > 24 + np.tan(np.radians(dip)) / PIXEL)
    assert line.startswith(f"{share:.0%} ")
    black = GROUND | {"background__ground_emissivity": 1.0}
    _, ground = scenery(tmp_path, -1.0, **AIR, **black)
    assert "look at the sky" in ground.missing()[0] and "[background] sky" in ground.missing()[0]
    assert scenery(tmp_path, 20.0, **AIR, **SKY)[1].missing() == []
    assert scenery(tmp_path, -1.0, **AIR, **SKY, **GROUND)[1].missing() == []


def test_backgrounds_without_directions(tmp_path):
    """A blackbody, one spectrum in all directions, and parallel rays have one radiance."""
    for changes in (
        {"background__temperature": 280},
        {"background__sky": '"240"'},
        {**SKY, "camera__projection": "orthographic"},
    ):
        scenario, behind = scenery(tmp_path, 3.0, **changes)
        assert behind.around is None and behind.missing() == []
        assert behind.image(LWIR, None) == behind.level(LWIR)
        assert np.all(behind.of_parts(LWIR) == behind.level(LWIR))


def test_the_target_hides_its_own_background(tmp_path):
    """Inside a plate of 300 K the image reads 300 K, whatever the sky behind each pixel is."""
    changes = WIDE | SKY | {"target__parameters": {"temperature": 300}, "camera__f_number": 1.0}
    scenario = plate(tmp_path, 12.0, 18.0, observer__elevation_deg=-4.0, **changes)
    found = image(scenario)
    (column, row), (columns, rows) = found.view.window
    inside = found.channels["mean_temperature.Y"][row + 8 : row + rows - 8, 32]
    assert len(inside) > 15 and inside == pytest.approx(300, abs=0.3) and np.ptp(inside) < 0.1
    electrons, behind = (found.channels[name] for name in ("electrons.Y", "electrons.background.Y"))
    assert electrons[:, 2] == pytest.approx(behind[:, 2], rel=0.05)
    assert np.sum((electrons - behind)[row:, column:]) > 0.1 * np.sum(behind[row:, column:])
    sky = found.channels["mean_temperature.Y"][[2, -3], 3]
    assert sky[1] - sky[0] > 5


@pytest.mark.parametrize("elevation_deg", [-1.5, 0.3, 2.0])
def test_a_level_horizon_is_blurred_as_an_image(tmp_path, monkeypatch, elevation_deg):
    """Column by column the same as with the point spread, within .3 % of the differences."""
    _, behind = scenery(tmp_path, elevation_deg, **AIR, **SKY, **GROUND)
    monkeypatch.setattr("mi_lcair.detection.camera.scenery.LEVEL", 1.0)
    optics = Optics(behind.view.imager, LWIR, np.ones_like)
    by_column = behind.image(LWIR, optics)
    monkeypatch.setattr("mi_lcair.detection.camera.scenery.LEVEL", 0.0)
    whole = behind.image(LWIR, optics)
    assert np.ptp(whole) > 0.5
    assert np.abs(by_column - whole).max() < 3e-3 * np.ptp(whole)
