"""Noise that pixels share, against dense covariances."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from mi_lcair.inversion.answers import chi_square
from mi_lcair.inversion.least_squares.bad_pixels import bad_pixels
from mi_lcair.inversion.least_squares.common_noise import CommonNoise
from mi_lcair.inversion.least_squares.prediction import cost_of, equations, weighed_product
from tests.inversion.blocks import block

RANDOM = np.random.default_rng(8)
COUNTS = np.ones((6, 7), dtype=bool)
COUNTS[0, 0] = COUNTS[3, 4] = False
PIXELS = int(COUNTS.sum())
SIGMA, ROW, COLUMN, FRAME = 0.3, 2.0, 0.5, 1.5
COMMON = CommonNoise.of_image(COUNTS, SIGMA, ROW, COLUMN, FRAME)


def covariance():
    """Of all noise, from the definition: pixels of the same row, column and image."""
    rows, columns = np.nonzero(COUNTS)
    same_row = rows[:, None] == rows
    same_column = columns[:, None] == columns
    return SIGMA**2 * (np.eye(PIXELS) + ROW**2 * same_row + COLUMN**2 * same_column + FRAME**2)


def image(R=1, unknowns=3, **changes):
    radiance = 5 + 0.1 * RANDOM.normal(size=(R, PIXELS))
    columns = np.tile(RANDOM.normal(size=(PIXELS, unknowns)), (R, 1, 1))
    measured = 5 + RANDOM.normal(size=PIXELS)
    return block(radiance, columns, measured, SIGMA, common=COMMON, **changes)


def test_groups_without_noise_are_left_out():
    assert CommonNoise.of_image(COUNTS, SIGMA, 0, 0, 0) is None
    rows = CommonNoise.of_image(COUNTS, SIGMA, 2.0, 0, 0).columns.toarray()
    assert rows.shape == (PIXELS, 6) and set(rows.ravel()) == {0, 2 * SIGMA}
    assert (rows[:6, 0] == 2 * SIGMA).all() and rows[:, 0].sum() == pytest.approx(12 * SIGMA)


@pytest.mark.parametrize("kind", [np.asarray, csr_array])
def test_products_have_the_inverse_covariance(kind):
    one, W = image(), np.linalg.inv(covariance())
    (J,) = one.columns
    b = RANDOM.normal(size=(PIXELS, 2))
    result = weighed_product(one, [kind(J)], [kind(b)])
    np.testing.assert_allclose(result, J.T @ W @ b, rtol=1e-9)
    residual = one.measured - one.radiance[0]
    assert cost_of([one], np.zeros(3)) == pytest.approx(residual @ W @ residual, rel=1e-9)
    # The best estimate of the noise that each pixel has for itself
    own = SIGMA**2 * W @ residual
    removed = COMMON.removed(one.weight, kind(residual[:, None]))
    np.testing.assert_allclose(removed[:, 0], own, rtol=1e-9)


def test_randomisations_are_not_multiplied_with_themselves():
    one, W = image(R=3), np.linalg.inv(covariance())
    r = one.measured - one.radiance
    pairs = [a @ W @ b for k, a in enumerate(r) for i, b in enumerate(r) if i != k]
    assert cost_of([one], np.zeros(3)) == pytest.approx(np.mean(pairs), rel=1e-9)


def test_equations():
    """Without noise of the render they are those of generalised least squares."""
    one, W = image(), np.linalg.inv(covariance())
    (J,) = one.columns
    normal = equations([one], np.zeros(3))
    np.testing.assert_allclose(normal.matrix, J.T @ W @ J, rtol=1e-9)
    np.testing.assert_allclose(normal.noise, J.T @ W @ J, rtol=1e-9)
    np.testing.assert_allclose(normal.measured_noise, J.T @ W @ J, rtol=1e-9)
    np.testing.assert_allclose(
        normal.gradient, J.T @ W @ (one.measured - one.radiance[0]), rtol=1e-9
    )
    # Weights that are not the inverse variance: the covariance of the gradient in full
    w = 0.4 * one.weight
    other = equations([replace(one, weight=w)], np.zeros(3))
    U = COMMON.columns.toarray()
    operator = np.linalg.inv(np.diag(1 / w) + U @ U.T)
    expected = J.T @ operator @ covariance() @ operator @ J
    np.testing.assert_allclose(other.noise, expected, rtol=1e-9)
    np.testing.assert_allclose(other.measured_noise, expected, rtol=1e-9)
    total = np.trace(operator @ covariance())
    share = COMMON.expected(w, np.full(PIXELS, SIGMA**2))
    assert 0.4 * PIXELS + share == pytest.approx(total, rel=1e-9)
    assert COMMON.expected(one.weight, np.full(PIXELS, SIGMA**2)) == pytest.approx(0, abs=1e-9)


def test_chi_square_of_shared_noise():
    """Of residuals with the stated covariance: as large as the number of values, in 400 draws."""
    root = np.linalg.cholesky(covariance())
    ratios = []
    for _ in range(400):
        measured = 5 + root @ RANDOM.normal(size=PIXELS)
        plain = block([np.full(PIXELS, 5.0)], [np.ones((PIXELS, 1))], measured, SIGMA)
        result = chi_square([image_of(plain)], np.zeros(1), 0.0)
        ratios.append(result["chi_square"] / result["degrees_of_freedom"])
    assert np.mean(ratios) == pytest.approx(1, abs=4 * np.sqrt(2 / PIXELS / 400))


def image_of(plain, **changes):
    return replace(plain, common=COMMON, **changes)


def test_a_stripe_is_no_row_of_bad_pixels():
    """A row that is five of its standard errors off, and one pixel that is bad."""
    measured = 5 + SIGMA * RANDOM.normal(size=PIXELS)
    row = np.nonzero(COUNTS)[0] == 2
    measured[row] += 5 * ROW * SIGMA
    measured[20] += 12 * SIGMA
    plain = block([np.full(PIXELS, 5.0)], [np.ones((PIXELS, 1))], measured, SIGMA, is_image=True)
    weight = plain.weight
    assert np.flatnonzero(bad_pixels(image_of(plain), np.zeros(1), weight)[0]).tolist() == [20]
    assert bad_pixels(plain, np.zeros(1), weight)[0][row].any()
