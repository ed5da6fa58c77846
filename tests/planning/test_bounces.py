"""How many reflections are needed, from invented radiances of each number of reflections."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.planning.bounces import (
    beyond_last,
    check_bounces,
    fewer_bounces,
    fewest_bounces,
    truncation_error,
)
from tests.planning.probes import FULL, Probes, probe


def test_geometric_series():
    """A tail is exact for bounces that fall by a constant ratio.

    Bounces that fall faster need no tail.
    """
    by_bounce = np.broadcast_to(0.5 ** np.arange(33)[None, :, None], (8, 33, 4))
    n, closure, missing = fewest_bounces(by_bounce, 1e-3, False)
    assert (n, closure) == (2, "tail") and missing < 1e-8
    falling = np.broadcast_to(np.r_[1, 0.5, 0.001, np.zeros(30)][None, :, None], (8, 33, 4))
    assert fewest_bounces(falling, 1e-3, False)[:2] == (1, "none") and fewest_bounces(
        falling, 1e-4, True
    )[:2] == (2, "none")


def test_few_counts_and_their_sum():
    """Four counts and the sum of the others give the same number of reflections as all of them.

    Where four are too few, the number is the largest one that was followed. Its error is that of
    a geometric series.
    """
    by_bounce = np.broadcast_to(0.1 ** np.arange(33)[None, :, None], (8, 33, 4))
    few = np.concatenate([by_bounce[:, :4], by_bounce[:, 4:].sum(axis=1, keepdims=True)], axis=1)
    n, closure, error = fewest_bounces(few, 2e-3, False, reflections=32)
    assert (n, closure) == fewest_bounces(by_bounce, 2e-3, False)[:2] == (2, "none")
    assert error == pytest.approx(1e-3, rel=1e-6)
    assert fewest_bounces(few, 5e-5, True, reflections=32)[:2] == (32, "none")
    slow = np.broadcast_to(0.9 ** np.arange(33)[None, :, None], (8, 33, 4))
    few = np.concatenate([slow[:, :4], slow[:, 4:].sum(axis=1, keepdims=True)], axis=1)
    n, _, error = fewest_bounces(few, 1e-4, True, reflections=32)
    assert n == 32 and error == pytest.approx(0.9**33, rel=0.2)


def test_radiance_that_grows_cannot_be_truncated():
    growing = np.ones((8, 33, 4)) * np.linspace(1.0, 1.2, 33)[:, None]
    assert fewest_bounces(growing, 1e-3, False)[2] > 0.9


def test_the_bound_of_a_noisy_truncation():
    """Of the mean: Student's 95 % bound of the missing part; of pixels: its rms."""
    random = np.random.default_rng(0)
    by_bounce = np.zeros((8, 4, 3))
    by_bounce[:, 0] = 10.0
    by_bounce[:, 1] = 2 + random.normal(size=(8, 3))
    n, closure, error = fewest_bounces(by_bounce, 0.5, False)
    missing = by_bounce[:, 1].mean(axis=1) / by_bounce.sum(axis=1).mean(axis=1)
    expected = missing.mean() + 2.364624 * missing.std(ddof=1) / np.sqrt(8)
    assert (n, closure) == (0, "none") and error == pytest.approx(expected)
    n, closure, error = fewest_bounces(by_bounce, 0.5, True)
    by_pixel = by_bounce[:, 1].mean(axis=0)
    expected = np.sqrt(np.mean(by_pixel**2)) / by_bounce.sum(axis=1).mean()
    assert (n, closure) == (0, "none") and error == pytest.approx(expected)


def test_what_lies_beyond_counts_in_the_whole():
    """0.9^n, four numbers apart and the others up to 32 together: 3 % of all lie beyond."""
    by_bounce = np.broadcast_to(0.9 ** np.arange(33)[None, :, None], (8, 33, 4))
    few = np.concatenate([by_bounce[:, :4], by_bounce[:, 4:].sum(axis=1, keepdims=True)], axis=1)
    last, before = few[0, 4, 0], few[0, 3, 0]
    missing = last * (last / (last + before)) ** 29
    expected = missing / (few[0, :, 0].sum() + missing)
    for each_pixel in (False, True):
        n, closure, error = fewest_bounces(few, 1e-4, each_pixel, reflections=32)
        assert (n, closure) == (32, "none") and error == pytest.approx(expected, rel=1e-9)


