"""What faces are: labels in names, tables of names, copies that Blender has numbered."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d import read
from mi_lcair.models3d.modellers.naming import NameTable, without_number
from tests.models3d.shapes import cube


@pytest.fixture
def load(tmp_path):
    """Function that reads a model with a table of names, given as texts."""

    def load(text, names=None, suffix=".csv", **options):
        (tmp_path / "model.obj").write_text(text)
        if names is not None:
            options["names"] = tmp_path / f"names{suffix}"
            options["names"].write_text(names)
        return read(tmp_path / "model.obj", **options)

    return load


@pytest.mark.parametrize(
    "label, others, bare",
    [
        ("f*bareAl*300*group=plume.001", (), "f*bareAl*300*group=plume"),
        ("f*bareAl*300*.012", (), "f*bareAl*300*"),
        ("f*bareAl*300*Cube.001", (), "f*bareAl*300*Cube"),
        ("s*blackbody*288*elevation_deg=4.5.001", (), "s*blackbody*288*elevation_deg=4.5"),
        # a number with three decimals is one, unless its beginning is a name too
        ("f*bareAl*300.125", (), "f*bareAl*300.125"),
        ("f*bareAl*300.001", ("f*bareAl*300",), "f*bareAl*300"),
        ("s*blackbody*288*elevation_deg=4.125", (), "s*blackbody*288*elevation_deg=4.125"),
        ("f*bareAl*300.0015", (), "f*bareAl*300.0015"),
        ("f*bareAl*300*", (), "f*bareAl*300*"),
    ],
)
def test_numbers_of_copies(label, others, bare):
    assert without_number(label, others) == bare


def test_copies_of_a_group(load):
    """Copies of an object belong to one mesh."""
    text = cube(label="f*bareAl*300*group=fin") + cube(label="f*bareAl*300*group=fin.001")
    assert {label.group for label in load(text).labels} == {"fin"}


def test_which_name_goes_first(load):
    """A material's entry goes before a group's and an object's, and the table before labels."""
    names = (
        "name,material,kelvin\nHull,gloss_black,301\nleft,gloss_black,302\nRust,gloss_black,303\n"
    )
    face = "f -1 -2 -3\n"
    text = cube(label="Hull") + face + "g left\n" + face + "usemtl Rust\n" + face + "g\n" + face
    text += "usemtl Other\no f*bareAl*310*\n" + face + "o Hull.002\n" + face
    model = load(text, names)
    assert model.temperature[5:].tolist() == [301, 301, 302, 303, 303, 310, 301]


def test_labels_of_materials(load):
    """A material's name is a label where no group or object has one."""
    face = "f -1 -2 -3\n"
    text = "usemtl f*gloss_black*301*\n" + cube(label="Hull") + "o f*bareAl*310*\n" + face
    text += "o Hull\nusemtl f*gloss_black*302\n" + face + "usemtl f*gloss_black*302.001\n" + face
    assert load(text).temperature[5:].tolist() == [301, 310, 302, 302]
    with pytest.raises(InputError, match="model.obj: material 'f.gold.300.': unknown material"):
        load("usemtl f*gold*300*\n" + cube(label="Hull"))


def test_a_table_overrides_labels(load):
    names = "name;type;kelvin;material;group\nbright paint;t;290,5;gloss_black;ground\n"
    text = "usemtl bright_paint.003\n" + cube(label="f*bareAl*310*")
    (label,) = load(text, names).labels
    assert (label.type, label.temperature, label.group) == ("t", 290.5, "ground")


def test_what_the_options_give_may_be_missing(load):
    """--material and --temperature hold for the model, and not for terrain."""
    names = "name,type,material,kelvin\nHull,,,\nGround,t,gloss_black,290\n"
    model = load(
        cube(label="Hull") + cube(label="Ground", at=(0, 0, -5)),
        names,
        material="blackbody",
        temperature=400,
    )
    found = {(label.type, label.material, label.temperature) for label in model.labels}
    assert found == {("f", "blackbody", 400), ("t", "gloss_black", 290)}


