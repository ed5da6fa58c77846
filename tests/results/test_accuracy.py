"""The error of a result in words."""

import pytest

from mi_lcair.sections import error_row, interval


def test_the_interval_is_a_fraction_of_what_is_not_zero():
    assert interval(0.5, -10, "W/sr", "it") == "the 95 % interval is +- 5 % of it"
    assert interval(0.5, 10, "W/sr", "it", absolute=True).startswith(
        "the 95 % interval is +- 0.5 W/sr, 5 %"
    )
    assert interval(2, 1.9, "W/sr", "it") == (
        "the 95 % interval is +- 2 W/sr, and it may be zero"
    )  # fmt: skip


@pytest.mark.parametrize(
    "arguments, row",
    [
        ((), ("error", "wide")),
        ((0.01, True), ("tolerance", "1 % reached: wide")),
        (
            ("2 W", False, "in 1 view"),
            ("tolerance", "2 W NOT reached in 1 view: wide; raise max_spp"),
        ),
        ((0.01, False, "", "wait"), ("tolerance", "1 % NOT reached: wide; wait")),
    ],
)  # fmt: skip
def test_rows(arguments, row):
    assert error_row("wide", *arguments) == row
