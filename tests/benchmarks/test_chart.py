"""The parts that all charts of methods share.

Which point counts as having reached a tolerance, and the files that are written.
"""

import csv

import pytest

from benchmarks import chart
from benchmarks.chart import Cost, Point, point


def points(case, method, errors, seconds_per_sample):
    """Points of a method with 10, 100, ... samples."""
    return [
        Point(
            case,
            method,
            n,
            10.0**n,
            seconds_per_sample * 10**n,
            0.1,
            error,
            error / 2,
            error * 2,
            1 + error,
            3 * error,
        )
        for n, error in enumerate(errors, 1)
    ]


SLOW = points("box", "slow", [0.2, 0.04, 0.004, 0.0004], 1e-6)
LUCKY = points(
    "box", "lucky", [0.0001, 0.3, 0.03, 0.002], 1e-9
)  # the first error is small by chance
POINTS = SLOW + LUCKY + points("cavity, closed", "slow", [0.5, 0.4], 1e-6)


def test_point_takes_medians_and_quartiles():
    cost = Cost([4, 5, 9], [1, 2, 3], 0.5)
    result = point("box", "slow", 3, cost, [1.1, 0.6, 0.8, 1.0, 1.3], 1.0)
    assert result.samples == 5 and result.seconds == 2 and result.value == 1.0
    assert (result.error_low, result.error, result.error_high) == pytest.approx((0.1, 0.2, 0.3))
    assert result.rms == pytest.approx((0.3 / 5) ** 0.5)  # the errors are 0.1, 0.4, 0.2, 0 and 0.3


@pytest.mark.parametrize(
    "method, tolerance, effort",
    [
        ("slow", 0.05, 2),
        ("slow", 0.04, 2),
        ("slow", 0.001, 4),
        ("slow", 0.0001, None),
        ("lucky", 0.05, 3),
        ("lucky", 0.001, None),
    ],
)
def test_reach_asks_for_all_higher_efforts(method, tolerance, effort):
    reached = chart.reach(POINTS, "box", method, tolerance, by="error")
    assert (reached and reached.effort) == effort


def test_reach_by_rms():
    """It is the measure of all tables, and larger than the median: 0.6, 0.12, 0.012, 0.0012."""
    assert chart.reach(POINTS, "box", "slow", 0.05) == SLOW[2]


def test_cheapest_by_time():
    assert (
        chart.cheapest(POINTS, "box", 0.05) == LUCKY[3]
    )  # it has more samples than SLOW[2] but takes less time
    assert chart.cheapest(POINTS, "box", 0.0015) == SLOW[3]
    assert chart.cheapest(POINTS, "cavity, closed", 0.05) is None


def test_not_a_number_reaches_nothing():
    assert (
        chart.reach(points("box", "broken", [0.001, float("nan")], 1), "box", "broken", 0.05)
        is None
    )


@pytest.mark.parametrize(
    "number, text",
    [
        (0.0123, "0.012"),
        (0.5, "0.5"),
        (3.14, "3.1"),
        (9.96, "10"),
        (8900, "8 900"),
        (251234, "250 000"),
        (1, "1"),
    ],
)
def test_digits(number, text):
    assert chart.digits(number) == text


@pytest.mark.slow
def test_files(tmp_path):
    chart.write_csv(tmp_path / "a.csv", POINTS)
    rows = (tmp_path / "a.csv").read_text().splitlines()
    rows = list(csv.DictReader(rows))
    assert (
        len(rows) == len(POINTS)
        and float(rows[1]["error"]) == 0.04
        and rows[4]["method"] == "lucky"
        and rows[-1]["case"] == "cavity, closed"
    )
    chart.draw(tmp_path / "a.png", POINTS, "two methods", chart.TIME)
    assert (tmp_path / "a.png").stat().st_size > 20000
