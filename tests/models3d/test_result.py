"""A model answers in Python as all results do."""

import json

import numpy as np

from mi_lcair.models3d import read, report
from tests.docs.fences import ROOT


def box():
    return read(ROOT / "scenes" / "examples" / "box.obj")


def test_a_model_states_its_size_in_one_line():
    assert repr(box()) == "model of 7 facets (14 triangles), 4 x 4 x 1.01 m, 290 to 330 K"


def test_a_notebook_shows_the_picture():
    assert "data:image/png;base64," in box()._repr_html_()


def test_the_table_has_a_row_for_each_facet():
    model = box()
    frame = model.to_dataframe()
    assert list(frame.material) == 5 * ["bare_aluminum"] + ["gloss_black", "ir_range_wall"]
    assert list(frame.group) == 5 * ["self"] + ["lid", "terrain"]
    np.testing.assert_allclose(frame.area_m2, [1, 1, 1, 1, 1, 1, 16])
    for name, area in report(model)["area_by_material"].items():
        assert np.isclose(frame.area_m2[frame.material == name].sum(), area)


def test_the_dictionary_is_strict_json():
    entries = box().as_dict()
    assert entries["kind"] == "model" and entries["facets"] == 7
    json.dumps(entries, allow_nan=False)
