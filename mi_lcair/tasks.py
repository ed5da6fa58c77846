"""Independent tasks, in this process or on the workers of a Dask cluster (extra mi-lcair[dask]).

A task is a pure function without arguments that can be pickled. Its result does not depend on where
it runs. Whatever takes long asks for `computed(tasks)`. The tasks run here, one after the other,
unless the caller is within `on_workers`.
"""

import atexit
import gc
import importlib.metadata
import logging
import os
import pickle
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from functools import wraps
from threading import RLock
from typing import ParamSpec, TypeVar
from urllib.parse import urlsplit
from uuid import uuid4

from mi_lcair.errors import InputError

# Who uses Dr.Jit: one thread at a time, under a lock, and the plugins of one scene
# ---------------------------------------------------------------------------------
# A thread that records or replays launches holds locks of Dr.Jit while it runs Python code. Another
# thread that uses Dr.Jit meanwhile, if only to read an array, holds Python's own lock and waits for
# Dr.Jit's: neither goes on. Two threads that record end the process. All that uses Dr.Jit therefore
# takes turns, from the loading of a scene to the result of a public function. A scene that any
# other thread discards is deleted in the next turn: the thread that has the turn may wait for the
# other, as for the one that serves workers.
#
# Mitsuba makes objects in threads of its own, if it may, and these would delete what garbage holds
# of Dr.Jit. All objects are therefore made in the thread that loads (`parallel = False`).
#
# Dr.Jit records calls of every plugin that is alive, also of other scenes. The plugins of the scene
# that is being traced are therefore known to the process.

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")

exclusive = RLock()  # held by the thread that uses Dr.Jit
discarded: list[dict] = []  # the attributes of scenes that wait for a turn to be deleted
_traced: set | None = None  # the plugins of the scene that is being traced


