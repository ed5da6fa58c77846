"""Declared numbers: which values their bounds allow, and the message about the others."""

import math
from dataclasses import dataclass
from typing import Literal

import pytest

from mi_lcair.declared import Bounds, Described, entry, excludes, needs, one_of, rule, together
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


RULES = (
    one_of("focal_m", "angle_deg"),
    excludes("path", "on", why="a path has its own"),
    needs("on", "angle_deg", lens="thin", why="of a thin lens"),
    needs("most", "on", "path", any_of=True),
    needs("words", "most", "x"),
    together("x", "y"),
    rule(lambda t: len(t.counts) < 3, "{t.counts}: at most two"),
)


@dataclass(frozen=True)
class Optics(Described, where="[optics]", rules=RULES):
    focal_m: float | None = entry(None, is_positive=True, unit="m")
    angle_deg: float | None = None
    lens: Literal["thin", "aplanatic"] = "thin"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    counts: tuple[int, ...] = entry((), lower=1)
    words: tuple[Literal["a", "b"], ...] = ()
    on: bool = False
    path: str | None = entry(None, is_file=True)
    most: int | Literal["auto"] | None = entry(None, lower=2)
    x: float = 0.0
    y: float = 0.0
    parameters: dict = entry(dict)
    size_m: float | None = entry(None, upper=9)

    def complete(self):
        if self.size_m is None and self.focal_m is not None:
            self.derive(size_m=self.focal_m / 2)


def test_a_table_that_keeps_its_rules_is_completed():
    assert Optics(1.0).size_m == 0.5 and Optics(1.0, size_m=2.0).size_m == 2.0
    Optics(angle_deg=3.0, on=True, counts=(1, 2), most="auto", x=1.0, y=1.0, words=("b", "a"))


@pytest.mark.parametrize(
    "values, message",
    [
        ({"focal_m": 0.0}, "focal_m = 0 m; must be positive"),
        ({"focal_m": True}, "focal_m = True; must be a number"),
        ({"counts": (1, 0)}, "counts = 0; must be 1 or more"),
        ({"lens": "thn"}, "unknown lens 'thn'; known: thin, aplanatic"),
        ({"words": ("a", "c")}, "unknown words 'c'; known: a, b"),
        ({"axis": (0, 1)}, "axis = [0, 1]; give 3 numbers"),
        ({"most": 1}, "most = 1; must be 2 or more"),
        ({"parameters": {"a": [1]}}, "parameters: a = [1]; must be a text or a number"),
        ({}, "focal_m and angle_deg are missing; give one of them"),
        (
            {"focal_m": 1, "angle_deg": 2},
            "has focal_m and angle_deg; give one of focal_m and angle_deg",
        ),
        (
            {"angle_deg": 2, "on": True, "path": "a"},
            "path and on cannot be combined; a path has its own",
        ),
        (
            {"focal_m": 1, "on": True},
            'on needs angle_deg and lens = "thin"; of a thin lens',
        ),
        (
            {"angle_deg": 1, "on": True, "lens": "aplanatic"},
            'on needs angle_deg and lens = "thin"; of a thin lens',
        ),
        ({"focal_m": 1, "most": 2}, "most needs on or path"),
        ({"focal_m": 1, "words": ("a",), "x": 1, "y": 1}, "words needs most and x"),
        ({"focal_m": 1, "y": 2}, "x is missing; give x and y"),
        ({"focal_m": 1, "counts": (1, 2, 3)}, "(1, 2, 3): at most two"),
        ({"focal_m": 30}, "size_m = 15; must be finite and at most 9"),
    ],
)
def test_what_a_table_refuses(values, message):
    with pytest.raises(InputError) as error:
        Optics(**values)
    assert str(error.value).startswith(f"[optics]: {message}")


def test_what_an_entry_takes_the_place_of_follows_from_the_rules():
    assert Optics.replaced("focal_m") == {"angle_deg"}
    assert Optics.replaced("path") == {"on"} and Optics.replaced("on") == {"path"}
    assert Optics.replaced("x") == set()


def test_all_are_needed_unless_another_is_given():
    @dataclass(frozen=True)
    class Where(Described, rules=(together("range", "angle", unless="position = [x, y]"),)):
        range: float | None = None
        angle: float | None = None
        position: tuple[float, float] | None = None

    assert Where(1.0, 0.0) and Where(position=(0.0, 1.0))
    for values in ({}, {"range": 1.0}):
        with pytest.raises(InputError, match="is missing; give range and angle, or position ="):
            Where(**values)
