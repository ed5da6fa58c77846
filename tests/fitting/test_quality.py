"""The verdict on a fit itself: its false alarms on right models, and its power on wrong ones."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mi_lcair import fitting
from mi_lcair.fitting.model import Scatterometer
from mi_lcair.fitting.quality import NEGLIGIBLE_DEX, judged, shift_of_log, size
from mi_lcair.fitting.scatterometer.reading import Measurements, pool
from mi_lcair.physics.estimation.verdicts import Verdict
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.synthetic import MODEL, ROUGH, fit, scan, scan_of

PARAMETERS = 4
SIGMA_DEX = 0.02
ANGLES = np.radians([angles.ravel() for angles in np.meshgrid([20, 40, 60], np.arange(-80, 81, 4))])
POINTS = ANGLES.shape[1]


def smooth(count):
    """Smooth functions of the angles, as the derivatives of a model are, (points, count)."""
    theta_i, theta_r = ANGLES
    return np.stack([np.cos(k * theta_r) * np.cos(theta_i) ** k for k in range(count)], axis=1)


def fitted(noise):
    """The residuals (points,) that a linear model with PARAMETERS parameters leaves."""
    basis, _ = np.linalg.qr(smooth(PARAMETERS))
    return noise - basis @ (basis.T @ noise)


def verdict_on(rows, noise_dex=None, freedom=np.inf):
    return judged(rows, SIGMA_DEX * rows, *ANGLES, PARAMETERS, noise_dex, freedom)


@pytest.mark.parametrize("noise_dex, expected", [(None, 0.0013), (SIGMA_DEX, 0.0023)])
def test_false_alarms_are_as_rare_as_stated(noise_dex, expected):
    """White noise: at most the number of alarms that has a chance of 0.1 % or more."""
    draws, random = 4000, np.random.default_rng(0)
    alarms = sum(
        verdict_on(fitted(random.standard_normal(POINTS)), noise_dex).lack_of_fit
        for _ in range(draws)
    )
    assert alarms <= stats.binom.isf(0.001, draws, expected)


def test_heavy_tails_raise_no_alarm_without_sigma():
    draws, random = 2000, np.random.default_rng(1)
    alarms = sum(verdict_on(fitted(random.standard_t(3, POINTS))).lack_of_fit for _ in range(draws))
    assert alarms <= stats.binom.isf(0.001, draws, 0.0013)


@pytest.mark.parametrize("scans", [2, 3])
@pytest.mark.parametrize("spread", [0.0, 0.5])
def test_repeats_as_the_reader_pools_them(scans, spread):
    """The noise of the points may differ by a factor; the pooled sigma follows it in part."""
    draws, random = 400, np.random.default_rng(2)
    alarms = 0
    for _ in range(draws):
        own = 0.04 * np.exp(spread * random.standard_normal(POINTS))
        brdf = 1 + own * random.standard_normal((scans, POINTS))
        *_, mean, sigma = pool(*np.tile(ANGLES, scans), brdf.ravel())
        rows = fitted((mean - 1) / sigma)
        freedom = POINTS * (scans - 1)
        alarms += verdict_on(rows, SIGMA_DEX, freedom).lack_of_fit
    assert alarms <= stats.binom.isf(0.001, draws, 0.0023)


@pytest.mark.parametrize(
    "noise_dex, error", [(None, 1.0), (SIGMA_DEX, 1.0)], ids=["without sigma", "with sigma"]
)
def test_a_shape_as_large_as_the_noise_is_found(noise_dex, error):
    random, wave = np.random.default_rng(3), np.sqrt(2) * np.cos(7 * ANGLES[1])
    found = [
        verdict_on(fitted(random.standard_normal(POINTS) + error * wave), noise_dex).lack_of_fit
        for _ in range(200)
    ]
    assert np.mean(found) > 0.95


def test_a_negligible_error_is_no_lack_of_fit():
    wave = np.cos(7 * ANGLES[1])
    rows = wave * NEGLIGIBLE_DEX / SIGMA_DEX
    quality = verdict_on(rows)
    assert quality.lack_of_fit is False and quality.verdict.endswith("by 0.46 % at most")
    assert verdict_on(3 * rows).verdict.startswith("LACK OF FIT: the model misses the data by ")


def test_what_cannot_be_judged():
    rows, (theta_i, theta_r) = np.random.default_rng(4).standard_normal(POINTS), ANGLES
    few = slice(6)
    quality = judged(rows[few], rows[few], theta_i[few], theta_r[few], 4, None, np.inf)
    assert quality.lack_of_fit is None and quality.verdict.startswith("not judged: no repeated")
    assert quality.residual_correlation is None and quality.systematic_dex == 0


def test_a_sigma_that_is_too_large_is_said():
    rows = 0.3 * fitted(np.random.default_rng(5).standard_normal(POINTS))
    quality = verdict_on(rows, SIGMA_DEX)
    assert quality.lack_of_fit is False and "less than their sigma says" in quality.verdict
    assert "less than their sigma says" not in verdict_on(rows / 0.3, SIGMA_DEX).verdict


def test_of_a_fit_with_stated_sigma():
    """The reduced chi-square of a right model is 1, and 4 if sigma is stated half as large."""
    data = scan(ROUGH, step=2, noise=0.05, seed=1)
    for stated, expected in ((0.05, 1), (0.025, 4)):
        own = Measurements(data.theta_i, data.theta_r, data.brdf, sigma=stated * data.brdf)
        quality = fit(own, form="thesis", starts=4).quality
        assert quality.reduced_chi_square == pytest.approx(expected, rel=0.2)
        assert quality.degrees_of_freedom == len(data.brdf) - 4
        assert quality.noise_dex == pytest.approx(stated / np.log(10))
        assert quality.lack_of_fit is (expected > 1)


def test_noise_does_not_shift_levels():
    """10 % noise shifts by 1.5 and -.5 % on the logarithmic scale. The level is known to .16 %."""
    level, theta = 0.5 / np.pi, np.radians(np.linspace(-75, 75, 4000))
    truth = np.full(theta.size, level)
    brdf = truth * (1 + 0.1 * np.random.default_rng(0).standard_normal(theta.size))
    shifts = []
    for sigma in (0.1 * truth, 0.1 * brdf, None):
        of = Measurements(np.full(theta.size, 0.3), theta, brdf, sigma=sigma)
        result = fitting.fit(of, model="grey", starts=1)
        shifts.append((1 - result.parameters["emissivity"]) / 0.5 - 1)
        assert "shifts" not in result.quality.verdict
    mean = np.mean(brdf) / level - 1
    np.testing.assert_allclose(shifts, mean, atol=2e-4)  # the same answer, whatever sigma means
    assert abs(mean) < 0.004


def test_sigma_of_readings_and_of_levels_give_the_same_fit():
    data = scan(ROUGH, step=4, noise=0.1, seed=3)
    truth = scan(ROUGH, step=4).brdf
    fits = [
        fit(replace(data, sigma=sigma), form="thesis", starts=2, source_half_angle_deg=0)
        for sigma in (0.1 * truth, 0.1 * data.brdf)
    ]
    for name, error in fits[0].standard_error.items():
        assert abs(fits[0].parameters[name] - fits[1].parameters[name]) < 0.05 * error
        assert fits[1].standard_error[name] == pytest.approx(error, rel=0.02)


def test_a_fit_with_outliers_stays_on_the_logarithmic_scale():
    """Its verdict tells by how much noise shifts levels."""
    told = re.search(
        r"noise of 10 % shifts .* by up to ([.0-9]+) %", shift_of_log(0.1 / np.log(10))
    )
    assert float(told[1]) == pytest.approx(1.5, rel=0.05)
    assert shift_of_log(0.05 / np.log(10)) == "" and "nan" not in shift_of_log(9.0)
    data = scan(ROUGH, step=4, noise=0.1, seed=3)
    data.sigma = 0.1 * data.brdf
    data.brdf[::20] *= 10
    assert "shifts levels" in fit(data, form="thesis", starts=2).quality.verdict


@pytest.mark.slow
def test_of_fits_of_right_and_wrong_models():
    """No alarm in 10 fits of the right model. The other model's lobe is always found out."""
    for seed in range(10):
        result = fit(scan(ROUGH, step=2, noise=0.05, seed=seed), form="thesis", starts=4)
        assert result.quality.lack_of_fit is False, result.quality.verdict
    microfacet = MODELS["microfacet"]
    surface = microfacet.values_at(np.full(len(microfacet.names), 0.5))
    for seed in range(3):
        data = scan_of(microfacet, surface, noise=0.05, seed=seed)
        result = fit(data, form="thesis", starts=8)
        assert result.quality.lack_of_fit is True, result.quality.verdict