def test_a_sky_ring(load):
    names = "name,type,material,kelvin,elevation_deg\nHull,s,blackbody,250,4.5\n"
    (label,) = load(cube(label="Hull"), names).labels
    assert (label.type, label.group, label.elevation_deg) == ("s", "sky", 4.5)


def test_a_fit_beside_the_table(load, tmp_path):
    fit = '{"model": "grey", "parameters": {"emissivity": 0.9}, "form": "standard", "band": "any"}'
    (tmp_path / "paint.json").write_text(fit)
    (label,) = load(cube(label="Hull"), "name,material,kelvin\nHull,paint.json,300\n").labels
    assert label.material == str(tmp_path / "paint.json")


@pytest.mark.parametrize(
    "names, reason",
    [
        ("name,material,kelvin\n", "no rows of data"),
        ("name,material,kelvin\nHull,gold,300\n", "names.csv, line 2: unknown material"),
        (
            "name,material,kelvin\nHull,blackbody,20\n",
            "line 2: temperature '20' looks",
        ),
        ("name,material,kelvin\nHull,,300\n", "line 2: lacks material"),
        ("name,material\nHull,blackbody\n", "line 2: lacks kelvin"),
        ("name,colour\nHull,red\n", "unknown column 'colour'; known: "),
        (
            "name,material,kelvin\nHull,blackbody,300\nHull.001,blackbody,310\n",
            "line 3: name 'Hull.001' is given twice",
        ),
        (
            "name,material,kelvin\nWing,blackbody,300\n",
            "line 10: the table .*names.csv does not name its object 'Hull'; name its object",
        ),
        (
            "name,material,emissivity,kelvin\nHull,blackbody,.9,300\n",
            "line 2: gives material and emissivity; give one of them",
        ),
        ("name,kelvin\nHull,300\n", "line 2: lacks material or emissivity"),
        ("name,emissivity,kelvin\nHull,92,300\n", "'92' must be a number from 0 to 1"),
        ("name,emissivity,kelvin\nHull,x,300\n", "'x' must be a number from 0 to 1"),
        ("name,type,material,kelvin\nHull,x,diffuse,300\n", "facet type 'x'"),
    ],
)
def test_refused(load, names, reason):
    with pytest.raises(InputError, match=reason):
        load(cube(label="Hull"), names)


def test_an_emissivity_in_place_of_a_material(load):
    """In a CSV with commas or semicolons, and in a label."""
    for separator, mark in ((",", "."), (";", ",")):
        rows = ["name", "emissivity", "kelvin"], ["Hull", f"{mark}92", "300"]
        names = "".join(f"{separator.join(row)}\n" for row in rows)
        (label,) = load(cube(label="Hull"), names).labels
        assert (label.material, label.temperature) == ("0.92", 300)
    (label,) = load(cube(label="f*0.92*300*")).labels
    assert label.material == "0.92"
    assert load(cube(label="Hull"), material="1", temperature=300).labels[0].material == "1.0"


def test_names_without_faces_are_told(load):
    model = load(
        cube(label="Hull"), "name,material,kelvin\nHull,blackbody,300\nWing,blackbody,300\n"
    )
    assert [line.split(": ")[1].split(" in ")[0] for line in model.remarks] == ["nothing"]
    assert model.remarks[0].endswith("is called Wing")
    assert np.all(model.temperature == 300)


def test_entries_of_a_table(tmp_path):
    (tmp_path / "names.csv").write_text("name,kelvin\nHull,300\nHot steel,\n")
    table = NameTable(tmp_path / "names.csv")
    assert table.find(("", "", "Hull.001"))[1] == {"kelvin": "300"}
    assert table.find(("Wing",)) is None and table.unused() == ["Hot steel"]


def test_the_error_without_labels_lists_the_names_for_a_table(load):
    with pytest.raises(InputError, match=r"give names with a table of names \(here Hot_steel\)"):
        load(cube(label="Hot steel.001"))
