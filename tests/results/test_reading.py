"""Results from the entries of their JSON: whatever can be written comes back."""

import json
from dataclasses import dataclass, field

import numpy as np
import pytest

from mi_lcair.results.reading import built
from mi_lcair.results.result import strict


@dataclass(frozen=True)
class Part:
    name: str
    value: float
    among: tuple["Part", ...] = ()


@dataclass(frozen=True)
class Whole:
    count: int
    is_done: bool
    numbers: np.ndarray
    interval: tuple[float, float]
    by_number: dict[int, float]
    parts: list[Part]
    first: Part | None = None
    rest: list = field(default_factory=list)


def entries_of(whole):
    """What JSON makes of an object and its parts."""
    plain = json.dumps(strict({**vars(whole), "parts": [of_part(part) for part in whole.parts]}
        | {"first": whole.first and of_part(whole.first)}), allow_nan=False)  # fmt: skip
    return json.loads(plain)


def of_part(part):
    return {**vars(part), "among": [of_part(inner) for inner in part.among]}


@pytest.mark.parametrize("seed", range(20))
def test_what_is_written_comes_back(seed):
    random = np.random.default_rng(seed)

    def part(depth):
        inner = tuple(part(depth - 1) for _ in range(random.integers(3))) if depth else ()
        return Part(str(random.integers(100)), float(random.normal()), inner)

    whole = Whole(
        count=int(random.integers(100)),
        is_done=bool(random.integers(2)),
        numbers=random.normal(size=random.integers(1, 4, 2)),
        interval=tuple(random.normal(size=2).tolist()),
        by_number={int(k): float(k) for k in random.integers(0, 99, 3)},
        parts=[part(2) for _ in range(random.integers(4))],
        first=part(0) if random.integers(2) else None,
        rest=random.integers(0, 9, 3).tolist(),
    )
    read = built(Whole, entries_of(whole))
    np.testing.assert_array_equal(read.numbers, whole.numbers)
    same = {name: value for name, value in vars(read).items() if name != "numbers"}
    assert same == {name: value for name, value in vars(whole).items() if name != "numbers"}


def test_numbers_that_do_not_exist_and_integers():
    assert np.isnan(built(Part, {"name": "a", "value": None}).value)
    np.testing.assert_array_equal(built(np.ndarray, [1.5, None]), [1.5, np.nan])
    assert built(np.ndarray, [1, 2]).dtype.kind == "i"  # indices stay indices


@pytest.mark.parametrize(
    "entries", [{"name": "a"}, {"name": 1, "value": 1.0}, {"name": "a", "value": "1"}, []]
)
def test_refuses_other_entries(entries):
    with pytest.raises((KeyError, TypeError)):
        built(Part, entries)
