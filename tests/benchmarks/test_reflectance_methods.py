"""Each reflectance integral against the exact DHR.

Accuracy, order of convergence, bias, and cases in which a method agrees with itself on a wrong
result.
"""

import numpy as np
import pytest
from drjit.llvm import Float64, UInt32

from benchmarks.methods.reflectance import (
    METHODS,
    half_vector,
    lattice,
    normal_importance,
    problem,
    rejection,
    sobol,
    stratified_monte_carlo,
    stratified_quadrature,
    uniform_quadrature,
)
from mi_lcair.physics.reflection import sandford_robertson_equations
from tests.physics.reflection.surfaces import MATERIALS, random_parameters

BROAD = (0.3, 0.1, 0.4, 0.3)  # epsilon, rho_d, b, e of a surface with a floor and a 20 degree lobe
ALUMINUM = MATERIALS[0]
QUADRATURES = (uniform_quadrature.method, stratified_quadrature.method)
RANDOM = [method for method in METHODS if method not in QUADRATURES]
by_name = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
randomly = pytest.mark.parametrize("method", RANDOM, ids=lambda method: method.name)


def relative_error(method, p, effort, repetitions=1, seed=0):
    return method.run(p, effort, repetitions, seed).numpy() / p.exact() - 1


# method -> (effort, largest relative error of one estimate for BROAD).
# For random methods the error is four standard deviations.
STATED = {
    uniform_quadrature: (200, 1e-4),
    stratified_quadrature: (160, 3e-4),
    normal_importance: (64000, 0.015),
    stratified_monte_carlo: (64000, 0.03),
    rejection: (64000, 0.08),
    half_vector: (65536, 0.01),
    sobol: (65536, 5e-4),
    lattice: (65536, 1e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", ["thesis", "normalized"])
@pytest.mark.parametrize("theta_deg", [0, 30, 60, 75])
@pytest.mark.parametrize("module", STATED, ids=lambda module: module.method.name)
def test_reproduces_the_exact_DHR(module, theta_deg, form):
    effort, error = STATED[module]
    assert (
        np.abs(relative_error(module.method, problem(*BROAD, theta_deg, form), effort, 4)).max()
        < error
    )


@pytest.mark.parametrize("method", QUADRATURES, ids=lambda method: method.name)
def test_quadratures_converge_with_their_order(method):
    """The error of a midpoint rule is proportional to N^-2.

    With 45 degrees and these N, the regions of the stratified quadrature hold whole cells.
    """
    p = problem(*BROAD, 45)
    errors = [np.abs(relative_error(method, p, N)[0]) for N in (72, 144, 288)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 2, atol=0.2)


@pytest.mark.slow
@randomly
@pytest.mark.parametrize(
    "parameters, theta_deg", [(BROAD, 30), (BROAD, 75), ((0.05, 0.05, 0.1, 0.1), 60)]
)
def test_random_methods_are_unbiased(method, parameters, theta_deg):
    """The mean of 4096 estimates of 64 samples lies within 4 standard errors of the DHR.

    The HDR is another number, because the model is not reciprocal. For the methods that use a
    density of i or r, the mean must also differ from it.
    """
    p = problem(*parameters, theta_deg)
    errors = np.concatenate([relative_error(method, p, 64, 1024, seed) for seed in range(4)])
    standard_error = errors.std() / np.sqrt(len(errors))
    assert abs(errors.mean()) < 4 * standard_error
    HDR_error = sandford_robertson_equations.HDR(p.surface, p.theta_i)[0] / p.exact() - 1
    if method in (half_vector.method, sobol.method):
        assert abs(errors.mean() - HDR_error) > 4 * standard_error


@randomly
def test_repetitions_and_seeds_differ(method):
    p = problem(*BROAD, 30)
    a, b = (method.run(p, 4096, 16, seed).numpy() for seed in (0, 1))
    assert (
        len(np.unique(np.concatenate([a, b]))) > 20
    )  # not 32: counts of accepted samples may agree
    np.testing.assert_array_equal(a, method.run(p, 4096, 16, 0).numpy())


@by_name
def test_counts_its_samples(method, monkeypatch):
    """`samples` is the number of lanes on which the BRDF is evaluated."""
    import drjit as dr

    evaluated = []
    p = problem(*BROAD, 30)
    if method is METHODS[1]:
        normal_importance.best_widths(p)  # done first, because the search is not counted
    original = type(p).integrand

    def integrand(self, i, r):
        evaluated.append(max(dr.width(r.x), dr.width(i.x)))
        return original(self, i, r)

    monkeypatch.setattr(type(p), "integrand", integrand)
    effort = method.efforts[2]
    method.run(p, effort, 3, 0)
    assert sum(evaluated) == 3 * method.samples(effort)


# ---- parts of the methods


@pytest.mark.parametrize("theta_deg", [0, 5, 10, 30, 80, 84, 89])
def test_regions_tile_the_hemisphere(theta_deg):
    """A perfect diffuser has reflectance 1 for every border between the regions."""
    p = problem(0, 1, 0, 1, theta_deg)
    assert stratified_quadrature.run(p, 160, 1, 0)[0] == pytest.approx(1, abs=2e-4)
    assert stratified_monte_carlo.run(p, 10**6, 1, 0)[0] == pytest.approx(1, abs=0.005)


def test_bound_of_rejection_sampling():
    """The bound is nowhere below f cos(theta_r), and equals it at the peak at normal incidence."""
    rng = np.random.default_rng(1)
    for k, parameters in enumerate(random_parameters(40)):
        for form in ("thesis", "normalized"):
            p = problem(*parameters, (0, 30, 60, 89)[k % 4], form)
            theta = np.clip(p.theta_i[0] + rng.standard_cauchy(4000) * p.surface.e[0], 0, np.pi / 2)
            phi = np.pi + rng.standard_cauchy(4000) * p.surface.e[0]
            r = normal_importance.direction(Float64(theta), Float64(phi))
            assert (
                p.integrand(p.incident(), r).numpy() <= rejection.bound(p)[0] * (1 + 1e-9)
            ).all()
    p = problem(*ALUMINUM, 0)
    assert p.integrand(p.incident(), p.incident())[0] == pytest.approx(
        rejection.bound(p)[0], rel=1e-9
    )


@pytest.mark.slow
def test_normal_importance_has_the_best_widths():
    """No width close to them gives a smaller measured variance."""
    p = problem(*BROAD, 30)
    best = normal_importance.best_widths(p)
    spread = lambda: np.std(normal_importance.run(p, 256, 4096, 0).numpy())
    least = spread()
    with pytest.MonkeyPatch.context() as patch:
        for factors in ((0.7, 1), (1.5, 1), (1, 0.7), (1, 1.5)):
            patch.setattr(normal_importance, "best_widths", lambda p: np.multiply(best, factors))
            assert spread() > 1.01 * least


def test_scrambled_points_stay_stratified():
    """The first 64 scrambled Sobol numbers have one in each 64th of the unit interval.

    This holds in each dimension and for each key.
    """
    for digits in sobol.reversed_digits():
        for key in (1, 12345, 2**31 + 7):
            x = (
                np.asarray(
                    sobol.dr.brev(sobol.laine_karras(digits, UInt32(key))).numpy()[:64], float
                )
                / 2**32
            )
            assert sorted((64 * x).astype(int)) == list(range(64))


# ---- claims of the chart


@pytest.mark.parametrize(
    "method", [half_vector.method, sobol.method], ids=lambda method: method.name
)
def test_few_samples_suffice_for_bare_aluminum(method):
    """The rms error is below 1 % with 4 samples and below 0.1 % with 128.

    The median error is below 0.3 times these.
    """
    p = problem(*ALUMINUM, 30)
    for samples, error in ((4, 0.01), (128, 0.001)):
        errors = relative_error(method, p, samples, 4096)
        assert np.median(np.abs(errors)) < 0.3 * error
        assert np.sqrt(np.mean(errors**2)) < error


def test_coarse_quadrature_aliases():
    """A lobe of e = 0.0042 falls between the samples, and the result shows no sign of it.

    The DHR is 0.888. Where the peak lies midway between the columns, N = 12, 24 and 48 give 0.03 to
    0.10, most of it from the floor. With N = 100 the result varies between 0.32 and 2.2, depending
    on the plane of incidence.
    """
    p = problem(*ALUMINUM, 30)
    assert p.exact() == pytest.approx(0.88797, abs=1e-5)
    lowest = [uniform_quadrature.run(p, N, 1024, 0).numpy().min() for N in (12, 24, 48)]
    np.testing.assert_allclose(lowest, [0.026, 0.042, 0.104], atol=0.001)
    turning = uniform_quadrature.run(p, 100, 256, 0).numpy()
    assert turning.min() < 0.35 and turning.max() > 2


@pytest.mark.parametrize(
    "theta_deg, value, exact",
    [
        (30, 0.8877, 0.8880),
        (0, 0.6947, 0.8886),
        (60, 0.7530, 0.8829),
        (75, 0.3568, 0.8627),
        (85, 0.0560, 0.6921),
    ],
)
def test_stratified_quadrature_aliases_away_from_30_degrees(theta_deg, value, exact):
    """The thesis's 80^2 + 50^2 samples, chosen at 30 degrees, fail at other angles.

    Toward grazing the lobe has a half width of e / tan(theta) in azimuth and falls between the
    columns. At normal incidence it lies beside the peak region. All repetitions give one value.
    """
    p = problem(*ALUMINUM, theta_deg)
    values = stratified_quadrature.run(p, 80, 64, 0).numpy()
    assert np.ptp(values) == 0
    assert (values[0], p.exact()) == pytest.approx((value, exact), abs=1e-4)
    assert np.median(np.abs(relative_error(half_vector.method, p, 256, 256))) < 0.005
