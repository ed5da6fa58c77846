"""Poses from points: exact ones, their errors over many draws, and points that determine none."""

from dataclasses import replace
from itertools import product

import mitsuba as mi
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import mi_lcair
from mi_lcair.detection.camera.poses import (
    hidden_points,
    is_line,
    minima,
    pixels,
    remarks_on,
    solve,
    starts,
)
from mi_lcair.detection.camera.view import Pointing, axes_of, pointing_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import target_scene
from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.views import Target, View
from tests.detection.camera.plate_scenario import CAMERA, plate

IMAGER = Imager(
    focal_length_mm=50,
    f_number=2,
    pitch_um=15,
    width=640,
    height=512,
    integration_time_ms=1,
    well_Me=5,
)


def draw(rng, count: int, distance_m: float, is_flat: bool = False):
    """Points in a box of 4 x 2 x 1.4 m, or in a plane, and a camera that looks at them.

    It is anywhere around them.

    Returns points, eye, and right, up and axis.
    """
    points = rng.uniform(-1, 1, (count, 3)) * [2, 1, 0 if is_flat else 0.7]
    right, up, _ = Rotation.random(random_state=rng).as_matrix()
    axis = np.cross(up, right)
    aside = distance_m * (rng.normal(size=2) * 0.03) @ [right, up]
    return points, points.mean(axis=0) - distance_m * axis + aside, np.stack([right, up, axis])


def test_pixels_are_those_of_mitsubas_perspective_sensor():
    """A ray of the sensor through a pixel meets the point that `pixels` puts there."""
    points, eye, sides = draw(np.random.default_rng(1), 6, 9.0)
    columns = np.column_stack([-sides[0], sides[1], sides[2], eye])
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": IMAGER.angle_deg(IMAGER.width),
            "to_world": mi.ScalarTransform4f(np.vstack([columns, [0, 0, 0, 1]])),
            "film": {"type": "hdrfilm", "width": IMAGER.width, "height": IMAGER.height},
        }
    )
    places = pixels(points, eye, sides, IMAGER) / [IMAGER.width, IMAGER.height]
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f(places.T.astype(np.float32)), mi.Point2f(0.5))
    to_points = (points - eye) / np.linalg.norm(points - eye, axis=1)[:, None]
    np.testing.assert_allclose(ray.d.numpy().T, to_points, atol=2e-6)


def linear(points, places):
    """Eye and axes by the direct linear transformation: the null space of twelve unknowns."""
    x, y = ((places - [320, 256]) * [1, -1] * IMAGER.pixel_angle).T
    P, zero = np.column_stack([points, np.ones(len(points))]), np.zeros((len(points), 4))
    rows = np.vstack([np.hstack([P, zero, -x[:, None] * P]), np.hstack([zero, P, -y[:, None] * P])])
    M = np.linalg.svd(rows)[2][-1].reshape(3, 4)
    M *= np.sign((M @ P[0])[2]) / np.linalg.norm(M[2, :3])
    return -np.linalg.solve(M[:, :3], M[:, 3]), M[:, :3]


@pytest.mark.parametrize("is_flat", [False, True])
def test_far_points_begin_with_their_pose(is_flat):
    """A first guess is the pose itself as rays become parallel; a plane has one guess more."""
    for seed in range(5):
        points, _, sides = draw(np.random.default_rng(seed), 8, 4e4, is_flat)
        points -= points.mean(axis=0)
        eye = -4e4 * sides[2]
        guesses = starts(points, pixels(points, eye, sides, IMAGER), IMAGER)
        assert len(guesses) == 1 + is_flat
        off = [np.linalg.norm(guess - eye) / 4e4 + np.ptp(axes - sides) for guess, axes in guesses]
        assert min(off) < 2e-3
        # Points beside the axis give the eye as well, and an axis toward them
        eye = eye - 4e4 * np.array([0.05, -0.03]) @ sides[:2]
        guesses = starts(points, pixels(points, eye, sides, IMAGER), IMAGER)
        assert min(np.linalg.norm(guess - eye) for guess, _ in guesses) < 0.01 * 4e4


def box(*sides_m):
    return np.array(list(product((-1.0, 1.0), repeat=3))) * sides_m


def test_limits_of_lines_and_planes():
    """1e-4 of the length of points or pixels is a line, 0.05 of it a plane."""
    places = np.random.default_rng(1).uniform(0, 500, (8, 2))
    for width, is_one in ((0.98e-4, True), (1.02e-4, False)):
        assert is_line(box(3, 3 * width, 0)) == is_one
        assert is_line(box(40, 40 * width, 0)[:, :2] + 300) == is_one
    for thickness, count in ((0.049, 2), (0.051, 1)):
        assert len(starts(box(3, 1, 3 * thickness), places, IMAGER)) == count


