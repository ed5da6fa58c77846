"""glTF, PLY and STL: objects, transforms, and files that cannot be read."""

import sys
from pathlib import Path

import numpy as np
import pytest

import mi_lcair.scenes
from mi_lcair.errors import InputError
from mi_lcair.models3d import read, report
from mi_lcair.models3d.modellers import exchange
from mi_lcair.models3d.modellers.exchange import read_mesh
from mi_lcair.models3d.modellers.obj import read_obj
from tests.models3d.shapes import cube

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


# Axes: what Blender wrote is undone, and models that lie on their side are remarked
# ----------------------------------------------------------------------------------

MODELS = Path(mi_lcair.scenes.__path__[0]) / "models"
EXAMPLES = Path(mi_lcair.scenes.__path__[0]) / "examples"


def exported(forward, up):
    """The matrix by which Blender's exporter turns coordinates: its x, y, z go to these axes."""
    unit = {name: sign * np.eye(3)[k] for k, n in enumerate("XYZ")
            for name, sign in ((n, 1), (f"-{n}", -1))}  # fmt: skip
    return np.stack([np.cross(unit[forward], unit[up]), unit[forward], unit[up]], axis=1)


@pytest.mark.parametrize("forward", exchange.AXES)
@pytest.mark.parametrize("up", exchange.AXES)
def test_an_export_is_undone(forward, up):
    if forward[-1] == up[-1]:
        with pytest.raises(InputError, match=f"forward=.{forward}. up=.{up}. lie on one line"):
            exchange.rotation(forward, up)
        return
    assert (exchange.rotation(forward, up) @ exported(forward, up) == np.eye(3)).all()


@pytest.mark.parametrize(
    "nose, direction", [("X", (1, 0, 0)), ("-X", (-1, 0, 0)), ("Y", (0, 1, 0)), ("-Y", (0, -1, 0))]
)
def test_the_nose_points_along_x(nose, direction):
    turn = exchange.rotation(nose=nose)
    assert (turn @ direction == (1, 0, 0)).all() and (turn @ (0, 0, 1) == (0, 0, 1)).all()
    assert np.linalg.det(turn) == pytest.approx(1)


@pytest.mark.parametrize(
    "names, reason",
    [
        ({"forward": "x"}, "unknown axis in forward 'x'; known: X,"),
        ({"up": "Y"}, "forward=.Y. up=.Y. lie on one line; .* has forward=.-Z. up=.Y."),
        ({"nose": "-Z"}, "nose=.-Z. is vertical"),
    ],
)
def test_refused_of_axes(names, reason):
    with pytest.raises(InputError, match=reason):
        exchange.rotation(**names)


def corners(obj, kind="f"):
    """Corners of the facets of a type, or of all if there are none."""
    chosen = np.array([number >= 0 and obj.names[number][2][0] == kind for number in obj.name])
    chosen = np.repeat(chosen | ~chosen.any(), np.diff(obj.first))
    return obj.vertices[np.unique(obj.corners[chosen])]


@pytest.mark.parametrize("path", sorted({*MODELS.glob("*.obj"), *EXAMPLES.glob("*.obj")}), ids=str)
def test_bundled_models_are_not_remarked(path):
    """Of all bundled models only those that Blender exported with y up are remarked."""
    obj = read_obj(path)
    assert (exchange.remark(corners(obj), obj.blender) is not None) == (obj.blender != "")


def test_models_on_their_side():
    """The airliner, symmetric about y = 0, is remarked once its y axis points up."""
    points = corners(read_obj(MODELS / "a340.obj"))
    lying = points @ exported("-Z", "Y").T
    assert "symmetric about z = 0 and not about y = 0" in exchange.remark(lying, "")
    assert "give forward='-Z' up='Y'" in exchange.remark(lying, "")
    assert "Blender 4.2.0 wrote the file" in exchange.remark(lying, "4.2.0")
    # A file of Blender whose symmetry shows that z points up needs no remark; any other does.
    assert exchange.remark(points, "4.2.0") is None
    assert "writes y up by default" in exchange.remark(points + (0, 1, 0), "4.2.0")
    assert exchange.remark(points + (0, 1, 0), "") is None
    flat = points * (1, 1, 0)
    assert exchange.remark(flat + (0, 1, 0), "") is None


@pytest.mark.parametrize(
    "head, version",
    [
        ("# Blender 4.2.1 LTS\n# www.blender.org\n", "4.2.1"),
        ("# Blender v2.93.4 OBJ File: 'x.blend'\n", "2.93.4"),
        ("# made with care in Blender 4\n", ""),
        ("", ""),
    ],
)
def test_the_header(tmp_path, head, version):
    (tmp_path / "model.obj").write_text(head + cube())
    assert read_obj(tmp_path / "model.obj").blender == version
