"""A new kind of result is one class: the console, JSON, tables, page and picture follow from it."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from mi_lcair.charts import BarChart, BarCharts, LineCharts, lines_of
from mi_lcair.results import Result, entry
from mi_lcair.sections import LongTable, Section, Table, blocks, remarks


@dataclass(frozen=True, repr=False)
class Cooling(Result):
    """Temperature of a plate over time."""

    name: str
    time: np.ndarray = entry("time_s")
    kelvin: np.ndarray = entry("temperature_K")
    half_width: np.ndarray = entry("half_width_K")
    remarks: tuple[str, ...] = ()
    seconds: float = entry(default=0.0)

    kind = "cooling"
    heading = "Temperature of a plate"
    computed = {"lowest_K": "lowest", "length": "name.__len__"}

    @property
    def lowest(self) -> float:
        return float(self.kelvin.min())

    def summary(self):
        return f"cooling of {self.name}: {self.lowest:g} K at the lowest"

    def columns(self):
        return {"time_s": self.time, "temperature_K": self.kelvin, "half_width_K": self.half_width}

    def facts(self, digits: int = 3):
        yield "lowest", f"{self.lowest:.{digits}g} K"
        yield "values", len(self.time)
        yield Table.of({"group": ["a", "b"], "area_m2": [2, 3.5], "area_error_m2": [0.1, 0.25]})
        yield Table.of({"value": [1.0], "sigma": [0.123], "numerical_error": [0.0456]})
        yield LongTable(self.columns())
        yield Section("More", ["a paragraph"])

    def picture(self):
        half = {"temperature_K": "half_width_K"}
        return lines_of(self.columns(), "time_s", ["temperature_K"], half=half, title=self.name)


@pytest.fixture
def cooling():
    seconds = np.arange(4.0)
    return Cooling("plate", seconds, 300 - seconds, 0.1 + 0 * seconds, ("take care",), 0.5)


def test_the_json_has_the_fields_with_their_keys(cooling):
    entries = cooling.as_dict()
    assert entries == {
        "kind": "cooling",
        "name": "plate",
        "time_s": [0, 1, 2, 3],
        "temperature_K": [300, 299, 298, 297],
        "half_width_K": [0.1] * 4,
        "remarks": ["take care"],
        "lowest_K": 297,
        "length": 5,
    }


def test_the_console_has_the_facts_and_the_remarks(cooling):
    sections = cooling.sections()
    facts, areas, errors = blocks(sections)
    assert facts == [["lowest", "297 K"], ["values", "4"]]
    assert areas == [["group", "area m^2"], ["a", "2 +- 0.1"], ["b", "3.5 +- 0.25"]]
    assert errors == [["value", "sigma", "numerical error"], ["1", "0.12", "0.046"]]
    assert [section.title for section in sections] == ["Temperature of a plate", "More"]
    assert remarks(sections) == ["take care"]
    assert next(iter(blocks(cooling.sections(digits=1))))[0] == ["lowest", "3e+02 K"]


def test_the_picture_has_the_units_and_the_bands(cooling):
    (axes,) = cooling.plot().axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time (s)", "temperature (K)")
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), cooling.kelvin)
    (band,) = axes.collections
    assert band.get_datalim(axes.transData).y1 == pytest.approx(300.1)
    assert isinstance(cooling.sections()[0].parts[-1], LineCharts)


def test_every_file_is_written(cooling, tmp_path):
    pytest.importorskip("plotly")
    for suffix in (".json", ".csv", ".nc", ".html", ".svg"):
        cooling.save(tmp_path / f"file{suffix}")
    read = Cooling.of_entries(json.loads((tmp_path / "file.json").read_text()))
    np.testing.assert_array_equal(read.kelvin, cooling.kelvin)
    page = (tmp_path / "file.html").read_text()
    assert "How it was made" in page and "take care" in page


def test_bars_stand_beside_or_follow_each_other():
    bars = {"target": [2.0, 1.0, 0.0], "scene": [3.0, 1.0, 1e-6]}
    errors = {"target": [0.1, 0.1, 0.0]}
    beside = BarChart("parts", ["a", "b", "tiny"], "intensity (W/sr)", bars, errors)
    (axes,) = BarCharts([beside], "title").draw().axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["a", "b"]
    assert [bar.get_height() for bar in axes.patches] == [2, 1, 3, 1]
    assert axes.get_ylabel() == "intensity (W/sr)" and axes.get_legend()
    stacked = BarChart("", ["a", "b"], "share", {"x": [0.2, 0.3], "y": [0.8, 0.7]}, stacked=True)
    (axes,) = BarCharts([stacked], "title").draw().axes
    assert [bar.get_x() for bar in axes.patches] == [0, 0, 0.2, 0.3]
