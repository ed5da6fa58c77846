"""Solutions of linear problems against least squares in closed form; bad pixels."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq, least_squares, minimize_scalar
from scipy.sparse import csr_array

from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.invert import determined
from mi_lcair.knowing.inversion.least_squares.newton import Prior, is_informed, length, matern
from mi_lcair.knowing.inversion.least_squares.newton import solved as damped
from mi_lcair.knowing.inversion.least_squares.prediction import (
    DatumBlock,
    Equations,
    Weighing,
    equations,
    without,
)
from mi_lcair.knowing.inversion.least_squares.solve import (
    ROUNDS,
    WIDTH,
    BadPixelSearch,
    Profile,
    bad_pixels,
    covariances,
    feasible,
    profile_intervals,
    solve,
    with_held,
    with_noise,
)
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, in_band_slope
from tests.knowing.inversion.blocks import LWIR, SKY, VALUES, block, kelvin, unknown, wall

N, PIXEL_SIGMA = 2000, 0.3
NOISE = PIXEL_SIGMA * np.random.default_rng(3).normal(size=N)
WEIGHT = np.full(N, PIXEL_SIGMA**-2.0)
RANDOM = np.random.default_rng(7)
J = RANDOM.normal(size=(20, 2))
TRUE, SIGMA = np.array([0.4, 0.7]), 0.1
MEASURED = 2 + J @ TRUE + SIGMA * RANDOM.normal(size=20)
EXACT = block([np.full(20, 2.0)], [J], MEASURED, SIGMA)
PAINTS = [unknown("a", prior=(0.5, 0.05)), unknown("b")]


def found(measured, is_image=True):
    image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, PIXEL_SIGMA, is_image=is_image)
    return bad_pixels(image, np.zeros(1), WEIGHT)


def test_noise_alone_has_no_bad_pixels():
    """In 200 draws about 5 % have one, as stated."""
    random = np.random.default_rng(0)
    alarms = sum(found(PIXEL_SIGMA * random.normal(size=N))[0].any() for _ in range(200))
    assert stats.binomtest(alarms, 200, 0.05).pvalue > 1e-3


def test_pixels_far_from_the_prediction_are_listed():
    limit = PIXEL_SIGMA * stats.norm.isf(0.025 / N)
    measured = np.clip(NOISE, -0.9 * limit, 0.9 * limit)
    measured[[5, 700, 1999]] = 1.05 * limit, -1.05 * limit, 1e6
    is_bad, are_many = found(measured)
    assert np.flatnonzero(is_bad).tolist() == [5, 700, 1999] and not are_many
    assert not found(measured, is_image=False)[0].any()


def test_the_limit_follows_the_median_of_the_residuals():
    """Residuals four times as large: the same pixels count as noise, and an outlier does not."""
    limit = PIXEL_SIGMA * stats.norm.isf(0.025 / N)
    measured = 4 * np.clip(NOISE, -0.9 * limit, 0.9 * limit)
    measured[9] = 4.6 * limit
    is_bad, are_many = found(measured)
    assert np.flatnonzero(is_bad).tolist() == [9] and are_many


def test_of_many_pixels_the_worst_are_listed():
    measured = NOISE.copy()
    measured[:400] = np.linspace(10, 50, 400)
    is_bad, are_many = found(measured)
    assert are_many and np.flatnonzero(is_bad).tolist() == list(range(300, 400))


def test_a_search_ends_when_it_finds_the_same_pixels():
    """Their weights are 0, those of others stay."""
    measured = 0 * NOISE
    measured[7] = 100.0
    image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, PIXEL_SIGMA, is_image=True)
    search, x, weighings = BadPixelSearch([image]), np.zeros(1), [Weighing(WEIGHT)]
    assert search.continues([image], x, weighings) and not search.continues([image], x, weighings)
    (weighed,) = search.weighed([image], weighings)
    assert np.flatnonzero(weighed.weight != WEIGHT).tolist() == [7] and weighed.weight[7] == 0


def test_a_search_gives_up_where_residuals_are_large_everywhere():
    """Other pixels are bad in each round; after the last one none is."""
    search, x, count = BadPixelSearch([block([NOISE], np.zeros((1, N, 1)), NOISE)]), np.zeros(1), 0
    random = np.random.default_rng(1)
    while True:
        measured = 100 * PIXEL_SIGMA * random.normal(size=N)
        measured[random.integers(N)] = 1e9
        image = block(np.zeros((2, N)), np.zeros((2, N, 1)), measured, PIXEL_SIGMA, is_image=True)
        count += 1
        if not search.continues([image], x, [Weighing(WEIGHT)]):
            break
    assert count == ROUNDS + 1 and not search.bad[0].any()


def solved(blocks, unknowns, is_exact=True, iterations=5, **options):
    weights = [Weighing(one.weight, one.common) for one in blocks]
    return solve(unknowns, lambda x: blocks, lambda x: weights, is_exact, iterations, **options)


def test_a_held_unknown_widens_the_errors_of_others():
    """It shifts them by what its effect has in common with theirs, times what is known of it."""
    state = solved([without(EXACT, np.array([False, True]))], PAINTS)
    width = np.array([1.0, 0.2])
    found = with_held(state, [EXACT], np.array([False, True]), width)
    alone = J[:, 0] @ J[:, 0] / SIGMA**2 + Prior.of(PAINTS).information[0]
    shift = 0.2 * J[:, 0] @ J[:, 1] / SIGMA**2 / alone
    np.testing.assert_allclose(found.covariance[0, 0], 1 / alone + shift**2, rtol=1e-6)
    assert found.covariance[0, 0] > 1.2 * state.covariance[0, 0]
    assert found.covariance[1, 1] == pytest.approx(state.covariance[1, 1])


def test_further_errors_widen_intervals():
    """3 and 5 standard errors of a profile's ends, and 4 more of another error."""
    state = solved([EXACT], PAINTS)
    ends = state.x[:, None] + WIDTH * np.array([[-3.0, 4.0], [np.nan, np.nan]])
    wide = replace(state, intervals=ends).widened(np.diag([16.0, 1.0]))
    far = wide.intervals - state.x[:, None]
    np.testing.assert_allclose(far, WIDTH * np.array([[-5.0, 32**0.5], [np.nan, np.nan]]))
    np.testing.assert_allclose(wide.covariance - state.covariance, np.diag([16.0, 1.0]))
    # They do not change what the data determine, which chi-square counts
    assert determined(wide) == determined(state) == pytest.approx(2, abs=0.5)


