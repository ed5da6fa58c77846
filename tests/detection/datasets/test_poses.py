"""Poses by the public rules of nerfstudio and COLMAP, against rays and pixels of the renderer."""

import json

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.datasets.poses import colmap, pose_of, transforms
from mi_lcair.detection.setting import setting_of
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.rendering.views import View
from tests.detection.camera.plate_scenario import plate
from tests.detection.datasets.box_set import write_box
from tests.detection.disc_scenario import triangles

ROLLED = {"camera__roll_deg": 25.0, "camera__right_deg": 0.2, "camera__up_deg": -0.1}
PATHS = {"file_path": "images/000000.png"}


def by_nerfstudio(tree, frame, points):
    """Columns and rows (n, 2): OpenGL's axes, x right, y up, z backward; pixel centres at .5."""
    to_camera = np.linalg.inv(np.array(frame["transform_matrix"]))
    x, y, z = to_camera[:3, :3] @ points.T + to_camera[:3, 3:]
    of = tree | frame
    return np.stack([of["cx"] + of["fl_x"] * x / -z, of["cy"] - of["fl_y"] * y / -z], axis=1)


def by_colmap(cameras, images, name, points):
    """The same from a PINHOLE camera, whose y axis points down and whose z axis forward."""
    rows = [line.split() for line in images.splitlines() if line and not line.startswith("#")]
    (row,) = (row for row in rows if row[9] == name)
    w, x, y, z, *place = map(float, row[1:8])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    (camera,) = (line.split() for line in cameras.splitlines() if line.split()[0] == row[8])
    assert camera[1] == "PINHOLE"
    fx, fy, cx, cy = map(float, camera[4:])
    a, b, c = rotation @ points.T + np.array(place)[:, None]
    return np.stack([fx * a / c + cx, fy * b / c + cy], axis=1)


def test_a_thousand_corners_are_where_the_rays_go(tmp_path):
    """The ray that Mitsuba's sensor sends through the pixel of a corner of a facet meets it."""
    scenario = plate(tmp_path, 4.0, 4.0, **ROLLED)
    setting = setting_of(scenario)
    points = triangles().reshape(-1, 3)[::2][:1000]
    view = CameraView.of(setting.target, View(35.0, 40.0), 180.0, scenario.camera)
    record = pose_of(view, (0.0, 0.0, 0.0)) | {"split": "train"}
    tree = transforms([record], [PATHS])
    lists = {split: tree[f"{split}_filenames"] for split in ("train", "val", "test")}
    assert lists == {"train": ["images/000000.png"], "val": [], "test": []}
    pixels = by_nerfstudio(tree, tree["frames"][0], points)
    wider = record | {"fl_x": 100.0, "fl_y": 100.0}
    texts = colmap([record, wider], ["000000.png", "000001.png"], points)
    two = texts["cameras.txt"], texts["images.txt"]
    same = by_colmap(*two, "000000.png", points)
    np.testing.assert_allclose(same, pixels, atol=1e-9)

    apart = transforms([record, wider], [PATHS, PATHS | {"file_path": "images/000001.png"}])
    assert "fl_x" not in apart and apart["frames"][1]["fl_x"] == 100  # each has its own
    others = by_nerfstudio(apart, apart["frames"][1], points)
    np.testing.assert_allclose(by_colmap(*two, "000001.png", points), others, atol=1e-9)

    sensor = view.sensor(setting.view)
    places = (pixels * view.parts - view.first) / view.size  # shares of the window
    ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f(places.T), mi.Point2f(0.5))
    origin, direction = (np.array(of, dtype=float).T for of in (ray.o, ray.d))
    aside = np.linalg.norm(np.cross(points - origin, direction), axis=1)
    distance = np.linalg.norm(points - view.eye, axis=1)
    assert len(points) == 1000
    assert np.max(aside / distance / scenario.camera.pixel_angle) < 0.05
    assert np.ptp(pixels, axis=0).min() > 10  # they are spread over the frame

    (_, first, second) = texts["cameras.txt"].splitlines()
    assert first.split()[:4] == ["1", "PINHOLE", "64", "48"] and second.split()[4] == "100"
    listed = [line.split() for line in texts["points3D.txt"].splitlines()[1:]]
    np.testing.assert_array_equal(np.array([row[1:4] for row in listed], float), points)


@pytest.mark.slow
def test_pixels_of_the_truth_are_on_the_box_and_its_edges_around_the_mask(tmp_path):
    """A pixel's depth gives a point on a side of the box; the outline has the area of the mask."""
    frames = {"truth": True, "seed": 3}
    mi_lcair.dataset(write_box(tmp_path, frames=frames, draws=None), tmp_path / "set")
    tree = json.loads((tmp_path / "set/transforms.json").read_text())
    names = [name for split in ("train", "val", "test") for name in tree[f"{split}_filenames"]]
    assert sorted(names) == [frame["file_path"] for frame in tree["frames"]] and len(names) == 3
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    sparse = tmp_path / "set/sparse/0"
    texts = [(sparse / name).read_text() for name in ("cameras.txt", "images.txt")]
    for frame in tree["frames"]:
        stem = frame["file_path"].removeprefix("images/").removesuffix(".png")
        pixels = by_nerfstudio(tree, frame, corners)
        np.testing.assert_allclose(by_colmap(*texts, f"{stem}.png", corners), pixels, atol=1e-9)

        depth = np.load(tmp_path / "set" / frame["depth_file_path"]) / 1e3
        truth, _ = read_exr(tmp_path / f"set/truth/{stem}.truth.exr")
        row, column = np.nonzero(depth)
        d = depth[row, column].astype(float)
        across = (column + 0.5 - tree["cx"]) / tree["fl_x"]
        down = (row + 0.5 - tree["cy"]) / tree["fl_y"]
        matrix = np.array(frame["transform_matrix"])
        points = (matrix[:3, :3] @ np.array([across * d, -down * d, -d])).T + matrix[:3, 3]
        off = np.abs(np.max(np.abs(points - [0, 0, 0.5]), axis=1) - 0.5)
        assert len(d) > 50 and np.max(off / d) * tree["fl_x"] < 0.05  # pixels

        share, x, y = truth["mask.Y"].astype(float), np.arange(32) + 0.5, np.arange(24) + 0.5
        area, middle = outline(pixels)
        seen = np.array([share.sum(axis=0) @ x, share.sum(axis=1) @ y]) / share.sum()
        assert share.sum() == pytest.approx(area, rel=0.01)
        np.testing.assert_allclose(seen, middle, atol=0.05)


def outline(points):
    """Area and centroid of the hull of points in the plane, by the shoelace formula."""
    from scipy.spatial import ConvexHull

    ring = points[ConvexHull(points).vertices]
    x, y = ring.T
    x1, y1 = np.roll(ring, -1, axis=0).T
    cross = x * y1 - x1 * y
    area = cross.sum() / 2
    centroid = np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / (6 * area)
    return abs(area), centroid
