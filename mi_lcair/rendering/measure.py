"""The loop that traces paths: measure(scene, windows, sampling, measurands) gives totals.

Everything that renders chooses windows, measurands and a criterion, and calculates with the totals.
"""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import ParallelRays
from mi_lcair.rendering.limits import channel_count, check_memory, source_count
from mi_lcair.rendering.measurands import Criterion, Measurands
from mi_lcair.rendering.pilots import WORTH_ASKING, best_aim, cheapest, open_settings
from mi_lcair.rendering.pixels.allocation import Allocation, allocate
from mi_lcair.rendering.pixels.errors import PixelCriterion
from mi_lcair.rendering.pixels.passes import may_be_sent, on_workers
from mi_lcair.rendering.sampling import TWO_CHOICES, Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import Totals, check_valid
from mi_lcair.rendering.window import Windows
from mi_lcair.startup.tasks import has_workers

# Ratio of the error to the allowed error, after the first paths, from which on the paths are aimed
# at the model. The pilots for that take up to 2^17 paths.
WORTH_AIMING = 8
# Points of each randomisation that a pass adds to a window, at least. Passes of few points would
# send the sums of a window from workers more often.
LEAST_OF_PASS = 256


def measure(
    scene: Scene,
    windows: Windows,
    sampling: Sampling,
    measurands: Measurands,
    criterion: Criterion | None = None,
    aim: Aim | None = None,
) -> Totals:
    """Trace paths through windows of a sensor until their means are known well enough.

    Parameters
    ----------
    scene : Scene
    windows : Windows
    sampling : Sampling
        Without a criterion, it sets the number of paths. Otherwise it limits their number.
    measurands : Measurands
    criterion : Criterion or None
        Paths are added to a window until its error is allowed.
    aim : Aim or None
        Where the paths begin, such as `aim` of earlier totals. None: anywhere, or at the model if
        that pays.

    Returns
    -------
    Totals
        Sums by window and randomisation.

    Raises
    ------
    InputError
        If memory does not suffice, if the criterion cannot be met, or if too many samples are NaN
        or infinite.
    """
    if criterion is None:
        sampling = sampling.settled(windows.sensor)
    elif sampling.spp is not None:
        raise InputError(TWO_CHOICES)
    windows.check(sampling)
    binning = measurands.binning(sampling.tolerance)
    with scene.prepared(measurands.by_spectrum, measurands.explored, binning) as tracer:
        kept = windows.count * (windows.randomisations if windows.by_randomisation else 1)
        split = measurands.channels.split
        if measurands.reduced:
            check_memory(kept, sources=source_count(tracer))
        else:
            check_memory(kept, channel_count(tracer, split))
        if criterion is not None:
            criterion.check(tracer, scene.name)
        result = _until_met(scene, tracer, windows, sampling, measurands, criterion, aim)
        bins = tracer.bins
    if isinstance(result, Totals):
        result.bins = bins
        return result
    with changed(scene, **result):
        return measure(scene, windows, sampling, measurands, criterion, aim)


def _until_met(
    scene, tracer, windows: Windows, sampling, measurands, criterion, aim
) -> Totals | dict[str, bool]:
    """The loop of `measure`: passes through all windows that need more paths.

    A pilot decides after the first paths on settings that the scene leaves open. If it finds that
    one of them pays, their values are returned, with which to begin again.
    """
    # The results by facet and a sensor of several views need a constant density
    may_aim = aim is None and measurands.facets is None and windows.may_be_aimed
    total, rays = windows.totals(tracer, aim), ParallelRays.of(windows.sensor)
    if criterion is None:
        goal = limit = -(-windows.paths(sampling) // windows.randomisations)
    else:
        settings = open_settings(scene, measurands, criterion)
        limit = windows.points(sampling.limit)
        goal = min(windows.first_points(), limit)
    done, scale = 0, windows.randomisations * windows.parts
    allocation: Allocation | None = None  # None: all windows have as many points
    may_share = isinstance(criterion, PixelCriterion) and tracer.closure != "tail"
    # The windows that need more paths, with the ratios and the points of the last estimate
    active, last, before = np.arange(windows.count), np.zeros(windows.count), 0
    most_rows = tracer.most_rows(measurands.channels)
    while done < goal:
        points = min(goal - done, max(windows.points_of_pass(len(active)), LEAST_OF_PASS))
        spans = [(active, done, points)]
        if allocation is not None:
            spans = allocation.spans(active, done, done + points)
        launches = [
            launch
            for some, first, more in spans
            for launch in windows.launches(some, first, more, sampling.seed, total.aim, most_rows)
        ]
        if windows.are_pixels and has_workers() and may_be_sent(scene, windows, measurands):
            sums = on_workers(scene, windows, measurands, sampling.tolerance, launches)
        else:
            sums = (measurands.trace(tracer, windows.sensor, of, rays) for of in launches)
        for number, (launch, of_launch) in enumerate(zip(launches, sums)):
            total.add(launch, of_launch)
            if sampling.progress and number:
                part = done + points * number / len(launches)
                sampling.progress(int(part * scale), goal * scale)
        done += points
        check_valid(total.invalid, int(total.traced.sum()), scene.name)
        if criterion is not None and done >= goal:
            needed = total.excess = np.broadcast_to(criterion.excess(total), windows.count)
            if settings and needed.max() > WORTH_ASKING:
                best = cheapest(scene, settings, windows, sampling, measurands, criterion)
                if any(best.values()):
                    return best
            settings = []
            if not windows.are_pixels:
                # The error of a lattice falls at most as 1 / points. A smaller estimate is luck,
                # and to end there would state too small an error too often.
                needed = np.maximum(needed, last * before / done)
            last, before = needed, done
            more = active[needed[active] > 1]
            if len(more):
                active, goal = more, min(limit, windows.next_points(done, needed[more].min()))
                if may_share:
                    shared, needed_points = allocate(total, criterion, windows.size, done, limit)
                    goal = int(min(goal, np.ceil(needed_points)))
                    if shared is not None:
                        # From here on numbers of points are means. They begin with the pilot's.
                        allocation, may_share, done = shared, False, 0
            if needed.max() > WORTH_AIMING and may_aim:
                # Begin again in all windows, with the same number of paths
                aim = best_aim(scene, tracer, windows, sampling, measurands, criterion)
                total, may_aim = windows.totals(tracer, aim), False
                active, last = np.arange(windows.count), np.zeros(windows.count)
                goal, done = done, 0
        if sampling.progress:
            sampling.progress(done * scale, goal * scale)
    return total
