"""Our side of the comparison with other tools: few paths agree with the exact answers."""

import csv
import subprocess
import sys
from importlib import import_module

import pytest
from click.testing import CliRunner

from docs.studies.peers import __main__ as peers
from docs.studies.peers import exact
from mi_lcair.cli import main as command_line


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    """Calls of mi-lcair do not start a process."""
    monkeypatch.setattr(
        subprocess,
        "run",
        lambda words, **_: CliRunner().invoke(command_line, [str(word) for word in words[1:]]),
    )


def run(script: str, case: str = "-", effort: int = 1) -> dict[str, tuple]:
    return import_module(f"docs.studies.peers.{script}").run(case, effort, 1)


def check(results: dict[str, tuple], truth: dict[str, float]):
    for name, value in truth.items():
        assert abs(results[name][0] - value) <= 4.5 * results[name][1], name


def test_plate():
    # 4096 paths know it to some percent
    results = run("plate_mi_lcair", effort=2**12)
    assert results["radiance"][1] < 0.05 * exact.plate()["radiance"]
    check(results, exact.plate())


def test_cavity():
    value, error = run("cavity_mi_lcair")["radiance"]
    assert value == pytest.approx(exact.cavity()["radiance"], rel=1e-9)
    assert error < 1e-9 * value


def test_pixel():
    results, truth = run("pixel_mi_lcair"), exact.pixel("mi_lcair")
    assert results["background"][0] == pytest.approx(truth["background"], rel=1e-9)
    # Diffraction spreads a thousandth of the contrast beyond the frame
    assert results["target"][0] == pytest.approx(truth["target"], rel=1e-4)
    assert results["snr"][0] == pytest.approx(truth["snr"], rel=2e-3)


def test_view_factors():
    model = str(peers.HERE / "obstructed_squares.obj")
    check(run("factors_mi_lcair", model, 2**12), exact.squares(True))


def test_exact_view_factors():
    # The table was checked by quadrature in four dimensions, and by View3D
    text = exact.TABLE.with_name("obstructed_squares.csv").read_text(encoding="utf-8")
    table = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    tried = 0
    for row in table:
        truth = {"none": exact.squares(False), "sheet": exact.squares(True)}.get(row["case"], {})
        pair = f"{row['from']} {row['to']}"
        if pair in truth:
            assert truth[pair] == pytest.approx(float(row["F"]), abs=1e-11), pair
            tried += 1
    assert tried == 6
    # The room is closed
    for wall in ("wall_y0", "ceiling"):
        factors = [value for pair, value in exact.room().items() if pair.split()[0] == wall]
        assert len(factors) == 8 and sum(factors) == pytest.approx(1, abs=1e-7)


def test_rows(monkeypatch):
    trial = peers.Trial("plate", "raysect", "plate_raysect", (10, 20), "samples")
    assert peers.rows(trial, None)[0].startswith("| raysect | not installed |")
    truth = exact.plate()["radiance"]
    # Errors of 1 and 3 % are sqrt(5) % as a root mean square
    results = [{"radiance": (share * truth, 0.02 * truth)} for share in (1.01, 0.97)]
    runs = [{"effort": n, "seconds": n / 1e3, "results": results} for n in (10, 20)]
    table = peers.rows(trial, {"first": 2.0, "runs": runs})
    lines = peers.code_lines("plate_raysect")
    assert table[0] == (
        f"| raysect | 10 samples | 2.2e-02 | 3.0e-02 | 2.0e-02 | 10 ms | 2 s | {lines} |"
    )
    monkeypatch.undo()
    assert peers.measured(trial, sys.executable) is None
