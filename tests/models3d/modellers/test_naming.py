"""What faces are: labels in names, tables of names, copies that Blender has numbered."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d import read
from mi_lcair.models3d.modellers.naming import (
    Label,
    NameTable,
    find_material,
    kelvin,
    parse,
    without_number,
)
from mi_lcair.physics.materials import names
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


# Labels: what each field may hold, and what is said when it does not
# -------------------------------------------------------------------

KNOWN = names()


@pytest.mark.parametrize(
    "text, label",
    [
        ("f*bareAl*300*", Label("f", "bare_aluminum", 300, "self")),  # the thesis's own example
        ("f*bareAl*300", Label("f", "bare_aluminum", 300, "self")),
        ("s*blackbody*288*", Label("s", "blackbody", 288, "sky")),
        ("t*ir_range_wall*263.5*Cube.001_Mesh*x", Label("t", "ir_range_wall", 263.5, "terrain")),
        ("f*blackbody*5e2*group=plume*Cone.001", Label("f", "blackbody", 500, "plume")),
        ("f*gloss_black*300*Cone*group=hot_parts", Label("f", "gloss_black", 300, "hot_parts")),
        ("s*blackbody*288*elevation_deg=4.5", Label("s", "blackbody", 288, "sky", 4.5)),
        ("s*blackbody*288*group=ring*elevation_deg=90*", Label("s", "blackbody", 288, "ring", 90)),
        ("f*blackbody*300*colour=red*a=b=c", Label("f", "blackbody", 300, "self")),
    ],
)
def test_labels(text, label):
    assert parse(text, KNOWN) == label


@pytest.mark.parametrize(
    "name, material",
    [
        ("bareAl", "bare_aluminum"),
        ("bare_aluminum", "bare_aluminum"),
        ("BareAluminum", "bare_aluminum"),
        ("bare aluminium", "bare_aluminum"),
        ("glossBlack", "gloss_black"),
        ("gloss-black", "gloss_black"),
        ("glossBlk", "gloss_black"),
        ("irRangeWall", "ir_range_wall"),
        ("BlackBody", "blackbody"),
        ("diffuse", "diffuse"),
    ],
)
def test_names_of_materials(name, material):
    assert find_material(name, KNOWN) == material


def test_a_users_own_material_goes_before_an_alias():
    assert find_material("bareAl", ["bareAl", *KNOWN]) == "bareAl"
    assert find_material("rust_2", ["rust-2", "rust_2"]) == "rust_2"


@pytest.mark.parametrize(
    "text, reason",
    [
        ("f*bareAl", "2 fields where 3 are needed"),
        ("*", "2 fields where 3"),
        ("x*bareAl*300*", "facet type 'x' must be f (model), s (sky) or t (terrain)"),
        ("*bareAl*300", "facet type ''"),
        ("F*bareAl*300*", "facet type 'F'"),
        ("f*bareAll*300*", "unknown material 'bareAll'; known: bare_aluminum,"),
        ("f**300*", "unknown material ''"),
        ("f*bareAl*hot*", "temperature 'hot' is not a number; give kelvin"),
        ("f*bareAl**", "temperature '' is not a number"),
        ("f*bareAl*27*", "temperature '27' looks like degrees Celsius; give kelvin: 300.15"),
        ("f*bareAl*60*", "looks like degrees Celsius; give kelvin: 333.15"),
        ("f*bareAl*-10*", "looks like degrees Celsius; give kelvin: 263.15"),
        ("f*bareAl*100C*", "temperature '100C' looks like degrees Celsius; give kelvin: 373.15"),
        ("f*bareAl*100 °C*", "give kelvin: 373.15"),
        ("f*bareAl*xC*", "is not a number"),
        (
            "f*bareAl*-300*",
            "temperature '-300' is out of range; give kelvin, more than 60 and at most 10000",
        ),
        ("f*bareAl*10001*", "out of range"),
        ("f*bareAl*nan*", "is not finite"),
        ("f*bareAl*inf*", "is not finite"),
        ("f*bareAl*300*group=hot parts", "group 'hot parts' must consist of letters"),
        ("f*bareAl*300*group=", "group ''"),
        ("f*bareAl*300*group=plume.001", "end it with '*'"),
        ("s*blackbody*288*elevation_deg=91", "elevation_deg '91' must be a number from 0 to 90"),
        ("s*blackbody*288*elevation_deg=-1", "'-1' must be"),
        ("s*blackbody*288*elevation_deg=4.5.001", "elevation_deg '4.5.001' must be"),
        ("s*blackbody*288*elevation_deg=nan", "'nan'"),
        ("f*blackbody*288*elevation_deg=5", "elevation_deg=5 belongs to sky facets (s) only"),
    ],
)
def test_refused_of_label(text, reason):
    with pytest.raises(InputError) as error:
        parse(text, KNOWN)
    assert reason in str(error.value)


def test_an_unknown_material_lists_the_known():
    with pytest.raises(InputError) as error:
        parse("f*glosBlack*300*", KNOWN)
    assert "known: gloss_black, " in str(error.value)  # the nearest


def test_what_comes_from_elsewhere_is_not_read():
    assert parse("f*?*?*group=hot", KNOWN, material="diffuse", has_temperatures=True) == Label(
        "f", "diffuse", None, "hot"
    )
    assert (
        parse("s*blackbody*280*", KNOWN, material="diffuse").material == "blackbody"
    )  # of model facets only


@pytest.mark.parametrize("value", ["60.01", "10000", "300.5", "3e2"])
def test_limits_of_temperature(value):
    assert kelvin(value) == float(value)
