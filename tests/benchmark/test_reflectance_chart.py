"""The chart of reflectance integrals: how its times and errors are computed."""

import numpy as np
import pytest
from drjit.llvm import Float64

from mi_lcair.benchmark import reflectance_chart
from mi_lcair.benchmark.reflectance import ReflectanceMethod


def test_time_is_shared_among_repetitions_and_compile_is_apart(monkeypatch):
    """The clock is the test's own, so that the load of the machine does not matter."""
    calls, clock = [], [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])

    def run(p, effort, repetitions, seed):
        calls.append((effort, repetitions, seed))
        clock[0] += 0.02 if len(calls) > 1 else 0.12
        return Float64(np.full(repetitions, 1.0 + seed))

    point = reflectance_chart.measured(
        "box",
        ReflectanceMethod("slow", "", (5,), run, lambda effort: 2 * effort),
        5,
        None,
        1.0,
        reflectance_chart.Work(lanes=100, repetitions=25, launches=2),
    )
    # 25 repetitions take 3 launches of 10, after a first one that compiles.
    assert calls == [(5, 10, seed) for seed in range(4)]
    assert (point.samples, point.effort, point.value, point.error) == (10, 5, 3.0, 2.0)
    assert point.seconds == pytest.approx(0.002)
    assert point.compile_seconds == pytest.approx(0.1)
