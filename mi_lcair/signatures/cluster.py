"""Render batches of a trend on the workers of a Dask cluster (optional extra mi-lcair[dask])."""

import logging
import socket
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from urllib.parse import urlsplit

from mi_lcair.errors import InputError
from mi_lcair.rendering.scene import load
from mi_lcair.startup.threads import exclusive

RETRIES = 3  # attempts for a batch that failed on a worker; Dask itself replaces dead workers
CONNECTION_S = 3  # time until the scheduler's machine takes a connection, s
TIMEOUT_S = 10  # time until the scheduler answers on it, s
WORKER_TIMEOUT_S = 60  # time until the scheduler has a worker, s


def rendered(sweep, batches, address: str):
    """Yield the rows of each batch as soon as a worker has rendered it.

    Parameters
    ----------
    sweep : Sweep
        Views, and how they are rendered.
    batches : list of (int, tuple of View)
        Numbers and views of the batches to render.
    address : str
        Address of the Dask scheduler, such as tcp://127.0.0.1:8786.

    Yields
    ------
    dict of View to dict of str to float
        Rows of a batch, as `render_batch` returns them.

    Raises
    ------
    InputError
        If the package distributed is missing, or if no scheduler with a worker answers.
    ConnectionError
        If the connection to the scheduler is lost later.
    """
    check_scheduler(address)
    try:
        from dask.distributed import Client, as_completed
    except ImportError:
        raise InputError(
            "rendering on a Dask cluster needs the package distributed; install mi-lcair[dask]"
        ) from None
    try:
        client = Client(address, timeout=TIMEOUT_S)
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


def render_here(sweep, number: int, views) -> dict:
    """Render one batch on this worker, and return its rows."""
    import drjit
    import mitsuba
    from dask.distributed import get_worker

    from mi_lcair.signatures.trend import render_batch

    with exclusive:  # Mitsuba renders with all threads of a worker
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
    """The scene, which a worker loads once.

    Raises InputError if the files on this worker give a scene with another fingerprint.
    """
    scene = load(source, **dict(parameters))
    if scene.fingerprint != fingerprint:
        raise InputError(
            f"scene '{source}' is another one on the Dask worker at {socket.gethostname()}; the "
            "worker's files or its version of mi_lcair differ"
        )
    return scene