def test_a_robust_fit_disregards_outliers():
    data = scan(ROUGH, step=2, noise=0.05)
    data.sigma = 0.05 * data.brdf
    data.brdf[::40] *= 10
    assert fit(data, form="thesis", starts=4, robust=True).quality.lack_of_fit is False
    assert fit(data, form="thesis", starts=4).quality.lack_of_fit is True


def wave(amplitude):
    """Alternating noise of 1 on a slow wave."""
    signs = np.where(np.arange(POINTS) % 2, 1.0, -1.0)
    return signs + amplitude * np.sin(ANGLES[1] * 3)


def test_figures_of_known_residuals():
    """Reduced chi-square, its p-value, and the systematic part of the rms."""
    rows, freedom = wave(1.5), POINTS - PARAMETERS
    found = verdict_on(rows, SIGMA_DEX)
    chi_square = np.sum(rows**2) / freedom
    assert found.degrees_of_freedom == freedom and found.noise_dex == SIGMA_DEX
    assert found.reduced_chi_square == pytest.approx(chi_square)
    assert found.p_value == pytest.approx(stats.chi2.sf(chi_square * freedom, freedom))
    rms = SIGMA_DEX * np.sqrt(np.mean(rows**2))
    share = max(1 - 1 / chi_square, found.residual_correlation)
    assert found.lack_of_fit and found.systematic_dex == pytest.approx(rms * np.sqrt(share))
    pairs = POINTS - 3  # of three scans
    assert found.correlation_by_chance == pytest.approx(3 / np.sqrt(pairs))
    repeats = verdict_on(rows, SIGMA_DEX, 20.0)
    assert repeats.p_value == pytest.approx(stats.f.sf(chi_square, freedom, 20))


