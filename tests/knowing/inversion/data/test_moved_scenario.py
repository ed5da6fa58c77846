"""Motions as unknowns of a camera's image and of a contrast."""

from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.camera_image import ROOM, CameraImage
from mi_lcair.knowing.inversion.data.loader import Loader
from mi_lcair.knowing.inversion.data.readings import MeasuredContrast
from mi_lcair.knowing.inversion.estimate import check_goal, unknowns_of
from mi_lcair.knowing.inversion.tables import Goal
from mi_lcair.knowing.inversion.unknowns import InverseProblem
from mi_lcair.rendering.parameters.values import changed
from tests.derivatives.motions.test_differences import CUBE, convex_hull
from tests.derivatives.motions.test_registration import SCENE
from tests.knowing.inversion.corner import SCENARIO

PIXEL_DEG = float(np.degrees(0.015 / 60))  # of the camera
ONE_WINDOW = {"render.resolution": 16, "render.spp": 64, "render.max_bounces": 0}
SHIFTS = ("observer.x_px", "observer.y_px")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """A cube of about 15 pixels in a frame of 24 x 24, on a background that is 15 K colder."""
    folder = tmp_path_factory.mktemp("moved")
    convex_hull("cube", CUBE).write_ply(str(folder / "cube.ply"))
    (folder / "cube.xml").write_text(SCENE)
    text = SCENARIO.format(air="vacuum").replace("corner.xml", "cube.xml")
    (folder / "cube.toml").write_text(text.replace("300\n", "350\n").replace("[4]", "[0]"))
    return str(folder / "cube.toml")


@pytest.fixture(scope="module")
def camera(scenario):
    return CameraImage.of(scenario, {})


def electrons(camera, **conditions) -> np.ndarray:
    """The image with other pointing, in a window for it."""
    pointed = camera.in_conditions({f"observer.{name}": v for name, v in conditions.items()})
    return pointed.facing().predicted([], 64, 5, 1)[0][0]


def test_pointing(camera, scenario):
    """The image moves by whole pixels and turns by right angles, as a scenario's angles say."""
    before = electrons(camera)
    noise = np.abs(electrons(camera) - camera.predicted([], 64, 9, 1)[0][0]).mean()
    for expected, conditions in (
        (np.roll(before, 2, axis=1), {"x_px": 2}),
        (np.roll(before, 2, axis=0), {"y_px": 2}),
        (np.rot90(before), {"roll_deg": 90}),
    ):
        assert np.abs(electrons(camera, **conditions) - expected).mean() < 3 * noise
        assert np.abs(expected - before).mean() > 20 * noise
    angles = {"camera.right_deg": -0.7 * PIXEL_DEG, "camera.up_deg": -0.4 * PIXEL_DEG}
    stated = electrons(CameraImage.of(scenario, angles))
    assert np.abs(electrons(camera, x_px=0.7, y_px=-0.4) - stated).mean() < 3 * noise


def test_derivatives_of_the_frame(camera):
    """A shift of the image is minus its gradient, blurred over the step; a turn keeps the sum."""
    camera = camera.facing(ROOM)
    names = [*SHIFTS, "cube.yaw_deg", "cube.size"]
    (image,), (columns,) = camera.predicted(names, 64, 5, 1)
    background = camera.scenery.image(camera.camera.band, camera.camera.optics)
    for axis, column in ((1, columns[0]), (0, columns[1])):
        gradient = -np.gradient(image, axis=axis)
        assert np.sum(column * gradient) / np.sum(gradient**2) == pytest.approx(1, abs=0.3)
        assert abs(column.sum()) < 0.03 * np.abs(column).sum()
    assert columns[3].sum() == pytest.approx(2 * np.sum(image - background), rel=0.01)


def test_frame_of_a_moved_model(scenario, tmp_path):
    """A frame of a model that turned, by a camera that points elsewhere, fits at their values."""
    truth = {"observer.x_px": 0.7, "observer.y_px": -0.4, "model.yaw_deg": 20.0}
    there = {
        "camera.right_deg": -0.7 * PIXEL_DEG,
        "camera.up_deg": -0.4 * PIXEL_DEG,
        "target.parameters.model.yaw_deg": 20.0,
        "render.spp": 64,
    }
    mi_lcair.image(Scenario.read(scenario, **there), seed=3).save(tmp_path / "seen.exr")
    problem = InverseProblem.of(
        {
            "data": [{"scene": scenario, "image": str(tmp_path / "seen.exr")}],
            "unknowns": {name: {} for name in truth},
        }
    )
    datum = Loader().datum(problem.data[0], 0, set())
    unknowns = unknowns_of(problem, [datum])

    def misfit(values) -> float:
        with datum.at(unknowns, np.array(list(values))) as of_values:
            image, _ = of_values.camera.predicted([], 16, 5, 1)
        off = image[0][datum.counts] - datum.measured
        return float(np.sqrt(np.mean((off / datum.noise(datum.measured)) ** 2)))

    assert misfit(truth.values()) < 3
    for name in truth:
        assert misfit((truth | {name: 0.0}).values()) > 10


@pytest.mark.study
def test_contrast_of_a_larger_target(scenario):
    """Of a convex body, it is proportional to the square of the size, as its window grows."""
    sight = MeasuredContrast.of(scenario, ONE_WINDOW)
    contrast, (column,) = sight.contrast(["cube.size"], None, 0, 4)
    assert column.mean() == pytest.approx(2 * contrast.mean(), rel=2e-3)
    with changed(sight.setting.view, {"cube.size": 0.9}):
        smaller, _ = sight.contrast([], None, 0, 4)
    assert smaller.mean() == pytest.approx(0.81 * contrast.mean(), rel=5e-3)


@pytest.mark.slow
def test_budget_of_a_larger_target(scenario):
    budget = mi_lcair.budget(Scenario.read(scenario, **ONE_WINDOW), {"sigma": {"cube.size": 0.05}})
    assert budget.sigma_of_quantities == pytest.approx(-0.1 * budget.value, rel=0.01)


def test_goal_of_a_contrast_takes_no_motions():
    """The area of the hidden background would change."""
    size = SimpleNamespace(name="cube.size", kind="motion")
    check_goal([size], Goal("intensity", "cube.xml"))
    with pytest.raises(InputError, match="'cube.size' changes the area of the background"):
        check_goal([size], Goal("contrast", "cube.xml", background_K=290.0))
