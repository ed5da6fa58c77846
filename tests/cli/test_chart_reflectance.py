"""Tests of mi-lcair chart reflectance: its files and its output."""

import json

import pytest

from mi_lcair.benchmark import reflectance_chart
from mi_lcair.benchmark.chart import Point
from mi_lcair.reports import method_chart

POINTS = [
    Point("aluminum MWIR", "ours", n, 10.0**n, 1e-6 * 10**n, 0.1, error, 0, 1, 0.9, error)
    for n, error in ((1, 0.1), (2, 0.005))
]


@pytest.fixture
def measured(monkeypatch):
    """Substitute for the measurement and its files; records its arguments."""
    asked = {}

    def measure(quick, progress):
        asked["quick"] = quick
        progress(1, 2)
        return POINTS

    def write(folder, points):
        assert points == POINTS
        (folder / "reflectance.csv").write_text("a table")

    monkeypatch.setattr(reflectance_chart, "measure", measure)
    monkeypatch.setattr(method_chart, "write_reflectance", write)
    return asked


def test_writes_and_prints(run, measured, folder):
    result = run("chart", "reflectance", "-o", "charts", "--quick")
    assert measured["quick"] and (folder / "charts" / "reflectance.csv").read_text() == "a table"
    lines = [line.split("  ") for line in result.stdout.splitlines()]
    assert [cell.strip() for cell in lines[2] if cell] == [
        "aluminum MWIR",
        "1%",
        "ours",
        "100",
        "100 µs",
    ]
    assert (
        "rms error" in result.stdout.splitlines()[0]
        and "none reaches it" in result.stdout.splitlines()[3]
        and result.stdout.endswith("to charts\n")
    )


def test_json(run, measured):
    points = json.loads(run("chart", "reflectance", "--json").stdout)["points"]
    assert (
        not measured["quick"]
        and points[1]["error"] == pytest.approx(0.005)
        and points[0]["case"] == "aluminum MWIR"
    )


def test_folder_is_refused_before_the_work(refused, measured, folder):
    (folder / "file").write_text("")
    assert "is not a folder" in refused("chart", "reflectance", "-o", "file")
    assert "does not exist" in refused("chart", "reflectance", "-o", "no/where")
    assert measured == {}


def test_nothing_is_left_behind(run, measured, folder, monkeypatch):
    def interrupted(quick, progress):
        raise KeyboardInterrupt

    monkeypatch.setattr(reflectance_chart, "measure", interrupted)
    assert run("chart", "reflectance", "-o", "charts").exit_code == 130
    assert list(folder.iterdir()) == []
