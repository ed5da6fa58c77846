"""The benchmarks for asv: each runs in a tiny setting and gives a positive number."""

import json
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
import pytest

import benchmarks
from benchmarks import errors, gpu, loop, speed, throughput, timing, work
from mi_lcair.fitting.report import Fit

ROOT = Path(__file__).parents[2]


def test_configuration_names_the_folder():
    settings = json.loads((ROOT / "asv.conf.json").read_text())
    assert (ROOT / settings["benchmark_dir"] / "__init__.py").exists()


def test_asv_finds_the_figures(capsys):
    """It imports every module, of which none may measure anything by that."""
    found = set()
    for module in walk_packages(benchmarks.__path__, "benchmarks."):
        found |= set(vars(import_module(module.name)))
    assert {"track_fit", "track_bundled", "peakmem_image", "Throughput"} <= found
    assert not any(name.startswith(("time_", "mem_")) for name in found)
    assert capsys.readouterr().out == ""


def test_ratio_is_one_of_times(monkeypatch):
    """The first call of each is not timed; the median of the others counts."""
    calls = []
    monkeypatch.setattr(timing, "seconds", lambda run, seed, clock: run(seed))
    one = lambda seed: calls.append(seed) or (6.0 if seed < 3 else 60.0)
    assert timing.ratio(one, lambda seed: 2.0, rounds=3) == 3.0
    assert calls == [0, 1, 2, 3]


@pytest.mark.slow
@pytest.mark.filterwarnings("default:light of sky")  # a remark of the airliner's sweep
@pytest.mark.parametrize(
    "track",
    [
        *(
            lambda name=name: errors.track_time_to_error(name, tolerance=0.2, rounds=1)
            for name in list(errors.SCENES)[::3]
        ),
        lambda: errors.track_openings(paths=2**12, seeds=3),
        lambda: errors.track_small_launch(rounds=1),
        lambda: errors.track_image(spp=4, rounds=1),
        lambda: work.track_sweep(work.AZIMUTHS[:2], ranges=(500, 800), rounds=1),
        lambda: work.track_trend(work.AZIMUTHS[:2], tolerance=0.2, rounds=1),
        lambda: work.track_fit(starts=2, rounds=1),
        lambda: work.track_help(rounds=1),
        lambda: work.track_command(rounds=1),
        lambda: speed.track_bundled("cavity", "path", spp=1, rounds=1),
    ],
)
@pytest.mark.filterwarnings("ignore:in 2 of 2 views terrain")  # of the airliner, from below
def test_track(track):
    assert 0 < track() < float("inf")


@pytest.mark.slow
def test_throughput(monkeypatch):
    """In one of the scenes, that of all contestants."""
    monkeypatch.setattr(throughput, "SCENES", {"furnace": throughput.SCENES["furnace"]})
    case = speed.Throughput()
    ratios = case.setup_cache(bounces=2, spp=4, resolution=16, repeats=1)
    assert all(case.track_paths(ratios, against) > 0 for against in case.params)


@pytest.mark.slow
def test_a_loop_changes_each_kind_of_parameter():
    times = loop.milliseconds("cavity", rounds=1)
    kinds = ["nothing", "temperature", "reflectance.value", "sensor.to_world", "vertex_positions"]
    assert list(times) == kinds and min(times.values()) > 0


@pytest.mark.slow
def test_memory():
    work.peakmem_image(resolution=16, spp=4)
    work.peakmem_signature(paths=2**10)


@pytest.mark.slow
def test_gpu_tasks_run_and_are_compared(monkeypatch):
    """On the processor against itself: nothing is apart, and each task has a row of numbers."""
    monkeypatch.setattr(gpu, "AZIMUTHS", (0, 90))
    # The fit takes seconds
    of_size = gpu.tasks
    names = ["render", "signature", "trend", "derivative"]
    quick = lambda size: {name: task for name, task in of_size(size).items() if name in names}
    monkeypatch.setattr(gpu, "tasks", quick)
    assert {"parameters", "standard_error"} <= {entry.name for entry in fields(Fit)}
    results = gpu.run(gpu.PROCESSOR, 4)
    assert list(results) == names
    assert f"{gpu.GPU} on" in gpu.machine() and "mitsuba 3." in gpu.machine()
    for name, line in zip(results, gpu.table(results, results).splitlines()[2:], strict=True):
        cells = line.strip("| ").split(" | ")
        assert cells[0] == name and float(cells[1]) != 0 and cells[2:4] == ["0.0e+00", "0"]
        assert np.all(np.array(results[name]["errors"]) > 0)


def test_a_gpu_that_fails_or_is_off_is_seen():
    """A value that is 1 % off is 10 of its standard errors off; a failure is the row's text."""
    processor = {"values": [2.0, 100.0], "errors": [1.0, 0.1], "seconds": 0.4}
    off = {"values": [2.0, 101.0], "errors": [1.0, 0.1], "seconds": 0.1}
    assert (
        gpu.row("trend", processor, off) == "| trend | 2 | 1.0e-02 | 10 | 400 ms | 100 ms | 4.0 |"
    )
    failed = gpu.row("fit", processor, {"failed": "RuntimeError: no"})
    assert failed.startswith("| fit | cuda_ad_mono: RuntimeError: no |") and failed.count("|") == 8


def test_without_a_gpu_one_line_says_so(monkeypatch):
    import mitsuba

    def refuse(variant):
        raise ImportError(variant)

    monkeypatch.setattr(mitsuba, "set_variant", refuse)
    with pytest.raises(SystemExit, match="no GPU here: cuda_ad_mono cannot start"):
        gpu.main([])
