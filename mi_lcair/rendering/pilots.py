"""How paths are drawn, decided by pilots where the scene leaves it open.

Paths may draw emitters (`emitter_sampling`), or keep away from openings (`opening_sampling`).
"""

from dataclasses import replace

import numpy as np

from mi_lcair.plugins.emission.drawing.openings import Openings
from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import ParallelRays
from mi_lcair.rendering.aiming import aim_at_model, aim_over_model, pilot_paths
from mi_lcair.rendering.facets.starts import starts_on_facets
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import Totals, student_factor
from mi_lcair.rendering.views import model_shapes

# Cost of a reflection at which directions are drawn, in rays. For emitters it was measured between
# 0.6 and 2.7 in the bundled scenes. For openings it is 1.3 to 2.5, and paths that do not leave have
# up to twice as many reflections.
DRAWN_RAYS = {"emitter_sampling": 2, "opening_sampling": 4}
# Ratio of the error to the allowed error, after the first paths, from which on the paths of the
# pilots are few compared with those that are still needed
WORTH_ASKING = 3
# Cost of a ray to a facet, as a part of that of a path. Measured for an airliner.
FACET_RAY = 0.5
PATHS_OF_A_START = 1, 8  # choices of the number of paths for each one that begins on a facet
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

    The cost is that of a path times the number of paths that a pilot finds to be needed. settings:
    from `open_settings`. The other arguments are those of `measure`.
    """
    drawn = [
        name for name in settings if name != "opening_sampling" or Openings.of(scene.mi) is not None
    ]
    # About the same paths are reflected, so that one count of their rays serves all
    counting = replace(measurands, channels=replace(measurands.channels, counts_segments=True))
    with changed(scene, **dict.fromkeys(settings, False)):
        needed, total = pilot(scene, windows, sampling, counting, criterion)
        segments = float(total.mean("segments").mean())
        costs = {None: cost(segments) * needed}
        for name in drawn:
            with changed(scene, **{name: True}):
                needed, _ = pilot(scene, windows, sampling, measurands, criterion)
            costs[name] = cost(segments, DRAWN_RAYS[name]) * needed
    best = min(costs, key=costs.get)
    return {name: name == best for name in settings}


def best_aim(scene, tracer, windows, sampling, measurands, criterion) -> Aim:
    """An aim at the model, with paths for its own emission that begin on facets, if these pay.

    That part has hardly any noise then. Where emission and reflections add up to a constant, as in
    a closed isothermal scene, paths that bring both have none. Important parts of the windows are
    looked for if more paths are needed than that takes. Without a model, paths begin anywhere. The
    arguments are those of `measure`.
    """
    if not model_shapes(scene):
        return Aim.anywhere()

    def needed(aim: Aim) -> float:
        return pilot(scene, windows, sampling, measurands, criterion, aim)[0]

    model_alone = measurands.channels.split == "model"
    best, starts = aim_over_model(scene, windows.sensor, model_alone), None
    paths = needed(best)
    if windows.may_follow_facets and tracer.closure == "none":
        starts = starts_on_facets(scene, windows.sensor, tracer.emitters.brightest)
    for every in PATHS_OF_A_START if starts is not None else ():
        split = replace(best, direct=replace(starts, every=every))
        paths_of_split = needed(split) * (1 + FACET_RAY / every)
        if paths_of_split < paths:
            best, paths = split, paths_of_split
    if paths < pilot_paths(windows.sensor):
        return best
    return aim_at_model(scene, tracer, windows.sensor, sampling.seed, measurands, best)


def pilot(scene, windows, sampling, measurands, criterion, aim: Aim | None = None) -> tuple:
    """Number of paths that a window needs, and the totals of the first paths."""
    if not windows.are_pixels:
        windows = replace(windows, randomisations=RANDOMISATIONS)
    points = min(windows.first_points(), windows.points(sampling.limit))
    active, rays = np.arange(windows.count), ParallelRays.of(windows.sensor)
    binning = measurands.binning(sampling.tolerance)
    with scene.prepared(measurands.by_spectrum, binning=binning) as tracer:
        criterion.check(tracer, scene.name)
        total = windows.totals(tracer, aim)
        most_rows = tracer.most_rows(measurands.channels)
        for launch in windows.launches(active, 0, points, sampling.seed, total.aim, most_rows):
            total.add(launch, measurands.trace(tracer, windows.sensor, launch, rays))
    return needed_paths(total, criterion.excess(total)), total


def needed_paths(total: Totals, excess: float | np.ndarray) -> float:
    """Mean number of paths of a window after which the error is the allowed one.

    The part of the interval that comes from scatter falls as the root of this number, and the rest
    as its inverse.

    excess: ratio of the error to the allowed error, of each window or of all.
    """
    scatter = 1.0
    if total.by_randomisation:
        channel = "target" if "target" in total.sums else None
        random = student_factor(total.randomisations - 1) * total.scatter_error(channel)
        whole = total.half_width(channel)
        scatter = np.divide(random, whole, out=np.ones_like(whole), where=whole > 0) ** 2
    square = np.minimum(excess, 1e60) ** 2
    of_scatter, of_rest = square * scatter, square * (1 - scatter)
    ratio = (of_scatter + np.sqrt(of_scatter**2 + 4 * of_rest)) / 2
    return float(np.mean(ratio * total.traced))