def test_points_behind_the_camera_miss_by_three_pixels_and_thrice_as_much_as_inverted():
    """Mirrored columns, whose misfit falls with the distance of the points."""
    points, _, sides = draw(np.random.default_rng(4), 8, 20.0)
    noise = np.random.default_rng(6).normal(size=(8, 2))

    def places(distance_m, noise_px=0.0):
        eye = points.mean(axis=0) - distance_m * sides[2]
        return pixels(points, eye, sides, IMAGER) * [-1, 1] + [640, 0] + noise_px * noise

    def misfits(*given):
        middle, seen = points.mean(axis=0), places(*given)
        return [minima(p, seen, IMAGER)[0].rms_px for p in (points, 2 * middle - points)]

    def is_refused(*given):
        try:
            solve(points, places(*given), IMAGER, None)
        except InputError as error:
            return "behind the camera" in str(error)
        return False

    far = brentq(lambda distance_m: misfits(distance_m)[0] - 3, 10, 200, xtol=1e-4)
    assert is_refused(0.99 * far) and not is_refused(1.01 * far)

    def excess(noise_px):
        front, behind = misfits(0.3 * far, noise_px)
        return front - 3 * behind

    much = brentq(excess, 0.1, 20, xtol=1e-4)
    assert is_refused(0.3 * far, 0.97 * much) and not is_refused(0.3 * far, 1.03 * much)


@pytest.mark.parametrize("distance_m", [4.5, 40.0, 400.0])
def test_exact_pixels_give_the_pose_of_a_linear_solution(distance_m):
    points, eye, sides = draw(np.random.default_rng(2), 8, distance_m)
    places = pixels(points, eye, sides, IMAGER)
    result = solve(points, places, IMAGER, 0.3)
    others = linear(points, places)
    for values, exact, other in zip((result.eye, result.sides), (eye, sides), others):
        np.testing.assert_allclose(values, exact, atol=1e-6 * distance_m)
        np.testing.assert_allclose(other, exact, atol=1e-5 * distance_m)
    assert result.rms_px < 1e-5 and result.second is None


@pytest.mark.parametrize(
    "count, distance_m, is_flat, sigma_px",
    [(8, 40.0, False, None), (8, 20.0, True, None), (5, 12.0, False, 0.3)],
)
def test_intervals_hold_the_pose(count, distance_m, is_flat, sigma_px):
    """95 % intervals of turns and position for .3 pixels of noise hold the pose in 90 to 98 %."""
    rng, held = np.random.default_rng(3), []
    for _ in range(150 if count == 8 and not is_flat else 60):
        points, eye, sides = draw(rng, count, distance_m, is_flat)
        noise = 0.3 * rng.normal(size=(count, 2))
        result = solve(points, pixels(points, eye, sides, IMAGER) + noise, IMAGER, sigma_px)
        turn = result.sides @ Rotation.from_matrix(sides.T @ result.sides).as_rotvec()
        miss = np.concatenate([turn, result.eye - eye])
        held.append(abs(miss) <= result.factor * result.errors)
    assert 0.90 <= np.mean(held) <= 0.98
    # Each of the six, within 4 binomial deviations
    assert np.all(np.mean(held, axis=0) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(held)))


def test_slopes_are_those_of_differences():
    points, eye, sides = draw(np.random.default_rng(5), 8, 30.0)
    found = solve(points, pixels(points, eye, sides, IMAGER), IMAGER, 0.3)
    step = 1e-4
    for k in range(3):
        turns = (Rotation.from_rotvec(sign * step * sides[k]).apply(sides) for sign in (1, -1))
        places = (
            ((eye, turn) for turn in turns),
            ((eye + sign * step * np.eye(3)[k], sides) for sign in (1, -1)),
        )
        for column, pair in zip((k, 3 + k), places):
            after, before = (pixels(points, *place, IMAGER) for place in pair)
            slope = ((after - before) / (2 * step)).ravel()
            np.testing.assert_allclose(found.slopes[:, column], slope, atol=1e-5 * abs(slope).max())


def test_errors_fall_with_the_square_root_of_the_points():
    """Each point four times: the same pose, and half of the errors."""
    points, eye, sides = draw(np.random.default_rng(5), 8, 30.0)
    places = pixels(points, eye, sides, IMAGER)
    few, many = (
        solve(np.tile(points, (n, 1)), np.tile(places, (n, 1)), IMAGER, 0.3) for n in (1, 4)
    )
    np.testing.assert_allclose(many.errors, few.errors / 2, rtol=1e-3)
    longer = replace(IMAGER, focal_length_mm=100)
    twice = solve(points, (places - [320, 256]) * 2 + [320, 256], longer, 0.6)
    np.testing.assert_allclose(twice.errors, few.errors, rtol=1e-3)


