"""Predictions near a render, and normal equations from products of independent randomisations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.answers import chi_square
from mi_lcair.knowing.inversion.least_squares import prediction
from mi_lcair.knowing.inversion.least_squares.prediction import (
    CommonNoise,
    Nuisances,
    cost_of,
    equations,
    weighed_product,
)
from mi_lcair.knowing.inversion.least_squares.solve import bad_pixels
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.knowing.inversion.blocks import block

SHARED = np.random.default_rng(8)
COUNTS = np.ones((6, 7), dtype=bool)
COUNTS[0, 0] = COUNTS[3, 4] = False
PIXELS = int(COUNTS.sum())
SIGMA, ROW, COLUMN, FRAME = 0.3, 2.0, 0.5, 1.5
COMMON = CommonNoise.of_image(COUNTS, SIGMA, ROW, COLUMN, FRAME)
RANDOM = np.random.default_rng(5)
R, N, K = 4, 6, 3
RADIANCE = 5 + RANDOM.random((R, N))
COLUMNS = RANDOM.normal(size=(R, N, K))
MEASURED = 6 + RANDOM.random(N)
WEIGHT = 0.5 + RANDOM.random(N)
X = np.array([0.2, -0.1, 0.4])
NOISY = block(RADIANCE, COLUMNS, MEASURED, 0.3, weight=WEIGHT)


def covariance():
    """Of all noise, from the definition: pixels of the same row, column and image."""
    rows, columns = np.nonzero(COUNTS)
    same_row = rows[:, None] == rows
    same_column = columns[:, None] == columns
    return SIGMA**2 * (np.eye(PIXELS) + ROW**2 * same_row + COLUMN**2 * same_column + FRAME**2)


def image(R=1, unknowns=3, **changes):
    radiance = 5 + 0.1 * SHARED.normal(size=(R, PIXELS))
    columns = np.tile(SHARED.normal(size=(PIXELS, unknowns)), (R, 1, 1))
    measured = 5 + SHARED.normal(size=PIXELS)
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
    b = SHARED.normal(size=(PIXELS, 2))
    result = weighed_product(one.weight, one.common, [kind(J)], [kind(b)])
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
        measured = 5 + root @ SHARED.normal(size=PIXELS)
        plain = block([np.full(PIXELS, 5.0)], [np.ones((PIXELS, 1))], measured, SIGMA)
        result = chi_square([image_of(plain)], np.zeros(1), 0.0)
        ratios.append(result["chi_square"] / result["degrees_of_freedom"])
    assert np.mean(ratios) == pytest.approx(1, abs=4 * np.sqrt(2 / PIXELS / 400))


def image_of(plain, **changes):
    return replace(plain, common=COMMON, **changes)


def test_a_stripe_is_no_row_of_bad_pixels():
    """A row that is five of its standard errors off, and one pixel that is bad."""
    measured = 5 + SIGMA * SHARED.normal(size=PIXELS)
    row = np.nonzero(COUNTS)[0] == 2
    measured[row] += 5 * ROW * SIGMA
    measured[20] += 12 * SIGMA
    plain = block([np.full(PIXELS, 5.0)], [np.ones((PIXELS, 1))], measured, SIGMA, is_image=True)
    weight = plain.weight
    assert np.flatnonzero(bad_pixels(image_of(plain), np.zeros(1), weight)[0]).tolist() == [20]
    assert bad_pixels(plain, np.zeros(1), weight)[0][row].any()


def other_pairs():
    return [(r, s) for r in range(R) for s in range(R) if r != s]


def test_a_linear_prediction():
    """From the values at which it was rendered."""
    predicted = replace(NOISY, reference=np.array([0.5, -0.2, 0.3])).at(X + [0.5, -0.2, 0.3])
    expected = RADIANCE + np.einsum("rnk,k->rn", COLUMNS, X)
    np.testing.assert_allclose(predicted.radiance, expected)
    np.testing.assert_allclose(predicted.mean, expected.mean(axis=0))
    np.testing.assert_allclose(predicted.variance, expected.std(axis=0, ddof=1) ** 2 / R)
    np.testing.assert_allclose(predicted.noise, 0.3)
    np.testing.assert_allclose(predicted.residuals, MEASURED - expected)


def test_a_temperature_is_followed_exactly():
    """Radiance goes with Planck's law, and the column with its derivative there."""
    LWIR = band("LWIR")
    B = lambda T: in_band_radiance(LWIR, np.array([T]))[0]
    slope = (B(300.5) - B(299.5)) / 1.0
    hot = block(
        [[2 + B(300.0)]],
        [[[slope]]],
        [0.0],
        reference=np.array([300.0]),
        band=LWIR,
        is_temperature=np.array([True]),
    )
    predicted = hot.at(np.array([360.0]))
    assert predicted.radiance[0, 0] == pytest.approx(2 + B(360.0), rel=1e-4)
    assert predicted.columns[0][0, 0] == pytest.approx(B(360.5) - B(359.5), rel=1e-4)


