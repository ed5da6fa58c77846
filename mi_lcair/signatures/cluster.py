"""Run jobs on the workers of a Dask cluster (optional extra mi-lcair[dask])."""

import logging
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TypeVar
from urllib.parse import urlsplit

from mi_lcair.errors import InputError
from mi_lcair.startup.threads import exclusive

Result = TypeVar("Result")

RETRIES = 3  # attempts for a job that failed on a worker; Dask itself replaces dead workers
CONNECTION_S = 3  # time until the scheduler's machine takes a connection, s
TIMEOUT_S = 10  # time until the scheduler answers on it, s
WORKER_TIMEOUT_S = 60  # time until the scheduler has a worker, s


@contextmanager
def workers(count: int, threads: int | None = None) -> Iterator[str]:
    """Context manager that starts worker processes, gives their scheduler's address and ends them.

    Parameters
    ----------
    count : int
        Number of processes. Dask replaces those that die.
    threads : int, optional
        Threads of each; by default the processors are shared out.

    Raises
    ------
    InputError
        If the package distributed is missing.
    """
    distributed = imported_distributed()
    share = threads or max(1, (os.cpu_count() or 1) // count)
    with (
        quiet(),
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=share, dashboard_address=None
        ) as cluster,
    ):
        yield cluster.scheduler_address


def imported_distributed():
    """The package dask.distributed; raises InputError if it is missing."""
    try:
        from dask import distributed
    except ImportError:
        raise InputError(
            "rendering on a Dask cluster needs the package distributed; install mi-lcair[dask]"
        ) from None
    return distributed


def computed(jobs: Sequence[Callable[[], Result]], variant: str, address: str):
    """Yield (number, result) of each job as soon as a worker has computed it.

    Parameters
    ----------
    jobs : sequence of callable
        Functions without arguments that can be pickled.
    variant : str
        Variant of Mitsuba.
    address : str
        Address of the Dask scheduler, such as tcp://127.0.0.1:8786.

    Raises
    ------
    InputError
        If the package distributed is missing, or if no scheduler with a worker answers.
    ConnectionError
        If the connection to the scheduler is lost later.
    """
    check_scheduler(address)
    distributed = imported_distributed()
    try:
        client = distributed.Client(address, timeout=TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise no_scheduler(address, type(error).__name__) from None
    with quiet(), client:
        try:
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT_S)
        except TimeoutError:
            raise InputError(
                f"the Dask scheduler at '{address}' has no worker; start one with `dask worker "
                f"{address}`"
            ) from None
        numbers = {
            client.submit(run_here, variant, job, pure=False, retries=RETRIES): number
            for number, job in enumerate(jobs)
        }
        for future in distributed.as_completed(numbers):
            try:
                yield numbers[future], future.result()
            except CancelledError:
                raise ConnectionError(
                    f"the Dask scheduler at '{address}' was lost; the batches done so far are "
                    "kept, and resume goes on with the others"
                ) from None


def check_scheduler(address: str) -> None:
    """Raise InputError if nothing answers at the address of a scheduler.

    Dask itself tries again for TIMEOUT_S, also where the machine refuses the connection at once.
    Addresses without a port, and those of protocols that are not based on TCP, are not checked.
    """
    protocol, _, place = address.rpartition("://")
    if protocol not in ("", "tcp", "tls"):
        return
    try:
        host, port = urlsplit(f"//{place}").hostname, urlsplit(f"//{place}").port
        if host and port:
            socket.create_connection((host, port), CONNECTION_S).close()
    except (OSError, ValueError) as error:
        raise no_scheduler(address, str(error)) from None


def no_scheduler(address: str, reason: str) -> InputError:
    """The error for an address at which no scheduler answers."""
    return InputError(
        f"no Dask scheduler answers at '{address}' ({reason}); start one with `dask scheduler` and "
        "give its address, such as tcp://127.0.0.1:8786"
    )


@contextmanager
def quiet():
    """Suppress logs within the block: a failure that Dask cannot retry raises an exception."""
    disabled = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(disabled)


def run_here(variant: str, job: Callable[[], Result]) -> Result:
    """Run a job on this worker, which may use all of the worker's threads."""
    import drjit
    import mitsuba
    from dask.distributed import get_worker

    with exclusive:  # Mitsuba renders with all threads of a worker
        mitsuba.set_variant(variant)
        drjit.set_thread_count(get_worker().state.nthreads)
        return job()
