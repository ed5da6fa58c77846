"""Windows of a camera's frame around a box of points, calculated by hand."""

from dataclasses import replace
from itertools import product

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.detection.camera.view import CameraView
from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.views import Target, View
from tests.detection.disc_scenario import write_disc

IMAGER = Imager(  # 0.01 rad per pixel
    focal_length_mm=1.5,
    f_number=4.0,
    pitch_um=15.0,
    width=64,
    height=48,
    integration_time_ms=0.5,
    well_Me=5.0,
    projection="orthographic",
)
PERSPECTIVE = replace(IMAGER, projection="perspective")


def box(x, y, z, centre=(0, 0, 0)):
    """A target whose corners lie at +-x, +-y and +-z around a centre."""
    corners = np.array(list(product((-x, x), (-y, y), (-z, z)))) + centre
    return Target(corners, np.array(centre, dtype=float), float(np.hypot(np.hypot(x, y), z)))


def front(imager=IMAGER, target=None, range_m=50.0):
    """The box seen from +x: +y is to the right, +z is up. A pixel is 0.5 m at its middle."""
    return CameraView.of(target or box(1.0, 3.01, 1.005), View(0.0, 0.0), range_m, imager)


def test_position_and_axes():
    view = front(target=box(1.0, 3.01, 1.005, centre=(5, 6, 7)))
    np.testing.assert_allclose(view.eye, [55, 6, 7])
    np.testing.assert_allclose([view.axis, view.right, view.up], [[-1, 0, 0], [0, 1, 0], [0, 0, 1]])
    radius = np.sqrt(1 + 3.01**2 + 1.005**2)
    assert view.near_m == pytest.approx(50 - 1.01 * radius, rel=1e-9)
    assert view.pixel_m == pytest.approx(0.5)
    close = front(range_m=1.005 * radius)  # the camera is just outside
    assert close.near_m == pytest.approx(1e-4 * radius)
    with pytest.raises(InputError, match="the observer is inside the target: range 3.2 m"):
        front(range_m=3.2)


def test_an_axis_beside_the_target():
    """Turned by right_deg and up_deg, the camera sees the target to its left and below."""
    view = front(replace(IMAGER, right_deg=5.0, up_deg=3.0))
    right, up = np.tan(np.radians([5.0, 3.0]))
    axis = np.array([-1, right, up]) / np.sqrt(1 + right**2 + up**2)
    np.testing.assert_allclose(view.axis, axis, rtol=1e-12)
    frame = np.array([view.axis, view.right, view.up])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert view.right @ [0, 1, 0] > 0.99 and view.up @ [0, 0, 1] > 0.99
    assert np.linalg.det([view.right, view.up, -view.axis]) == pytest.approx(1)
    pole = CameraView.of(box(1.0, 3.0, 1.0), View(0.0, 90.0), 50.0, IMAGER)
    np.testing.assert_allclose(pole.axis, [0, 0, -1], atol=1e-12)


def test_window_of_parallel_rays():
    """Columns 32 +- 6.02, rows 24 +- 2.01; 12.04 pixels across are rendered in 6 parts each."""
    view = front()
    assert view.parts == 6 and not view.is_cut
    assert view.first == (int((32 - 6.02) * 6), int((24 - 2.01) * 6))  # 155, 131
    assert view.size == (228 - 155 + 1, 156 - 131 + 1)
    assert view.window == ((25, 21), (14, 6))  # parts 155..228 of 6, parts 131..156
    assert np.all(view.near_range() == view.near_m)
    assert view.near_range().shape == view.size[::-1]


def test_window_in_perspective():
    """The nearest corners are 49 m away: 6.143 and 2.051 pixels from the middle."""
    view = front(PERSPECTIVE)
    assert view.first == (int((32 - 6.1429) * 6), int((24 - 2.0510) * 6))
    assert view.size[0] == int((32 + 6.1429) * 6) - view.first[0] + 1
    near = view.near_range()
    x = (view.first[0] + np.arange(view.size[0]) + 0.5) / 6 - 32
    y = (view.first[1] + np.arange(view.size[1]) + 0.5) / 6 - 24
    for row, column in ((0, 0), (5, 70), (25, 30)):
        expected = view.near_m * np.sqrt(1 + (0.01 * x[column]) ** 2 + (0.01 * y[row]) ** 2)
        assert near[row, column] == pytest.approx(expected, rel=1e-12)


