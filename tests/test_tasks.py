"""Tests of tasks on workers: the same results, and workers and schedulers that cannot be used."""

import os
import socket
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import mi_lcair
from mi_lcair import tasks
from mi_lcair.errors import InputError
from mi_lcair.tasks import check_scheduler, computed, in_order, kept, on_workers

distributed = pytest.importorskip("dask.distributed")


@pytest.fixture(scope="module")
def address():
    """Address of a scheduler with two workers."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as cluster:
        yield cluster.scheduler_address


def power(base, exponent):
    return base**exponent


def refused(text):
    raise InputError(text)


READ = []


def end_once(path):
    """End this worker at the first call."""
    if not path.exists():
        path.write_text("")
        os._exit(1)
    return "done"


@kept
def content(path):
    """Content of a file, and how often a worker has read it."""
    READ.append(path)
    return Path(os.fsdecode(path)).read_text(), len(READ)


def test_results_are_in_order_here_and_there(address):
    powers = [partial(power, 2, k) for k in range(20)]
    assert list(in_order(powers)) == [2**k for k in range(20)]
    with on_workers(address=address):
        assert list(in_order(powers)) == [2**k for k in range(20)]
        assert sorted(computed(powers)) == [(k, 2**k) for k in range(20)]
        assert list(computed([])) == []
        with pytest.raises(InputError, match="no such scene .on the Dask worker at"):
            list(computed([partial(refused, "no such scene")]))
    assert tasks.PRESENT.get() is None


def test_what_a_worker_keeps_is_of_one_call(address, tmp_path):
    """Tasks of a call share what they need; a later call sees that a file has changed."""
    path = tmp_path / "scene.xml"
    tasks = [partial(content, os.fsencode(path))] * 6
    with on_workers(address=address):
        for call, text in enumerate(("first", "second"), 1):
            path.write_text(text)
            assert all(read == text and count <= call for read, count in in_order(tasks))


def test_a_worker_that_dies_is_replaced(address, tmp_path):
    with on_workers(address=address):
        assert list(in_order([partial(end_once, tmp_path / "file"), os.getpid]))[0] == "done"


@pytest.mark.slow
def test_trends_are_the_same_to_the_bit(address, monkeypatch):
    """A scene with settings, and scenes that a worker cannot load, or loads as another one."""
    monkeypatch.setattr("mi_lcair.detection.sweeps.subject.VIEWS_AT_ONCE", 2)
    scene = mi_lcair.load("two_plates", resolution=8)
    views = {"azimuths_deg": [0, 45, 90], "resolution": 8, "spp": 4, "max_bounces": 1}
    here = mi_lcair.trend(scene, **views).table
    with mi_lcair.workers(dask=address):
        there = mi_lcair.trend(scene, **views).table
        for name, values in here.items():
            np.testing.assert_array_equal(there[name], values, err_msg=name)
        with pytest.raises(InputError, match="workers load a scene from its file"):
            mi_lcair.trend(mi_lcair.load(scene.mi), **views)
        scene.parameters["resolution"] = "9"
        with pytest.raises(InputError, match="another one on a worker"):
            mi_lcair.trend(scene, **views)


def test_a_worker_of_another_version_is_named(address, monkeypatch):
    monkeypatch.setattr(tasks, "versions", lambda: {"mi_lcair": "9.9.9"})
    message = r"has mi_lcair \d+\.\d+\.\d+, and this process has 9\.9\.9; install"
    with on_workers(address=address), pytest.raises(InputError, match=message):
        list(computed([os.getpid]))
    monkeypatch.setattr(tasks, "versions", lambda: {"no-such-package": "1"})
    with on_workers(address=address), pytest.raises(InputError, match="not installed"):
        list(computed([os.getpid]))


HERE = {"processes": False, "protocol": "tcp://", "dashboard_address": ":0"}


def test_a_worker_in_a_thread_is_refused():
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, **HERE) as cluster,
        on_workers(address=cluster.scheduler_address),
        pytest.raises(InputError, match="is a thread of the process that renders"),
    ):
        list(computed([os.getpid]))


def test_a_script_without_a_guard(monkeypatch):
    def fails(**options):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "LocalCluster", fails)
    with on_workers(1), pytest.raises(InputError, match="within `if __name__ == '__main__':`"):
        list(computed([os.getpid]))


SCHEDULER = """
import time
from dask.distributed import LocalCluster
workers = LocalCluster(
    n_workers=1, processes=False, protocol="tcp://", threads_per_worker=1, dashboard_address=":0"
)
print(workers.scheduler_address, flush=True)
time.sleep(600)
"""


@contextmanager
def started(*command):
    """A process of this Python that is killed at the end of the block."""
    environment = {**os.environ, "PYTHONPATH": str(Path(mi_lcair.__file__).parents[1])}
    process = subprocess.Popen(
        [sys.executable, *map(str, command)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_a_scheduler_that_dies():
    with started("-c", SCHEDULER) as scheduler:
        address = scheduler.stdout.readline().strip()
        with on_workers(address=address), pytest.raises(ConnectionError, match="was lost"):
            for _ in computed([partial(power, 1, k) for k in range(1000)]):
                scheduler.kill()


def test_a_cluster_without_workers(monkeypatch):
    monkeypatch.setattr(tasks, "WORKER_TIMEOUT_S", 0.1)
    with (
        distributed.LocalCluster(n_workers=0, **HERE) as cluster,
        on_workers(address=cluster.scheduler_address),
        pytest.raises(InputError, match="has no worker; start one"),
    ):
        list(computed([os.getpid]))


@pytest.fixture
def listening():
    """A socket of this machine that takes connections."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_a_scheduler_that_is_absent_is_named_at_once(listening):
    """Dask, which is not asked here, would try for ten seconds."""
    port = listening.getsockname()[1]
    addresses = [f"tcp://127.0.0.1:{port}", f"127.0.0.1:{port}", f"tls://localhost:{port}"]
    for address in addresses:
        check_scheduler(address)
    listening.close()
    for address in addresses:
        message = f"no Dask scheduler answers at '{address}' .*refused"
        with on_workers(address=address), pytest.raises(InputError, match=message):
            next(computed([os.getpid]))


