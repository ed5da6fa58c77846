"""Mean radiance over whole windows of a sensor, with a number of paths or to a tolerance.

All paths of a window use the points of a few lattices, whose first two dimensions are the position
in the window. A mean therefore needs far fewer paths than the mean of an image of pixels.
"""

from collections.abc import Callable

import numpy as np

from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.rays import ParallelRays
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.aiming import aim_at_model
from mi_lcair.rendering.limits import check_memory
from mi_lcair.rendering.render import PASS_SAMPLES
from mi_lcair.rendering.statistics import Totals, check_valid

# Independent randomisations of a window's points. Their scatter gives the standard error.
RANDOMISATIONS = 8
FIRST_PATHS = 2**12  # paths of all windows before the first estimate of the error
LEAST_POINTS = 16  # smallest first number of points in each randomisation
# Ratio of the error to the allowed error after the first paths from which on a pilot is traced, to
# aim the paths at the model. The pilot takes 2^18 paths.
WORTH_AIMING = 8
MOST_DOUBLINGS = 3  # the error is itself an estimate, so the next goal is at most 8 times as far


def window_means(
    scene,
    tracer,
    sensor,
    windows: int = 1,
    paths: int | None = None,
    excess: Callable[[Totals], float | np.ndarray] | None = None,
    most_paths: int | None = None,
    seed: int = 0,
    split: str = "target",
    facets=None,
    progress=None,
    aim: Aim | None = None,
    tables=None,
) -> Totals:
    """Trace paths through windows next to each other until their means are known well enough.

    Parameters
    ----------
    scene : Scene
    tracer : PathTracer
        Integrator of the scene, from `Scene.prepared`.
    sensor : mitsuba.Sensor
        Sensor whose film holds the windows side by side.
    windows : int
        Number of windows.
    paths : int or None
        Paths of each window, rounded up to a multiple of RANDOMISATIONS.
    excess : callable or None
        Without `paths`: ratio of the error to the allowed error of each window for the totals so
        far. Paths are added to a window until its ratio is at most 1.
    most_paths : int or None
        Largest number of paths of each window that are traced for `excess`.
    seed : int
        Seed of the random numbers.
    split, facets
        What is recorded beside the radiance, see `PathTracer.trace`.
    progress : callable or None
        Called with (paths done, paths expected) of each window.
    aim : Aim or None
        Where the paths begin, such as `aim` of earlier results. None: anywhere, or at the model if
        that pays.
    tables : ColumnTables or None
        Parameters in which the radiance is differentiated, see `PathTracer.trace`.

    Returns
    -------
    Totals
        Sums by window and randomisation.

    Raises
    ------
    InputError
        If memory does not suffice, or if too many samples are NaN or infinite.
    """
    whole = lambda number: -(-number // RANDOMISATIONS)  # points of each randomisation
    check_memory(windows * RANDOMISATIONS, tracer, split)
    chance = tracer.chance_contribution(sensor)

    def nothing(aim: Aim) -> Totals:
        return Totals(
            windows,
            RANDOMISATIONS,
            by_randomisation=True,
            chance=chance,
            systematic=tracer.systematic_error,
            aim=aim,
        )

    rays, channels = ParallelRays.of(sensor), Channels(split, tables=tables)
    # The results by facet and a sensor of several views need a constant density
    may_aim = aim is None and facets is None and sensor.class_name() == "OrthographicCamera"
    aim = aim or Aim.anywhere()
    total = nothing(aim)
    first = max(LEAST_POINTS, FIRST_PATHS // (windows * RANDOMISATIONS))
    limit = whole(paths or most_paths)
    goal = limit if paths else min(first, limit)
    # The windows that need more paths, with the ratios and the points of the last estimate
    active, last, before = np.arange(windows), np.zeros(windows), 0
    done = 0
    while done < goal:
        points = min(goal - done, max(1, PASS_SAMPLES // (len(active) * RANDOMISATIONS)))
        launch = Launch(
            columns=windows,
            rows=1,
            seed=seed,
            randomisations=RANDOMISATIONS,
            points=points,
            first_point=done,
            windows=len(active),
            chosen=tuple(active.tolist()),
            aim=aim,
        )
        total.add(launch, tracer.trace(sensor, launch, channels, facets, rays))
        done += points
        check_valid(total.invalid, int(total.traced.sum()), scene.name)
        if not paths and done >= goal:
            # The error of a lattice falls at most as 1 / points. A smaller estimate is luck, and to
            # end there would state too small an error too often.
            needed = np.maximum(np.broadcast_to(excess(total), windows), last * before / done)
            last, before = needed, done
            more = active[needed[active] > 1]
            goal = next_goal(done, needed[more].min(initial=np.inf) if len(more) else 0.0, limit)
            if needed.max() > WORTH_AIMING and may_aim:
                # Begin again, with the same number of paths
                aim, may_aim = aim_at_model(scene, tracer, sensor, seed, split), False
                total, goal, done, last = nothing(aim), done, 0, np.zeros(windows)
            elif len(more):
                active = more
        if progress:
            progress(done * RANDOMISATIONS, goal * RANDOMISATIONS)
    return total


def next_goal(done: int, excess: float, limit: int) -> int:
    """Points after which the error is estimated again; `done` if no more are needed.

    A lattice is most uniform after a power of two points, so that the number is doubled. It is
    doubled more than once only where even an error that falls as 1 / points needs that.
    """
    if excess <= 1:
        return done
    doublings = np.clip(np.floor(np.log2(min(excess, 2.0**MOST_DOUBLINGS))), 1, MOST_DOUBLINGS)
    return min(limit, done * 2 ** int(doublings))
