"""Tables of the charts of methods: times to an error, and factors between methods."""

import pytest

from docs.studies.method_tables import seconds_to, table, times_faster
from tests.benchmarks.test_chart import POINTS, points


def test_seconds_to_an_error_are_interpolated():
    """The rms errors of SLOW are 0.6, 0.12, 0.012 and 0.0012 at 10, 100, 1000 and 10000 us.

    Between the last two the error is inversely proportional to the time.
    """
    assert seconds_to(POINTS, "box", "slow", 0.006) == pytest.approx(2e-3)
    assert seconds_to(POINTS, "box", "slow", 0.012) == pytest.approx(1e-3)
    assert seconds_to(POINTS, "box", "slow", 1) == pytest.approx(1e-5)
    assert seconds_to(POINTS, "box", "slow", 0.001) is None
    assert seconds_to(POINTS, "cavity, closed", "lucky", 1) is None


def test_times_faster():
    fast = [*POINTS, *points("box", "fast", [0.2, 0.04, 0.004, 0.0004, 0.00004], 1e-9)]
    faster = lambda methods, rivals, tolerance: times_faster(
        fast, "box", methods, rivals, tolerance
    )
    assert faster(["fast"], ["slow", "lucky"], 0.006) == "5"  # lucky takes 10 us
    assert faster(["slow", "fast"], ["slow"], 0.006) == "1 000"
    assert faster(["fast"], ["slow"], 0.000121) == "> 100"  # the longest run takes 10 ms
    assert faster(["slow"], ["fast"], 0.0005) == "-"
    assert faster(["fast"], ["unknown"], 0.006) == "-"


def test_table():
    head, _, five, one, tenth, hundredth = table(POINTS, "box", "slow").splitlines()
    assert head.count("|") == five.count("|") == 9
    assert "| rms error |" in head
    assert five == "| 5% | lucky | 10 000 | 10 µs | 1 000, 1 ms | 100 | 0.1 |  |"
    assert one == "| 1% | lucky | 10 000 | 10 µs | 10 000, 10 ms | 1 000 | 1 |  |"
    assert tenth == "| 0.1% | none |  |  | does not reach it |  |  | slow; lucky |"
    assert hundredth == "| 0.01% | none |  |  | does not reach it |  |  | slow; lucky |"
    limited = table(POINTS, "cavity, closed", "slow", " within 2 s")
    assert "| none |  |  | does not reach it within 2 s |  |  | slow |" in limited
    assert "| do not reach it within 2 s |" in limited
