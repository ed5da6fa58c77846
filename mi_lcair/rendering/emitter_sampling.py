"""Whether paths draw emitters: decided by a pilot where the scene leaves it open."""

from dataclasses import replace

import numpy as np

from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.rendering.settings import changed

# Cost of sampling an emitter, in rays. Measured: between 0.6 and 2.7 in the bundled scenes.
EMITTER_SAMPLE = 2
# Ratio of the error to the allowed error, after the first paths, from which on the paths of the
# pilots are few beside those that are still needed
WORTH_ASKING = 3
# Randomisations of the pilots of one window. With 32, two equal variances differ by less than 1.8.
RANDOMISATIONS = 32


def cost(segments: float, draws_emitters: bool) -> float:
    """Cost of a path, in rays.

    Emitter sampling adds EMITTER_SAMPLE rays at each reflection. The cost is counted and not timed,
    so that the load of the machine does not decide which settings are chosen.

    Parameters
    ----------
    segments : float
        Mean number of rays of a path.
    draws_emitters : bool
        Whether the path samples emitters.
    """
    return segments + (EMITTER_SAMPLE * max(segments - 1, 0) if draws_emitters else 0.0)


def is_open(scene, measurands, criterion) -> bool:
    """Whether a pilot decides if paths draw emitters.

    It does not where the scene says so, and for a fixed number of paths, derivatives and facets.
    """
    integrator = scene.mi.integrator()
    special = measurands.facets, measurands.channels.tables, measurands.reduced
    is_plain = not measurands.explored and all(entry is None for entry in special)
    says_nothing = integrator.emitter_sampling == AUTO and integrator.max_bounces > 0
    return criterion is not None and is_plain and says_nothing


def drawing_is_cheaper(scene, windows, sampling, measurands, criterion) -> bool:
    """Whether paths that draw emitters meet a criterion sooner.

    Two pilots with equal numbers of paths give the ratio of the error to the allowed error, which
    includes sources that no path has met. The cost to the same error is that of a path times the
    square of this ratio. The arguments are those of `measure`.
    """
    # The reflected paths are the same, so that one count of their rays serves both
    counting = replace(measurands, channels=replace(measurands.channels, counts_segments=True))
    with changed(scene, emitter_sampling=False):
        without, total = pilot(scene, windows, sampling, counting, criterion)
    segments = float(total.mean("segments").mean())
    with changed(scene, emitter_sampling=True):
        drawn, _ = pilot(scene, windows, sampling, measurands, criterion)
    return cost(segments, True) * drawn**2 < cost(segments, False) * without**2


def pilot(scene, windows, sampling, measurands, criterion) -> tuple:
    """Ratio of the error to the allowed error after the first paths, and their totals."""
    if not windows.are_pixels:
        windows = replace(windows, randomisations=RANDOMISATIONS)
    points = min(windows.first_points(), windows.points(sampling.limit))
    active = np.arange(windows.count)
    with scene.prepared(measurands.by_spectrum, bins=measurands.bins) as tracer:
        criterion.check(tracer, scene.name)
        total = windows.totals(tracer)
        for launch in windows.launches(active, 0, points, sampling.seed, total.aim):
            total.add(launch, measurands.trace(tracer, windows.sensor, launch))
        return float(np.max(criterion.excess(total))), total
