"""Poses from points: exact ones, their errors over many draws, and points that determine none."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mi_lcair.camera.poses.from_points import pixels, solve, starts
from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager

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
        eye = points.mean(axis=0) - 4e4 * sides[2]
        guesses = starts(points, pixels(points, eye, sides, IMAGER), IMAGER)
        assert len(guesses) == 1 + is_flat
        off = [np.linalg.norm(guess - eye) / 4e4 + np.ptp(axes - sides) for guess, axes in guesses]
        assert min(off) < 2e-3


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
