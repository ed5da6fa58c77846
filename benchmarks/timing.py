"""Ratios of times that are measured alternately."""

import time
from statistics import median


def ratio(one, two, rounds: int = 5) -> float:
    """Median of time(one) / time(two) over alternating calls, after one call each that compiles.

    one, two: functions of a seed.
    """
    one(0), two(0)
    return median(seconds(one, seed) / seconds(two, seed) for seed in range(1, rounds + 1))


def seconds(run, seed: int) -> float:
    """Time of a call [s]; the call must end with a result outside of Dr.Jit."""
    start = time.perf_counter()
    run(seed)
    return time.perf_counter() - start
