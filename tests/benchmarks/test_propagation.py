"""The chart of propagation methods.

How a method is timed, after which effort it stops, and the files of given points.
"""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import propagation
from benchmarks.chart import Point
from benchmarks.methods.propagation import AMBIENT, METHODS
from benchmarks.methods.propagation.problem import Method, Problem
from benchmarks.propagation import CLOSURES, Chart, Closure, Effort, curves, wanted

EFFORT = Effort(seconds=1.0, most=100, repetitions=5, same=2, paths=1, seeds=2)


def problem(name="box", answer=10.0) -> Problem:
    return Problem(name, None, None, 1, 1, True, answer=answer, source="closed form")


def result() -> Chart:
    """Results on two scenes.

    On the first our method is ten times as fast as radiosity. On the second it is the only one.
    """
    points = [
        Point(
            "box",
            name,
            effort,
            10 * effort,
            seconds * effort,
            0.2,
            *[error / effort] * 3,
            10,
            error / effort,
        )
        for name, seconds, error in (
            ("radiosity", 0.5, 0.05),
            ("lattice points", 0.05, 0.05),
            ("mirror, one bounce", 0.01, 5),
        )
        for effort in (1, 10, 100)
    ]
    points += [Point("hall", "lattice points", 1, 10, 0.3, 0.2, 0.0005, 0, 1, 10, 0.0005)]
    errors = {"none": -0.02, "ambient": 0.005, "tail": -0.0002}
    closures = [
        Closure(
            f"cavity, {f}",
            f,
            bounces,
            closure,
            errors[closure] * (10 * f if closure == "ambient" else 1),
            1e-4,
        )
        for f in (0.01, 0.3, 0.5)
        for bounces, closure in CLOSURES
    ]
    closures += [
        Closure("hall", None, bounces, closure, 0.3, 1e-4) for bounces, closure in CLOSURES
    ]
    return Chart([problem("box"), problem("hall")], points, closures, False)


def test_curves_repeat_in_turn_and_stop(monkeypatch):
    """A random method is repeated with other seeds, a deterministic one with fewer repetitions.

    The compile is timed separately. No effort is tried beyond the first that takes too long.
    Methods and efforts take turns.
    """
    calls = []

    def fake(case, method, effort, seed):
        calls.append((method.name, effort, seed))
        seconds = 3.0 if seed == 0 else 0.1 * effort
        return seconds, 10 + (-1) ** seed / effort, effort, seconds

    monkeypatch.setattr(propagation, "timed", fake)
    monkeypatch.setattr(propagation, "peak_memory", lambda run, case, effort, seed: 2 * effort)
    monkeypatch.setattr(propagation, "MOST_SECONDS", 100)
    random = Method("random", "", None, lambda case: [1, 4, 16, 64, 256], True)
    same = Method("same", "3.5", None, lambda case: [1, 256], False)
    points = curves(problem(), [random, same], EFFORT)
    assert [p.effort for p in points if p.method == "random"] == [1, 4, 16]
    first = [("random", effort, seed) for effort in (1, 4, 16) for seed in (0, 1)]
    # The effort 256 exceeds `most`
    second = [("random", effort, 2) for effort in (1, 4, 16)]
    rest = [("random", effort, seed) for seed in (3, 4, 5) for effort in (1, 4, 16)]
    same = [("same", 1, seed) for seed in range(3)]
    assert calls == [*first, *same[:2], *second, same[2], *rest]
    assert points[1].error == pytest.approx(1 / 40) and points[1].seconds == pytest.approx(0.4)
    assert points[1].compile_seconds == pytest.approx(2.6) and points[1].memory_MB == 8


def test_slow_runs_are_repeated_less():
    done = [(propagation.MOST_SECONDS, 0, 0), (1.0, 0, 0)]
    effort = Effort(seconds=1.0, most=100, repetitions=20, same=2, paths=1, seeds=2)
    random = Method("random", "", None, lambda case: [1], True)
    assert wanted(random, done[1:], effort) == 20
    assert wanted(random, done, effort) == propagation.LEAST_REPETITIONS


def test_no_panel_has_more_than_six_lines(tmp_path, figures):
    """The thesis's methods are apart from path tracing."""
    point = result().points[0]
    points = [replace(point, method=method.name) for method in METHODS]
    propagation.write(tmp_path, replace(result(), points=points))
    names = [[line.get_text() for line in figure.legends[0].texts] for figure in figures[:3]]
    assert all(len(methods) <= 6 for methods in names)
    assert {*sum(names, []), AMBIENT.name} == {method.name for method in METHODS}


def test_methods_have_names_of_their_own():
    assert len({method.name for method in METHODS}) == len(METHODS)


# ---- the command


@pytest.fixture
def measured(monkeypatch, tmp_path):
    """Substitute for the measurement, in an empty folder; records its arguments."""
    calls = []

    def measure(quick, progress):
        calls.append(quick)
        progress(1, 2)
        return result()

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(propagation, "measure", measure)
    return calls


@pytest.mark.slow
def test_writes_its_files(measured, capsys):
    propagation.main(["-o", "out", "--quick"])
    printed = capsys.readouterr().out
    assert measured == [True] and {file.name for file in Path("out").iterdir()} == {
        "propagation.png",
        "propagation_radiosity.png",
        "propagation_thesis.png",
        "propagation.csv",
        "propagation_closure.png",
        "propagation_closure.csv",
    }
    assert Path("out/propagation_closure.csv").read_text().count("\n") == 1 + 4 * len(CLOSURES)
    assert "box    1%         lattice points" in printed
    assert "none reaches it within 0.1 s" in printed
    assert "more than 0.1 s of processor time on each thread" in printed


def test_json(measured, capsys, monkeypatch):
    monkeypatch.setattr(propagation, "write", lambda folder, result: None)
    propagation.main(["--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["limit_processor_seconds"] == 0.1
    assert len(found["points"]) == 10 and found["closures"][0]["closure"] == "none"