def exclusively(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Decorator: threads run the functions that have it one after the other."""

    @wraps(function)
    def in_turn(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        with exclusive:
            discarded.clear()
            return function(*arguments, **options)

    return in_turn


@contextmanager
def tracing(plugins):
    """Context manager in which `is_traced` is True for these plugins and False for all others.

    The quantities that the plugins derive must be up to date. The thread must hold `exclusive`.
    """
    global _traced
    before, _traced = _traced, set(plugins)
    try:
        yield
    finally:
        _traced = before


def is_traced(plugin) -> bool | None:
    """Whether the plugin belongs to the scene being traced.

    None while `bounce_path` does not trace, for example under Mitsuba's integrators. A plugin's
    methods receive only the interaction, so that they cannot see it otherwise. The shape of another
    scene's emitter may be deleted.
    """
    return None if _traced is None else plugin in _traced


Result = TypeVar("Result")

RETRIES = 3  # attempts for a task that failed on a worker; Dask itself replaces dead workers
CONNECTION_S = 3  # time until the scheduler's machine takes a connection, s
TIMEOUT_S = 10  # time until the scheduler answers on it, s
WORKER_TIMEOUT_S = 60  # time until the scheduler has a worker, s
COLLECTION_S = 10  # time between collections of garbage on a worker, s
# Dask's own watch over its workers, which takes a tenth of their time otherwise
LEAN = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.admin.system-monitor.interval": "10s",
}
PACKAGES = ("mi_lcair", "mitsuba", "drjit")  # whose versions a worker must have too

_collected = 0.0  # when a task last collected garbage, on a worker
_call = ""  # call of `computed` of the last task, on a worker
_kept: dict = {}  # what this call has made of the pickled arguments of functions, see `kept`


def kept(make: Callable[[bytes], Result]) -> Callable[[bytes], Result]:
    """Decorator: a worker calls a function of pickled arguments once in a call of `computed`.

    In a later call the files that the arguments name may have changed.
    """

    @wraps(make)
    def known(arguments: bytes) -> Result:
        key = make.__qualname__, arguments
        if key not in _kept:
            _kept.clear()
            _kept[key] = make(arguments)
        return _kept[key]

    return known


class Cluster:
    """Workers of a scheduler, or new processes, to which nothing is sent before the first task.

    Parameters
    ----------
    count : int or None
        Number of processes that are started, and ended with the block of `on_workers`.
    address : str or None
        Address of a scheduler instead, such as tcp://127.0.0.1:8786.
    open : ExitStack
        Ends what was started.
    """

    def __init__(self, count: int | None, address: str | None, open: ExitStack):
        self.count, self.address, self.open, self.client = count, address, open, None

    def connected(self):
        """The client of the scheduler, which has a worker."""
        if self.client is not None:
            return self.client
        distributed = imported_distributed()
        import dask
        import drjit

        self.open.enter_context(quiet())
        if self.count is not None:
            share = max(1, drjit.thread_count() // self.count)
            self.open.enter_context(dask.config.set(LEAN))
            try:
                local = distributed.LocalCluster(
                    n_workers=self.count, threads_per_worker=share, dashboard_address=":0"
                )
            except RuntimeError:
                raise InputError(
                    "the workers do not start; a script starts them within `if __name__ == "
                    "'__main__':`, because each worker imports the script"
                ) from None
            self.address = self.open.enter_context(local).scheduler_address
        check_scheduler(self.address)
        try:
            client = distributed.Client(self.address, timeout=TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise no_scheduler(self.address, type(error).__name__) from None
        self.open.enter_context(client)
        try:
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT_S)
        except TimeoutError:
            raise InputError(
                f"the Dask scheduler at '{self.address}' has no worker; start one with `dask "
                f"worker {self.address}`"
            ) from None
        self.client = client
        return client

    def computed(self, tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
        """Yield (number, result) of each task as soon as a worker has computed it."""
        import mitsuba

        client = self.connected()
        import cloudpickle  # of distributed; it also sends functions of a script
        from dask.distributed import as_completed
        from distributed.comm import CommClosedError

        sender = socket.gethostname(), os.getpid()
        about = versions(), sender, mitsuba.variant(), uuid4().hex
        run = opener()
        numbers = {
            client.submit(run, *about, cloudpickle.dumps(task), pure=False, retries=RETRIES): number
            for number, task in enumerate(tasks)
        }
        for future in as_completed(numbers):
            try:
                refusal, result = future.result()
            except (CancelledError, CommClosedError):
                raise ConnectionError(
                    f"the Dask scheduler at '{self.address}' was lost; a folder of effective "
                    "areas keeps its results"
                ) from None
            if refusal is not None:
                client.cancel(list(numbers))
                raise InputError(refusal)
            future.release()  # the worker may forget the result
            yield numbers[future], result


PRESENT: ContextVar[Cluster | None] = ContextVar("PRESENT", default=None)


@contextmanager
def on_workers(count: int | None = None, address: str | None = None) -> Iterator[None]:
    """Context manager in which `computed` uses workers; without arguments, this process.

    count, address: see `Cluster`. Raises InputError if both are given.
    """
    if count is not None and address is not None:
        raise InputError("workers starts processes and dask names a scheduler; give one of them")
    if count is not None and count < 1:
        raise InputError(f"workers = {count}; must be 1 or more")
    if count is None and address is None:
        yield
        return
    with ExitStack() as open:
        token = PRESENT.set(Cluster(count, address, open))
        try:
            yield
        finally:
            PRESENT.reset(token)


def has_workers() -> bool:
    """Whether tasks run on workers."""
    return PRESENT.get() is not None


def computed(tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result]]:
    """Yield (number, result) of each task as soon as it is known.

    Parameters
    ----------
    tasks : sequence of callable
        Functions without arguments. On workers they are pickled.

    Raises
    ------
    InputError
        If a task cannot be done, if the package distributed is missing, if no scheduler with a
        worker answers, or if a worker has other versions.
    ConnectionError
        If the connection to the scheduler is lost later.
    """
    cluster = PRESENT.get()
    if cluster is not None and tasks:
        yield from cluster.computed(tasks)
    else:
        for number, task in enumerate(tasks):
            yield number, task()


def in_order(tasks: Sequence[Callable[[], Result]]) -> Iterator[Result]:
    """Yield the results of tasks in the order of the tasks, see `computed`."""
    waiting, following = {}, 0
    for number, result in computed(tasks):
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def opener() -> Callable:
    """The function that a worker runs.

    It is made here so that it is sent as a whole. A worker without this package can then say so.
    """

    def opened(versions: dict, sender: tuple, variant: str, call: str, task: bytes) -> tuple:
        """(None, result) of a pickled task, or (what is wrong, None)."""
        import importlib.metadata
        import os
        import socket

        host = socket.gethostname()
        if (host, os.getpid()) == sender:
            return (
                "a worker of the Dask scheduler is a thread of the process that renders, and each "
                "would wait for the other; start workers as processes: dask worker ADDRESS",
                None,
            )
        for package, version in versions.items():
            try:
                here = importlib.metadata.version(package)
            except importlib.metadata.PackageNotFoundError:
                here = "not installed"
            if here != version:
                return (
                    f"the Dask worker at {host} has {package} {here}, and this process has "
                    f"{version}; install the same version there",
                    None,
                )
        from mi_lcair.tasks import run_here

        return run_here(variant, call, task, host)

    return opened


def versions() -> dict[str, str]:
    """Versions of the PACKAGES."""
    return {package: importlib.metadata.version(package) for package in PACKAGES}


def run_here(variant: str, call: str, task: bytes, host: str) -> tuple:
    """Run a task of a call of `computed` on this worker, which may use all of its threads."""
    from dask.distributed import get_worker

    global _call, _collected
    with exclusive:  # Mitsuba renders with all threads of a worker, and one of them imports it
        import drjit
        import mitsuba

        # If Dask's own thread collected an object of Mitsuba while a task records, it would wait
        # for Dr.Jit with Python's lock, and the task for that lock. Only tasks collect garbage.
        if gc.isenabled():
            gc.disable()
            gc.freeze()  # modules and what else is never collected
        if call != _call:
            _kept.clear()
            _call = call
            atexit.unregister(_kept.clear)  # last registered, it runs before Mitsuba ends
            atexit.register(_kept.clear)
        mitsuba.set_variant(variant)
        drjit.set_thread_count(get_worker().state.nthreads)
        try:
            return None, pickle.loads(task)()
        except InputError as error:
            return f"{error} (on the Dask worker at {host})", None
        finally:
            if time.monotonic() - _collected > COLLECTION_S:
                gc.collect()
                _collected = time.monotonic()


def is_worker() -> bool:
    """Whether this process runs tasks of another one."""
    return bool(_call)


def imported_distributed():
    """The package dask.distributed; raises InputError if it is missing."""
    try:
        from dask import distributed
    except ImportError:
        raise InputError(
            "rendering on a Dask cluster needs the package distributed; install mi-lcair[dask]"
        ) from None
    return distributed


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
