"""The benchmarks for asv: each runs in a tiny setting and gives a positive number."""

import json
from pathlib import Path

import pytest

from benchmarks import errors, speed, timing, work

ROOT = Path(__file__).parents[2]


def test_configuration_names_the_folder():
    settings = json.loads((ROOT / "asv.conf.json").read_text())
    assert (ROOT / settings["benchmark_dir"] / "__init__.py").exists()


def test_ratio_is_one_of_times(monkeypatch):
    """The first call of each is not timed; the median of the others counts."""
    calls = []
    monkeypatch.setattr(timing, "seconds", lambda run, seed: run(seed))
    one = lambda seed: calls.append(seed) or (6.0 if seed < 3 else 60.0)
    assert timing.ratio(one, lambda seed: 2.0, rounds=3) == 3.0
    assert calls == [0, 1, 2, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    "track",
    [
        *(
            lambda name=name: errors.track_time_to_error(name, tolerance=0.2, rounds=1)
            for name in errors.SCENES
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
def test_track(track):
    assert 0 < track() < float("inf")


@pytest.mark.slow
def test_throughput():
    case = speed.Throughput()
    ratios = case.setup_cache(bounces=2, spp=4, resolution=16, repeats=1)
    assert all(case.track_paths(ratios, against) > 0 for against in case.params)


@pytest.mark.slow
def test_memory():
    work.peakmem_image(resolution=16, spp=4)
    work.peakmem_signature(paths=2**10)
