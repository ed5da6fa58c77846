"""Paths are shared among pixels by the errors around them, without bias and with honest errors."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.rendering import measure as module
from mi_lcair.rendering.pixels import Allocation, PixelError, pixel_errors, shares_of, surroundings
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.rendering.made_totals import sums_of, totals
from tests.rendering.test_measure import Tracer, run

SIDE, RANDOMISATIONS = 24, 4
ROOMY = 40  # seeds


class RareTracer(Tracer):
    """Pixel p has paths of the radiance 1 / q[p] with a probability of q[p], otherwise of 0."""

    def __init__(self, chance, seed):
        super().__init__(chance)
        self.random = np.random.default_rng(seed)

    def trace(self, sensor, launch, channels, facets, rays):
        self.launches.append(launch)
        q = self.noise[launch.window_numbers][:, None]
        hits = self.random.binomial(launch.points, q, (launch.windows, RANDOMISATIONS))
        return sums_of(hits / q / launch.points, launch.points)


def image_windows(side=SIDE):
    sensor = SimpleNamespace(
        class_name=lambda: "PerspectiveCamera",
        film=lambda: SimpleNamespace(crop_size=lambda: (side, side)),
    )
    return Windows.of_image(sensor, RANDOMISATIONS)


def chances(seed):
    """Probabilities that differ by pixel: most paths are alike, and some spots have rare ones."""
    spots = gaussian_filter(np.random.default_rng(seed).standard_normal((SIDE, SIDE)), 3)
    return np.where(spots > np.quantile(spots, 0.9), 0.01, 0.9).ravel()


@pytest.mark.parametrize("seed", range(4))
def test_the_points_of_all_passes_follow_each_other(seed):
    random = np.random.default_rng(seed)
    allocation = Allocation(shares_of(random.exponential(size=50), 0.1), 7, 4)
    traced = np.zeros(50, dtype=int)
    goals = [0, *np.sort(random.integers(0, 3000, 5))]
    for done, goal in zip(goals, goals[1:]):
        for windows, first, points in allocation.spans(np.arange(50), done, goal):
            assert points > 0 and np.all(np.maximum(traced[windows], 7) == first)
            traced[windows] = first + points
    assert np.array_equal(np.maximum(traced, 7), allocation.points(goals[-1]))
    assert allocation.points(goals[-1]).mean() == pytest.approx(goals[-1], abs=7 + 4)


def test_shares_follow_the_weights():
    weight = np.repeat([1.0, 16.0], [60, 4])
    shares = shares_of(weight, 0)
    assert shares.mean() == pytest.approx(1) and shares[-1] / shares[0] == 16
    assert shares_of(weight, 0.5).min() >= 0.5 / np.sqrt(2)


@pytest.mark.parametrize("seed", range(3))
def test_a_pixel_does_not_decide_its_own_share(seed):
    squares, pixel = np.random.default_rng(seed).exponential(size=1600), 125  # row 3, column 5
    of_dark, of_bright = (
        surroundings(np.where(np.arange(1600) == pixel, value, squares), (40, 40))
        for value in (1e3, 2e3)
    )
    assert of_dark[pixel] == pytest.approx(of_bright[pixel], rel=2e-3)  # the image's mean counts
    assert of_bright[pixel + 1] > 1.1 * of_dark[pixel + 1]


def test_a_constant_is_its_own_surroundings():
    assert surroundings(np.full(45, 3.0), (5, 9)) == pytest.approx(3.0 * 1.001)
    assert surroundings(np.array([3.0]), (1, 1)) == pytest.approx(3.0 * 1.001)


def rendered(seed, tolerance=0.2):
    tracer = RareTracer(chances(5), seed)
    total = run(tracer, Sampling(tolerance=tolerance), PixelError(tolerance), image_windows())
    return tracer, total


def test_means_are_unbiased_and_errors_honest():
    """Over many seeds, also in pixels whose first paths have met nothing bright.

    With their own paths in the decision, pixels that are dark by chance would stay so.
    """
    means, errors = [], []
    for seed in range(ROOMY):
        tracer, total = rendered(seed)
        assert total.reached and len(set(tracer.traced)) > 1
        means.append(total.mean())
        errors.append(total.scatter_error() ** 2)
    rare = chances(5) < 0.1
    for pixels in (rare, ~rare):
        mean = np.array(means)[:, pixels].mean(axis=1)
        deviation = (mean.mean() - 1) / (mean.std(ddof=1) / np.sqrt(ROOMY))
        assert abs(deviation) < 3.5
        stated = np.sqrt(np.mean(np.array(errors)[:, pixels]) / pixels.sum())
        # The standard deviation of 40 means has an error of 11 %
        assert stated == pytest.approx(mean.std(ddof=1), rel=0.35)


def test_fewer_paths_than_an_even_image(monkeypatch):
    """The smallest possible part is (mean of sigma)^2 / mean of sigma^2, which is 0.1."""
    shared = np.mean([rendered(seed)[1].traced.mean() for seed in range(10)])
    monkeypatch.setattr(module, "allocate", lambda *_: (None, np.inf))
    even = np.mean([rendered(seed)[1].traced.mean() for seed in range(10)])
    sigma = np.sqrt(1 / chances(5) - 1)
    least = sigma.mean() ** 2 / np.mean(sigma**2)
    assert least < shared / even < 0.8


def test_errors_of_pixels_with_other_numbers_of_paths():
    """Neighbours have the same variance of a path, and errors by their own numbers of paths."""
    random = np.random.default_rng(1)
    total = totals(random.standard_normal((400, 8)) / np.sqrt(64), points=64)
    more = np.where(np.arange(400) % 2, 4, 1)
    for values in (total.valid, total.radiance, total.traced[:, None]):
        values *= more[:, None]
    means = random.standard_normal((400, 8)) / np.sqrt(64 * more)[:, None]
    total.radiance[:] = means * total.valid
    error = pixel_errors(total, (20, 20)) * np.sqrt(8 * 64 * more)
    assert error == pytest.approx(np.ones(400), rel=0.3)


@pytest.mark.parametrize("direction", ["column", "row", "diagonal", "other diagonal"])
def test_errors_of_pixels_along_an_edge(direction):
    """The scatter is in one line of pixels: intervals hold 90 %, of the mean of a square 62 %."""
    i, j = np.indices((20, 20))
    on = {"column": j == 9, "row": i == 9, "diagonal": i == j, "other diagonal": i + j == 19}
    on_edge, random = on[direction].ravel(), np.random.default_rng(2)
    held = []
    for _ in range(100):
        means = random.standard_normal((400, RANDOMISATIONS)) * on_edge[:, None]
        error = pixel_errors(totals(means), (20, 20))[on_edge]
        held.append(np.abs(means.mean(axis=1)[on_edge]) <= 1.96 * error)
    assert 0.88 < np.mean(held) < 0.98


def test_errors_of_equal_pixels_are_hardly_larger():
    """By 7 % in variance, see BY_CHANCE."""
    random = np.random.default_rng(3)
    means = random.standard_normal((60 * 60, RANDOMISATIONS))
    squares = pixel_errors(totals(means), (60, 60)) ** 2
    assert np.mean(squares) == pytest.approx(1.07 / RANDOMISATIONS, rel=0.03)


def test_errors_without_bounds_are_those_of_the_scatter():
    """Neither an edge nor a bright source that no path has met enlarges them."""
    means = 10 + np.random.default_rng(4).standard_normal((60 * 60, RANDOMISATIONS))
    unmet = UnmetSources(in_view=1e4, undrawn=0.0)
    total = totals(means, unmet=unmet, lowest=0.0, highest=500.0)
    stated, scatter = (pixel_errors(total, (60, 60), None, bounds) for bounds in (True, False))
    assert stated.min() > 2 * scatter.max()
    assert np.mean(scatter**2) == pytest.approx(1.07 / RANDOMISATIONS, rel=0.03)
