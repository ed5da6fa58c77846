"""A sweep: traces the views that are not known yet, and calculates all cases from them."""

import time
import warnings
from dataclasses import replace
from functools import lru_cache
from typing import TypeVar

import numpy as np

from mi_lcair.detection.remarks import averaged_plumes
from mi_lcair.detection.weather import AirOfLight
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.source import Source
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.signatures.effective_areas import temperatures_of
from mi_lcair.signatures.view_areas import ViewAreas
from mi_lcair.startup.tasks import computed
from mi_lcair.startup.threads import exclusively
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.conditions import Conditions
from mi_lcair.sweeps.lines import Line, lines_of
from mi_lcair.sweeps.rows import detection_ranges_of, rows_of
from mi_lcair.sweeps.subject import Batch, Subject, Views, loaded
from mi_lcair.sweeps.sweep_result import Sweep

Key = TypeVar("Key")
Lit = tuple[Subject, AirOfLight | None]  # a subject, and the air of its light


def measure_sweep(
    conditions: Conditions,
    folder: AreasFolder | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Signatures over a table of conditions.

    Parameters
    ----------
    conditions : Conditions
    folder : AreasFolder or None
        Where effective areas are kept, and found again.
    progress : callable or None
        Called with (views done, all views).
    """
    start = time.perf_counter()
    loaded.cache_clear()  # files may have changed since the last sweep
    sources_of.cache_clear()
    lines = list(lines_of(conditions))
    if conditions.base.detection_range:
        for line in lines:
            if line.sight is not None and line.sight.detector.nei is None:
                raise InputError(
                    "[base]: detection_range needs nei, the noise-equivalent irradiance of "
                    "[sensor] in W m^-2"
                )
    for line in lines:
        if line.temperatures:
            temperatures_of(sources_of(line.subject, line.light), line.temperatures)
    batches = planned(lines, conditions.sampling.resolution, conditions.sampling.sampling())
    views = sum(len(batch.views) for of_lit in batches.values() for batch in of_lit)
    of_lit, traced = results_of(batches, folder, progress)
    table = table_of(lines, of_lit, conditions)
    return Sweep(conditions, table, views, traced, time.perf_counter() - start)


def results_of(
    batches: dict[Key, list[Batch]], folder: AreasFolder | None, progress: Progress | None
) -> tuple[dict[Key, Views], int]:
    """What is traced for the batches of each key, together, and the number of views now traced."""
    everything = [batch for of_key in batches.values() for batch in of_key]
    known = {}
    if folder is not None:
        read = ((batch, folder.read(batch)) for batch in everything)
        known = {batch.key: traced for batch, traced in read if traced is not None}
    missing = [batch for batch in everything if batch.key not in known]
    views = sum(len(batch.views) for batch in everything)
    new = sum(len(batch.views) for batch in missing)
    done = views - new
    for number, traced in computed([batch.run for batch in missing]):
        batch = missing[number]
        known[batch.key] = traced
        if folder is not None:
            folder.write(batch, traced)
        done += len(batch.views)
        if progress:
            progress(done, views)
    parts = {key: [known[batch.key] for batch in of_key] for key, of_key in batches.items()}
    return {key: of_key[0].joined(of_key) for key, of_key in parts.items()}, new


def planned(lines: list[Line], resolution: int, sampling: Sampling) -> dict[Lit, list[Batch]]:
    """The batches of views that the lines need, by subject and height of the light."""
    lines_of_lit: dict[Lit, list[Line]] = {}
    for line in lines:
        lines_of_lit.setdefault((line.subject, line.light), []).append(line)
    batches = {}
    for lit, some in lines_of_lit.items():
        sights = (line.sight for line in some if line.sight is not None)
        for remark in averaged_plumes(lit[0].load(), sights):
            warnings.warn(remark, stacklevel=2)
        views = list(dict.fromkeys(view for line in some for view in line.views))
        batches[lit] = Batch.of_views(*lit, views, resolution, sampling)
    return batches


@lru_cache(maxsize=2)
@exclusively
def sources_of(subject: Subject, light: AirOfLight | None) -> list[Source]:
    """The sources of a subject, whose light knows the air that it has crossed."""
    scene = subject.load()
    if light is not None:
        light.shine_on(scene)
    with scene.prepared(by_spectrum=True) as tracer:
        return [source for source in tracer.emitters.sources.list if source.name is not None]


def table_of(
    lines: list[Line], of_lit: dict[Lit, ViewAreas], conditions: Conditions
) -> dict[str, np.ndarray]:
    """Quantities of all cases, by name with the unit."""
    table: dict[str, np.ndarray] = {}
    lit, areas, numbers, of_views, ranges = None, None, {}, {}, {}
    for line in lines:
        if (line.subject, line.light) != lit:
            lit = line.subject, line.light
            areas = replace(of_lit[lit], sources=sources_of(*lit))
            numbers, of_views, ranges = {view: k for k, view in enumerate(areas.views)}, {}, {}
        if line.views not in of_views:  # what is derived from the areas serves many lines
            of_views[line.views] = areas.of_views([numbers[view] for view in line.views])
        of_line = of_views[line.views]
        rows = rows_of(line, of_line)
        if conditions.base.detection_range:
            key = line.sight.direction, line.views
            if key not in ranges:
                ranges[key] = detection_ranges_of(line, of_line)
            rows |= ranges[key]
        for name, values in rows.items():
            table.setdefault(name, np.full(conditions.count, np.nan))[line.cases] = values
    return table
