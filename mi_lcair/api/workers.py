"""`workers`, processes on which everything that takes long runs."""

from contextlib import AbstractContextManager

from mi_lcair.startup.tasks import on_workers


def workers(count: int | None = None, dask: str | None = None) -> AbstractContextManager[None]:
    """Context manager in which long work runs on worker processes.

    These are the views of sweeps, trends and flights, images, frames, random draws of budgets
    and inversions with several starts. The numbers are the same as without workers.

    Parameters
    ----------
    count : int, optional
        Number of processes that are started at the first task, and ended with the block. They
        share the processors. One that dies is replaced.
    dask : str, optional
        Address of a Dask scheduler instead, such as "tcp://127.0.0.1:8786", with the workers that
        you have started. They load scenes from the same paths and have the same versions of
        mi_lcair, mitsuba and drjit.

    Raises
    ------
    InputError
        For both or a number below 1. Within the block: if the package distributed is missing, if
        no scheduler with a worker answers, if a worker has another version, lacks a file or is a
        thread of this process, and for a scene without a file.

    Examples
    --------
    >>> with mi_lcair.workers(2):
    ...     table = mi_lcair.sweep("sweep.toml")
    """
    return on_workers(count, dask)
