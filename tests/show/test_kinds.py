"""What a file or a name is."""

import pytest

from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.formats import read_columns
from mi_lcair.show import kinds
from mi_lcair.show.kinds import kind_of
from mi_lcair.show.page.reading import read

TREND = "azimuth_deg,elevation_deg,intensity_W_sr\n0,0,1\n"
SPECTRUM = "wavelength_um,target_W_sr_um\n3,1\n"


@pytest.mark.parametrize(
    "name, kind",
    [
        ("image.EXR", kinds.IMAGE),
        ("model.obj", kinds.MODEL),
        ("model.glb", kinds.MODEL),
        ("any.xml", kinds.SCENE),
        ("cavity", kinds.SCENE),
        ("any.toml", kinds.SCENARIO),
        ("a340_landing/position_1", kinds.SCENARIO),
        ("gloss_black", kinds.MATERIAL),
    ],
)
def test_names_and_suffixes(name, kind):
    assert kind_of(name) == kind


@pytest.mark.parametrize(
    "text, kind",
    [(TREND, kinds.TREND), (SPECTRUM, kinds.SPECTRUM), ("facet,a\n0,1\n", kinds.FACETS)],
)
def test_tables_by_their_columns(tmp_path, text, kind):
    path = tmp_path / "t.csv"
    path.write_text(text)
    assert kind_of(path) == kind
    formats.write_netcdf(tmp_path / "t.nc", formats.dataset(read_columns(path)))
    assert kind_of(tmp_path / "t.nc") == kind
    path.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="neither a trend"):
        kind_of(path)


@pytest.mark.parametrize(
    "text, kind",
    [
        ('{"kind": "signature"}', kinds.SIGNATURE),
        ('{"kind": "fit"}', kinds.FIT),
        ('{"kind": "mi_lcair solution"}', kinds.SOLUTION),
        ('{"kind": "budget"}', kinds.BUDGET),
        ('{"kind": "audit"}', kinds.AUDIT),
        ('{"parameters": {}}', kinds.FIT),
        ('{"kind": "sensitivities"}', kinds.ANOTHER),
    ],
)
def test_results_by_their_kind(tmp_path, text, kind):
    path = tmp_path / "result.json"
    path.write_text(text)
    assert kind_of(path) == kind


@pytest.mark.parametrize(
    "text, words",
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[1]", "not the JSON of a result"),
        ('{"made": {}}', "not the JSON of a result"),
        ('{"kind": ["x"]}', "its kind is no text"),
    ],
)
def test_other_json(tmp_path, text, words):
    path = tmp_path / "result.json"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        kind_of(path)


def test_a_result_of_another_kind(tmp_path):
    """A page shows its entries: numbers, and lists of one length as a table. It is no result."""
    path = tmp_path / "result.json"
    path.write_text(
        '{"kind": "sensitivities", "intensity_W_sr": 2.5, "names": ["a", "b"], "value": [1, 2],'
        ' "rows": [{"x": 1, "y": null}, {"x": 3, "y": "z"}], "of": {"unit": "K"}}'
    )
    title, sections = read(str(path), kinds.ANOTHER)
    facts, table = sections[0].parts
    assert title == "Sensitivities (result.json)"
    assert facts.rows == [("kind", "sensitivities"), ("intensity_W_sr", 2.5), ("of.unit", "K")]
    assert {name: list(v) for name, v in table.columns.items()} == {
        "names": ["a", "b"],
        "value": [1, 2],
        "rows.x": [1, 3],
        "rows.y": ["", "z"],
    }
    with pytest.raises(InputError, match="kind 'sensitivities'; those that are read are a sig"):
        kinds.read_result(path)


def test_a_folder_of_an_import_is_a_scene(tmp_path):
    (tmp_path / "scene.xml").write_text("<scene/>")
    assert kind_of(tmp_path) == kinds.SCENE


def test_a_users_material(tmp_path):
    materials = tmp_path / "own.toml"
    materials.write_text("""
[paint.MWIR]
model = "sandford_robertson"
source = "measured"
epsilon = 0.3
rho_d = 0.2
b = 0.4
e = 0.1
""")
    assert kind_of("paint", materials) == kinds.MATERIAL
    with pytest.raises(InputError, match="'paint' is no image .* nearest are [a-z]+[+_]paint"):
        kind_of("paint")
