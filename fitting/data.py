"""The data of one fit, its settings, the variants that it compares, and residuals on a scale.

BRDFs of one surface span five decades, and their errors are proportional to their values. The
residuals are therefore differences of log10 (in decades). On the linear and the cube-root scale the
few points of the peak outweigh all others. These two scales exist for comparison.

Noise shifts levels on the logarithmic scale, by the square of its relative size. A fit that
describes the data is therefore continued on the linear scale, with variances that depend on the
fitted level and not on the reading. Sources: McCullagh and Nelder, Generalized Linear Models, 1989,
chapter 9 (quasi-likelihood); Carroll and Ruppert, Transformation and Weighting in Regression, 1988.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from scipy.optimize import nnls

from mi_lcair.declared import Bounds, Described, entry
from mi_lcair.errors import InputError
from mi_lcair.fitting.model import Hemispherical, Scatterometer
from mi_lcair.fitting.scatterometer.reading import DirectionalData, Measurements
from mi_lcair.physics.reflection import model
from mi_lcair.physics.reflection.interface import ReflectionModel, Restriction
from mi_lcair.physics.reflection.models import MODELS

LOW = 4.0  # sigma by which noise lowers a reading, at most
LOWEST = 0.1  # reading over the fitted BRDF, below which it counts as this in a logarithm
DARKEST = 1e-30  # lower limit of a BRDF [1/sr], so that its logarithm is finite
# The models that a fit compares where it is not told its model
COMPARED = {name: entry for name, entry in MODELS.items() if entry.is_compared}
AUTO = "auto"  # as a name of a model or a form: all of them are compared
# Smallest significant difference of the criterion. A smaller one is "not worth more than a bare
# mention" (Kass and Raftery 1995).
SIGNIFICANT = 2.0
# Smallest standard deviation of a point, relative to its value. One that was computed from a few
# repeats can be too small by chance.
SIGMA_FLOOR = 0.01
# The detector is assumed to have saturated if at least PLATEAU points have the same largest value,
# and if they are less than the share RARE of all points.
PLATEAU, RARE = 3, 0.2
TINY, VARIANCE_ROUNDS = 1e-18, 5  # least relative variance, and rounds in which it is determined
DIRECTIONAL_STD = 0.02  # standard deviation of an emissivity or DHR for which none is given


def log10(f):
    """log10 of BRDFs f [1/sr], and its derivative with respect to f."""
    f = np.maximum(f, DARKEST)
    return np.log10(f), 1 / (f * np.log(10))


def cube_root(f):
    """Cube root of BRDFs f [1/sr], and its derivative with respect to f."""
    root = np.cbrt(np.maximum(f, DARKEST))
    return root, 1 / (3 * root * root)


def linear(f):
    """BRDFs f [1/sr] themselves, and their derivative 1."""
    return f, np.ones_like(f)


# Each scale is a function that returns the scaled BRDF and its derivative with respect to the BRDF.
SCALES = {"log": log10, "cube_root": cube_root, "linear": linear}


class Residuals:
    """Residuals (rows) in units of their standard deviations.

    The rows are the BRDF points on a scale, followed by the entries of the directional tables. A
    call with coordinates u (m, n) returns rows (m, r) and their derivatives (m, r, n). The argument
    `lanes`, the indices of the starts, matters only for residuals that differ between starts. The
    attribute `unit` is the change of a typical row for one decade of the BRDF.

    Parameters
    ----------
    instrument
        A `Scatterometer`, which predicts the BRDFs.
    brdf
        Measured BRDFs [1/sr], (p,).
    scale
        Scale of the comparison, a key of SCALES.
    spread
        Standard deviation of the points on this scale, one number or (p,).
    directional
        Triples (`Hemispherical`, measured values, standard deviations).
    """

    def __init__(self, instrument, brdf, scale: str = "log", spread=1.0, directional=()):
        self.instrument, self.scale, self.directional = instrument, SCALES[scale], list(directional)
        self.measured = self.scale(np.asarray(brdf, dtype=float))[0]
        self.weight = np.broadcast_to(1 / np.asarray(spread, dtype=float), self.measured.shape)
        decade = self.scale(np.asarray(brdf, dtype=float))[1] * brdf * np.log(10) * self.weight
        self.unit = float(np.sqrt(np.mean(np.square(decade))))

    def __call__(self, u: np.ndarray, lanes=None) -> tuple[np.ndarray, np.ndarray]:
        f, df = self.instrument(u)
        value, slope = self.scale(f)
        rows, slopes = (
            [(value - self.measured) * self.weight],
            [df * (slope * self.weight)[..., None]],
        )
        for table, measured, std in self.directional:
            value, slope = table(u)
            rows.append((value - measured) / std)
            slopes.append(slope / std[:, None])
        if len(rows) == 1:
            return rows[0], slopes[0]
        return np.concatenate(rows, axis=1), np.concatenate(slopes, axis=1)


class Cauchy:
    """The same rows, transformed so that outliers have little weight.

    A row r becomes c sqrt(log(1 + (r/c)^2)). Its influence on the fit falls where |r| exceeds c.
    Half its square is the Cauchy loss; a method that minimizes a sum of squares then minimizes this
    loss.
    """

    def __init__(self, residuals, c: float):
        self.residuals, self.c, self.unit = residuals, c, residuals.unit

    @staticmethod
    def influence(rows: np.ndarray, c: float) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative of the loss with respect to each row."""
        ratio2 = np.square(rows / c)
        return rows / (1 + ratio2), (1 - ratio2) / np.square(1 + ratio2)

    def __call__(self, u, lanes=None):
        rows, slopes = self.residuals(u)
        ratio2 = np.square(rows / self.c)
        size = self.c * np.sqrt(np.log1p(ratio2))
        shrink = np.where(ratio2 > 1e-16, np.abs(rows) / np.maximum(size, 1e-300) / (1 + ratio2), 1)
        return np.copysign(size, rows), slopes * shrink[..., None]