def test_least_squares_with_priors():
    """(J^T J / sigma^2 + P) x = J^T (y - 2) / sigma^2 + P m; without a prior the span is one."""
    P, mean = np.diag([0.05**-2.0, 1.0]), np.array([0.5, 0.3])
    inverse = np.linalg.inv(J.T @ J / SIGMA**2 + P)
    state = solved([EXACT], PAINTS)
    np.testing.assert_allclose(
        state.x, inverse @ (J.T @ (MEASURED - 2) / SIGMA**2 + P @ mean), rtol=1e-6
    )
    np.testing.assert_allclose(state.covariance, inverse, rtol=1e-6)
    np.testing.assert_allclose(state.prior, np.diag(P))
    assert state.converged and state.renders == 2  # the first guess predicts half of the values
    assert state.at_bound.tolist() == [0, 0] and not state.held.any()
    np.testing.assert_allclose(state.render_share, 0, atol=1e-9)


def test_a_render_that_must_be_repeated():
    """A prediction 2 + J x^2, linear about each render, against the solution of x^2."""
    rendered = []

    def render(x):
        rendered.append(x)
        columns = [2 * J * x]
        return [replace(EXACT, radiance=np.array([2 + J @ x**2]), columns=columns, reference=x)]

    unknowns = [unknown("a"), unknown("b")]
    done = []
    state = solve(
        unknowns,
        render,
        lambda x: [Weighing(EXACT.weight)],
        False,
        30,
        lambda *counts: done.append(counts),
    )
    squared = np.linalg.lstsq(J, MEASURED - 2, rcond=None)[0]
    np.testing.assert_allclose(state.x, np.sqrt(squared), rtol=5e-3)
    assert state.converged and 3 < state.renders == len(rendered) < 20
    assert done == [(k, 30) for k in range(1, len(rendered) + 1)]
    once = solve(unknowns, render, lambda x: [Weighing(EXACT.weight)], False, 1)
    assert not once.converged and once.renders == 1


