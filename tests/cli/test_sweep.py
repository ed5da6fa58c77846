"""Tests of the command `sweep`."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import xarray

from tests.detection.disc_scenario import write_disc

SWEEP = """[base]
scenario = "disc.toml"
[conditions]
azimuth_deg = { from = 0, to = 20, step = 10 }
range_m = [500, 1000]
[sampling]
spp = 2
resolution = 8
"""


def write(folder, text=SWEEP):
    write_disc(folder)
    (folder / "sweep.toml").write_text(text)


def test_sweep(run, refused, folder):
    """A file with a dimension for each condition, and nothing else is left behind."""
    write(folder)
    result = run("sweep", "sweep.toml", "-o", "s.nc")
    words = "6 cases over 3 azimuth_deg x 2 range_m, from 3 views, 3 of them traced"
    assert result.exit_code == 0 and result.stdout.startswith(f"sweep sweep  {words}\n")
    with xarray.open_dataset(folder / "s.nc") as data:
        assert data["contrast_W_m2"].sizes == {"azimuth_deg": 3, "range_m": 2}
        assert data["contrast_W_m2"].units == "W m-2"
    assert not (folder / "s.nc.areas").exists()
    assert "exists; give --overwrite" in refused("sweep", "sweep.toml", "-o", "s.nc")
    assert run("sweep", "sweep.toml", "-o", "s.csv", "--areas", "areas").exit_code == 0
    rows = (folder / "s.csv").read_text().splitlines()
    assert len(rows) == 7 and rows[0].startswith("azimuth_deg,range_m,intensity_W_sr")
    again = run("sweep", "sweep.toml", "-o", "t.nc", "--areas", "areas", "--json")
    assert json.loads(again.stdout)["traced"] == 0
    assert (folder / "t.nc").read_bytes() == (folder / "s.nc").read_bytes()


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (SWEEP.replace("500", "-5"), (), "range"),
        (SWEEP.replace("range_m", "rnage_m"), (), "rnage_m"),
        (SWEEP.replace("spp = 2", "spp = 2\ntolerance = 0.1"), (), "cannot be combined with it"),
        (SWEEP, ("--workers", 2, "--dask", "x"), "give one of them"),
        (SWEEP, ("--areas", "disc.toml"), "no folder"),
        ("[base", (), "sweep.toml"),
    ],
)
def test_refused(refused, folder, text, arguments, message):
    write(folder, text)
    before = set(folder.iterdir())
    assert message in refused("sweep", "sweep.toml", "-o", "s.nc", *arguments)
    assert set(folder.iterdir()) == before


@pytest.mark.slow
def test_killed_sweeps_go_on(run, folder):
    """Killed at random moments and started again: the bytes of a sweep that was not disturbed."""
    write(folder, SWEEP.replace("to = 20, step = 10", "to = 89.9, step = 0.2"))
    start = time.perf_counter()
    assert run("sweep", "sweep.toml", "-o", "whole.nc").exit_code == 0
    seconds = time.perf_counter() - start + 2  # of the start of Python
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    moments = random.Random(1)
    for _ in range(2):
        command = [sys.executable, "-m", "mi_lcair", "sweep", "sweep.toml", "-o", "s.nc"]
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as process:
            time.sleep(moments.uniform(0.3, 1) * seconds)
            process.send_signal(signal.SIGKILL)
    run("sweep", "sweep.toml", "-o", "s.nc", "--overwrite")
    assert (folder / "s.nc").read_bytes() == (folder / "whole.nc").read_bytes()
    assert not (folder / "s.nc.areas").exists()
