"""Trends on a Dask cluster: workers and schedulers that die, or that were never started."""

import gc
import json
import os
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import drjit
import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.signatures import cluster
from mi_lcair.signatures.cluster import check_scheduler, computed
from mi_lcair.signatures.trend_file import beside

distributed = pytest.importorskip("dask.distributed")
pytestmark = pytest.mark.slow
HERE = {"processes": False, "threads_per_worker": 1, "dashboard_address": ":0"}


@pytest.fixture(autouse=True)
def without_collection():
    """No garbage is collected meanwhile.

    Where Dask's own threads collect objects of Mitsuba that earlier tests have left, they wait for
    Dr.Jit, and a recording in a worker's thread waits for Python's lock, which they hold.
    """
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", max_bounces=2)


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


def test_two_workers_of_which_one_dies(cylinder, tmp_path):
    """Another worker renders the batch of a worker that is killed, and the file is the same.

    One worker is a thread of this process. The other one is killed as soon as the first one has
    rendered a batch, while it still imports what its own batch needs.
    """
    many = {"azimuths_deg": np.arange(0, 360, 20.0), "resolution": 16, "spp": 4, "batch": 2}
    mi_lcair.trend(cylinder, path=tmp_path / "local.csv", **many)
    path, killed, threads = tmp_path / "cluster.csv", [], drjit.thread_count()
    with distributed.LocalCluster(n_workers=1, protocol="tcp://", **HERE) as workers:
        address = workers.scheduler_address
        with started(
            *("-m", "distributed.cli.dask_worker", address),
            *("--no-nanny", "--no-dashboard", "--nthreads", 1),
        ) as victim:
            client = distributed.Client(workers)
            client.wait_for_workers(2, timeout=60)

            def kill(done, views):
                if not killed:
                    killed.append(client.processing())
                    victim.kill()

            mi_lcair.trend(cylinder, path=path, dask=address, progress=kill, **many)
            client.close()
    drjit.set_thread_count(threads)
    assert len(killed[0]) == 2 and all(killed[0].values())  # both workers had batches
    for of in (lambda path: path, beside):
        assert of(path).read_text() == of(tmp_path / "local.csv").read_text()


SCHEDULER = """
import time
from dask.distributed import LocalCluster
workers = LocalCluster(
    n_workers=1, processes=False, protocol="tcp://", threads_per_worker=1, dashboard_address=":0"
)
print(workers.scheduler_address, flush=True)
time.sleep(600)
"""


def test_a_scheduler_that_dies(tmp_path, monkeypatch):
    """A lost scheduler gives one line and exit status 1; the finished batches can be resumed."""
    monkeypatch.chdir(tmp_path)
    with started("-c", SCHEDULER) as scheduler:
        address = scheduler.stdout.readline().strip()

        def kill():
            while not Path("t.csv").exists() and scheduler.poll() is None:
                time.sleep(0.01)
            scheduler.kill()

        threading.Thread(target=kill).start()
        options = ["--azimuth", "0:359:1", "--spp", "256", "--batch", "2", "-o", "t.csv", "--dask"]
        run = CliRunner().invoke(main, ["trend", "cylinder_ir_range", *options, address])
    assert run.exit_code == 1 and "the Dask scheduler at" in run.stderr
    assert run.stderr.count("\n") == 1
    assert json.loads(Path("t.csv.json").read_text())["batches"]


def test_a_cluster_without_workers(cylinder, monkeypatch):
    monkeypatch.setattr(cluster, "WORKER_TIMEOUT_S", 0.1)
    with (
        distributed.LocalCluster(n_workers=0, protocol="tcp://", **HERE) as workers,
        pytest.raises(InputError, match="has no worker; start one"),
    ):
        mi_lcair.trend(cylinder, [0], dask=workers.scheduler_address)


@pytest.fixture
def listening():
    """A socket of this machine that takes connections."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_a_scheduler_that_is_absent_is_named_at_once(listening, monkeypatch):
    """Dask, which is not asked here, would try for ten seconds."""
    port = listening.getsockname()[1]
    for address in (f"tcp://127.0.0.1:{port}", f"127.0.0.1:{port}", f"tls://localhost:{port}"):
        check_scheduler(address)
    listening.close()
    monkeypatch.setitem(sys.modules, "dask", None)
    for address in (f"tcp://127.0.0.1:{port}", f"127.0.0.1:{port}", f"tls://localhost:{port}"):
        with pytest.raises(InputError, match=f"no Dask scheduler answers at '{address}' .*refused"):
            next(computed([], "llvm_ad_mono", address))


def test_addresses_that_are_none():
    for address in ("tcp://127.0.0.1:99999", "tcp://no.such.host.invalid:8786", "tcp://[::1:8786"):
        with pytest.raises(InputError, match="no Dask scheduler answers"):
            check_scheduler(address)


def test_addresses_that_dask_itself_must_try():
    for address in ("inproc://127.0.0.1/1/2", "ucx://127.0.0.1:1", "localhost"):
        check_scheduler(address)
