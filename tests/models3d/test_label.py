"""Labels: what each field may hold, and what is said when it does not."""

import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d.label import Label, find_material, kelvin, parse
from mi_lcair.physics.materials import names

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
def test_refused(text, reason):
    with pytest.raises(InputError) as error:
        parse(text, KNOWN)
    assert reason in str(error.value)


def test_an_unknown_material_lists_the_known():
    with pytest.raises(InputError) as error:
        parse("f*glosBlack*300*", KNOWN)
    assert "known: gloss_black" in str(error.value) and all(
        name in str(error.value) for name in KNOWN
    )


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
