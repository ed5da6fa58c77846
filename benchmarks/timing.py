"""Ratios of times that are measured alternately."""

import time
from statistics import median


def ratio(one, two, rounds: int = 5, clock=time.perf_counter) -> float:
    """Median of time(one) / time(two) over alternating calls, after one call each that compiles.

    one, two: functions of a seed.
    """
    one(0), two(0)
    seeds = range(1, rounds + 1)
    return median(seconds(one, seed, clock) / seconds(two, seed, clock) for seed in seeds)


def seconds(run, seed: int, clock=time.perf_counter) -> float:
    """Time of a call [s]; the call must end with a result outside of Dr.Jit."""
    start = clock()
    run(seed)
    return clock() - start
