"""Sampler `lattice`: its points, its randomisations, and its use by Mitsuba's own integrators."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice

SEED = 3


def points(count, dimensions, randomisation=0, first=0):
    """Points of a randomisation, (count, dimensions)."""
    point = dr.arange(mi.UInt32, count) + first
    sampler = Lattice.at(mi.UInt32(randomisation), point, mi.UInt32(SEED))
    return np.stack([sampler.next_1d().numpy() for _ in range(dimensions)], axis=1)


@pytest.mark.parametrize("m", [1, 6, 13])
def test_each_dimension_is_evenly_spaced(m):
    """The first 2^m points have the same distances in every dimension: nothing is drawn twice."""
    values = np.sort(points(2**m, 40).astype(np.float64), axis=0)
    np.testing.assert_allclose(np.diff(values, axis=0), 2.0**-m, atol=2**-23)


def test_points_are_those_of_the_rank_1_rule():
    """Against i z / n + shift, in another order and computed with Python's integers."""
    n, dimensions = 256, 12
    found = points(n, dimensions).astype(np.float64)
    z = VECTOR[:dimensions].astype(object)
    rule = np.array([[float(i * int(zd) % n) / n for zd in z] for i in range(n)])
    for d in range(dimensions):
        # The order is that of the reversed bits of i
        order = [int(f"{i:08b}"[::-1], 2) for i in range(n)]
        shift = (found[:, d] - rule[order, d]) % 1
        assert np.ptp((shift - shift[0] + 0.5) % 1) < 1e-6


def test_more_points_continue_the_first():
    np.testing.assert_array_equal(
        points(64, 7), np.concatenate([points(24, 7), points(40, 7, first=24)])
    )


def test_randomisations_and_dimensions_are_independent():
    """Shifts of 4,000 randomisations: uniform, and uncorrelated between dimensions, neighbouring
    randomisations, and the two uses of one component of the generating vector.
    """
    count = 4000
    sampler = Lattice.at(dr.arange(mi.UInt32, count), mi.UInt32(0), mi.UInt32(SEED))
    numbers = [sampler.next_1d() for _ in range(len(VECTOR) + 3)]
    shifts = {d: numbers[d].numpy() for d in (0, 1, 2, 500, 1024, 1025)}
    for d in (0, 1, 2, 500, 1025):
        assert kstest(shifts[d], "uniform").pvalue > 1e-4
    pairs = [(0, 1), (1, 2), (0, 1024), (1, 1025)]
    for a, b in pairs:
        assert abs(np.corrcoef(shifts[a], shifts[b])[0, 1]) < 4 / np.sqrt(count)
    assert abs(np.corrcoef(shifts[0][1:], shifts[0][:-1])[0, 1]) < 4 / np.sqrt(count)
    # The difference of two dimensions is not the same in all randomisations
    assert np.std((shifts[1024] - shifts[0]) % 1) > 0.25


def test_numbers_never_reach_one():
    """Rounding 2^32 - 1 times 2^-32 to Float32 would give 1."""
    sampler = Lattice.at(mi.UInt32(0), mi.UInt32(0), mi.UInt32(0))
    sampler.reversed_index = mi.UInt32(0xFFFFFFFF) - dr.arange(mi.UInt32, 2**16)
    sampler.key = mi.UInt32(0)
    numbers = sampler.next_1d().numpy()
    assert numbers.max() < 1 and numbers.min() >= 0
    assert float(mi.Float(mi.UInt32(0xFFFFFFFF) >> 8)[0] * 2.0**-24) < 1