def test_a_tail_in_each_pixel():
    """A tail of the mean ratio 0.5, where two pixels have ratios of 0.4 and 0.6."""
    k, ratios = np.arange(40)[:, None], np.array([0.4, 0.6])
    by_bounce = np.broadcast_to(ratios**k, (8, 40, 2))
    means, errors = by_bounce[0].mean(axis=1), {}
    for n in range(2, 12):
        factor = means[n] / (means[n - 1] - means[n])
        gap = ratios ** (n + 1) / (1 - ratios) - factor * ratios**n
        errors[n] = np.sqrt(np.mean(gap**2)) / means.sum()
    expected = next(n for n in errors if errors[n] <= 0.02)
    n, closure, error = fewest_bounces(by_bounce, 0.02, True)
    assert closure == "tail" and n == expected > 2
    assert error == pytest.approx(errors[n], rel=1e-6)


def test_what_lies_beyond_the_last():
    """A geometric series of the last two; of a sum of several, the same ratio by their number."""
    assert beyond_last(np.array([8.0, 4.0, 3.0])) == pytest.approx(0.75 / 0.25)
    assert beyond_last(np.array([4.0, 5.0])) == pytest.approx(0.999 / 0.001)
    assert beyond_last(np.array([4.0])) == beyond_last(np.array([4.0, 0.0])) == 0
    assert beyond_last(np.array([0.0, 4.0])) == beyond_last(np.zeros(3), 2) == 0
    # 1, r, and r^2 + r^3 + r^4 together: beyond are r^5 + ... = r^3 of r^2 + r^3 + ...
    r = 0.5
    whole = r**2 / (1 - r)
    part = whole * (1 - r**3)
    ratio = part / (part + r)
    assert beyond_last(np.array([1.0, r, part]), 2) == pytest.approx(ratio**3)


def decaying(ratio, count=33):
    by_bounce = np.broadcast_to((ratio ** np.arange(count))[None, :, None], (64, count, 1))
    return probe(value=by_bounce.sum(axis=1), by_bounce=by_bounce, reflections=count - 1)


def test_fewer_reflections():
    """0.1^n of 1.111: 2 reflections leave 1e-3, below 0.15 of the tolerance of 0.01."""
    reference, probes = decaying(0.1), Probes(None)
    found = fewer_bounces(probes, FULL, reference, 0.01, lambda rays: rays > 5)
    assert found[0] is reference and found[3] is None
    assert (found[1].max_bounces, found[1].closure) == (2, "none")
    assert found[2] == pytest.approx(1e-3, rel=1e-6)
    assert found[4] == ["reflections beyond 2: at most 0.001 of the mean"]
    # If that saves too little, all are followed
    found = fewer_bounces(probes, FULL, reference, 0.01, lambda rays: rays > 31)
    assert found[1].max_bounces == 32 and found[2] < 1e-9


def test_reflections_that_are_counted_again():
    """Few counts do not suffice, and a probe with all of them does."""
    slow = decaying(0.6)
    few = np.concatenate(
        [slow.by_bounce[:, :4], slow.by_bounce[:, 4:].sum(axis=1, keepdims=True)], axis=1
    )
    first = probe(value=slow.value, by_bounce=few, reflections=32)
    probes = Probes(lambda settings: slow)
    found = fewer_bounces(probes, FULL, first, 0.01, lambda rays: False)
    assert probes.asked == [FULL] and found[0] is slow and found[1].max_bounces == 32
    assert truncation_error(probes, first) == pytest.approx(0.6**33, rel=1e-2)


def test_errors_above_the_tolerance():
    check_bounces(Probes(None), 3, FULL, 0.0099, 0.01)
    with pytest.raises(InputError, match="beyond 3 reflections may be 1.00% .* no more than 32"):
        check_bounces(Probes(None), 3, FULL, 0.01, 0.01)
