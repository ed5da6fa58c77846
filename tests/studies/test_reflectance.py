"""The page of reflectance integrals: its numbers come from the points."""

import pytest

from benchmarks import reflectance as benchmark
from benchmarks.chart import Point
from benchmarks.reflectance import Work
from docs.studies import reflectance


@pytest.fixture
def points(monkeypatch):
    """A measurement on one material with few samples per launch."""
    monkeypatch.setattr(benchmark, "MATERIALS", benchmark.MATERIALS[:1])
    for module in (benchmark, reflectance):
        monkeypatch.setattr(module, "QUICK", Work(2**10, 2, 1))
    steps = []
    measured = benchmark.measure(True, lambda *step: steps.append(step))
    assert steps[-1] == (len(measured), len(measured)) and len(steps) == len(measured)
    return measured


@pytest.mark.slow
def test_page(points, monkeypatch, tmp_path):
    reflectance.write(tmp_path, points, quick=True)
    assert {file.name for file in tmp_path.iterdir()} == {
        "reflectance.png",
        "reflectance.csv",
        "reflectance.md",
    }
    page = (tmp_path / "reflectance.md").read_text()
    assert "{" not in page and "nan" not in page
    # These two rows do not depend on random numbers.
    assert "| bare_aluminum MWIR | stratified quadrature | 8 900 | 0.031 % |" in page
    assert "| bare_aluminum MWIR | 75 | 0.86273 | -59 % |" in page
    for method in benchmark.METHODS:
        # The name is in the table of launches and in at least one table of results.
        assert page.count(f"| {method.name} |") >= 2


def test_factors_are_ratios_of_points():
    """Ours reaches an rms error of 1 % with 100 samples, and 0.1 % with 1000.

    For the 0.5 % of the thesis's setting it takes 1000 as well.
    """

    def at(method, effort, samples, rms):
        return Point("box", method.name, effort, samples, samples * 1e-6, 0, rms / 10, 0, 0, 1, rms)

    ours, theirs = reflectance.OURS, reflectance.UNIFORM
    points = [
        at(ours, 1, 10, 0.1),
        at(ours, 2, 100, 0.007),
        at(ours, 3, 1000, 0.0005),
        at(theirs, 500, 250000, 0.005),
    ]
    assert reflectance.factor_row(points, "box", theirs) == (
        "| box | uniform quadrature | 250 000 | 0.5 % | 250 ms "
        "| 2 500, 2 500 | 250, 250 | 250, 250 |"
    )
    assert reflectance.needs_row(points, "box") == "| box | 10 | 100 | 100 | 1 000 |"