@dataclass(frozen=True)
class FitSettings(Described):
    """What is compared and how it is searched; see `fit`.

    Raises InputError for the first setting that is out of its range.
    """

    model: str
    form: str
    starts: int = entry(lower=1)
    seed: int
    loss: Literal["log", "cube_root", "linear"]
    robust: bool
    max_angle_deg: float = entry(is_positive=True, upper=90)
    min_brdf: float = entry(lower=0)
    source_half_angle_deg: float = entry(lower=0, upper=np.nextafter(90.0, 0))
    calibration: float | None = entry(None, lower=0, upper=1)

    @property
    def half_angle(self) -> float:
        """Angular radius of the source [radians]."""
        return float(np.radians(self.source_half_angle_deg))


@dataclass(frozen=True)
class Variant:
    """What a search fits to the data: a form of a reflection model, whole or restricted."""

    model: ReflectionModel
    form: str
    restriction: Restriction | None = None

    @property
    def whole(self) -> "Variant":
        """The same model and form without a restriction."""
        return Variant(self.model, self.form)

    @property
    def free(self) -> np.ndarray:
        """Mask (n,) of the coordinates that a search may change."""
        mask = np.ones(len(self.model.parameters), dtype=bool)
        if self.restriction:
            mask[self.restriction.coordinate] = False
        return mask

    def restrict(self, u: np.ndarray) -> np.ndarray:
        """Coordinates u (m, n), with the restricted one set to its fixed value."""
        return np.where(self.free, u, self.restriction.value) if self.restriction else u


@dataclass
class FittedVariant:
    """A variant at its minimum.

    Attributes
    ----------
    variant, residuals
        The variant, and the residuals that were minimized.
    u
        Coordinates of the minimum, (n,).
    cost
        Half the sum of squares of the rows.
    gradient
        Relative gradient at the minimum.
    share
        Share of the starts that reached this minimum.
    criterion
        Excess of the criterion over that of the best candidate.
    """

    variant: Variant
    residuals: Any
    u: np.ndarray
    cost: float
    gradient: float
    share: float
    criterion: float = 0.0

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return int(self.variant.free.sum())


def variants(model_name: str, form: str) -> list[Variant]:
    """The variants to compare for a model and a form, whole ones first.

    model_name, form: names, or "auto" for all. Restricted variants are included if the form is
    "auto". Raises InputError for unknown names.
    """
    models = list(COMPARED.values()) if model_name == AUTO else [model(model_name)]
    whole = [
        Variant(entry, name) for entry in models for name in entry.forms if form in (AUTO, name)
    ]
    if not whole:
        known = "; ".join(f"{listed.name} has {', '.join(listed.forms)}" for listed in models)
        raise InputError(f"form '{form}' is unknown; {known}")
    return whole + [
        Variant(variant.model, variant.form, restriction)
        for variant in whole
        for restriction in variant.model.restrictions
        if form == AUTO
    ]


def criterion(candidate: FittedVariant, rows: int, effective: float) -> float:
    """Bayesian information criterion, n ln(sum of squares / rows) + k ln n.

    k is the number of free parameters.

    Parameters
    ----------
    candidate
        A variant at its minimum.
    rows
        Number of residuals.
    effective
        Number n of independent residuals.

    Returns
    -------
    float
        The criterion; the lower, the better.
    """
    mean = max(2 * candidate.cost / rows, 1e-24)  # smaller means differ by round-off only
    return effective * np.log(mean) + candidate.size * np.log(effective)


