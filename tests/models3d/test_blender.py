"""Models exported by Blender: committed files, and, where it is installed, Blender itself.

Name an interpreter that has `bpy` in MI_LCAIR_BLENDER_PYTHON to export the files anew.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.errors import InputError
from mi_lcair.models3d import read, report

SCRIPT = Path(__file__).with_name("blender_export.py")
FILES = Path(__file__).parents[1] / "data" / "blender"
INTERPRETER = os.environ.get("MI_LCAIR_BLENDER_PYTHON") or (
    sys.executable if importlib.util.find_spec("bpy") else None
)
HULL = ((-2, -0.5, 0), (2, 0.5, 1))
FIN = ((-1.9, -0.1, 1.05), (-0.9, 0.1, 1.85))
COPY = ((0.4, 0.7, 0.2), (0.6, 1.7, 0.6))
VOLUME = 4 + 0.16 + 0.08
DEFAULT = {"forward": "-Z", "up": "Y"}
AS_IT_IS = {"forward": "Y", "up": "Z"}
PAINTED = {"material": "gloss_black", "temperature": 300}


@pytest.fixture(
    params=[
        "committed",
        pytest.param(
            "exported",
            marks=[
                pytest.mark.slow,
                pytest.mark.skipif(not INTERPRETER, reason="needs Blender's module bpy"),
            ],
        ),
    ],
    scope="module",
)
def folder(request, tmp_path_factory):
    """Folder with the files of `blender_export.py`."""
    if request.param == "committed":
        return FILES
    exported = tmp_path_factory.mktemp("blender")
    # bpy and Mitsuba need not agree to live in one process
    subprocess.run([INTERPRETER, SCRIPT, exported], check=True, capture_output=True, timeout=300)
    return exported


def boxes(model):
    """Lowest and highest corner of the model's facets below, above and beside the hull's sides."""
    middle = np.array([model.vertices[corners].mean(axis=0) for corners in model.triangles])
    groups = {
        "hull": (abs(middle[:, 1]) < 0.6) & (middle[:, 2] < 1.02),
        "fin": middle[:, 2] > 1.02,
        "copy": middle[:, 1] > 0.6,
    }
    assert sum(map(np.count_nonzero, groups.values())) == len(model.triangles)
    return {
        name: (
            model.vertices[model.triangles[chosen]].min(axis=(0, 1)),
            model.vertices[model.triangles[chosen]].max(axis=(0, 1)),
        )
        for name, chosen in groups.items()
    }


def check_shape(model, turned_over=0):
    """The model is as it was built in Blender; so many of the copy's facets face inward."""
    found = boxes(model)
    for name, box in (("hull", HULL), ("fin", FIN), ("copy", COPY)):
        assert np.allclose(found[name], box, atol=1e-6), name
    figures = report(model)
    assert figures["volume"] == pytest.approx(VOLUME - 2 * 0.08 * (turned_over > 0), rel=1e-5)
    assert figures["inward"] == turned_over and figures["open_edges"] == 0


@pytest.mark.parametrize(
    "file, axes, facets",
    [("default.obj", DEFAULT, 18), ("y_forward_z_up.obj", AS_IT_IS, 18), ("labelled.glb", {}, 36)],
)
def test_a_labelled_model(folder, file, axes, facets):
    """Whatever the export's settings, the import gives the model that was built. Blender's number
    of a copy, .001, is no part of a group's name.
    """
    model = read(folder / file, **axes)
    check_shape(model)
    assert model.count == facets and model.remarks == ()
    assert {(label.material, label.temperature, label.group) for label in model.labels} == {
        ("bare_aluminum", 310, "self"),
        ("gloss_black", 330, "fin"),
    }


@pytest.mark.parametrize(
    "file, facets",
    [
        ("plain.obj", 18),
        ("plain.glb", 36),
        ("plain.ply", 18),
        ("plain.stl", 36),
        ("plain.usda", 18),
    ],
)
def test_a_model_without_labels(folder, file, facets):
    """Blender's PLY exporter leaves the facets of a mirrored object facing inward; the import
    counts them.
    """
    axes = AS_IT_IS if file.endswith("obj") else {}
    model = read(folder / file, **PAINTED, **axes)
    check_shape(model, turned_over=6 if file.endswith("ply") else 0)
    assert model.count == facets and set(model.temperature) == {300}
    with pytest.raises(InputError, match="has no label; .* give material and temperature$"):
        read(folder / file, **axes)