def test_addresses_that_are_none():
    for address in ("tcp://127.0.0.1:99999", "tcp://no.such.host.invalid:8786", "tcp://[::1:8786"):
        with pytest.raises(InputError, match="no Dask scheduler answers"):
            check_scheduler(address)


def test_addresses_that_dask_itself_must_try():
    for address in ("inproc://127.0.0.1/1/2", "ucx://127.0.0.1:1", "localhost"):
        check_scheduler(address)


@pytest.mark.parametrize(
    ("count", "address", "message"), [(2, "x", "give one of them"), (0, None, "must be 1 or more")]
)
def test_refused(count, address, message):
    with pytest.raises(InputError, match=message), on_workers(count, address):
        pass


@pytest.mark.slow
def test_draws_of_a_budget_are_the_same_to_the_bit(address):
    sigma = {"sigma": {"bare_aluminum.epsilon": 0.01, "self.temperature": 2.0}}
    scene = mi_lcair.load("cylinder_ir_range", resolution=8, finish="bare_aluminum", max_bounces=1)
    draw = lambda: mi_lcair.budget(scene, sigma, spp=4, draws=20).monte_carlo.results
    here = draw()
    with mi_lcair.workers(dask=address):
        np.testing.assert_array_equal(draw(), here)
    assert np.ptp(here) > 0


@pytest.mark.slow
def test_starts_of_an_inversion_are_the_same_to_the_bit(address):
    problem = {
        "data": [
            {
                "name": "plates",
                "scene": "two_plates",
                "parameters": {"resolution": "8"},
                "intensity": 2000.0,
                "sigma": 20.0,
            }
        ],
        "unknowns": {"plate.temperature": {"start": 700, "lower": 300, "upper": 1200}},
        "render": {"starts": 3, "spp": 16, "iterations": 5},
    }
    here = mi_lcair.invert(problem, advise=False).as_dict()
    with mi_lcair.workers(dask=address):
        there = mi_lcair.invert(problem, advise=False).as_dict()
    assert {**there, "time_s": 0} == {**here, "time_s": 0}


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"spp": 20}, {"tolerance": 0.2}], ids=["spp", "tolerance"])
def test_images_are_the_same_to_the_bit(address, monkeypatch, options):
    monkeypatch.setattr("mi_lcair.rendering.window.PASS_SAMPLES", 2**11)
    scene, steps = mi_lcair.load("open_box", resolution=16), []
    here = mi_lcair.render(scene, **options, progress=lambda *done: steps.append(done))
    assert len(steps) > 1
    with mi_lcair.workers(dask=address):
        there = mi_lcair.render(scene, **options)
    for name, values in here.channels.items():
        np.testing.assert_array_equal(there.channels[name], values, err_msg=name)
