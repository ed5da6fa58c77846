"""Whether pixels that were left out are scattered."""

from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.knowing.inversion.dead_pixels import gathering

SIZE = 32
GROUPS = np.repeat(np.arange(4), SIZE // 4)[:, None] + np.zeros(SIZE, dtype=int)


def said(places, counts=None) -> str | None:
    """What is said about pixels (row, column) of four groups that are strips of 8 rows."""
    bad = np.zeros((SIZE, SIZE), dtype=bool)
    bad[tuple(np.transpose(places))] = True
    counts = np.ones_like(bad) if counts is None else counts
    shares = {f"s{k}": (k == GROUPS)[counts].astype(float) for k in range(4)}
    datum = SimpleNamespace(is_image=True, counts=counts, shares=shares)
    return gathering(datum, SimpleNamespace(weight=np.where(bad[counts], 0.0, 1.0)))


def test_pixels_at_random_places_are_scattered():
    """Of 400 images with 1 to 20 dead pixels at most 2 are said to gather: 1 in 1,000 may be."""
    random = np.random.default_rng(0)
    draws = [random.choice(SIZE**2, 1 + draw % 20, replace=False) for draw in range(400)]
    assert sum(said([divmod(p, SIZE) for p in draw]) is not None for draw in draws) <= 2


@pytest.mark.parametrize(
    ("places", "words"),
    [
        ([(30, 30), (30, 31), (31, 30)], "lie side by side"),
        ([(9, 3), (11, 12), (13, 20), (10, 28), (12, 7), (14, 15), (10, 22), (13, 1)], "lie on s1"),
        ([(8 * k + 7, 5 * k + j) for k in range(3) for j in (0, 4)], "lie at the edges of groups"),
        ([(3, 3), (3, 4)], None),
    ],
)
def test_pixels_that_gather(places, words):
    assert said(places) == words


def test_only_pixels_that_count_are_compared():
    """With three of four strips masked, dead pixels of the fourth gather nowhere."""
    counts = GROUPS == 1
    assert said([(9, 3), (11, 12), (13, 20), (10, 28), (12, 7), (14, 15)], counts) is None
