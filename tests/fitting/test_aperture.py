"""Averages over the source's disc against a sum over small cells."""

import numpy as np
import pytest

from mi_lcair.fitting.aperture import RULES, Disc, gauss, graded, panel
from mi_lcair.fitting.model import Scatterometer
from tests.fitting.synthetic import MODEL, disc_average


def test_gauss_nodes():
    """n nodes on 0..1 integrate x^(2n - 1) exactly, and not x^(2n)."""
    x, weights = gauss(3)
    for power, exact in ((0, True), (5, True), (6, False)):
        assert np.isclose(weights @ x**power, 1 / (power + 1), rtol=1e-12) is np.bool_(exact)


@pytest.mark.parametrize("counts", [(9, 7), (5, 3), (3, 2)])
def test_a_panel_is_the_unit_square(counts):
    t, s, weight = panel(*counts)
    assert len(t) == counts[0] * counts[1]
    assert weight.sum() == pytest.approx(1) and weight @ (t * s) == pytest.approx(0.25)
    assert weight @ t**2 == pytest.approx(1 / 3, rel=1e-3)
    if counts[0] > 3:  # denser at the rim: a square root is integrated well
        assert weight @ np.sqrt(1 - t) == pytest.approx(2 / 3, rel=1e-4)


def test_grading():
    """From 0 to the length, fine at 0, with its derivative."""
    from drjit.llvm.ad import Float64

    length, width = 3.0, 0.1
    x, slope = graded(Float64([0.0, 0.5, 1.0]), Float64(length), Float64(width))
    end = np.arcsinh(length / width)
    np.testing.assert_allclose(x.numpy(), width * np.sinh(end * np.array([0, 0.5, 1])))
    assert x.numpy()[2] == pytest.approx(length)
    step = 1e-6
    ends = [
        graded(Float64([0.5 + d]), Float64(length), Float64(width))[0][0] for d in (step, -step)
    ]
    assert slope.numpy()[1] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-6)


def test_nodes_of_points():
    """Near the mirror direction both panels with many nodes; far away one with few."""
    half_angle = 0.01
    sizes = [2 * 9 * 7, 9 * 7, 5 * 3, 3 * 2]  # each panel inside, one panel beyond the rim
    offsets = half_angle * np.array([0.5, 3.9, -11.9, 12.1])
    disc = Disc(np.full(4, 0.5), 0.5 + offsets, half_angle)
    assert np.bincount(disc.point).tolist() == sizes
    assert disc.first.tolist() == np.cumsum([0, *sizes[:-1]]).tolist()
    assert [reach for reach, _ in RULES] == [4, 12, np.inf]


def test_averages_of_points():
    """Sums of f w and of its derivatives, divided by the sums of w."""
    disc = Disc(np.full(2, 0.5), np.array([0.7, 0.8]), 0.01)
    count = len(disc.point)
    random = np.random.default_rng(0)
    f, w, df = random.random((3, 1, count))
    mean, slope = disc.average(np.stack([f * w, w], axis=-1), (df * w)[..., None])
    for k in (0, 1):
        own = disc.point == k
        total = w[0, own].sum()
        assert mean[0, k] == pytest.approx((f * w)[0, own].sum() / total)
        assert slope[0, k, 0] == pytest.approx((df * w)[0, own].sum() / total)


def test_directions_over_a_wide_disc():
    """A disc of 17 degrees, so that solid angles show: means against a sum over small cells."""
    from drjit.llvm.ad import Float64, UInt32

    theta_i, R = 0.6, 0.3
    disc = Disc(np.array([theta_i]), np.array([0.7]), R)
    node = UInt32(np.arange(len(disc.point)))
    angles = Float64(theta_i), Float64(0.7)
    at, weight = disc.direction(*angles, Float64(0.1), node)
    x, y, z, weight = *at.numpy(), weight.numpy()

    side = (np.arange(800) + 0.5) / 400 - 1
    a, b = (R * grid.ravel() for grid in np.meshgrid(side, side))
    a, b = a[np.hypot(a, b) < R], b[np.hypot(a, b) < R]
    X, Y, Z = np.sin(theta_i + a) * np.cos(b), np.sin(b), np.cos(theta_i + a) * np.cos(b)
    cells = np.cos(b) * Z
    for f in (lambda x, y, z: x, lambda x, y, z: y**2, lambda x, y, z: z**3):
        expected = np.average(f(X, Y, Z), weights=cells)
        assert np.average(f(x, y, z), weights=weight) == pytest.approx(expected, rel=1e-3)


def test_a_broad_lobe_and_a_narrow_one():
    """The average over the disc, weighted by the cosine."""
    half_angle = np.radians(0.909)
    theta_i = np.radians([20.0, 20, 55])
    theta_r = theta_i + np.radians([0.0, 0.85, -3])
    for e in (0.0042, 0.25):
        surface = (0.11, 0.02, 0.05, e)
        f, _ = Scatterometer(MODEL, "thesis", theta_i, theta_r, half_angle)(
            MODEL.to_cube([surface])
        )
        expected = disc_average(theta_i, theta_r, surface, half_angle, cells=301)
        np.testing.assert_allclose(f[0], expected, rtol=6e-3)
