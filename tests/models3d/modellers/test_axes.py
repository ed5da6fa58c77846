"""Axes: what Blender wrote is undone, and models that lie on their side are remarked."""

from pathlib import Path

import numpy as np
import pytest

import mi_lcair.scenes
from mi_lcair.errors import InputError
from mi_lcair.models3d.modellers import axes
from mi_lcair.models3d.modellers.obj import read_obj
from tests.models3d.shapes import cube

MODELS = Path(mi_lcair.scenes.__path__[0]) / "models"
EXAMPLES = Path(mi_lcair.scenes.__path__[0]) / "examples"


def exported(forward, up):
    """The matrix by which Blender's exporter turns coordinates: its x, y, z go to these axes."""
    unit = {name: sign * np.eye(3)[k] for k, n in enumerate("XYZ")
            for name, sign in ((n, 1), (f"-{n}", -1))}  # fmt: skip
    return np.stack([np.cross(unit[forward], unit[up]), unit[forward], unit[up]], axis=1)


@pytest.mark.parametrize("forward", axes.AXES)
@pytest.mark.parametrize("up", axes.AXES)
def test_an_export_is_undone(forward, up):
    if forward[-1] == up[-1]:
        with pytest.raises(InputError, match=f"forward=.{forward}. up=.{up}. lie on one line"):
            axes.rotation(forward, up)
        return
    assert (axes.rotation(forward, up) @ exported(forward, up) == np.eye(3)).all()


@pytest.mark.parametrize(
    "nose, direction", [("X", (1, 0, 0)), ("-X", (-1, 0, 0)), ("Y", (0, 1, 0)), ("-Y", (0, -1, 0))]
)
def test_the_nose_points_along_x(nose, direction):
    turn = axes.rotation(nose=nose)
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
def test_refused(names, reason):
    with pytest.raises(InputError, match=reason):
        axes.rotation(**names)


def corners(obj, kind="f"):
    """Corners of the facets of a type, or of all if there are none."""
    chosen = np.array([number >= 0 and obj.names[number][2][0] == kind for number in obj.name])
    chosen = np.repeat(chosen | ~chosen.any(), np.diff(obj.first))
    return obj.vertices[np.unique(obj.corners[chosen])]


@pytest.mark.parametrize("path", sorted({*MODELS.glob("*.obj"), *EXAMPLES.glob("*.obj")}), ids=str)
def test_bundled_models_are_not_remarked(path):
    """Of all bundled models only those that Blender exported with y up are remarked."""
    obj = read_obj(path)
    assert (axes.remark(corners(obj), obj.blender) is not None) == (obj.blender != "")


def test_models_on_their_side():
    """The airliner, symmetric about y = 0, is remarked once its y axis points up."""
    points = corners(read_obj(MODELS / "a340.obj"))
    lying = points @ exported("-Z", "Y").T
    assert "symmetric about z = 0 and not about y = 0" in axes.remark(lying, "")
    assert "give forward='-Z' up='Y'" in axes.remark(lying, "")
    assert "Blender 4.2.0 wrote the file" in axes.remark(lying, "4.2.0")
    # A file of Blender whose symmetry shows that z points up needs no remark; any other does.
    assert axes.remark(points, "4.2.0") is None
    assert "turns y up by default" in axes.remark(points + (0, 1, 0), "4.2.0")
    assert axes.remark(points + (0, 1, 0), "") is None
    flat = points * (1, 1, 0)
    assert axes.remark(flat + (0, 1, 0), "") is None


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