def choose(candidates: list[FittedVariant], criteria) -> int:
    """Index of the simplest candidate that is not significantly worse than the best.

    Of several equally simple candidates, it is the one with the lower criterion.
    """
    close = [
        index for index in range(len(candidates)) if criteria[index] <= min(criteria) + SIGNIFICANT
    ]
    return min(close, key=lambda index: (candidates[index].size, criteria[index]))


@dataclass
class Data:
    """BRDF points and directional tables that are fitted together.

    Attributes
    ----------
    theta_i, theta_r
        Elevations of source and observer [radians], (p,).
    brdf
        Measured BRDFs [1/sr], (p,).
    half_angle
        Angular radius of the source [radians].
    scale
        Scale on which model and data are compared, a key of SCALES.
    spread
        Standard deviations of the points on this scale, (p,).
    has_sigma
        Whether the measurements came with standard deviations.
    directional
        Tables of emissivity or DHR that are fitted with the points.
    std_factor
        Factor by which the tables' standard deviations are multiplied.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    brdf: np.ndarray
    half_angle: float
    scale: str
    spread: np.ndarray
    has_sigma: bool
    directional: list[DirectionalData] = field(default_factory=list)
    std_factor: float = 1.0

    @property
    def points(self) -> int:
        """Number of BRDF points."""
        return len(self.brdf)

    @property
    def rows(self) -> int:
        """Number of residuals: BRDF points and entries of the directional tables."""
        return self.points + sum(len(table.theta) for table in self.directional)

    def residuals(self, variant: Variant, aperture: bool = True) -> Residuals:
        """The residuals of a variant. aperture: False takes the source as a point."""
        model, form = variant.model, variant.form
        half_angle = self.half_angle if aperture else 0.0
        instrument = Scatterometer(model, form, self.theta_i, self.theta_r, half_angle)
        tables = [
            (
                Hemispherical(model, form, table.theta, table.quantity),
                table.value,
                self.std_factor * table.std,
            )
            for table in self.directional
        ]
        return Residuals(instrument, self.brdf, self.scale, self.spread, tables)

    def per_decade(self, f: np.ndarray) -> np.ndarray:
        """Change of each row when every BRDF f (points,) grows by one decade, (rows,).

        It is 0 for the rows of the directional tables.
        """
        change = SCALES[self.scale](f)[1] * f * np.log(10) / self.spread
        return np.concatenate([change, np.zeros(self.rows - self.points)])

    def at_level(self, f: np.ndarray) -> "Data":
        """The same points on the linear scale, weighted by fitted BRDFs f (points,).

        If sigma was measured, the part of it that follows the noise of the reading is taken out:
        log(sigma) is linear in log(f), its square, the residual log(brdf / f), and the product of
        both. Otherwise the variance is a + b f + c f^2, which the squared residuals determine.
        """
        f = np.maximum(f, DARKEST)
        if self.has_sigma:
            # The sigma of a reading that is not positive, or much too low, follows from its level
            is_known = (self.brdf > LOWEST * f) & (self.spread > 0)
            level, ratio = np.log(f), np.log(np.where(is_known, self.brdf, f) / f)
            level = level - level[is_known].mean()
            of_noise = np.stack([ratio, ratio * level], axis=1)
            of_level = np.column_stack([np.ones_like(level), level, level**2])
            columns, sigma = np.hstack([of_level, of_noise]), np.where(is_known, self.spread, 1.0)
            slopes = np.linalg.lstsq(columns[is_known], np.log(sigma[is_known]), rcond=1e-9)[0]
            known = sigma * np.exp(-of_noise @ slopes[3:])
            spread = np.where(is_known, known, np.exp(of_level @ slopes[:3]))
            return replace(self, scale="linear", spread=spread)
        unit = np.median(f)
        terms, squares = (f[:, None] / unit) ** np.arange(3), np.square(self.brdf - f) + f**2 * TINY
        variance = f**2 * np.median(squares / f**2)
        for _ in range(VARIANCE_ROUNDS):
            variance = terms @ nnls(terms / variance[:, None], squares / variance)[0]
        return replace(self, scale="linear", spread=np.sqrt(variance))

    def jointly(self, variance: float, tables: list[DirectionalData]) -> "Data":
        """The same points, together with directional tables.

        variance: variance of a BRDF row, by which the rows are scaled to unit variance. A BRDF
        point and an entry of a table then have the right weight relative to each other.
        """
        return replace(self, spread=self.spread * np.sqrt(variance), directional=tables)

    def with_std_factor(self, factor: float) -> "Data":
        """The same data with the tables' standard deviations multiplied by `factor`."""
        return replace(self, std_factor=factor)

    def decades(self, candidate) -> np.ndarray:
        """log10(model / data) of the BRDF points, (p,), for any loss; 1 for lower readings."""
        f = np.maximum(self.levels(candidate), DARKEST)
        lowest = LOWEST * f if self.scale == "linear" else 0.0
        return np.log10(f / np.maximum(self.brdf, lowest))

    def levels(self, candidate) -> np.ndarray:
        """Fitted BRDFs of the points, (p,)."""
        return self.residuals(candidate.variant).instrument(candidate.u[None])[0][0]

    def rms_dex(self, candidate) -> float:
        """Root mean square of `decades`."""
        return float(np.sqrt(np.mean(np.square(self.decades(candidate)))))


