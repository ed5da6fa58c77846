"""The chart of reflectance integrals: how its times and errors are computed."""

import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from drjit.llvm import Float64

from benchmarks import reflectance
from benchmarks.chart import Point
from benchmarks.methods.reflectance import ReflectanceMethod


def test_time_is_shared_among_repetitions_and_compile_is_apart(monkeypatch):
    """The clock is the test's own, so that the load of the machine does not matter."""
    calls, clock = [], [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])

    def run(p, effort, repetitions, seed):
        calls.append((effort, repetitions, seed))
        clock[0] += 0.02 if len(calls) > 1 else 0.12
        return Float64(np.full(repetitions, 1.0 + seed))

    point = reflectance.measured(
        "box",
        ReflectanceMethod("slow", "", (5,), run, lambda effort: 2 * effort),
        5,
        None,
        1.0,
        reflectance.Work(lanes=100, repetitions=25, launches=2),
    )
    # 25 repetitions take 3 launches of 10, after a first one that compiles.
    assert calls == [(5, 10, seed) for seed in range(4)]
    assert (point.samples, point.effort, point.value, point.error) == (10, 5, 3.0, 2.0)
    assert point.seconds == pytest.approx(0.002)
    assert point.compile_seconds == pytest.approx(0.1)


# ---- the command

POINTS = [
    Point("aluminum MWIR", "ours", n, 10.0**n, 1e-6 * 10**n, 0.1, error, 0, 1, 0.9, error)
    for n, error in ((1, 0.1), (2, 0.005))
]


@pytest.fixture
def measured(monkeypatch, tmp_path):
    """Substitute for the measurement and its files, in an empty folder; records its arguments."""
    asked = {}

    def measure(quick, progress):
        asked["quick"] = quick
        progress(1, 2)
        return POINTS

    def write(folder, points):
        assert points == POINTS
        (folder / "reflectance.csv").write_text("a table")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reflectance, "measure", measure)
    monkeypatch.setattr(reflectance, "write", write)
    return asked


def test_writes_and_prints(measured, capsys):
    reflectance.main(["-o", "charts", "--quick"])
    assert measured["quick"] and Path("charts/reflectance.csv").read_text() == "a table"
    lines = capsys.readouterr().out.splitlines()
    cells = [cell.strip() for cell in lines[2].split("  ") if cell]
    assert cells == ["aluminum MWIR", "1%", "ours", "100", "100 µs"]
    assert "rms error" in lines[0] and "none reaches it" in lines[3]
    assert lines[-1] == "wrote files to charts"


def test_json(measured, capsys):
    reflectance.main(["--json"])
    points = json.loads(capsys.readouterr().out)["points"]
    assert not measured["quick"] and points[0]["case"] == "aluminum MWIR"
    assert points[1]["error"] == pytest.approx(0.005) and points[1]["memory_MB"] is None


@pytest.mark.parametrize(
    "folder, message", [("file", "is not a folder"), ("no/where", "does not exist")]
)
def test_folder_is_refused_before_the_work(measured, capsys, folder, message):
    Path("file").write_text("")
    with pytest.raises(SystemExit) as end:
        reflectance.main(["-o", folder])
    printed = capsys.readouterr().err
    assert end.value.code == 2 and message in printed and printed.count("\n") == 1
    assert measured == {}


def test_nothing_is_left_behind(measured, monkeypatch):
    def interrupted(quick, progress):
        raise KeyboardInterrupt

    monkeypatch.setattr(reflectance, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        reflectance.main(["-o", "charts"])
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    "name", ["propagation", "reflectance", "openings", "facet_radiance", "throughput"]
)
def test_the_docstring_is_the_help(name, capsys):
    module = import_module(f"benchmarks.{name}")
    with pytest.raises(SystemExit):
        module.main(["--help"])
    assert f"python -m benchmarks.{name} [--quick]" in module.__doc__
    assert module.__doc__.splitlines()[0] in capsys.readouterr().out