def test_convergence_where_paths_change_with_the_values():
    """2 + J x^2 with a noise of the render ten times that of the measurement.

    A thousandth of the paths differs between two renders. The cost then changes by more than a
    last step changes it, and only the gradient shows the way.
    """
    shape, random = (4, 20), np.random.default_rng(1)
    fixed = 10 * SIGMA * random.normal(size=shape)

    def render(x):
        other = np.random.default_rng(x.view(np.uint32)).normal(size=shape)
        F = 2 + J @ x**2 + fixed + 10 * SIGMA * np.sqrt(1e-3) * other
        columns = list(np.broadcast_to(2 * J * x, (4, *J.shape)))
        return [replace(EXACT, radiance=F, columns=columns, reference=x)]

    weight = np.full(20, 1 / (26 * SIGMA**2))
    for start in (0.3, 0.5, 0.9):
        both = [unknown("a", start=start), unknown("b", start=start)]
        state = solve(both, render, lambda x: [Weighing(weight)], False, 20)
        assert state.converged and state.trace[-1].renders < 12
        error = np.sqrt(np.diag(state.covariance))
        assert (np.abs(state.x - np.sqrt([0.4, 0.7])) < 4 * error).all()


def test_convergence_where_each_render_has_other_noise():
    """2 + J x in renders whose noise is three times that of the measurement: errors are as stated.

    The paths across an edge that a motion moves differ in all renders. No step then leads to values
    whose next step is short.
    """
    random, deviations = np.random.default_rng(2), []
    for _ in range(40):
        measured = 2 + J @ TRUE + SIGMA * random.normal(size=20)

        def render(x, measured=measured):
            F = 2 + J @ x + 3 * np.sqrt(8) * SIGMA * random.normal(size=(8, 20))
            return [replace(EXACT, radiance=F, columns=[J] * 8, measured=measured, reference=x)]

        weight = np.full(20, 1 / (10 * SIGMA**2))
        both = [unknown("a", lower=-9.0, upper=9.0), unknown("b", lower=-9.0, upper=9.0)]
        state = solve(both, render, lambda x, of=weight: [Weighing(of)], False, 20)
        assert state.converged
        deviations.append((state.x - TRUE) / np.sqrt(np.diag(state.covariance)))
    assert 0.7 < np.std(deviations) < 1.2  # values where two renders agree are better than one


def test_a_derivative_that_becomes_noise_on_the_way():
    """Where the solution's derivatives are noise, the unknown goes back and is not determined."""
    random = np.random.default_rng(3)
    measured = 2 + J @ [0.4, -0.1]  # beyond the bound 0

    def render(x):
        columns = [J for _ in range(4)]
        if x[1] < 0.25:
            columns = [np.column_stack([J[:, 0], 30 * random.normal(size=20)]) for _ in range(4)]
        noisy = [2 + J @ x + 0.01 * random.normal(size=20) for _ in range(4)]
        made = block(noisy, columns, measured, SIGMA)
        return [replace(made, reference=x)]

    unknowns = [unknown("a"), unknown("b", start=0.5)]
    state = solve(unknowns, render, lambda x: [Weighing(np.full(20, SIGMA**-2.0))], False, 20)
    assert state.converged and state.held.tolist() == [False, True]
    assert state.x[1] == pytest.approx(0.5, rel=1e-12) and np.isnan(state.intervals[1]).all()
    assert state.covariance[1, 1] == pytest.approx(unknowns[1].span ** 2, rel=1e-6)


def test_a_value_stops_at_its_bound():
    narrow = [replace(PAINTS[0], prior=None, upper=0.2), unknown("b")]
    state = solved([EXACT], narrow)
    assert state.x[0] == 0.2 and state.at_bound.tolist() == [1, 0]
    # The other one is the least-squares solution with the first at its bound
    P, y = 1.0, MEASURED - 2 - 0.2 * J[:, 0]
    expected = (J[:, 1] @ y / SIGMA**2 + 0.3 * P) / (J[:, 1] @ J[:, 1] / SIGMA**2 + P)
    assert state.x[1] == pytest.approx(expected, rel=1e-6)
    state = solved([EXACT], [replace(PAINTS[0], prior=None, lower=0.8), unknown("b")])
    assert state.x[0] == 0.8 and state.at_bound.tolist() == [-1, 0]


def test_bounds_and_priors_of_unknowns():
    prior = Prior.of([kelvin(lower=0.0), unknown(prior=(0.4, 0.1)), kelvin(lower=250.0, upper=290)])
    np.testing.assert_allclose(prior.mean, [300, 0.4, 300])
    np.testing.assert_allclose(prior.information, [100**-2.0, 100, 40**-2.0])
    assert prior.lower.tolist() == [1, 0, 250] and prior.upper.tolist() == [np.inf, 1, 290]
    assert prior.cost(np.array([310, 0.5, 300])) == pytest.approx(0.01 + 1)


