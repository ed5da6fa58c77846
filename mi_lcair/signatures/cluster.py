"""Batches of a trend on the workers of a Dask cluster (optional extra mi-lcair[dask])."""

import logging
import socket
import threading
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache

import mi_lcair
from mi_lcair.errors import InputError

RETRIES = 3  # of a batch that failed on a worker; one that died is Dask's own business
TIMEOUT_S, WORKER_TIMEOUT_S = 10, 60  # to reach the scheduler, and for its first worker
_one_at_a_time = (
    threading.Lock()
)  # Mitsuba renders with all of a worker's threads: its tasks must not meet


def rendered(sweep, batches, address: str):
    """Yields the rows of each batch as a worker has done it.

    Raises InputError where no scheduler answers at `address`, and ConnectionError where it is lost
    later.
    """
    try:
        from dask.distributed import Client, as_completed
    except ImportError:
        raise InputError(
            "rendering on a Dask cluster needs the package distributed; install mi-lcair[dask]"
        ) from None
    try:
        client = Client(address, timeout=TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at '{address}' ({error.__class__.__name__}); "
            "start one with `dask scheduler` and give its address, such as tcp://127.0.0.1:8786"
        ) from None
    with quiet(), client:
        try:
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT_S)
        except TimeoutError:
            raise InputError(
                f"the Dask scheduler at '{address}' has no worker; "
                f"start one with `dask worker {address}`"
            ) from None
        futures = [
            client.submit(render_here, sweep, number, views, pure=False, retries=RETRIES)
            for number, views in batches
        ]
        for future in as_completed(futures):
            try:
                yield future.result()
            except CancelledError:
                raise ConnectionError(
                    f"the Dask scheduler at '{address}' was lost; the batches done so far are "
                    "kept, and resume goes on with the others"
                ) from None


@contextmanager
def quiet():
    """Within the block no log is written: what Dask retries succeeds, or fails in an exception."""
    disabled = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(disabled)


def render_here(sweep, number: int, views) -> dict:
    """On a worker: the rows of one batch."""
    import drjit
    import mitsuba
    from dask.distributed import get_worker

    from mi_lcair.signatures.trend import render_batch

    with _one_at_a_time:
        mitsuba.set_variant(sweep.variant)
        drjit.set_thread_count(get_worker().state.nthreads)
        return render_batch(
            loaded(sweep.scene, tuple(sweep.parameters.items()), sweep.fingerprint),
            sweep,
            number,
            views,
        )


@lru_cache(maxsize=1)
def loaded(source: str, parameters: tuple, fingerprint: str):
    """The scene, loaded when a worker first meets it. InputError where this worker's files make
    another one.
    """
    scene = mi_lcair.load(source, **dict(parameters))
    if scene.fingerprint != fingerprint:
        raise InputError(
            f"scene '{source}' is another one on the Dask worker at {socket.gethostname()}; "
            "its files, or its version of mi_lcair, differ"
        )
    return scene
