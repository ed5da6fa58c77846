"""Line charts: the same curves in a picture and on a page."""

from base64 import b64decode

import numpy as np
import pytest

from mi_lcair.charts import COLOURS, INK, Curve, LineChart, label
from mi_lcair.show.line_charts import figure_of
from mi_lcair.signatures.effective_areas import spectrum_charts as charts

X = np.linspace(3, 5, 11)
MAIN = Curve("total", 4 * X, "W sr-1 um-1")
PART = Curve("a", X, "W sr-1 um-1", 12)
AIR = Curve("transmittance (right)", X / 5, "", 8, on_right=True)


def chart(*curves, from_zero=True):
    return LineChart("target", X, "wavelength (µm)", "intensity (W)", [*curves], from_zero)


def test_a_picture_has_the_curves_with_their_colours():
    figure = figure_of([chart(MAIN, PART), chart(PART)], "title")
    first, second = figure.axes
    assert [line.get_label() for line in first.lines[:2]] == ["total", "a"]
    assert first.lines[0].get_ydata() == pytest.approx(4 * X)
    assert [line.get_color() for line in first.lines[:2]] == [INK, COLOURS[2]]
    assert first.get_legend() and second.get_legend() is None
    assert second.get_xlabel() == "wavelength (µm)" and not first.get_xlabel()


@pytest.mark.parametrize("values, from_zero, ends", [
    (X, True, (0, 5 + 0.25 * 5)),
    (-X, False, (-5 - 0.05 * 5, 0.25 * 5)),
    (0 * X, True, (0, 0.25e-30)),
])  # fmt: skip
def test_the_legend_has_room_above_the_curves(values, from_zero, ends):
    (axes,) = figure_of([chart(Curve("a", values, ""), from_zero=from_zero)], "").axes
    assert axes.get_ylim() == pytest.approx(ends)


def test_fractions_have_an_axis_of_their_own():
    left, right = figure_of([chart(MAIN, AIR)], "").axes
    assert right.get_ylabel() == "transmittance" and right.get_ylim() == (0, 1.25)
    assert right.lines[0].get_ydata() == pytest.approx(X / 5)
    assert len(left.get_legend().get_texts()) == 2


def test_charts_stand_side_by_side_with_their_labels():
    figure = figure_of([chart(MAIN), chart(MAIN)], "t", across=True)
    assert [axes.get_xlabel() for axes in figure.axes] == ["wavelength (µm)"] * 2
    assert label("radiance", "W m-2 sr-1") == "radiance (W m⁻² sr⁻¹)"


def test_a_page_has_the_same_curves():
    pytest.importorskip("plotly")
    from mi_lcair.show.page.line_panel import HEIGHT, line_panel

    panel = line_panel([chart(MAIN, AIR), chart(MAIN, PART)])
    traces = panel.data["data"]
    assert [trace["name"] for trace in traces] == ["total", "transmittance (right)", "total", "a"]
    assert [trace["showlegend"] for trace in traces] == [True, True, False, True]
    values = np.frombuffer(b64decode(traces[3]["y"]["bdata"]))
    assert values == pytest.approx(X) and traces[3]["line"]["color"] == COLOURS[2]
    assert panel.height == 2 * HEIGHT
    layout = panel.data["layout"]
    assert {"transmittance", "intensity (W)"} == {
        axis["title"]["text"] for name, axis in layout.items() if name.startswith("yaxis")
    }


def test_spectra_are_charts_of_target_and_scene():
    """The title has the integral over the response, and groups that do not emit are left out."""
    columns = {
        "wavelength_um": X,
        "response": np.full(11, 0.5),
        "target_W_sr_um": np.full(11, 3.0),
        "target.a_W_sr_um": np.full(11, 3.0),
        "target.b_W_sr_um": np.zeros(11),
        "scene_W_sr_um": np.full(11, 4.0),
        "scene.b_W_sr_um": np.ones(11),
    }
    target, scene = charts(columns)
    assert (target.title, scene.title) == ("target: 3 W/sr in band", "scene: 4 W/sr in band")
    assert [curve.name for curve in target.curves] == ["total", "a"]
    assert [(curve.name, curve.colour) for curve in scene.curves] == [("total", None), ("b", 1)]


def test_the_legend_of_a_logarithmic_chart_has_room_above_the_curves():
    chart = LineChart("", X, "time (s)", "ratio", [MAIN, PART], is_log=True)
    (axes,) = figure_of([chart], "").axes
    assert axes.get_ylim()[1] > 1.3 * MAIN.values.max()