def test_length_of_a_step():
    """The root of step^T (information + prior) step."""
    normal = equations([EXACT], np.zeros(2))
    step, P = np.array([0.1, -0.2]), np.array([4.0, 9.0])
    prior = Prior(np.zeros(2), P, np.zeros(2), np.ones(2))
    expected = np.sqrt(step @ (J.T @ J / SIGMA**2 + np.diag(P)) @ step)
    assert length(step, normal, prior) == pytest.approx(expected)


@pytest.mark.parametrize("matrix_of", [np.asarray, csr_array], ids=["dense", "sparse"])
def test_damped_equations(matrix_of):
    """(M + P + D) step = right for what is free; of sparse equations also what the data know."""
    A, right = RANDOM.normal(size=(6, 3)), np.array([1.0, 2.0, 3.0])
    M, P, D = A.T @ A, np.array([0.5, 0.6, 0.7]), np.array([0.1, 0.2, 0.3])
    normal = Equations(matrix_of(M), np.zeros(3), matrix_of(M), matrix_of(M))
    prior = Prior(np.zeros(3), P, np.zeros(3), np.ones(3))
    free = np.array([True, True, False])
    expected = np.linalg.solve((M + np.diag(P + D))[:2, :2], right[:2])
    np.testing.assert_allclose(damped(normal, prior, D, right, free), [*expected, 0.0], rtol=1e-9)
    assert length(np.zeros(3), normal, prior) == 0


@pytest.mark.parametrize("mean, at_bound", [(0.35, [-1]), (0.8, [0])])
def test_a_prior_that_pulls_away_from_a_bound(mean, at_bound):
    """Data want 0.1 and the bound is 0.3: a strong prior decides whether the value stays there."""
    one = block([np.zeros(4)], [np.ones((4, 1))], np.full(4, 0.1), 1.0)
    state = solved([one], [unknown(lower=0.3, prior=(mean, 0.5))])
    assert state.at_bound.tolist() == at_bound
    assert state.x[0] == pytest.approx(max(0.3, (4 * 0.1 + 4 * mean) / 8))


def test_steps_that_no_surface_can_make_are_halved():
    def rendered(x):
        if x[0] > 0.3:
            raise InputError("too large")
        return "blocks"

    new, blocks = feasible(rendered, np.array([0.0]), np.array([1.0]))
    assert (new[0], blocks) == (0.25, "blocks")
    _, blocks = feasible(rendered, np.array([1.0]), np.array([2.0]))
    assert blocks is None


@pytest.mark.parametrize("length", [None, 5.0])
def test_facets_against_a_solver_of_scipy(length):
    """40 temperatures from 200 noisy values and their priors, 300 +- 100 K; no value sees the last.

    The noise is so large that the priors matter. With a correlation length the last follows its
    neighbours in a row of facets, 1 m apart.
    """
    LWIR, sigma, count = band("LWIR"), 20.0, 40
    start = np.full(count, 300.0)
    matrix = np.abs(RANDOM.normal(size=(200, count)))
    matrix[:, -1] = 0
    truth = 300 + 10 * RANDOM.normal(size=count)
    measured = matrix @ in_band_radiance(LWIR, truth) + sigma * RANDOM.normal(size=200)
    one = DatumBlock(
        measured=measured,
        noise=lambda predicted: np.full(200, sigma),
        radiance=np.array([matrix @ in_band_radiance(LWIR, start)]),
        columns=[csr_array(matrix * in_band_slope(LWIR, start))],
        unknown=np.arange(count),
        reference=start,
        band=LWIR,
        is_temperature=np.ones(count, dtype=bool),
        weight=np.full(200, sigma**-2.0),
    )
    facets = [kelvin(f"f[{k}]", name="f", kind="facet", facet=k) for k in range(count)]
    whiten = np.eye(count) / 100
    if length:
        facets = [
            replace(facet, centre=(k, 0.0, 0.0), correlation_m=length, prior=(300.0, 30.0))
            for k, facet in enumerate(facets)
        ]
        distance = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        correlation = matern(distance, length) + 1e-6 * np.eye(count)
        whiten = np.linalg.inv(np.linalg.cholesky(900 * correlation))
    state = solved([one], facets)

    def residuals(x):
        misfit = (matrix @ in_band_radiance(LWIR, x) - measured) / sigma
        return np.append(misfit, whiten @ (x - 300))

    expected = least_squares(residuals, start)
    assert np.ptp(expected.x) > 20
    np.testing.assert_allclose(state.x, expected.x, atol=0.5)
    # A facet without data stays, but for rounding of the linear solver
    assert (abs(state.x[-1] - 300) < 1e-9) == (length is None)
    inverse = np.linalg.inv(expected.jac.T @ expected.jac)
    np.testing.assert_allclose(np.diag(state.covariance), np.diag(inverse), rtol=0.02)
    np.testing.assert_allclose(state.covariance, inverse, atol=0.02 * inverse.max())
    np.testing.assert_allclose(state.render_share, 0, atol=1e-6)