@pytest.mark.parametrize("file", ["plain.obj", "plain.glb", "plain.usda"])
def test_a_table_of_names(folder, file, tmp_path):
    """A Blender material goes before the object, and Fin.001 is a Fin."""
    (tmp_path / "names.csv").write_text(
        "name,type,material,kelvin,group\n"
        "Hull,f,bare_aluminum,310,\nHot steel,f,bare_aluminum,400,hot\nFin,f,gloss_black,330,fin\n"
    )
    model = (
        read(folder / file, names=tmp_path / "names.csv", **AS_IT_IS)
        if file.endswith("obj")
        else read(folder / file, names=tmp_path / "names.csv")
    )
    check_shape(model)
    areas = {}
    for corners, facet in zip(model.vertices[model.triangles], model.triangle_facet):
        label = model.labels[model.label[facet]]
        area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2
        key = label.material, label.temperature, label.group
        areas[key] = areas.get(key, 0) + area
    hull = "Hull" if file.endswith("usda") else "self"  # groups of the hierarchy
    assert areas == pytest.approx(
        {
            ("bare_aluminum", 310.0, hull): 1 + 4 + 4,  # sides 0, 2 and 4 of the hull
            ("bare_aluminum", 400.0, "hot"): 1 + 4 + 4,
            ("gloss_black", 330.0, "fin"): 2 * (0.2 + 0.8 + 0.16) + 2 * (0.2 + 0.4 + 0.08),
        },
        rel=1e-5,
    )


def test_custom_properties(folder):
    """What Blender's custom properties and attributes of faces say in USD."""
    pytest.importorskip("pxr")
    model = read(folder / "thermal.usda")
    check_shape(model)
    labels = [model.labels[number] for number in model.label]
    found = [(a.material, a.group, t) for a, t in zip(labels, model.temperature.tolist())]
    names = model.names.tolist()
    assert [row for row, name in zip(found, names) if name == "Hull"] == [
        ("oxidized_steel", "hot", 400) if k % 2 else ("gloss_black", "Hull", 310.5)
        for k in range(6)
    ]
    assert [row for row, name in zip(found, names) if name == "Fin"] == [
        ("gloss_black", "Fin", 310.5)
    ] * 6
    copies = [row for row, name in zip(found, names) if name == "Fin.001"]
    assert copies == [("gloss_black", "Fin_001", 341.0 + k) for k in range(6)]
    (remark,) = model.remarks
    assert remark == "its material's thermal:kelvin is used instead of its own: /root/Fin/Fin"


def test_the_example_is_one_model():
    """As OBJ and as USD."""
    pytest.importorskip("pxr")
    examples = Path(scenes.__path__[0]) / "examples"
    obj = read(examples / "drone.obj", **PAINTED, **DEFAULT)
    usd = read(examples / "drone.usda")
    assert usd.remarks == () and usd.count == obj.count
    assert np.sort(usd.box) == pytest.approx(np.sort(obj.box), abs=1e-5)  # OBJ has 6 decimals
    first, second = report(usd), report(obj)
    assert first["volume"] == pytest.approx(second["volume"], rel=1e-5)
    assert {label.material for label in usd.labels} == {"aluminum+paint", "blackbody"}
    assert {label.group for label in usd.labels} == {
        "Fuselage",
        "Fin",
        "Wing",
        "Wing_001",
        "exhaust",
    }


def test_a_default_export_is_remarked(folder):
    """Blender's header does not name the axes. Without the options the model lies on its side, and
    a line says what to give.
    """
    model = read(folder / "default.obj")
    (remark,) = model.remarks
    assert "Blender 5." in remark and "give forward='-Z' up='Y'" in remark
    assert np.ptp(model.box, axis=0) == pytest.approx([4, 1.85, 2.2], abs=1e-6)
