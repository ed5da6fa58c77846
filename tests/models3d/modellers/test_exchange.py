"""glTF, PLY and STL: objects, transforms, and files that cannot be read."""

import sys

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d import read, report
from mi_lcair.models3d.modellers.exchange import read_mesh

trimesh = pytest.importorskip("trimesh")
TRIANGLE = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    b"end_header\n"
)
PAINTED = {"material": "gloss_black", "temperature": 300}


def block(size=(1, 2, 3)):
    return trimesh.creation.box(size)


@pytest.mark.parametrize("suffix", ["glb", "ply", "stl"])
def test_a_mesh(tmp_path, suffix):
    """A box of 1 x 2 x 3, whose longest side points up in all but glTF."""
    block().export(tmp_path / f"box.{suffix}")
    model = read(tmp_path / f"box.{suffix}", **PAINTED)
    size = (1, 3, 2) if suffix == "glb" else (1, 2, 3)
    assert np.ptp(model.box, axis=0) == pytest.approx(size, rel=1e-6)
    figures = report(model)
    assert figures["volume"] == pytest.approx(6, rel=1e-6)
    assert figures["open_edges"] == 0 and model.count == 12 and model.remarks == ()
    model = read(tmp_path / f"box.{suffix}", **PAINTED, forward="-Z", up="Y", scale=2)
    assert np.ptp(model.box, axis=0) == pytest.approx((2, 6, 4), rel=1e-6)


def test_transforms_and_names(tmp_path):
    """A mesh that is used twice, once moved and once mirrored. Node names are labels."""
    scene = trimesh.Scene()
    mirrored = np.diag([-1.0, 1, 1, 1])
    mirrored[:3, 3] = -5, 0, 0
    moved = trimesh.transformations.translation_matrix((5, 0, 0))
    scene.add_geometry(block(), node_name="f*bareAl*300*", geom_name="block", transform=moved)
    scene.graph.update("f*gloss_black*310*group=fin", geometry="block", matrix=mirrored)
    scene.export(tmp_path / "two.glb")
    model = read(tmp_path / "two.glb")
    assert {(label.material, label.group) for label in model.labels} == {
        ("bare_aluminum", "self"),
        ("gloss_black", "fin"),
    }
    figures = report(model)
    assert figures["volume"] == pytest.approx(12, rel=1e-6) and figures["inward"] == 0
    assert model.box[:, 0] == pytest.approx([-5.5, 5.5])
    again = read(tmp_path / "two.glb")  # facets have the same numbers each time
    assert (model.label == again.label).all() and (model.corners == again.corners).all()


def test_the_name_of_a_file_without_names(tmp_path):
    block().export(tmp_path / "hull.stl")
    (tmp_path / "names.csv").write_text("name,material,kelvin\nhull,blackbody,300\n")
    assert read(tmp_path / "hull.stl", names=tmp_path / "names.csv").labels[0].temperature == 300


@pytest.mark.parametrize(
    "name, content, reason",
    [
        ("none.glb", None, "none.glb: cannot be read: No such file"),
        ("bad.glb", b"glTF\x02\x00\x00\x00", "bad.glb: cannot be read as glTF: "),
        ("bad.gltf", b"{", "bad.gltf: cannot be read as glTF: "),
        ("bad.ply", b"ply\nformat ascii 1.0\nend_header\n", "bad.ply: "),
        ("empty.stl", b"", "empty.stl: "),
        (
            "points.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            b"property float z\nend_header\n0 0 0\n",
            "points.ply: its header must have one element vertex and one element face",
        ),
        (
            "nan.ply",
            TRIANGLE + b"0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n",
            "nan.ply: vertex 1 is not finite",
        ),
        (
            "index.ply",
            TRIANGLE + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
            "index.ply: face 0 names vertex 7; the mesh has 3",
        ),
    ],
)
def test_refused(tmp_path, name, content, reason):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=reason) as error:
        read(tmp_path / name, **PAINTED)
    assert "\n" not in str(error.value)


def test_without_trimesh(tmp_path, monkeypatch):
    block().export(tmp_path / "box.glb")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(InputError, match=r"needs trimesh; python -m pip install 'mi_lcair\["):
        read_mesh(tmp_path / "box.glb")


def test_a_binary_ply_of_triangles_and_squares(tmp_path, monkeypatch):
    """Blender writes one unless it triangulates. Its faces are facets, and no extra is needed."""
    monkeypatch.setitem(sys.modules, "trimesh", None)
    header = (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\n"
        b"property float y\nproperty float z\nelement face 2\n"
        b"property list uchar uint vertex_indices\nend_header\n"
    )
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], "<f4")
    faces = b"".join(
        bytes([len(face)]) + np.array(face, "<u4").tobytes() for face in ([0, 1, 2, 3], [1, 4, 2])
    )
    (tmp_path / "mixed.ply").write_bytes(header + points.tobytes() + faces)
    model = read(tmp_path / "mixed.ply", **PAINTED)
    assert model.count == 2 and len(model.triangles) == 3
    assert model.columns()["area_m2"] == pytest.approx([1.0, 0.5])