def test_a_mean_over_the_lattice_has_less_noise():
    """A smooth product and the area of a triangle: both unbiased, both far less noisy than 1024
    independent points (standard errors 1/36 and 1/64 at best).
    """
    lane = dr.arange(mi.UInt32, 200 * 1024)
    sampler = Lattice.at(lane // 1024, lane % 1024, mi.UInt32(SEED))
    u = np.stack([sampler.next_1d().numpy() for _ in range(4)], axis=1).astype(np.float64)
    u = u.reshape(200, 1024, 4)
    product = np.prod(1 + 0.5 * (u - 0.5), axis=2)
    means = np.stack([product.mean(axis=1), np.mean(u[..., 0] > u[..., 1], axis=1)], axis=1)
    error = means.std(axis=0, ddof=1)
    independent = np.sqrt([(1 + 1 / 48) ** 4 - 1, 0.25]) / 32
    assert np.all(error < independent / [15, 15])
    assert np.all(np.abs(means.mean(axis=0) - [1, 0.5]) < 4 * error / np.sqrt(200))


@pytest.mark.parametrize("dimensions, bins", [(1, 256), (2, 16), (3, 6)])
def test_a_point_of_many_randomisations_is_uniform(dimensions, bins):
    """Chi-square of the counts in the cells of a grid, as Mitsuba tests its samplers."""
    count = 2**14
    sampler = Lattice.at(dr.arange(mi.UInt32, count), mi.UInt32(5), mi.UInt32(SEED))
    u = np.stack([sampler.next_1d().numpy() for _ in range(dimensions)], axis=1)
    counts, _ = np.histogramdd(u, bins=bins, range=[(0, 1)] * dimensions)
    assert chisquare(counts.ravel()).pvalue > 1e-4


def test_points_are_stratified():
    """1,024 points of a pixel in 16 x 16 cells: 4 each, 2 more or fewer at most.

    Mitsuba's own samplers have 4 each in the two numbers of one call, and are independent between
    calls: there some cell has 8 or more.
    """
    for seed in range(4):
        sampler = mi.load_dict({"type": "lattice", "sample_count": 1024})
        sampler.seed(seed, 1024)
        u = np.stack([sampler.next_1d().numpy() for _ in range(8)], axis=1)
        for pair in zip(u.T, u.T[1:]):
            counts, *_ = np.histogram2d(*pair, bins=16, range=[(0, 1)] * 2)
            assert counts.min() >= 2 and counts.max() <= 6


def test_positions_are_sheared():
    """x moves by a part of y, then y by a part of the new x: 1/32 to 1/16, in each randomisation
    another part.
    """
    randomisation, point = np.divmod(np.arange(300 * 64, dtype=np.uint32), 64)
    at = lambda: Lattice.at(mi.UInt32(randomisation), mi.UInt32(point), mi.UInt32(SEED))
    plain, sheared = at().next_2d().numpy().astype(float), at().next_position().numpy()
    moved, by = (sheared - plain) % 1, np.stack([plain[1], sheared[0]])
    slopes = np.where(by > 0.5, moved / by, np.nan).reshape(2, 300, 64)
    assert np.all(np.nanmax(slopes, axis=2) - np.nanmin(slopes, axis=2) < 1e-6)
    slopes = np.nanmean(slopes, axis=2)
    assert kstest(32 * slopes.ravel() - 1, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(slopes)[0, 1]) < 4 / np.sqrt(300)


def test_a_copy_continues_and_a_fork_begins():
    sampler = mi.load_dict({"type": "lattice", "sample_count": 8})
    sampler.seed(5, 32)
    sampler.next_2d()
    copy, fork = sampler.clone(), sampler.fork()
    np.testing.assert_array_equal(sampler.next_1d().numpy(), copy.next_1d().numpy())
    assert fork.sample_count() == 8 and fork.wavefront_size() != 32
    sampler.seed(5, 32)
    again = sampler.next_1d().numpy()
    sampler.seed(6, 32)
    assert np.any(again != sampler.next_1d().numpy())


# ---------------------------------------------------------------- Mitsuba's own integrators


def lit_sphere(sampler, spp=16):
    """A grey sphere under a constant sky, 16 x 16 pixels."""
    return mi.load_dict(
        {
            "type": "scene",
            "sphere": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": 0.5}},
            "floor": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, -1]).scale(3),
                "bsdf": {"type": "diffuse", "reflectance": 0.5},
            },
            "sky": {"type": "constant", "radiance": 1.0},
            "sensor": {
                "type": "perspective",
                "to_world": mi.ScalarTransform4f().look_at([0, -4, 2], [0, 0, 0], [0, 0, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": 16,
                    "height": 16,
                    "rfilter": {"type": "box"},
                    "pixel_format": "luminance",
                },
                "sampler": {"type": sampler, "sample_count": spp},
            },
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["path", "prb", "prb_basic"])
def test_stock_integrators_use_it(kind):
    """The same image as with independent numbers, within 4 standard errors of the mean over 16
    seeds, with less noise in a pixel.
    """
    integrator = mi.load_dict({"type": kind, "max_depth": 4})
    images = {
        sampler: np.array(
            [
                mi.render(scene, integrator=integrator, spp=16, seed=seed).numpy()
                for seed in range(16)
            ],
            dtype=np.float64,
        )
        for sampler in ("lattice", "independent")
        for scene in [lit_sphere(sampler)]
    }
    variance = {name: image.var(axis=0, ddof=1) for name, image in images.items()}
    mean = {name: image.mean() for name, image in images.items()}
    error = np.sqrt(sum(v.sum() for v in variance.values()) / 16) / 256
    assert abs(mean["lattice"] - mean["independent"]) < 4 * error
    assert variance["lattice"].mean() < 0.75 * variance["independent"].mean()


@pytest.mark.slow
def test_the_derivative_of_a_stock_integrator():
    """Path replay draws the same numbers twice: the derivative agrees with differences."""
    scene = lit_sphere("lattice", 64)
    params = mi.traverse(scene)
    key = "sphere.bsdf.reflectance.value"
    integrator = mi.load_dict({"type": "prb", "max_depth": 3})

    def mean(value):
        params[key] = mi.Float(value)
        params.update()
        return mi.render(scene, integrator=integrator, seed=1).numpy().mean(dtype=float)

    difference = (mean(0.52) - mean(0.48)) / 0.04
    params[key] = mi.Float(0.5)
    dr.enable_grad(params[key])
    params.update()
    dr.backward(dr.mean(mi.render(scene, params, integrator=integrator, seed=1), axis=None))
    assert dr.grad(params[key]).numpy()[0] == pytest.approx(difference, rel=0.02)