def mixed_radiances(start: float) -> DatumBlock:
    """Noisy sums of the blackbody radiances of five temperatures, rendered at a first guess."""
    LWIR, random, first = band("LWIR"), np.random.default_rng(5), np.full(5, start)
    matrix = random.random((60, 5)) + 2 * np.eye(5)[random.integers(0, 5, 60)]
    truth = in_band_radiance(LWIR, np.linspace(220, 420, 5))
    return DatumBlock(
        measured=matrix @ truth + 0.3 * random.normal(size=60),
        noise=lambda predicted: np.full(60, 0.3),
        radiance=np.array([matrix @ in_band_radiance(LWIR, first)]),
        columns=[matrix * in_band_slope(LWIR, first)],
        unknown=np.arange(5),
        reference=first,
        band=LWIR,
        is_temperature=np.ones(5, dtype=bool),
        weight=np.full(60, 0.3**-2.0),
    )


@pytest.mark.parametrize("start", [60.0, 200.0, 700.0, 3000.0])
def test_temperatures_from_any_first_guess(start):
    """The prior's mean is 300 K for all of them, so that the solution is the same."""
    temperatures = [kelvin(f"s{k}", start=start, prior=(300.0, 100.0)) for k in range(5)]
    state = solved([mixed_radiances(start)], temperatures)
    expected = solved([mixed_radiances(300.0)], temperatures)
    error = np.sqrt(np.diag(expected.covariance))
    assert state.converged
    assert (np.abs(state.x - expected.x) < 0.03 * error).all()
    assert (np.abs(state.x - np.linspace(220, 420, 5)) < 4 * error).all()


def test_convergence_of_a_linear_problem_is_tested(monkeypatch):
    """A single step does not reach the solution from far away, and the state says so."""
    monkeypatch.setattr("mi_lcair.knowing.inversion.least_squares.newton.INNER", 1)
    temperatures = [kelvin(f"s{k}", start=3000.0) for k in range(5)]
    assert not solved([mixed_radiances(3000.0)], temperatures).converged


def test_share_of_the_render_in_the_variance():
    """Noise of the render as large as that of the measurement makes half of the variance."""
    random = np.random.default_rng(2)
    R, n = 8, 4000
    radiance = 2 + np.sqrt(R) * SIGMA * random.normal(size=(R, n))
    columns = np.broadcast_to(np.ones((n, 1)), (R, n, 1))
    noisy = block(radiance, columns, np.full(n, 2.3), SIGMA)
    state = solved([noisy], [unknown("a")])
    assert state.render_share[0] == pytest.approx(0.5, abs=0.03)
    assert state.covariance[0, 0] == pytest.approx(2 * SIGMA**2 / n, rel=0.05)


def test_covariance_of_dense_equations():
    """(M^T N^-1 M + P)^-1; without the render's noise, its spread N -> N_measured and P."""
    A = RANDOM.normal(size=(2, 2))
    M, N = A @ A.T + np.eye(2), np.diag([2.0, 3.0])
    measured, P = np.diag([1.0, 0.5]), np.array([0.3, 0.6])
    found, variance = covariances(
        Equations(M, np.zeros(2), N, measured), Prior(np.zeros(2), P, None, None)
    )
    T = M.T @ np.linalg.inv(N)
    inverse = np.linalg.inv(T @ M + np.diag(P))
    np.testing.assert_allclose(found, inverse)
    spread = inverse @ (T @ measured @ T.T + np.diag(P)) @ inverse.T
    np.testing.assert_allclose(variance, np.diag(spread))