def test_parts_of_large_and_small_targets():
    """48 parts or more lie across a target; a multiple of 3; 2^20 at most across the frame."""
    assert front(target=box(1.0, 12.0, 12.0)).parts == 3  # 48 pixels
    assert front(target=box(0.1, 1.99, 1.0)).parts == 3 * 3  # 7.96 pixels: 2.01 times 3 and up
    # 0.6 pixels high: 3 * 4 parts across it are 7.2, and 3 * 3 would be 5.4
    assert front(target=box(0.1, 12.0, 0.15)).parts == 3 * 4
    assert front(target=box(1e-6, 1e-5, 1e-5)).parts == 3 * (2**20 // (3 * (64 + 64)))
    assert front(replace(IMAGER, width=8192, height=1, focal_length_mm=150.0)).parts >= 3


def test_a_target_at_the_edge_of_the_frame():
    """64 x 48 pixels are 32 m x 24 m at 50 m."""
    aside = box(1.0, 3.0, 1.0)
    cut = CameraView.of(
        Target(aside.points + [0, 15.0, 0], aside.centre, aside.radius), View(0, 0), 50.0, IMAGER
    )
    # Columns 56 to 68 are rendered, of which 8 are in the frame
    assert cut.is_cut and cut.first[0] + cut.size[0] == 68 * cut.parts + 1
    assert cut.first[0] == int((32 + 12 / 0.5) * cut.parts)
    assert cut.inside.sum() == 8 * cut.parts * cut.size[1] and cut.around[1] == (56, -5)
    low = Target(aside.points - [0, 0, 11.5], aside.centre, aside.radius)
    below = CameraView.of(low, View(0, 0), 50.0, IMAGER)
    assert below.is_cut and below.first[1] + below.size[1] == 49 * below.parts + 1
    assert below.inside.sum() == 3 * below.parts * below.size[0] and below.around[0] == (45, -2)
    corner = Target(aside.points + [0, -15.0, 11.5], aside.centre, aside.radius)
    both = CameraView.of(corner, View(0, 0), 50.0, IMAGER)
    # Columns -4 to 8 and rows -1 to 3
    inside = np.outer(
        np.arange(both.size[1]) >= both.parts, np.arange(both.size[0]) >= 4 * both.parts
    )
    assert np.array_equal(both.inside, inside) and both.around == ((-1, 44), (-4, 55))
    above = Target(aside.points + [0, 0, 10.9], aside.centre, aside.radius)
    assert not CameraView.of(above, View(0, 0), 50.0, IMAGER).is_cut
    outside = Target(aside.points + [0, 20.0, 0], aside.centre, aside.radius)
    with pytest.raises(InputError, match="no part of the target is in the frame of 35.5 x 27 deg"):
        CameraView.of(outside, View(0, 0), 50.0, IMAGER)


def test_a_target_that_goes_far_beyond_the_frame():
    """32 pixels are rendered beyond the frame; then the target goes on as there, up to its end."""
    target = box(1.0, 59.99, 1e4)  # 240 pixels across, 4e4 high; the frame has 64 x 48
    view = CameraView.of(target, View(0, 0), 50e3, replace(IMAGER, focal_length_mm=1500.0))
    assert view.window == ((-32, -32), (64 + 64, 48 + 64)) and view.is_cut
    assert view.beyond == ((384, 384), (240 // 2 - 64, 240 // 2 - 64))
    assert view.around == ((-32 - 384, -32 - 384), (-88, -88))
    values = np.zeros(view.size[::-1])
    values[:, -view.parts :] = 1.0
    samples = view.samples(values)
    assert samples.shape == (3 * (48 + 2 * 416), 3 * 240)
    assert np.all(samples[:, -3 * 57 :] == 1) and not samples[:, : -3 * 57].any()


def test_samples_are_means_of_parts():
    """6 parts a pixel make 3 samples of 2 x 2 parts; parts outside the window are 0."""
    view = front()
    values = np.arange(np.prod(view.size), dtype=float).reshape(view.size[::-1])
    samples = view.samples(values)
    assert samples.shape == (6 * 3, 14 * 3)
    assert samples.sum() * 4 == pytest.approx(values.sum())
    # The window's first pixel begins at part 150 and 126, the parts at 155 and 131
    assert samples[2, 2] == values[0, 0] / 4 and not samples[:2].any() and not samples[:, :2].any()
    assert samples[3, 3] == pytest.approx(values[1:3, 1:3].mean())


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_rays_of_the_sensor(tmp_path, projection):
    """Columns go to the right, rows go down, and pixels are where the view says."""
    scene = load(write_disc(tmp_path).with_suffix(".xml"))
    imager = replace(
        IMAGER, focal_length_mm=100.0, projection=projection, right_deg=0.1, up_deg=-0.05
    )
    target = Target.of(scene)
    view = CameraView.of(target, View(20.0, 10.0), 1000.0, imager)
    sensor = view.sensor(scene)
    ray, _ = sensor.sample_ray(0, 0, mi.Point2f([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), mi.Point2f(0.5))
    starts, directions = (np.array(v, dtype=float).T for v in (ray.o, ray.d))
    # The rays meet the plane across the axis through the target's middle
    depth = (target.centre - view.eye) @ view.axis
    meets = (
        starts
        + directions
        * ((depth - (starts - view.eye) @ view.axis) / (directions @ view.axis))[:, None]
    )
    column, row = (
        half
        + (meets - view.eye) @ side / (depth if projection == "perspective" else 1000.0) / 1.5e-4
        for half, side in ((32, view.right), (24, -view.up))
    )
    (first, top), (width, height) = (
        np.array(pair) / view.parts for pair in (view.first, view.size)
    )
    assert column == pytest.approx([first, first + width, first], abs=0.02)
    assert row == pytest.approx([top, top, top + height], abs=0.02)
    middle = (target.centre - view.eye) / 1000.0
    assert middle @ view.right < 0 < middle @ view.up  # the axis points to its right, and below
    near = np.linalg.norm(starts - view.eye, axis=1)
    if projection == "perspective":
        assert near == pytest.approx(view.near_range()[[0, 0, -1], [0, -1, 0]], rel=1e-5)
