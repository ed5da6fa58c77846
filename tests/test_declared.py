"""Declared numbers: which values their bounds allow, and the message about the others."""

import math
from dataclasses import dataclass, field

import pytest

from mi_lcair.declared import Bounds, check_fields, within
from mi_lcair.errors import InputError


@pytest.mark.parametrize(
    "bounds, inside, outside, message",
    [
        (
            Bounds(lower=-1, upper=2.5),
            (-1, 2.5),
            (-1.001, 2.501),
            "x = -1.001; must lie in -1..2.5",
        ),
        (Bounds(lower=0), (0, 1e300), (-1e-300, math.inf), "must be 0 or more, and finite"),
        (Bounds(upper=3), (-1e300, 3), (3.001, -math.inf), "must be finite and at most 3"),
        (Bounds(), (-1e300, 1e300), (math.nan, math.inf), "x = nan; must be finite"),
        (Bounds(is_positive=True, unit="K"), (1e-300, 1), (0, -1), "x = 0 K; must be positive and"),
        (
            Bounds(is_positive=True, upper=1),
            (1e-9, 1),
            (0, 1.001),
            "must be positive and at most 1",
        ),
        (
            Bounds(lower=0, upper=2**32),
            (0, 2**32),
            (2**32 + 1, -1),
            "4294967297; must lie in 0..42",
        ),
    ],
)
def test_bounds(bounds, inside, outside, message):
    for value in inside:
        bounds.check(value, "x")
    for value in (*outside, math.nan):
        with pytest.raises(InputError):
            bounds.check(value, "x")
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        bounds.check(outside[0], "x")


def test_a_number_that_was_rounded_may_exceed_its_bounds_by_the_rounding():
    bounds = Bounds(lower=0.5, upper=4)
    for value in (0.5 * (1 - 0.9e-6), 4 * (1 + 0.9e-6)):
        bounds.check(value, "x", rounding=1e-6)
        with pytest.raises(InputError):
            bounds.check(value, "x")
    for value in (0.5 * (1 - 1.1e-6), 4 * (1 + 1.1e-6)):
        with pytest.raises(InputError):
            bounds.check(value, "x", rounding=1e-6)


@dataclass
class Table:
    counts: tuple[int, ...] = field(default=(), metadata=within(lower=1))
    size: float | None = field(default=None, metadata=within(is_positive=True))
    free: float = -1.0


def test_the_fields_of_a_table_are_checked_with_each_number_of_a_tuple():
    for table in (Table(), Table((1, 2), 0.1, math.inf)):
        check_fields(table)
    with pytest.raises(InputError, match=r"\[table\]: counts = 0; must be 1 or more"):
        check_fields(Table((3, 0)), "[table]: ")
    with pytest.raises(InputError, match="size = 0; must be positive"):
        check_fields(Table(size=0))