def test_what_the_data_know_better_than_the_prior():
    """matrix^2 / noise is the information of the data."""
    normal = Equations(
        np.diag([2.0, 2.0, -2.0, 0.0]), np.zeros(4), np.diag([4.0, 4.0, 4.0, 0.0]), np.eye(4)
    )
    information = np.array([0.99, 1.01, 0.5, 0.5])
    assert is_informed(normal, information).tolist() == [True, False, False, False]


def test_noise_of_the_matrix_causes_no_bias():
    """Ordinary least squares with a matrix of noisy entries gives too small a contrast.

    The entries are 0..1, with a noise of 0.2 in each of eight matrices. The variance of their mean,
    0.005, is 6 % of the variance of an entry, and the contrast is about 6 % too small.
    """
    random, pixels, LWIR = np.random.default_rng(2), 192 * 192, band("LWIR")
    truth, start = np.linspace(200, 400, 5), np.full(5, 300.0)
    exact = random.random((pixels, 5))
    noisy = exact + 0.2 * random.normal(size=(8, pixels, 5))
    measured = exact @ in_band_radiance(LWIR, truth) + 0.01 * random.normal(size=pixels)
    block = DatumBlock(
        measured=measured,
        noise=lambda predicted: np.full(pixels, 0.01),
        radiance=np.array([one @ in_band_radiance(LWIR, start) for one in noisy]),
        columns=[csr_array(one * in_band_slope(LWIR, start)) for one in noisy],
        unknown=np.arange(5),
        reference=start,
        band=LWIR,
        is_temperature=np.ones(5, dtype=bool),
        weight=np.ones(pixels),
    )
    facets = [kelvin(f"f[{k}]", kind="facet", facet=k) for k in range(5)]
    found = solve(facets, lambda x: [block], lambda x: [Weighing(np.ones(pixels))], True, 1)
    error = np.sqrt(np.diag(found.covariance))
    assert (np.abs(found.x - truth) < 3 * error).all() and (error < 2).all()
    ordinary = np.linalg.lstsq(noisy.mean(axis=0), measured, rcond=None)[0]
    deviation = brightness_temperature(LWIR, ordinary) - truth
    assert deviation[0] > 0 and deviation[-1] < -5 * error[-1]


def test_errors_of_another_noise():
    """Four times the variance: as if solved with twice the noise, beside the same priors."""
    state = solved([EXACT], PAINTS)
    wider = replace(
        EXACT, weight=EXACT.weight / 4, noise=lambda predicted: np.full(len(predicted), 2 * SIGMA)
    )
    expected = solved([wider], PAINTS)
    scaled_state = with_noise(state, 4.0)
    np.testing.assert_allclose(scaled_state.covariance, expected.covariance, rtol=1e-6)
    intervals = np.array([[0.1, 0.8], [np.nan, np.nan]])
    ends = with_noise(replace(state, intervals=intervals), 4.0).intervals
    ratio = np.sqrt(expected.covariance[0, 0] / state.covariance[0, 0])
    np.testing.assert_allclose(ends[0] - state.x[0], ratio * (intervals[0] - state.x[0]), rtol=1e-6)
    assert np.isnan(ends[1]).all()


def test_a_render_s_noise_does_not_change_with_that_of_the_measurement():
    """A share s of the variance comes from the measurement: it becomes 1 + 3 s times as large."""
    shape = (4, 20)
    F = 2 + 0.2 * RANDOM.normal(size=shape)
    columns = list(np.broadcast_to(J, (4, *J.shape)))
    noisy = replace(EXACT, radiance=F, columns=columns, weight=np.full(20, 1 / (5 * SIGMA**2)))
    state = solved([noisy], [unknown("a", upper=9.0), unknown("b", upper=9.0)])
    share = 1 - state.render_share
    assert (share > 0.1).all() and (share < 0.9).all()
    wider = with_noise(state, 4.0)
    ratio = np.diag(wider.covariance) / np.diag(state.covariance)
    np.testing.assert_allclose(ratio, 1 + 3 * share, rtol=0.05)


# Profile-likelihood intervals against searches along closed forms
# ----------------------------------------------------------------

PROFILE_RANDOM = np.random.default_rng(3)
PROFILE_SIGMA, COUNT = 0.05, 30
DESIGN = PROFILE_RANDOM.normal(size=(COUNT, 2))