def test_points_behind_the_camera_are_as_near_as_a_millionth_of_their_extent():
    """Of the longest side of their box, wherever the box is."""
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 1, -2.0]]) + [100.0, 200, 300]
    places = pixels(points, points[0] + [1.0, 0, 3], np.eye(3), IMAGER)
    np.testing.assert_allclose(places[0, 0] - 320, -1 / (4e-6 * IMAGER.pixel_angle))


def noisy(count: int, pixels_off: float):
    """Points, and their places with a noise of this rms after a pose was fitted."""
    points, eye, sides = draw(rng := np.random.default_rng(9), count, 30.0)
    places, noise = pixels(points, eye, sides, IMAGER), rng.normal(size=(count, 2))
    for _ in range(4):
        noise *= pixels_off / solve(points, places + noise, IMAGER, None).rms_px
    return points, places + noise


@pytest.mark.parametrize("sigma_px", [1 / 1.95, 1 / 2.05, None])
def test_remarks_on_noise(sigma_px):
    """Beyond two stated deviations; without any, below 4 degrees of freedom."""
    remarks = remarks_on(solve(*noisy(8, 1.0), IMAGER, sigma_px), sigma_px, [])
    assert [words in " ".join(remarks) for words in ("by 1 (rms), more than sigma", "freedom")] == [
        sigma_px == 1 / 2.05,
        False,
    ]


@pytest.mark.parametrize("count", [4, 5])
def test_few_points_have_wide_intervals(count):
    """Student's factors of 2 and 4 degrees of freedom, of printed tables: 4.303 and 2.776."""
    solved = solve(*noisy(count, 0.1), IMAGER, None)
    assert solved.factor == pytest.approx({4: 4.303, 5: 2.776}[count], abs=1e-3)
    few = [words for words in remarks_on(solved, None, []) if "leave" in words]
    assert len(few) == (count == 4) and all("leave 2 degrees of freedom" in w for w in few)
    variance = np.sum(solved.residual_px**2) / (2 * count - 6)
    inverse = variance * np.linalg.inv(solved.slopes.T @ solved.slopes)
    np.testing.assert_allclose(solved.errors**2, np.diag(inverse), rtol=1e-9)


def test_a_small_plane_has_two_poses():
    """A square far away, seen obliquely, looks alike from two sides."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    axis = -np.array([0.4, 0.3, np.sqrt(0.75)])
    right = np.cross([0, 0, 1], -axis) / np.hypot(0.4, 0.3)
    sides = np.stack([right, np.cross(right, axis), axis])
    eye = -150 * axis
    noise = 0.3 * np.random.default_rng(1).normal(size=(4, 2))
    result = solve(square, pixels(square, eye, sides, IMAGER) + noise, IMAGER, 0.3)
    assert result.second is not None
    nearest = min((result, result.second), key=lambda pose: np.linalg.norm(pose.eye - eye))
    assert np.all(abs(nearest.eye - eye) < 4 * nearest.errors[3:])


@pytest.mark.parametrize("distance_m", [30.0, 60.0])
def test_a_second_pose_is_alike_and_apart(distance_m):
    """Its chi-square is less than 9 higher, and a coordinate differs by 3 standard errors."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    eye = distance_m * np.array([0.4, 0.3, np.sqrt(0.75)])
    right = np.cross([0, 0, 1], eye) / np.hypot(*eye[:2])
    axis = -eye / distance_m
    places = pixels(square, eye, np.stack([right, np.cross(right, axis), axis]), IMAGER)
    places = places + 0.6 * np.random.default_rng(1).normal(size=places.shape)
    best, other = minima(square, places, IMAGER)
    alike = np.sqrt(other.square - best.square) / 3
    of_one = solve(square, places, IMAGER, 1.0).errors[3:]
    apart = np.max(abs(other.eye - best.eye) / of_one) / 3
    assert alike < apart
    for limit, below in ((alike, False), (apart, True)):
        for factor, is_found in ((0.98, below), (1.02, not below)):
            second = solve(square, places, IMAGER, factor * limit).second
            assert (second is not None) == is_found


def seen(points, distance_m=20.0):
    points = np.array(points, dtype=float)
    _, _, sides = draw(np.random.default_rng(8), 4, distance_m)
    return points, pixels(points, points.mean(axis=0) - distance_m * sides[2], sides, IMAGER)


