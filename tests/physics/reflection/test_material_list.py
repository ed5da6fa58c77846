"""The list of materials: what it holds, and the emissivities that a render has."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from tests.plugins.reflection_models import seen_at

GREY = '[{name}.any]\nmodel = "grey"\nemissivity = {value}\nsource = "test"\n'


def test_emissivities_are_those_of_a_render():
    """The plugin's table in Float32; an entry for every band is tried in LWIR."""
    result = mi_lcair.materials()
    assert len(result.listed) == len(result.emissivity) == 11
    for entry, emissivity in zip(result.listed, result.emissivity):
        where = "LWIR" if entry.band == "any" else entry.band
        bsdf = mi.load_dict({"type": "material", "material": entry.name, "band": where})
        rendered = bsdf.eval_attribute_1("emissivity", seen_at(np.radians([0.0, 60.0])))
        np.testing.assert_allclose(emissivity, rendered.numpy(), atol=2e-6)


def test_files_and_folders_come_first(tmp_path):
    (tmp_path / "a.toml").write_text(GREY.format(name="rust", value=0.7))
    (tmp_path / "b.toml").write_text("[target]\nscene = 'x'\n")
    result = mi_lcair.materials(tmp_path)
    columns = result.columns()
    assert columns["name"][0] == "rust" and columns["emissivity_60deg"][0] == pytest.approx(0.7)
    assert columns["source"][0] == "test" and len(result.left_out) == 1
    assert "b.toml: material 'target'" in result.left_out[0]
    first = result.as_dict()["materials"][0]
    assert first["parameters"] == {"emissivity": 0.7} and first["band"] == "any"
    assert mi_lcair.materials(tmp_path / "a.toml", tmp_path).columns()["name"][1] == "rust"
    assert result.summary() == "materials: 9 names, 12 entries; 103 labels of surfaces"
    assert len({entry["name"] for entry in result.as_dict()["labels"]}) == 103


@pytest.mark.parametrize("name", ["empty", "none.toml", "b.toml"])
def test_unusable_files_are_refused(tmp_path, name):
    (tmp_path / "empty").mkdir()
    (tmp_path / "b.toml").write_text(GREY.format(name="rust", value=1.7))
    with pytest.raises(InputError, match=name):
        mi_lcair.materials(tmp_path / name)