def test_repeats_need_twice_the_variance():
    """A chi-square of 1.9 from repeats is no lack of fit, one of 2.1 is."""
    noise = np.where(np.arange(POINTS) % 2, 1.0, -1.0)  # neighbours are opposite
    scale = np.sqrt((POINTS - PARAMETERS) / POINTS)
    for chi_square, lacks in ((1.9, False), (2.1, True)):
        rows = noise * scale * np.sqrt(chi_square)
        assert verdict_on(rows, SIGMA_DEX, 1e6).lack_of_fit is lacks
        stated = verdict_on(rows, SIGMA_DEX)  # of a stated sigma
        rms = SIGMA_DEX * scale * np.sqrt(chi_square)
        assert stated.lack_of_fit
        assert stated.systematic_dex == pytest.approx(rms * np.sqrt(1 - 1 / chi_square))


def test_differences_in_words():
    assert size(0.002) == "0.46 %" and size(0.25) == "78 %" and size(0.31) == "a factor of 2"


@pytest.mark.slow
@pytest.mark.parametrize(
    "sign, scale, words",
    [
        (-1, 1, "with the opposite sign of theta_r it fits"),
        (1, np.pi, r"with the BRDF divided by (\S+) or more .pi"),
        (1, 300, r"with the BRDF divided by (\S+) or more it"),
        (1, 1, ""),
    ],
)
def test_a_gross_misfit_names_its_cause(sign, scale, words):
    """The least scale that fits is 10 to 20 % below that of the data."""
    data = scan((0.1, 0.05, 0.1, 0.05), step=8, noise=0.02)
    changed = replace(data, theta_r=sign * data.theta_r, brdf=scale * data.brdf)
    quality = fit(changed, starts=4, source_half_angle_deg=0).quality
    assert quality.lack_of_fit is bool(words) and bool(words) == ("with the" in quality.verdict)
    cause = re.search(words, quality.verdict)
    assert cause and (scale == 1 or 0.75 * scale < float(cause[1]) < 1.05 * scale)


def test_no_cause_is_named_without_one():
    """A misfit of a model that lacks the surface's shape is not that of a sign or a unit."""
    rng = np.random.default_rng(0)
    data = scan((0.1, 0.05, 0.1, 0.05), step=8)
    data.brdf = data.brdf * np.exp(2 * rng.standard_normal(len(data.brdf)))
    assert "it fits" not in fit(data, starts=4, source_half_angle_deg=0).quality.verdict


def mistaken(data, mistake):
    """Data with a mistake, and the words that name it."""
    random, low = np.random.default_rng(4), np.median(data.brdf)
    if mistake == "cos":
        factor = np.cos(data.theta_r)
        return replace(data, brdf=data.brdf * factor, sigma=data.sigma * factor), "cos theta_r"
    if mistake == "floor":
        return replace(data, brdf=data.brdf + 0.4 * low), r"floor of \S+ 1/sr"
    noise = 0.4 * low * random.standard_normal(data.brdf.size)
    return replace(data, brdf=np.abs(data.brdf + noise)), "a floor of noise?"


@pytest.mark.parametrize("mistake", ["cos", "floor", "noise"])
def test_nothing_is_determined_beside_a_lack_of_fit(mistake):
    data = scan((0.3, 0.05, 0.4, 0.1), step=4, noise=0.03)
    data, words = mistaken(replace(data, sigma=0.03 * data.brdf), mistake)
    result = fit(data, form="thesis", starts=4, source_half_angle_deg=0)
    assert result.quality.lack_of_fit and re.search(words, result.quality.verdict)
    assert not any(Verdict.has_interval(verdict) for verdict in result.verdict.values())
    assert any("the model misses the measured values" in v for v in result.verdict.values())


def test_a_source_that_is_wider_than_stated_is_named():
    data = scan((0.3, 0.05, 0.4, 0.02), step=2)
    half_angle = np.radians(2)
    instrument = Scatterometer(MODEL, "thesis", data.theta_i, data.theta_r, half_angle)
    brdf = instrument(MODEL.to_cube([(0.3, 0.05, 0.4, 0.02)]))[0][0]
    brdf *= 1 + 0.03 * np.random.default_rng(4).standard_normal(brdf.size)
    result = fit(replace(data, brdf=brdf), form="thesis", starts=4, source_half_angle_deg=0)
    assert "with a source of 2 degrees half-angle it fits" in result.quality.verdict