@pytest.mark.parametrize(
    "points, change, message",
    [
        (np.eye(3), None, "3 points; a pose needs 4 or more"),
        (np.outer(range(5), [1, 2, 0.5]), None, "the points lie on a line"),
        (np.zeros((5, 3)), None, "the points lie on a line"),
        (np.eye(4, 3), lambda places: 0 * places + 7, "the pixels lie on a line"),
        (
            np.eye(4, 3),
            lambda places: np.outer(range(4), [30, 20]) + [50, 90],
            "the pixels lie on a line",
        ),
        (np.outer(range(5), [1, 2, 0.5]) + [3, 1, 2], None, "the points lie on a line"),
        (
            np.array(list(product((-1, 1), repeat=3))),
            lambda places: np.array(
                [[300 + 50 * x, 200 + 40 * y * z] for x, y, z in product((-1, 1), repeat=3)]
            ),
            "the pixels do not fit to a view of the points",
        ),
        (
            np.random.default_rng(2).normal(size=(8, 3)),
            lambda places: places * [-1, 1] + [640, 0],
            "the points would be behind the camera",
        ),
    ],
)
def test_points_that_determine_no_pose(points, change, message):
    points, places = seen(points)
    with pytest.raises(InputError, match=message) as caught:
        solve(points, change(places) if change else places, IMAGER, None)
    assert "\n" not in str(caught.value)


# The pose of a scenario's camera: its scenario sees the points where they were
# -----------------------------------------------------------------------------

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
        "observer.range_m": 400.0,
        "observer.azimuth_deg": azimuth,
        "observer.elevation_deg": elevation,
        "camera.right_deg": 0.1,
        "camera.up_deg": -0.05,
        "camera.roll_deg": roll,
    }
    eye, sides = camera(scenario := Scenario.read("plate.toml", **entries))
    points = np.array(list(product((-1, 1), (-0.7, 0.7), (-0.4, 0.4))))
    values = np.hstack([points, pixels(points, eye, sides, scenario.camera)])
    (folder / "other").mkdir()
    result = mi_lcair.pose("plate.toml", values, 0.3)
    *facts, table = result.facts()
    said = dict(pair for pair in facts if isinstance(pair, tuple))
    errors = solve(points, values[:, 3:], scenario.camera, 0.3).errors
    np.testing.assert_allclose(result.position_error_m, errors[3:])
    np.testing.assert_allclose(result.turn_error_deg, np.degrees(errors[:3]))
    half = np.degrees(1.96 * errors[:3])
    words = ", ".join(f"{x:.2g} about {side}" for x, side in zip(half, ("right", "up", "axis")))
    assert said["turns, 95 %"] == f"{words} [degrees]"
    assert [row[0] for row in table.rows] == list(range(1, 9))
    half = ", ".join(f"{x:.2g}" for x in 1.96 * result.position_error_m)
    assert f"95 % +- ({half}) m" in result.summary()
    assert [row[1:4] for row in table.rows] == [tuple(point) for point in points.tolist()]
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
    assert "the model hides point 1, 2, 3, 4 of 8: do the rows go" in upward.remarks[0]


def test_what_hides_a_point(folder):
    """A plate of radius r at x = 0, from +x: what is beside a point or 2 r away hides none."""
    scenario = Scenario.read("plate.toml")
    scene = target_scene(scenario, scenario.sensor.detector())
    target = Target.of(scene)
    r = np.hypot(1.0, 0.5)
    assert target.radius == pytest.approx(r, rel=1e-3)
    x = [0.5, -0.95e-3 * r, -1.05e-3 * r, -1.9 * r, -2.1 * r, -2.9 * r]
    points = np.column_stack([x, np.zeros((6, 2))])
    assert hidden_points(scene, target, points, np.array([300.0, 0, 0])) == [3, 4]
    # From 3 m in front, points 1 m behind are hidden up to 4/3 of the half of the width, 1 m
    points = np.array([[-1, 1.2, 0], [-1, 1.4, 0], [-1, -1.3, 0]])
    assert hidden_points(scene, target, points, np.array([3.0, 0, 0])) == [1, 3]


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
    assert result.remarks[0].startswith("the model hides point 1, 2, 3, 4 of 8: ")


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


@pytest.mark.parametrize("column, row", [(-65, 1), (129, 1), (1, -49), (1, 97)])
def test_points_more_than_a_frame_outside_are_refused(folder, column, row):
    """The frame has 64 x 48 pixels; nearer points may be refused for another reason only."""
    points = np.column_stack([np.arange(20.0).reshape(4, 5) % 7, [1, 2, 3, 4], [1, 2, 3, 5]])[:, 2:]
    points[3, 3:] = column, row
    with pytest.raises(InputError, match=f"point 4: column {column}, row {row} is far outside"):
        mi_lcair.pose("plate.toml", points)
    points[3, 3:] -= 2 * np.sign(points[3, 3:] - [32, 24]) * (abs(points[3, 3:]) > 2)
    try:
        mi_lcair.pose("plate.toml", points)
    except InputError as error:
        assert "far outside" not in str(error)


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
