"""Whether the fitted model describes the data: reduced chi-square, and correlated residuals.

There are two tests, each with a false alarm in about 1 of 1000 fits of a model that is right.
Where the standard deviations of the points are known, from the file or from repeated scans, the
sum of squared residuals is compared with them (chi-square; F if they come from repeats, as in the
classical test of lack of fit against pure error: Draper and Smith, Applied Regression Analysis,
3rd edition 1998, section 2.1). In any case, neighbouring residuals of a scan are compared, as by
Durbin and Watson (Biometrika 38, 1951): noise changes its sign from point to point, and the
difference of two shapes does not.

The likely causes of a misfit are tried: BRDF x cos theta_r, a floor that is not subtracted, noise
that sigma does not contain, and a source wider than stated. Of a gross misfit these are signs of
theta_r, and the unit of the BRDF, too.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.optimize import minimize_scalar

from mi_lcair.errors import InputError
from mi_lcair.fitting.data import Data, FitSettings, FittedVariant, Variant, select
from mi_lcair.fitting.scatterometer.reading import Measurements
from mi_lcair.fitting.search import (
    BY_CHANCE,
    COARSE,
    FAR,
    compare,
    descend,
    neighbour_correlation,
)
from mi_lcair.physics.estimation import verdicts

# Largest reduced chi-square that is no lack of fit if the standard deviations come from repeats.
# Few repeats leave them uncertain, and a pooled value does not follow how they vary from point to
# point.
LARGEST_OF_REPEATS = 2.0
# Largest difference between model and data that is not reported as lack of fit [decades]. It is
# 0.5 %, less than the error of any scatterometer's calibration.
NEGLIGIBLE_DEX = 0.002
# Mistakes that are tried: floors up to this percentile of the BRDF, and sizes of the source
LOW, SOURCES_DEG = 5, (0.5, 1, 2, 4)
GROSS_DEX = 0.2  # misfit from which causes are tried [decades]: a factor of 1.6
STARTS = 6  # starting points of each trial
SHARE = 0.35  # a cause is likely if it leaves at most this share of the misfit [decades]
DECADES = 4  # of the largest scale by which a BRDF is divided
FALLS = 0.75  # ratio of misfits below which a further decade is tried
HALVINGS = 4  # of a decade, in the search for the least scale that fits
ENOUGH = 2.0  # a scale fits if its misfit is at most this multiple of that of a larger scale
REFLECTANCE = np.pi, 1.25  # scale of a reflectance factor, and the factor within which it is named


@dataclass(frozen=True)
class Quality:
    """How well a model describes the BRDF points of a fit.

    Attributes
    ----------
    lack_of_fit
        Whether the model misses the data by more than their noise; None if the data cannot tell.
    verdict
        The same in words.
    reduced_chi_square, degrees_of_freedom, p_value
        Sum of squared residuals in standard deviations for each degree of freedom, the number of
        these, and the probability of a larger value for a model that is right. None if no standard
        deviations are known.
    noise_dex
        Rms of the points' standard deviations [decades]; None if they are not known.
    residual_correlation, correlation_by_chance
        Correlation of neighbouring residuals along the scans, and the largest that noise shows.
        None for scans that are too short.
    systematic_dex
        Rms of the part of the residuals that is no noise [decades]; 0 without lack of fit.
    """

    lack_of_fit: bool | None
    verdict: str
    reduced_chi_square: float | None
    degrees_of_freedom: int | None
    p_value: float | None
    noise_dex: float | None
    residual_correlation: float | None
    correlation_by_chance: float | None
    systematic_dex: float

    @property
    def missed(self) -> str:
        """What the model misses, in the words of verdicts on parameters; "" without lack of fit."""
        if not self.lack_of_fit:
            return ""
        is_large = self.p_value is not None and self.p_value < verdicts.SIGNIFICANCE
        how = f"(p = {self.p_value:.1g})" if is_large else f"by about {size(self.systematic_dex)}"
        return f"the measured values {how}"


def quality(
    data: Data, best: FittedVariant, robust: bool, sigma_freedom: float = np.inf
) -> Quality:
    """The `Quality` of a candidate at its minimum.

    Parameters
    ----------
    data
        The BRDF points, with the standard deviations that were measured.
    best
        The chosen candidate.
    robust
        Whether outliers had little weight. They then do not count here.
    sigma_freedom
        Degrees of freedom from which the standard deviations were computed; infinite if they were
        given.
    """
    rows = data.residuals(best.variant)(best.u[None])[0][0][: data.points]
    dex = data.decades(best)
    kept = np.ones(len(rows), dtype=bool)
    if robust:
        kept = np.abs(rows) <= FAR * verdicts.inner_deviation(rows, 1e-12)
    noise_dex = None
    if data.has_sigma:
        per_decade = data.per_decade(data.brdf * 10**dex)[: data.points]
        noise_dex = float(np.sqrt(np.mean(np.square(1 / per_decade[kept]))))
    of_points = (column[kept] for column in (rows, dex, data.theta_i, data.theta_r))
    result = judged(*of_points, best.size, noise_dex, sigma_freedom)
    shifted = shift_of_log(noise_dex) if data.scale == "log" and noise_dex is not None else ""
    return replace(result, verdict=result.verdict + shifted)


def shift_of_log(noise_dex: float) -> str:
    """What noise does to a level that is fitted on a logarithmic scale, in words if it counts.

    A relative standard deviation s shifts it by -s^2 / 2 if sigma is a share of the reading, and by
    2 s^2 more if it is one of the true value, as bright readings then have too large a weight.
    """
    s = min(noise_dex * np.log(10), 1.0)
    up = np.log10(1 + 1.5 * s**2)
    words = f"; noise of {100 * s:.2g} % shifts levels on the logarithmic scale by up to {size(up)}"
    return words if up >= NEGLIGIBLE_DEX else ""


def judged(
    rows, dex, theta_i, theta_r, parameters: int, noise_dex: float | None, sigma_freedom: float
) -> Quality:
    """The `Quality` of residuals.

    rows, dex: residuals in units of their standard deviations, if these are known, and in decades,
    (p,). theta_i, theta_r: elevations of source and observer [radians], (p,). parameters: number of
    free ones. noise_dex: rms of the standard deviations [decades], None if they are not known.
    sigma_freedom: as for `quality`.
    """
    chi_square = freedom = p_value = None
    missed = large = False
    if noise_dex is not None and len(rows) > parameters:
        freedom = len(rows) - parameters
        chi_square = float(np.sum(np.square(rows)) / freedom)
        if np.isfinite(sigma_freedom):
            p_value = float(stats.f.sf(chi_square, freedom, sigma_freedom))
            large = chi_square > LARGEST_OF_REPEATS
        else:
            p_value, large = float(stats.chi2.sf(chi_square * freedom, freedom)), True
        missed = large and p_value < verdicts.SIGNIFICANCE
    correlation, pairs = neighbour_correlation(rows, theta_i, theta_r)
    by_chance = BY_CHANCE / np.sqrt(max(pairs, 1))
    is_judged = by_chance < 1
    bent = is_judged and correlation > by_chance
    rms = float(np.sqrt(np.mean(np.square(dex))))
    share = max(correlation if bent else 0.0, 1 - 1 / chi_square if missed else 0.0)
    systematic = float(rms * np.sqrt(share))
    lacks = bool((missed or bent) and systematic > NEGLIGIBLE_DEX)
    known = lacks if is_judged or chi_square is not None else None
    return Quality(
        lack_of_fit=known,
        verdict=words(known, systematic, chi_square, p_value, correlation, by_chance, freedom),
        reduced_chi_square=chi_square,
        degrees_of_freedom=freedom,
        p_value=p_value,
        noise_dex=noise_dex,
        residual_correlation=correlation if is_judged else None,
        correlation_by_chance=float(by_chance) if is_judged else None,
        systematic_dex=systematic if lacks else 0.0,
    )


def words(lacks, systematic, chi_square, p_value, correlation, by_chance, freedom) -> str:
    """The verdict in words. Arguments are the fields of `Quality`."""
    if lacks is None:
        return "not judged: no repeated scans, no sigma, and scans of too few points"
    facts = []
    if chi_square is not None:
        facts.append(f"chi-square {verdicts.chi_square_text(chi_square, freedom, p_value)}")
        if stats.chi2.cdf(chi_square * freedom, freedom) < verdicts.SIGNIFICANCE:
            facts.append(verdicts.OVERSTATED)
    if by_chance < 1:
        facts.append(
            f"neighbouring residuals correlate by {correlation:.2f} (noise: up to {by_chance:.2f})"
        )
    if lacks:
        return f"LACK OF FIT: the model misses the data by about {size(systematic)}; " + "; ".join(
            facts
        )
    if systematic > 0:
        facts.append(f"the model misses the data by {size(NEGLIGIBLE_DEX)} at most")
    return f"no lack of fit seen: {'; '.join(facts)}"


def size(dex: float) -> str:
    """A difference in decades as a percentage, or as a factor if it is large."""
    percent = 100 * (10**dex - 1)
    return f"a factor of {10**dex:.2g}" if percent > 100 else f"{percent:.2g} %"


def mistake(data: Data, search, found: Quality, robust: bool, freedom: float) -> str:
    """The mistake in the data without which the chosen model has no lack of fit, or "".

    data: the BRDF points. search: the search, whose candidates are starts. found: the quality of
    the fit. freedom: as `sigma_freedom` of `quality`.
    """
    if not found.lack_of_fit or data.scale != "log":
        return ""
    model, low, trials = search.best.variant.model, np.percentile(data.brdf, LOW), []
    candidates = [each for each in search.candidates if each.variant.model is model]
    of_cos = replace(data, brdf=data.brdf / np.cos(data.theta_r))
    trials.append((of_cos, "the BRDF divided by cos theta_r (is it BRDF x cos?)"))

    def lowered(floor):
        less = np.maximum(data.brdf - floor, (low - floor) / 2)
        spread = data.spread * data.brdf / less if data.has_sigma else data.spread
        return replace(data, brdf=less, spread=spread)

    def misfit(floor):
        less = lowered(floor)
        return less.rms_dex(descend(search.best, less.residuals(search.best.variant), COARSE))

    floor = minimize_scalar(misfit, bounds=(0, low), options={"xatol": 0.01 * low}).x
    trials.append((lowered(floor), f"a floor of {floor:.2g} 1/sr subtracted from the BRDF"))
    if data.has_sigma:
        f = data.residuals(search.best.variant).instrument(search.best.u[None])[0][0]
        loose = replace(data, has_sigma=False).at_level(f)
        ratio = (loose.spread / data.at_level(f).spread)[np.argsort(f)]
        words = "sigma {:.2g} times as large at low BRDFs, {:.2g} at high ones (a floor of noise?)"
        trials.append((loose, words.format(*ratio[[len(f) // 10, -1 - len(f) // 10]])))
    for degrees in () if data.half_angle else SOURCES_DEG:
        wide = replace(data, half_angle=float(np.radians(degrees)))
        trials.append((wide, f"a source of {degrees:g} degrees half-angle"))
    for changed, words in trials:
        for candidate in candidates:
            fitted = descend(candidate, changed.residuals(candidate.variant), COARSE)
            if quality(changed, fitted, robust, freedom).lack_of_fit is False:
                return f"with {words} it fits; check the file"
    return ""


def likely_cause(
    measurements: Measurements, compared: list[Variant], settings: FitSettings, misfit_dex: float
) -> str:
    """The cause of a misfit [decades] in words, if a trial finds one; otherwise "".

    The models are fitted with the opposite sign of theta_r, and with the BRDF divided by a scale.
    The least scale that fits is named, since any larger one looks like an absorber. A BRDF that is
    too small looks so itself.
    """
    if misfit_dex < GROSS_DEX:
        return ""
    whole = [variant for variant in compared if variant.restriction is None]
    settings = replace(settings, starts=min(settings.starts, STARTS))
    sigma, allowed = measurements.sigma, SHARE * misfit_dex

    def left(scale: float = 1.0, sign: float = 1.0) -> float:
        """Misfit of changed measurements [decades]."""
        changed = replace(
            measurements,
            theta_r=sign * measurements.theta_r,
            brdf=measurements.brdf / scale,
            sigma=None if sigma is None else sigma / scale,
        )
        try:
            data, _, _ = select(
                changed,
                settings.loss,
                settings.half_angle,
                settings.max_angle_deg,
                settings.min_brdf / scale,
                min(len(variant.model.parameters) for variant in whole),
            )
        except InputError:  # too few points
            return np.inf
        return data.rms_dex(compare(data, whole, settings, lambda: None)[0])

    trials = [(left(sign=-1.0), "the opposite sign of theta_r")]
    misfit, high = misfit_dex, 0.0
    while high < DECADES and (smaller := left(10 ** (high + 1))) < FALLS * misfit:
        misfit, high = smaller, high + 1
    if misfit <= allowed:
        low = high - 1
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if left(10**middle) <= ENOUGH * misfit else (middle, high)
        trials.append((misfit, f"the BRDF divided by {_named(10**high)}"))
    misfit, words = min(trials)
    return f"with {words} it fits to {misfit:.2g} decades; check the file" * (misfit <= allowed)


def _named(scale: float) -> str:
    """A scale in words, with what has such a scale."""
    pi, near = REFLECTANCE
    what = " (pi? a reflectance factor has it)" if 1 / near < scale / pi < near else ""
    return f"{float(f'{scale:.2g}'):g} or more{what}"
