"""Temperatures of facets from noisy images and few paths, with true errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.inversion.facet_estimate import estimate_facets, radiance_slope
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.sensitivity.facets import FacetMatrix, facet_matrix
from tests.sensitivity.waist import VIEWS, smooth_temperatures, write_scene

RINGS = SEGMENTS = 6
FACETS = RINGS * SEGMENTS
NETD = 0.05  # K at 300 K
DRAWS = 20
TRUE = smooth_temperatures(RINGS, SEGMENTS)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("waist")
    return mi_lcair.load(write_scene(folder, TRUE, RINGS, SEGMENTS, size=16))


@pytest.fixture(scope="module")
def sigma(scene):
    return NETD * float(radiance_slope(scene.band, 300.0))


@pytest.fixture(scope="module")
def images(scene):
    """The views without noise, from many other paths than those of the matrices."""
    return [
        mi_lcair.render(scene, spp=4096, sensor=view, seed=10_000 + view, split=None).channels["Y"]
        for view in range(len(VIEWS))
    ]


def views(scene, seed, spp=128, randomisations=8):
    return [
        facet_matrix(
            scene,
            groups=["body"],
            sensor=view,
            spp=spp,
            seed=len(VIEWS) * seed + view,
            randomisations=randomisations,
        )
        for view in range(len(VIEWS))
    ]


@pytest.fixture(scope="module")
def matrices(scene):
    return views(scene, seed=1)


@pytest.fixture(scope="module")
def draws(scene, images, sigma):
    """Estimates from matrices and images with other noise each."""
    random = np.random.default_rng(5)
    noisy = lambda: [image + sigma * random.normal(size=image.shape) for image in images]
    return [estimate_facets(views(scene, seed), noisy(), sigma) for seed in range(DRAWS)]


def test_errors_are_true(draws):
    """95 % intervals of 720 temperatures; without bias the mean has an error of 0.04 sigma."""
    deviation = np.array([(draw.temperature - TRUE) / draw.error for draw in draws])
    assert 0.92 < (np.abs(deviation) < 1.96).mean() < 0.975
    assert abs(deviation.mean()) < 0.15
    assert np.mean([draw.error for draw in draws]) < 0.1


def test_noise_of_the_matrix_causes_no_bias(scene):
    """Ordinary least squares with a matrix of noisy entries gives too small a contrast.

    The entries are 0..1, with a noise of 0.2 in each of eight matrices. The variance of their mean,
    0.005, is 6 % of the variance of an entry, and the contrast is about 6 % too small.
    """
    random, pixels, facets = np.random.default_rng(2), 192 * 192, 5
    exact = random.random((pixels, facets))
    noisy = exact + 0.2 * random.normal(size=(8, pixels, facets))
    temperature = np.linspace(200, 400, facets)
    source = in_band_radiance(scene.band, temperature)
    view = FacetMatrix(
        [csr_array(one) for one in noisy],
        np.zeros((8, pixels)),
        np.arange(facets),
        temperature,
        scene.band,
        (192, 192),
    )
    image = (exact @ source + 0.01 * random.normal(size=pixels)).reshape(192, 192)
    found = estimate_facets([view], [image], 0.01)
    assert (np.abs(found.temperature - temperature) < 3 * found.error).all()
    ordinary = np.linalg.lstsq(noisy.mean(axis=0), image.ravel(), rcond=None)[0]
    deviation = brightness_temperature(scene.band, ordinary) - temperature
    assert deviation[0] > 0
    assert deviation[-1] < -5 * found.error[-1]


def test_covariance(draws):
    """Its diagonal holds the squared errors; a rank of 36 needs no more than its part."""
    whole = draws[0].covariance(np.arange(FACETS))
    assert np.sqrt(np.diag(whole)) == pytest.approx(draws[0].error, rel=1e-9)
    assert draws[0].covariance([7, 3]) == pytest.approx(whole[np.ix_([7, 3], [7, 3])], rel=1e-9)


def test_exact_images_of_the_same_paths_give_the_temperatures_back(matrices):
    """Every randomisation predicts its own image; their mean differs from each by the noise."""
    same = [
        replace(m, matrices=[m.mean] * 8, rest=m.rest.mean(axis=0) + 0 * m.rest) for m in matrices
    ]
    images = [matrix.radiance().mean(axis=0) for matrix in same]
    found = estimate_facets(same, images, 0.01)
    assert found.temperature == pytest.approx(matrices[0].temperature, abs=1e-6)
    assert np.abs(found.residuals).max() < 1e-6


def test_pixels_without_data_are_left_out(matrices, images, sigma):
    holed = [image.copy() for image in images]
    holed[0][4:8] = np.nan
    broken = [image.copy() for image in images]
    broken[0][4:8] = 1e6
    deviations = np.full((len(images), *images[0].shape), sigma)
    whole, part = (estimate_facets(matrices, data, sigma) for data in (images, holed))
    assert np.isnan(part.residuals[0][4:8]).all()
    assert (part.error > 0.99 * whole.error).all()
    assert part.error.sum() > whole.error.sum()
    deviations[0][4:8] = 1e12  # pixels of no weight are the same
    weak = estimate_facets(matrices, broken, deviations)
    assert weak.temperature == pytest.approx(part.temperature, abs=0.01)


def test_a_prior_serves_facets_that_no_pixel_sees(matrices, images, sigma):
    """The top views only: the facets of the lower half come from the prior alone."""
    one = [matrices[4]], [images[4]]
    with pytest.raises(InputError, match=r"facets reach no pixel \(\d+, .*give them a prior"):
        estimate_facets(*one, sigma)
    found = estimate_facets(*one, sigma, prior=(300.0, 5.0))
    unseen = np.asarray(matrices[4].mean.sum(axis=0)) == 0
    assert 0 < unseen.sum() < FACETS
    assert found.temperature[unseen] == pytest.approx(300, abs=1e-6)
    assert found.error[unseen] == pytest.approx(5, rel=1e-6)
    assert found.error[:SEGMENTS].max() < 0.2


def test_a_narrow_prior_holds(matrices, images, sigma):
    found = estimate_facets(matrices, images, sigma, prior=(TRUE + 1, 1e-6))
    assert found.temperature == pytest.approx(TRUE + 1, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m, i: (m, i[:3], 0.01), "3 images were given for 6 facet matrices"),
        (lambda m, i: (m, [i[0][:9], *i[1:]], 0.01), r"image 0 has the shape \(9, 16\)"),
        (lambda m, i: (m, i, 0.0), "image 0: the standard deviation of its noise is not positive"),
        (lambda m, i: (m, i, 0.01, (300.0, 0.0)), "prior's temperatures and standard deviations"),
        (lambda m, i: (m[:1], [np.full((16, 16), np.nan)], 0.01, None), "reach no pixel"),
    ],
)
def test_bad_input_is_one_line(matrices, images, change, message):
    with pytest.raises(InputError, match=message):
        estimate_facets(*change(matrices, images))


def test_too_few_randomisations(scene, images, sigma):
    with pytest.raises(InputError, match="have 2 randomisations; at least 4"):
        estimate_facets(views(scene, 0, spp=2, randomisations=2), images, sigma)


def test_more_facets_than_pixels(matrices, images, sigma):
    few = [np.where(np.arange(256).reshape(16, 16) % 50 == 30, image, np.nan) for image in images]
    with pytest.raises(InputError, match="36 temperatures are unknown|reach no pixel"):
        estimate_facets(matrices, few, sigma)
