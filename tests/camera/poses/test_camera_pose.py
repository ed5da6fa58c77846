"""The pose of a scenario's camera: its scenario sees the points where they were."""

from itertools import product

import numpy as np
import pytest

import mi_lcair
from mi_lcair.camera.poses.from_points import pixels
from mi_lcair.camera.view import Pointing, axes_of, pointing_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import target_scene
from mi_lcair.errors import InputError
from mi_lcair.rendering.views import Target, View
from tests.camera.plate_scenario import CAMERA, plate

AROUND = [(20.0, 5.0, 0.0), (-130.0, 40.0, 33.0), (75.0, -60.0, -170.0), (10.0, 90.0, 12.0)]


def camera(scenario):
    """Eye, and unit vectors to the right, upward and along the axis, of a scenario's camera."""
    target = Target.of(target_scene(scenario, scenario.sensor.detector()))
    observer = scenario.observer
    view = View(observer.azimuth_deg, observer.elevation_deg)
    axes = axes_of(target, view, observer.range_m, scenario.camera, Pointing())
    return axes["eye"], np.stack([axes["right"], axes["up"], axes["axis"]])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plate(tmp_path, 2.0, 1.0)
    tables = {
        "target": 'scene = "disc.xml"\nparameters = {temperature = 300}',
        "observer": "range_m = 300\nazimuth_deg = 0\nelevation_deg = 0",
        "atmosphere": 'table = "vacuum"',
        "background": "temperature = 280",
        "sensor": 'band = "LWIR"\nnei = 1e-9',
        "camera": "\n".join(f"{name} = {value}" for name, value in CAMERA.items()),
    }
    (tmp_path / "plate.toml").write_text(
        "".join(f"[{name}]\n{text}\n" for name, text in tables.items())
    )
    return tmp_path


@pytest.mark.parametrize("azimuth, elevation, roll", AROUND)
def test_a_pose_found_again_is_that_of_the_scenario(folder, azimuth, elevation, roll):
    """From exact pixels; the written scenario has the same eye and sides, at poles, too."""
    entries = {
        "observer.range_m": 60.0,
        "observer.azimuth_deg": azimuth,
        "observer.elevation_deg": elevation,
        "camera.right_deg": 0.7,
        "camera.up_deg": -0.4,
        "camera.roll_deg": roll,
    }
    eye, sides = camera(scenario := Scenario.read("plate.toml", **entries))
    points = np.array(list(product((-1, 1), (-0.7, 0.7), (-0.4, 0.4))))
    values = np.hstack([points, pixels(points, eye, sides, scenario.camera)])
    (folder / "other").mkdir()
    result = mi_lcair.pose("plate.toml", values, 0.3)
    result.save(folder / "other" / "seen.toml")
    eye_again, sides_again = camera(Scenario.read(folder / "other" / "seen.toml"))
    np.testing.assert_allclose(eye_again, eye, atol=1e-4)
    np.testing.assert_allclose(sides_again, sides, atol=1e-6)


def test_points_that_the_model_hides_are_named(folder):
    """Rows that were counted upward give a pose on the other side of what is far away."""
    eye, sides = camera(scenario := Scenario.read("plate.toml", **{"observer.elevation_deg": 20.0}))
    points = np.array([[0.3, 0, 0.2], [0.2, 0.5, 0.1], [0.3, -0.8, -0.3], [0.1, 0, -0.4]])
    points = np.concatenate([points, [[0.0, -1, -0.5], [0, 1, -0.5], [0, 1, 0.5], [0, -1, 0.5]]])
    places = pixels(points, eye, sides, scenario.camera)
    right = mi_lcair.pose("plate.toml", np.hstack([points, places]), 0.3)
    assert not right.remarks
    upward = mi_lcair.pose("plate.toml", np.hstack([points, [0, 48] + [1, -1] * places]), 0.3)
    assert "from there the model hides point 1, 2, 3, 4 of 8: do the rows go" in upward.remarks[0]


def test_a_scene_far_from_its_origin(folder):
    """Points are in the axes of the file, although the loaded scene was moved to its origin."""
    scene = folder / "disc.xml"
    text = scene.read_text().replace("</transform>", '<translate x="5000" y="-900"/></transform>')
    scene.write_text(text)
    scenario = Scenario.read("plate.toml")
    origin = np.array(target_scene(scenario, scenario.sensor.detector()).origin)
    assert np.linalg.norm(origin) > 1000
    eye, sides = camera(scenario)
    points = np.array(list(product((-1, 1), (-0.7, 0.7), (-0.4, 0.4))))
    places = pixels(points, eye, sides, scenario.camera)
    result = mi_lcair.pose("plate.toml", np.hstack([points + origin, places]), 0.3)
    np.testing.assert_allclose(result.position_m, eye + origin, atol=1e-3)
    assert result.observer.range_m == pytest.approx(300.0, abs=1e-3)


def test_pointing_is_the_inverse_of_the_axes(folder):
    for azimuth, elevation, roll in AROUND:
        entries = {"camera.right_deg": 3.0, "camera.up_deg": -2.0, "camera.roll_deg": roll}
        place = {"observer.azimuth_deg": azimuth, "observer.elevation_deg": elevation}
        _, (right, _, axis) = camera(Scenario.read("plate.toml", **entries, **place))
        pointing = pointing_of(View(azimuth, elevation), right, axis)
        assert pointing == pytest.approx({"right_deg": 3.0, "up_deg": -2.0, "roll_deg": roll})


def test_a_camera_that_rolls_to_the_right_turns_its_image_to_the_left(folder):
    """By 90 degrees: what was to the right is on top."""
    level, turned = (
        camera(Scenario.read("plate.toml", **{"camera.roll_deg": roll})) for roll in (0.0, 90.0)
    )
    np.testing.assert_allclose(turned[1][0], -level[1][1], atol=1e-12)
    np.testing.assert_allclose(turned[1][1], level[1][0], atol=1e-12)


def test_unusable_input_is_one_line(folder):
    values = np.ones((4, 5))
    for points, options, message in (
        (np.ones((4, 4)), {}, r"points must be an array \(n, 5\)"),
        (values, {"sigma_px": -1}, "sigma_px"),
        (values, {"parameters": {"camera.projection": "orthographic"}}, "needs a table .camera."),
        ("none.csv", {}, "none.csv: cannot be read"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.pose("plate.toml", points, **options)
    (folder / "points.csv").write_text("x_m,y_m,z_m,column,row\n1,2,3,4,5\n")
    with pytest.raises(InputError, match="the header must name x_m, .* column_px and row_px"):
        mi_lcair.pose("plate.toml", "points.csv")
