"""A table of facets becomes the colours of the pixels in which each facet is seen."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.facets import FacetTable, facet_images, seen_facets
from mi_lcair.table import read_table


def test_pixels_show_the_facets_that_lie_there():
    """open_box from above: facet 0, the floor, across the middle; the wall, facet 1, edge-on, and
    nothing around.
    """
    scene = mi_lcair.load("open_box", resolution=16)
    seen = seen_facets(scene, FacetTable(scene))
    expected = np.full((16, 16), -1)
    expected[3:13, 1:15] = 0  # 0.1 m of 0.16 m, and 0.1414 m
    assert np.array_equal(seen, expected)


def test_pixel_rows_run_downward():
    """furnace: the slabs are turned, the sphere's facets are numbered from its top (+z) down."""
    scene = mi_lcair.load("furnace", resolution=40)
    sphere = seen_facets(scene, FacetTable(scene))[10:30, 20]
    sphere = sphere[(sphere >= 6) & (sphere < 406)]
    assert len(sphere) > 10 and np.all(np.diff(sphere) >= 0)
    left, right = seen_facets(scene, FacetTable(scene))[20, [0, -1]]
    assert 406 <= left < 412 <= right < 418  # a sensor that looks along +y has +x at its right


@pytest.fixture
def table(tmp_path):
    def write(text):
        (tmp_path / "facets.csv").write_text(text)
        return tmp_path / "facets.csv"

    return write


def test_values_go_to_their_facets(table):
    """Rows in any order; NaN for a facet without row or value and for a pixel without facet."""
    file = table(
        "# made by hand\narea_m2,facet,material,radiance_W_m2_sr\n0.5,1,paint,7\n\n2,0,paint,\n"
    )
    scene = mi_lcair.load("open_box", resolution=16)
    images = facet_images(scene, read_table(file, ("facet",)), ["area_m2", "radiance_W_m2_sr"])
    assert np.isnan(images["radiance_W_m2_sr"]).all()
    assert (
        set(np.unique(images["area_m2"][3:13, 1:15])) == {2}
        and np.isnan(images["area_m2"][0]).all()
    )


@pytest.mark.parametrize(
    "text, column, reason",
    [
        ("", "a", "must name facet; found: nothing"),
        ("facet,a\n", "a", "no rows of data"),
        ("face,a\n0,1\n", "a", "must name facet"),
        ("facet,a\n0,1\n1\n", "a", "line 3: 1 cells where the header names 2"),
        (
            "facet,a\n0,1\n2,1\n",
            "a",
            "line 3: facet '2' is not in the scene, whose facets are numbered from 0 to 1",
        ),
        ("facet,a\n0,1\n0.5,1\n", "a", "line 3: facet '0.5' is not"),
        ("facet,a\n-1,1\n", "a", "line 2: facet '-1' is not"),
        ("facet,a\n0,1\n1,2\n0,3\n", "a", "facet 0 has 2 rows"),
        ("facet,a\n,1\n", "a", "line 2: facet '' is not"),
        ("facet,a\n0,paint\n", "a", "line 2: 'paint' in column 'a' is not a number"),
        ("facet,a\none,1\n", "a", "line 2: 'one' in column 'facet' is not a number"),
    ],
)
def test_unsound_tables_are_refused(table, text, column, reason):
    file = table(text)
    with pytest.raises(InputError, match=reason):
        facet_images(
            mi_lcair.load("two_plates", resolution=4), read_table(file, ("facet",)), [column]
        )


def test_a_table_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="none.csv: cannot be read: No such file"):
        read_table(tmp_path / "none.csv", ("facet",))