@pytest.mark.parametrize("is_sparse", [False, True])
def test_gain_and_offset(is_sparse):
    """gain (F + J x) + offset, with columns gain J, F + J x and 1."""
    camera = replace(NOISY, gain=3, offset=4)
    if is_sparse:
        camera = replace(camera, columns=[csr_array(J) for J in COLUMNS])
    predicted = camera.at(np.append(X, [1.1, -0.5]))
    plain = RADIANCE + np.einsum("rnk,k->rn", COLUMNS, X)
    np.testing.assert_allclose(predicted.radiance, 1.1 * plain - 0.5)
    assert predicted.unknown.tolist() == [0, 1, 2, 3, 4]
    expected = np.concatenate(
        [1.1 * COLUMNS, plain[..., None], np.ones((R, N, 1))],
        axis=2,
    )
    for J, wanted in zip(predicted.columns, expected):
        np.testing.assert_allclose(J.toarray() if is_sparse else J, wanted)


def test_nuisances():
    """Relative to each predicted value, or to their mean, behind other shared errors."""
    patterns = np.array([[0.1, 0.2], [0.3, 0.4]])
    errors = Nuisances(["a", "b"], ["a", "b"], patterns, np.array([False, True]))
    predicted = np.array([2.0, 6.0])
    expected = [[0.2, 0.8], [1.8, 1.6]]
    np.testing.assert_allclose(errors.added_to(None, predicted).columns, expected)
    rows = CommonNoise(csr_array([[1.0], [1.0]]))
    columns = errors.added_to(rows, predicted).columns.toarray()
    np.testing.assert_allclose(columns, np.hstack([[[1], [1]], expected]))


def test_sizes_of_shared_errors():
    """The estimate with a prior of 1 and noise of 1 / sqrt(w), from the normal equations."""
    columns, values = RANDOM.normal(size=(N, 2)), RANDOM.normal(size=N)
    W = np.diag(WEIGHT)
    expected = np.linalg.solve(np.eye(2) + columns.T @ W @ columns, columns.T @ W @ values)
    np.testing.assert_allclose(CommonNoise(columns).sizes(WEIGHT, values), expected)
    left = values - columns @ expected
    shared = block([np.zeros(N)], np.zeros((1, N, 1)), values, common=CommonNoise(columns))
    found = replace(shared, weight=WEIGHT).at(np.zeros(1)).without_common(values)
    np.testing.assert_allclose(found, left)


def test_values_within_the_half_width_are_equal():
    """A measured value 1 +- 0.2 against predictions of 1.1 and 1.5."""
    goal = block([[1.1, 1.5]], np.zeros((1, 2, 1)), [1.0, 1.0], half_width=0.2)
    np.testing.assert_allclose(goal.at(np.zeros(1)).residuals, [[0.0, -0.3]])


def test_products_of_different_randomisations():
    expected = np.mean(
        [COLUMNS[r].T @ np.diag(WEIGHT) @ COLUMNS[s] for r, s in other_pairs()], axis=0
    )
    np.testing.assert_allclose(prediction.product(list(COLUMNS), WEIGHT, list(COLUMNS)), expected)
    exact = prediction.product([COLUMNS[0]], WEIGHT, [COLUMNS[1]])
    np.testing.assert_allclose(exact, COLUMNS[0].T @ np.diag(WEIGHT) @ COLUMNS[1])


@pytest.mark.parametrize("is_sparse", [False, True])
def test_normal_equations(is_sparse):
    """Of two data that share an unknown, each term from the definition."""
    second = replace(NOISY, measured=MEASURED + 1, unknown=np.array([1, 3, 4]))
    x, blocks = np.array([0.2, -0.1, 0.4, 0.3, -0.6]), [NOISY, second]
    if is_sparse:
        blocks = [replace(b, columns=[csr_array(J) for J in COLUMNS]) for b in blocks]
    found = prediction.equations(blocks, x, is_sparse)
    W, mean = np.diag(WEIGHT), COLUMNS.mean(axis=0)
    matrix = np.mean([COLUMNS[r].T @ W @ COLUMNS[s] for r, s in other_pairs()], axis=0)
    expected = np.zeros((4, 5, 5))
    gradient = np.zeros(5)
    for measured, of in ((MEASURED, [0, 1, 2]), (MEASURED + 1, [1, 3, 4])):
        F = RADIANCE + np.einsum("rnk,k->rn", COLUMNS, x[of])
        gradient[of] += np.mean(
            [COLUMNS[r].T @ W @ (measured - F[s]) for r, s in other_pairs()], axis=0
        )
        for k, variance in ((1, 0.09 + F.var(axis=0, ddof=1) / R), (2, np.full(N, 0.09))):
            expected[k][np.ix_(of, of)] += mean.T @ np.diag(WEIGHT**2 * variance) @ mean
        expected[0][np.ix_(of, of)] += matrix
    for name, wanted in zip(("matrix", "noise", "measured_noise"), expected):
        value = getattr(found, name)
        np.testing.assert_allclose(
            value.toarray() if is_sparse else value, wanted, atol=1e-12, err_msg=name
        )
    np.testing.assert_allclose(found.gradient, gradient)
    if not is_sparse:
        transfer = expected[0].T @ np.linalg.inv(expected[1])
        np.testing.assert_allclose(found.transfer, transfer, rtol=1e-6)
        both = transfer @ expected[0]
        np.testing.assert_allclose(found.information, (both + both.T) / 2, rtol=1e-6)
        np.testing.assert_allclose(found.pull, transfer @ gradient, rtol=1e-6)