def product(x, measured):
    """A prediction that is linear in a, and in b with a slope that depends on a."""
    a, b = x
    radiance = DESIGN[:, 0] * a + DESIGN[:, 1] * (0.3 * b + a * b)
    columns = np.stack([DESIGN[:, 0] + DESIGN[:, 1] * b, DESIGN[:, 1] * (0.3 + a)], axis=1)
    weight = np.full(COUNT, PROFILE_SIGMA**-2.0)
    return block(
        [radiance], [columns], measured, PROFILE_SIGMA, reference=np.array(x), weight=weight
    )


def profile_solved(measured, unknowns):
    weights = [Weighing(np.full(COUNT, PROFILE_SIGMA**-2.0))]
    return solve(unknowns, lambda x: [product(x, measured)], lambda x: weights, False, 30)


def cost(x, measured, unknowns):
    residual = (measured - product(x, measured).radiance[0]) / PROFILE_SIGMA
    priors = [((v - u.prior[0]) / u.prior[1]) ** 2 for v, u in zip(x, unknowns) if u.prior]
    spans = [((v - u.start) / u.span) ** 2 for v, u in zip(x, unknowns) if not u.prior]
    return residual @ residual + sum(priors) + sum(spans)


def reference_ends(measured, unknowns, best, k):
    """Where the cost with the other unknown at its best is 1.96^2 higher, by scipy."""
    other = unknowns[1 - k]

    def profile(value):
        def at(y):
            return cost((value, y) if k == 0 else (y, value), measured, unknowns)

        options = {"bounds": (other.lower, other.upper), "method": "bounded"}
        return minimize_scalar(at, **options, options={"xatol": 1e-9}).fun

    top = profile(best[k]) + WIDTH**2
    ends = []
    for bound in (unknowns[k].lower, unknowns[k].upper):
        is_inside = profile(bound) <= top
        ends.append(bound if is_inside else brentq(lambda v: profile(v) - top, best[k], bound))
    return ends


@pytest.mark.parametrize("draw", range(6))
def test_intervals_are_those_of_the_profile(draw):
    random = np.random.default_rng(draw)
    truth = random.uniform((0.0, 0.0), (0.15, 1.0))
    measured = product(truth, None).radiance[0] + PROFILE_SIGMA * random.normal(size=COUNT)
    unknowns = [unknown("a", upper=2.0), unknown("b", start=0.5, upper=3.0)]
    if draw % 2:
        unknowns[0] = unknown("a", upper=2.0, prior=(0.1, 0.2))
    state = profile_solved(measured, unknowns)
    assert state.converged
    errors = np.sqrt(np.diag(state.covariance))
    linear = np.stack([state.x - WIDTH * errors, state.x + WIDTH * errors], axis=1)
    for k in range(2):
        expected = np.array(reference_ends(measured, unknowns, state.x, k))
        is_linear = np.isnan(state.intervals[k, 0])
        ends = linear[k] if is_linear else state.intervals[k]
        tolerance = (0.12 if is_linear else 0.04) * (expected[1] - expected[0])
        np.testing.assert_allclose(ends, expected, atol=tolerance)


def test_linear_intervals_stay():
    """Of a linear prediction within its bounds, of sparse equations, and of many unknowns."""
    unknowns = [unknown("a", prior=(0.5, 0.1)), unknown("b")]
    measured = 5 + DESIGN @ [0.5, 0.5]
    weight = np.full(COUNT, PROFILE_SIGMA**-2.0)
    exact = block([np.full(COUNT, 5.0)], [DESIGN], measured, PROFILE_SIGMA, weight=weight)
    state = solve(unknowns, lambda x: [exact], lambda x: [Weighing(weight)], True, 1)
    assert np.isnan(state.intervals).all()
    assert state.renders <= 2
    # At a bound both depend on it, without a render
    narrow = [unknown("a", upper=0.49), unknown("b")]
    state = solve(narrow, lambda x: [exact], lambda x: [Weighing(weight)], True, 1)
    assert state.at_bound.tolist() == [1, 0] and state.intervals[0, 1] == 0.49
    assert np.isfinite(state.intervals).all() and state.renders <= 2
    thin = replace(exact, columns=[csr_array(DESIGN)])
    prior = Prior.of(narrow)
    quiet = np.zeros(2, dtype=bool)
    ends = profile_intervals([thin], state.x, prior, state.covariance, quiet, None)
    assert np.isnan(ends).all()


