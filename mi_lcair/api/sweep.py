"""`sweep`, a table of signatures over many conditions."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.progress import Progress
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.conditions import Conditions
from mi_lcair.sweeps.measure import measure_sweep
from mi_lcair.sweeps.sweep_result import Sweep


def sweep(
    conditions: str | PathLike[str] | Mapping,
    areas: str | PathLike[str] | None = None,
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
    progress : callable, optional
        Called with (views done, all views).

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        If the conditions or the folder cannot be used. All conditions are checked
        before anything is traced.
    """
    folder = None if areas is None else AreasFolder(areas)
    return measure_sweep(Conditions.read(conditions), folder, progress)