def test_equations_of_few_values_have_a_lower_rank():
    """One value cannot separate two unknowns, and the inverse leaves their difference out."""
    found = prediction.equations([block([[1.0]], [[[2.0, 2.0]]], [3.0], 0.5)], np.zeros(2))
    np.testing.assert_allclose(found.information, 16 * np.ones((2, 2)))
    np.testing.assert_allclose(found.pull, [16, 16])  # 2 (3 - 1) / 0.25


def test_equations_that_are_not_finite_are_refused():
    broken = np.full((2, 2), np.nan)
    found = prediction.Equations(np.eye(2), np.zeros(2), broken, broken)
    with pytest.raises(InputError, match="cannot be predicted, because an unknown is almost 0"):
        found.pull  # noqa: B018


def test_a_direction_of_rounding_errors_has_no_pressure():
    """Its gradient is 9 of its standard errors, which count if nothing else is known of it."""
    noise = np.diag([4.0, 1e-9])
    found = prediction.Equations(noise, np.array([2.0, 9e-4 * np.sqrt(0.1)]), noise, noise)
    assert found.pressure(np.ones(2))(found) == pytest.approx(1)
    assert found.pressure(np.array([1, 1e-6]))(found) == pytest.approx(1 + 81)


def test_cost():
    """The sum of weighted squared residuals, also from different randomisations."""
    F = RADIANCE + np.einsum("rnk,k->rn", COLUMNS, X)
    r = MEASURED - F
    expected = np.mean([np.sum(WEIGHT * r[a] * r[b]) for a, b in other_pairs()])
    assert prediction.cost_of([NOISY, NOISY], X) == pytest.approx(2 * expected)


def test_derivatives_below_their_noise_are_hidden():
    """Of three unknowns one has a derivative, one noise alone, and one none at all."""
    random = np.random.default_rng(1)
    columns = np.zeros((8, 50, 3))
    columns[..., 0] = 1 + 0.1 * random.normal(size=(8, 50))
    columns[..., 1] = 0.1 * random.normal(size=(8, 50))
    blocks = [block(np.ones((8, 50)), columns, np.ones(50))]
    assert prediction.hidden(blocks, 3).tolist() == [False, True, False]
    assert not prediction.hidden([replace(blocks[0], columns=blocks[0].columns[:2])], 3).any()
    kept = prediction.without(blocks[0], np.array([False, True, False]))
    np.testing.assert_array_equal(kept.columns[3][:, 1], 0)
    np.testing.assert_array_equal(kept.columns[3][:, 0], columns[3][:, 0])


def test_the_limit_of_hidden_is_three_standard_errors():
    """The jackknife error of the squared derivative, computed with one randomisation left out."""
    random = np.random.default_rng(3)
    J = 0.12 + 0.3 * random.normal(size=(6, 40, 30))
    weight = 0.5 + random.random(40)
    squared = lambda part: np.mean(
        [
            weight @ (part[r] * part[s])
            for r in range(len(part))
            for s in range(len(part))
            if r != s
        ],
        axis=0,
    )
    parts = np.array([squared(np.delete(J, r, axis=0)) for r in range(6)])
    error = np.sqrt(5 / 6 * np.sum((parts - parts.mean(axis=0)) ** 2, axis=0))
    expected = squared(J) < 3 * error
    assert 5 < expected.sum() < 28
    found = prediction.hidden([block(np.ones((6, 40)), J, np.ones(40), weight=weight)], 30)
    np.testing.assert_array_equal(found, expected)


def test_a_single_randomisation_has_no_noise():
    assert prediction.variance_of_mean(np.array([[1.0, 2.0]])).tolist() == [0, 0]
    assert prediction.variance_of_mean(np.array([[1.0], [3.0]])).tolist() == [1.0]