def test_a_profile_has_the_errors_of_the_estimate():
    """The rise of the cost is compared with that of one standard error of the estimate."""
    measured = 5 + DESIGN @ [0.5, 0.5]
    weight = np.full(COUNT, PROFILE_SIGMA**-2.0)
    exact = block([np.full(COUNT, 5.0)], [DESIGN], measured, PROFILE_SIGMA, weight=weight)
    x, prior = np.array([0.5, 0.5]), Prior.of([unknown("a"), unknown("b")])
    for factor in (4, 0.25):  # errors twice and half as large
        covariance = factor * np.linalg.inv(DESIGN.T @ DESIGN / PROFILE_SIGMA**2)
        direction = covariance[0] / np.sqrt(covariance[0, 0])
        profile = Profile([exact], x, prior, 0, direction, equations([exact], x))
        assert profile.rise_of_error == pytest.approx(factor, rel=0.01)
        assert profile.errors([exact], x + 1.5 * direction) == pytest.approx(1.5, rel=0.01)
        for side in (-1, 1):
            assert profile.straight_end(side) == pytest.approx(0.5 + side * WIDTH * direction[0])


def test_noise_of_other_renders_does_not_end_a_profile():
    """It raises the cost by 30, and an interval ends where the cost is 3.84 higher."""
    truth = np.array([0.05, 0.5])
    unknowns = [unknown("a", upper=2.0), unknown("b", start=0.5, upper=3.0)]
    widths = []
    for draw in range(20):
        random = np.random.default_rng(draw)
        measured = product(truth, None).radiance[0] + PROFILE_SIGMA * random.normal(size=COUNT)
        state = profile_solved(measured, unknowns)
        expected = reference_ends(measured, unknowns, state.x, 0)

        def noisy(x, random=random, measured=measured):
            clean = product(x, measured)
            return [
                replace(clean, radiance=clean.radiance + PROFILE_SIGMA * random.normal(size=COUNT))
            ]

        errors = np.sqrt(state.covariance[0, 0])
        profile = Profile(
            state.blocks,
            state.x,
            Prior.of(unknowns),
            0,
            state.covariance[0] / errors,
            equations(state.blocks, state.x),
        )
        width = profile.end(1, noisy) - state.x[0]
        widths.append(width / (expected[1] - state.x[0]))
    assert widths == pytest.approx(np.ones(20), abs=0.1)


def test_values_that_no_surface_can_have_end_a_profile():
    measured = product((0.05, 0.5), None).radiance[0]
    unknowns = [unknown("a"), unknown("b")]
    state = profile_solved(measured, unknowns)

    def refused(x):
        raise InputError("epsilon + rho_d above G(b)")

    prior = Prior.of(unknowns)
    noise = state.blocks, state.x, prior, state.covariance, np.zeros(2, dtype=bool)
    ends = profile_intervals(*noise, refused)
    assert ends.shape == (2, 2) and not np.isinf(ends).any()


def test_a_valley_between_a_cliff_and_a_slope(monkeypatch):
    """Temperature and reflectance of a wall, whose radiance alone is known.

    The temperature cannot be lower than that of a black wall. Above, only the priors end both
    intervals, and all three ends follow from a search along the valley.
    """
    searched, rendered, at = [], [], Profile.at

    def counted(self, *arguments):
        searched.append(arguments)
        return at(self, *arguments)

    monkeypatch.setattr(Profile, "at", counted)
    measured, sigma = wall((310, 0.3)).radiance[0], 0.01

    def render(x):
        rendered.append(x)
        changes = {"noise": lambda predicted: np.full(len(predicted), sigma)}
        return [wall(x, measured=measured, weight=np.full(VALUES, sigma**-2.0), **changes)]

    both = [kelvin(start=320.0, upper=2000.0), unknown(start=0.5)]
    state = solve(both, render, lambda x: [Weighing(np.full(VALUES, sigma**-2.0))], False, 20)
    R = np.linspace(0, 0.99, 100_001)
    T = brightness_temperature(LWIR, (measured[0] - R * SKY) / (1 - R))
    rise = ((T - 320) / 100) ** 2 + (R - 0.5) ** 2
    inside = rise <= rise.min() + WIDTH**2
    (low, high), (bound, top) = state.intervals
    assert bound == 0 and low == pytest.approx(T[0], abs=0.02 * (state.x[0] - T[0]))
    assert high == pytest.approx(T[inside].max(), abs=0.01 * (high - low))
    assert top == pytest.approx(R[inside].max(), abs=0.01)
    assert len(searched) <= 40 and len(rendered) - state.trace[-1].renders <= 4
