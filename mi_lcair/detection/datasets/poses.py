"""Cameras of a data set: nerfstudio's transforms.json and COLMAP's text files."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mi_lcair.detection.camera.view import CameraView

SPLITS = ("train", "val", "test")
INTRINSICS = ("fl_x", "fl_y", "cx", "cy", "w", "h")
GREY = "128 128 128"  # colour of the points, which have none


def pose_of(view: CameraView, origin: Sequence[float]) -> dict[str, Any]:
    """Intrinsics of a camera in pixels, and its matrix from the camera to the world.

    The camera's axes are those of OpenGL: x to the right, y upward, and z backward. Columns and
    rows are counted from the upper left corner of the frame, so that the middle of the first pixel
    is (0.5, 0.5). The world is the scene of the file. origin: that of the loaded scene in it.
    """
    imager = view.imager
    matrix = np.eye(4)
    matrix[:3] = np.stack([view.right, view.up, -view.axis, view.eye + origin], axis=1)
    focal = 1 / imager.pixel_angle
    numbers = focal, focal, imager.width / 2, imager.height / 2, imager.width, imager.height
    return dict(zip(INTRINSICS, numbers)) | {"transform_matrix": matrix.tolist()}


def transforms(records: Sequence[Mapping], paths: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """nerfstudio's transforms.json of some images.

    paths: names of each image's files by the entry, file_path and if there is a truth mask_path and
    depth_file_path.
    """
    intrinsics = [{name: record[name] for name in INTRINSICS} for record in records]
    common = intrinsics[0] if all(of == intrinsics[0] for of in intrinsics) else {}
    frames = [
        {**of_file, **({} if common else of), "transform_matrix": record["transform_matrix"]}
        for of_file, of, record in zip(paths, intrinsics, records)
    ]
    splits = {
        f"{split}_filenames": [
            of_file["file_path"]
            for of_file, record in zip(paths, records)
            if record["split"] == split
        ]
        for split in SPLITS
    }
    return {"camera_model": "OPENCV", **common, **splits, "frames": frames}


def colmap(records: Sequence[Mapping], names: Sequence[str], points: np.ndarray) -> dict[str, str]:
    """COLMAP's cameras.txt, images.txt and points3D.txt.

    points: points of the model, (n, 3) [m].
    """
    cameras: dict[tuple, int] = {}
    images = []
    for number, (record, name) in enumerate(zip(records, names), 1):
        of = tuple(record[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy"))
        camera = cameras.setdefault(of, len(cameras) + 1)
        matrix = np.array(record["transform_matrix"])
        # From the world to a camera whose y axis points down and whose z axis points forward
        rotation = (matrix[:3, :3] * [1, -1, -1]).T
        place = -rotation @ matrix[:3, 3]
        images.append(
            f"{number} {numbers(quaternion(rotation))} {numbers(place)} {camera} {name}\n"
        )
    rows = [f"{of[0]} {of[1]} {numbers(of[2:])}" for of in cameras]
    return {
        "cameras.txt": "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy\n"
        + "".join(f"{number} PINHOLE {row}\n" for number, row in enumerate(rows, 1)),
        "images.txt": "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and an empty line\n"
        + "".join(f"{line}\n" for line in images),
        "points3D.txt": "# POINT3D_ID X Y Z R G B ERROR\n"
        + "".join(f"{k} {numbers(point)} {GREY} 0\n" for k, point in enumerate(points, 1)),
    }


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion (w, x, y, z) of a rotation, with w of 0 or more."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z]) * (-1 if w < 0 else 1)


def numbers(values) -> str:
    """Numbers with all digits, and blanks between them."""
    return " ".join(f"{value:.17g}" for value in values)
