"""How paths are drawn, decided by pilots where the scene leaves it open.

Paths may draw emitters (`emitter_sampling`), or keep away from openings (`opening_sampling`).
"""

from dataclasses import replace

import numpy as np

from mi_lcair.plugins.emission.drawing.openings import Openings
from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.rendering.aiming import aim_at_model
from mi_lcair.rendering.facets.starts import starts_on_facets
from mi_lcair.rendering.settings import changed

# Cost of a reflection at which directions are drawn, in rays. For emitters it was measured between
# 0.6 and 2.7 in the bundled scenes. For openings it is 1.3 to 2.5, and paths that do not leave have
# up to twice as many reflections.
DRAWN_RAYS = {"emitter_sampling": 2, "opening_sampling": 4}
# Ratio of the error to the allowed error, after the first paths, from which on the paths of the
# pilots are few beside those that are still needed
WORTH_ASKING = 3
# Ratio of two errors from which on the smaller one is worth a ray to a facet for each path
WORTH_STARTING = 0.9
# Randomisations of the pilots of one window. With 32, two equal variances differ by less than 1.8.
RANDOMISATIONS = 32


def cost(segments: float, drawn_rays: float = 0) -> float:
    """Cost of a path, in rays.

    It is counted and not timed, so that the load of the machine does not decide which settings are
    chosen.

    Parameters
    ----------
    segments : float
        Mean number of rays of a path.
    drawn_rays : float
        Cost of what is drawn at each reflection, in rays.
    """
    return segments + drawn_rays * max(segments - 1, 0)


def open_settings(scene, measurands, criterion) -> list[str]:
    """The settings about which a pilot decides.

    There are none where the scene says them, and for a fixed number of paths, derivatives and
    facets.
    """
    integrator = scene.mi.integrator()
    special = measurands.facets, measurands.channels.tables, measurands.reduced
    is_plain = not measurands.explored and all(entry is None for entry in special)
    if criterion is None or not is_plain or integrator.max_bounces == 0:
        return []
    return [name for name in DRAWN_RAYS if vars(integrator)[name] == AUTO]


def cheapest(scene, settings: list, windows, sampling, measurands, criterion) -> dict[str, bool]:
    """Values of open settings, of which at most one is True, that meet a criterion soonest.

    Pilots with equal numbers of paths give the ratio of the error to the allowed error, which
    includes sources that no path has met. The cost to the same error is that of a path times the
    square of this ratio. settings: from `open_settings`. The other arguments are those of
    `measure`.
    """
    drawn = [
        name for name in settings if name != "opening_sampling" or Openings.of(scene.mi) is not None
    ]
    # About the same paths are reflected, so that one count of their rays serves all
    counting = replace(measurands, channels=replace(measurands.channels, counts_segments=True))
    with changed(scene, **dict.fromkeys(settings, False)):
        excess, total = pilot(scene, windows, sampling, counting, criterion)
        segments = float(total.mean("segments").mean())
        costs = {None: cost(segments) * excess**2}
        for name in drawn:
            with changed(scene, **{name: True}):
                excess, _ = pilot(scene, windows, sampling, measurands, criterion)
            costs[name] = cost(segments, DRAWN_RAYS[name]) * excess**2
    best = min(costs, key=costs.get)
    return {name: name == best for name in settings}


def best_aim(scene, tracer, windows, sampling, measurands, criterion) -> Aim:
    """An aim at the model, with paths for its own emission that begin on facets, if these pay.

    That part has hardly any noise then. Where emission and reflections add up to a constant, as in
    a closed isothermal scene, paths that bring both have none. The arguments are those of
    `measure`.
    """
    starts, plan = None, (scene, tracer, windows.sensor, sampling.seed, measurands)
    if windows.may_follow_facets and tracer.closure == "none":
        starts = starts_on_facets(scene, windows.sensor, tracer.emitters.brightest)
    if starts is not None:
        aim = aim_at_model(*plan, starts)
        split, whole = (
            pilot(scene, windows, sampling, measurands, criterion, part)[0]
            for part in (aim, replace(aim, direct=None))
        )
        if split < WORTH_STARTING * whole:
            return aim
    return aim_at_model(*plan)


def pilot(scene, windows, sampling, measurands, criterion, aim: Aim | None = None) -> tuple:
    """Ratio of the error to the allowed error after the first paths, and their totals."""
    if not windows.are_pixels:
        windows = replace(windows, randomisations=RANDOMISATIONS)
    points = min(windows.first_points(), windows.points(sampling.limit))
    active = np.arange(windows.count)
    binning = measurands.binning(sampling.tolerance)
    with scene.prepared(measurands.by_spectrum, binning=binning) as tracer:
        criterion.check(tracer, scene.name)
        total = windows.totals(tracer, aim)
        for launch in windows.launches(active, 0, points, sampling.seed, total.aim):
            total.add(launch, measurands.trace(tracer, windows.sensor, launch))
        return float(np.max(criterion.excess(total))), total
