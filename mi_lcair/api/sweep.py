"""`sweep`, a table of signatures over many conditions."""

from collections.abc import Mapping
from contextlib import nullcontext
from os import PathLike

from mi_lcair.errors import InputError
from mi_lcair.progress import Progress
from mi_lcair.signatures.cluster import workers as started
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.conditions import Conditions
from mi_lcair.sweeps.measure import measure_sweep, run_here, run_on
from mi_lcair.sweeps.sweep_result import Sweep


def sweep(
    conditions: str | PathLike[str] | Mapping,
    areas: str | PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Signatures of a scene or a scenario over a table of conditions.

    Only what changes geometry or reflectances is traced: effective areas by source, once for each
    view. Ranges, airs, backgrounds, temperatures and the noise of the sensor are arithmetic.

    Parameters
    ----------
    conditions : path-like or mapping
        TOML file, or a dictionary of its tables [base], [conditions] and [sampling].
    areas : path-like, optional
        Folder that keeps the effective areas. What it holds is not traced again: a later sweep
        over other ranges, airs or temperatures needs no render, and one that was killed goes on.
    workers : int, optional
        Number of processes that are started for the tracing, and ended.
    dask : str, optional
        Address of a Dask scheduler whose workers trace instead. They load the scene from the same
        path. The numbers are the same in all cases.
    progress : callable, optional
        Called with (views done, all views).

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        If the conditions, the folder or the scheduler cannot be used. All conditions are checked
        before anything is traced.
    """
    if workers is not None and dask is not None:
        raise InputError("workers starts processes and dask names a scheduler; give one of them")
    if workers is not None and workers < 1:
        raise InputError(f"workers = {workers}; must be 1 or more")
    table = Conditions.read(conditions)
    folder = None if areas is None else AreasFolder(areas)
    with nullcontext(dask) if workers is None else started(workers) as address:
        run = run_here if address is None else run_on(address)
        return measure_sweep(table, folder, run, progress)