def select(
    measurements: Measurements,
    scale: str,
    half_angle: float,
    max_angle_deg: float,
    min_brdf: float,
    fewest: int,
    level: np.ndarray | None = None,
) -> tuple[Data, np.ndarray, dict[str, int]]:
    """Choose the points to fit.

    Parameters
    ----------
    measurements
        The measured points.
    scale
        Scale on which model and data are compared, a key of SCALES.
    half_angle
        Angular radius of the source [radians].
    max_angle_deg
        Largest |theta_i| and |theta_r| that are used [degrees].
    min_brdf
        BRDF above which points are used [1/sr].
    fewest
        Smallest number of points that can be fitted: the number of parameters.
    level
        Fitted BRDFs of all measurements. With sigma, those above `min_brdf` are chosen by them,
        and readings that are lower by more than LOW sigma are left out. Otherwise the readings
        decide, and noise keeps the bright ones of those near the limit.

    Returns
    -------
    tuple
        The `Data`, the mask of the points that were used, and the number of points that were
        dropped for each reason.

    Raises
    ------
    InputError
        If fewer than `fewest` points are left.
    """
    theta_i, theta_r, brdf = (
        np.asarray(column, dtype=float)
        for column in (measurements.theta_i, measurements.theta_r, measurements.brdf)
    )
    finite = np.isfinite(theta_i) & np.isfinite(theta_r) & np.isfinite(brdf)
    reach = np.maximum(np.abs(theta_i), np.abs(theta_r)) <= np.radians(max_angle_deg) + 1e-9
    bright = brdf > max(min_brdf, 0)
    if level is not None and measurements.sigma is not None:
        by_noise = level - brdf <= LOW * np.asarray(measurements.sigma, dtype=float)
        bright = (level > max(min_brdf, 0)) & (bright | by_noise)
    used = finite & reach & bright
    saturated = used & (brdf >= (1 - 1e-9) * np.max(brdf, where=used, initial=0))
    saturated &= PLATEAU <= saturated.sum() < RARE * used.sum()
    used &= ~saturated
    dropped = {
        "not a number": int(np.sum(~finite)),
        f"theta_i or theta_r beyond {max_angle_deg:g} degrees": int(np.sum(finite & ~reach)),
        f"brdf not above {min_brdf:g} 1/sr": int(np.sum(finite & reach & ~bright)),
        "at one largest value, as if the detector saturated": int(np.sum(saturated)),
    }
    dropped = {reason: count for reason, count in dropped.items() if count}
    if used.sum() < fewest:
        why = "".join(f"; {count} dropped: {reason}" for reason, count in dropped.items())
        raise InputError(
            f"{measurements.name or 'measurements'}: {used.sum()} points to fit, fewer than the "
            f"{fewest} parameters{why}"
        )
    spread, has_sigma = np.ones(used.sum()), measurements.sigma is not None
    if has_sigma:
        sigma = np.fmax(np.asarray(measurements.sigma, dtype=float)[used], SIGMA_FLOOR * brdf[used])
        spread = sigma * SCALES[scale](brdf[used])[1]
    data = Data(theta_i[used], theta_r[used], brdf[used], half_angle, scale, spread, has_sigma)
    return data, used, dropped


ANGLE_DEG = Bounds(lower=0, upper=np.nextafter(90, 0))


def with_std(table: DirectionalData, quantity: str) -> DirectionalData:
    """The table as `quantity`, with a standard deviation at each angle.

    Raises InputError for values outside 0..1 and angles outside 0..90 degrees.
    """
    value = np.asarray(table.value, dtype=float)
    Bounds(lower=0, upper=1).check_all(value, lambda k: f"{quantity}: value")
    angle = f"{quantity}: angle [degrees]"
    ANGLE_DEG.check_all(np.degrees(table.theta), lambda k: angle, hint=", 90 excluded")
    std = (
        np.full(len(value), DIRECTIONAL_STD)
        if table.std is None
        else np.maximum(table.std, DIRECTIONAL_STD / 10)
    )
    return DirectionalData(np.asarray(table.theta, dtype=float), value, std, quantity)
