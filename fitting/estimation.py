"""`fit`, which determines a model's parameters from measurements."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from os import PathLike
from time import perf_counter
from typing import Literal

import drjit as dr
import numpy as np

from mi_lcair.declared import fraction
from mi_lcair.fitting.data import (
    Data,
    FitSettings,
    FittedVariant,
    Variant,
    select,
    variants,
    with_std,
)
from mi_lcair.fitting.model import Hemispherical, parameters_at
from mi_lcair.fitting.quality import likely_cause, mistake, quality
from mi_lcair.fitting.report import Fit
from mi_lcair.fitting.scatterometer import reading
from mi_lcair.fitting.search import COARSE, ROUND_OFF, Noise, assess, compare, descend
from mi_lcair.fitting.uncertainty import judge
from mi_lcair.progress import Progress, stepper
from mi_lcair.tasks import exclusively

CONVERGED = 1e-9  # relative gradient below which a fit is called converged
JOINT_STARTS = 16  # largest number of starts of a fit with an emissivity or DHR
# Largest factor by which the BRDF's rms deviation may grow when an emissivity or DHR is fitted with
# it.
LARGEST_RMS_RATIO = 1.2
LINEAR_ROUNDS = 4  # rounds in which the variances and the fit on the linear scale are found in turn
# Angles at which the emissivity is predicted if none was measured [radians].
EMISSIVITY_ANGLES = np.radians(np.arange(0.0, 86.0, 5.0))


@exclusively
def fit(
    measurements: reading.Measurements | str | PathLike[str],
    *,
    emissivity: reading.DirectionalData | str | PathLike[str] | None = None,
    dhr: reading.DirectionalData | str | PathLike[str] | None = None,
    quantity: Literal["brdf", "brdf_cos", "brf"] | None = None,
    theta_r_positive: Literal["specular", "source"] | None = None,
    model: str = "auto",
    form: str = "auto",
    starts: int = 64,
    seed: int = 0,
    loss: Literal["log", "cube_root", "linear"] = "log",
    robust: bool = False,
    max_angle_deg: float = 80,
    min_brdf: float = 1e-4,
    source_half_angle_deg: float | None = None,
    calibration: float | str | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit a reflection model to measured BRDFs, and to an emissivity or DHR if one is given.

    Several variants (models, forms, restrictions) are compared if `model` or `form` is "auto". The
    simplest variant that is not significantly worse than the best is chosen.

    Parameters
    ----------
    measurements
        The BRDF points, or their CSV or ASTM E1392/E2387 file.
    emissivity, dhr
        Measured directional emissivity and directional-hemispherical reflectance, or their files,
        or None.
    quantity
        Quantity of the values, if the file does not give it: BRDF, BRDF x cos theta_r, or BRF,
        which is BRDF x pi.
    theta_r_positive
        Side on which theta_r is positive, if the file does not give it.
    model
        Name of a reflection model. auto compares sandford_robertson and microfacet,
        and selects the simplest one that describes the data.
    form
        Form of the model, such as thesis or normalized. auto compares all forms and their
        restrictions.
    starts
        Number of starting points of the search.
    seed
        Seed of the random starting points.
    loss
        Scale on which BRDFs are compared. With log, a fit that describes the data is repeated on
        the linear scale, with the noise that the first fit shows.
    robust
        Give outliers little weight.
    max_angle_deg
        Largest angle of source and observer that is used [degrees].
    min_brdf
        BRDF above which points are used [1/sr].
    source_half_angle_deg
        Angular radius of the source [degrees], 0 for a point source (default: the value in the
        file).
    calibration
        Standard deviation of a factor that all readings have in common, such as 0.05 or "5%"
        (default: the value in the file).
    progress
        Function of (steps done, steps in total).

    Returns
    -------
    Fit
        The parameters of the chosen variant.

    Raises
    ------
    InputError
        If a setting is out of range, a file cannot be used, or there are too few points.
    """
    began = perf_counter()
    if isinstance(measurements, (str, PathLike)):
        measurements = reading.read(measurements, quantity, theta_r_positive)
    directional = {
        name: reading.read_directional(table, name) if isinstance(table, (str, PathLike)) else table
        for name, table in (("emissivity", emissivity), ("dhr", dhr))
        if table
    }
    if source_half_angle_deg is None:
        source_half_angle_deg = float(np.degrees(measurements.source_half_angle))
    calibration = measurements.calibration if calibration is None else fraction(calibration)
    compared = variants(model, form)
    points = max_angle_deg, min_brdf, source_half_angle_deg, calibration
    settings = FitSettings(model, form, starts, seed, loss, robust, *points)
    fewest = min(len(variant.model.parameters) for variant in compared)
    selected, used, dropped = select(
        measurements, loss, settings.half_angle, max_angle_deg, min_brdf, fewest
    )
    compared = [v for v in compared if len(v.model.parameters) <= selected.points]
    steps = largest_steps(compared, bool(directional))
    search = searched(selected, compared, directional, settings, stepper(progress, steps))
    fit_quality = quality(selected, search.best, robust, measurements.sigma_freedom)
    if loss == "log" and not robust:
        (points, *which), linear = on_linear_scale(search, measurements, settings)
        of_linear = quality(points, linear.best, robust, measurements.sigma_freedom)
        if not (of_linear.lack_of_fit or linear.noise.has_outliers(points.points)):
            search, fit_quality, (used, dropped) = linear, of_linear, which
    measured = directional.get("emissivity")
    theta = EMISSIVITY_ANGLES if measured is None else np.asarray(measured.theta, dtype=float)
    curve = Hemispherical(search.best.variant.model, search.best.variant.form, theta, "emissivity")
    certainty = judge(search.data, search.best, search.noise, settings, curve, fit_quality)
    misfit, freedom = selected.rms_dex(search.best), measurements.sigma_freedom
    if cause := (
        mistake(selected, search, fit_quality, robust, freedom)
        or likely_cause(measurements, compared, settings, misfit)
    ):
        fit_quality = replace(fit_quality, verdict=f"{fit_quality.verdict}; {cause}")
    if progress:
        progress(steps, steps)
    return Fit(
        **certainty,
        **described(search),
        **emissivity_of(search.best, theta, curve, measured, max_angle_deg),
        used=int(used.sum()),
        used_points=used,
        dropped=dropped,
        settings=asdict(settings) | {"joint": search.joint},
        quality=fit_quality,
        measurements=measurements,
        directional=directional,
        seconds=perf_counter() - began,
    )


@dataclass(frozen=True)
class Search:
    """What a search of all variants found.

    Attributes
    ----------
    data
        The BRDF points with the directional tables.
    best, candidates
        The chosen candidate, and all candidates.
    noise
        The noise that the chosen one leaves.
    compile_seconds
        Time spent on compiling kernels.
    """

    data: Data
    best: FittedVariant
    candidates: list[FittedVariant]
    noise: Noise
    compile_seconds: float

    @property
    def joint(self) -> dict[str, dict[str, float]]:
        """The weights of the directional tables, by quantity."""
        tables = self.data.directional
        return {table.quantity: {"std_factor": self.data.std_factor} for table in tables}


def searched(
    data: Data,
    compared: list[Variant],
    directional: dict[str, reading.DirectionalData],
    settings: FitSettings,
    step: Callable[[], None],
) -> Search:
    """Search all variants, and join the directional tables to the BRDF points.

    Parameters
    ----------
    data
        The BRDF points.
    compared
        Variants to compare, whole ones first.
    directional
        Directional tables to be fitted with the points, by quantity; may be empty.
    settings
        The settings of the fit.
    step
        Function that is called after each search.
    """
    whole = [variant for variant in compared if variant.restriction is None]
    tables = [with_std(table, quantity) for quantity, table in directional.items()]
    compile_seconds, candidates = warm_up(data, whole), []
    if tables:
        # The misfit of the BRDF alone gives the weight of a BRDF point beside an emissivity.
        alone, candidates, noise = compare(data, whole, settings, step)
        largest_rms = LARGEST_RMS_RATIO * data.rms_dex(alone)
        data = data.jointly(noise.variance, tables)
        compile_seconds += warm_up(data, whole)
        # Hemispherical integrals cost much more than BRDFs.
        settings = replace(settings, starts=min(settings.starts, JOINT_STARTS))
    best, candidates, noise = compare(data, compared, settings, step, candidates)
    if tables and data.rms_dex(best) > largest_rms:
        # The tables spoil the BRDF too much. They get less weight, and the search is repeated.
        data = relieved(data, best, largest_rms)
        best, candidates, noise = compare(data, compared, settings, step, candidates)
    return Search(data, best, candidates, noise, compile_seconds)


def on_linear_scale(search: Search, measurements: reading.Measurements, settings: FitSettings):
    """Continue a search on the linear scale, where noise does not shift levels.

    The fitted levels choose the points, also those whose readings noise has made negative. Returns
    what `select` does, with the weights of the BRDF points without tables, and the search.
    """
    best, given = search.best, search.data
    angles = (np.nan_to_num(column) for column in (measurements.theta_i, measurements.theta_r))
    none = np.ones(len(measurements.brdf))
    everywhere = Data(*angles, none, settings.half_angle, "linear", none, False)
    limits = settings.half_angle, settings.max_angle_deg, settings.min_brdf, len(best.u)
    for _ in range(LINEAR_ROUNDS):
        level = everywhere.levels(best)
        selected, used, dropped = select(measurements, "linear", *limits, level)
        weighted = data = selected.at_level(level[used])
        if given.directional:
            variance = assess(weighted, best).variance
            data = weighted.jointly(variance, given.directional).with_std_factor(given.std_factor)
        best = descend(best, data.residuals(best.variant), ROUND_OFF)
    listed = [best if candidate is search.best else candidate for candidate in search.candidates]
    noise = assess(data, best)
    continued = replace(search, data=data, best=best, candidates=listed, noise=noise)
    return (weighted, used, dropped), continued


def largest_steps(compared: list[Variant], is_joint: bool) -> int:
    """Largest number of steps of a fit: the last comparison of a joint one is not always needed."""
    whole = sum(variant.restriction is None for variant in compared)
    return len(compared) + is_joint * (len(compared) + whole) + 1


def warm_up(data: Data, variants: list[Variant]) -> float:
    """Compile the kernels of the variants, and return the seconds that this took."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for variant in variants:
            for aperture in {False, bool(data.half_angle)}:
                data.residuals(variant, aperture)(variant.model.starting_points(2, 0))
        return (
            sum(
                kernel.get("codegen_time", 0) + kernel.get("backend_time", 0)
                for kernel in dr.kernel_history()
            )
            / 1000
        )


def relieved(data: Data, best: FittedVariant, most: float) -> Data:
    """Raise the tables' standard deviations until the BRDF's rms deviation is acceptable.

    A model that cannot describe both BRDF and tables fits both worse. This limits how much worse it
    fits the BRDF. best: the candidate from which the descents start. most: largest rms deviation of
    the BRDF [decades]. Returns the data with a larger std_factor, at most 32.
    """
    low, high = 1.0, 32.0
    for _ in range(7):
        middle = np.sqrt(low * high)
        trial = data.with_std_factor(middle)
        if trial.rms_dex(descend(best, trial.residuals(best.variant), COARSE)) > 0.995 * most:
            low = middle
        else:
            high = middle
    return data.with_std_factor(high)


def names_of(variant: Variant) -> dict[str, str | None]:
    """The names of a variant's model, form and restriction."""
    restriction = variant.restriction and variant.restriction.name
    return {"model": variant.model.name, "form": variant.form, "restriction": restriction}


def parameters_of(candidate: FittedVariant) -> dict[str, float]:
    """A candidate's parameters by name."""
    model = candidate.variant.model
    return dict(zip(model.names, parameters_at(model, candidate.u[None])[0][0].tolist()))


def described(search: Search) -> dict:
    """What a search found, as attributes of `Fit`."""
    best, noise = search.best, search.noise
    return {
        **names_of(best.variant),
        "parameters": parameters_of(best),
        "rms_dex": search.data.rms_dex(best),
        "effective_points": noise.effective,
        "outliers": noise.outliers,
        "converged": bool(best.gradient < CONVERGED),
        "gradient_norm": best.gradient,
        "starts_in_basin": best.share,
        "candidates": [
            {
                **names_of(candidate.variant),
                "free_parameters": candidate.size,
                "rms_dex": search.data.rms_dex(candidate),
                "criterion": candidate.criterion,
                "parameters": parameters_of(candidate),
                "chosen": candidate is best,
            }
            for candidate in search.candidates
        ],
        "compile_seconds": search.compile_seconds,
    }


def emissivity_of(
    best: FittedVariant,
    theta,
    curve: Hemispherical,
    measured: reading.DirectionalData | None,
    max_angle_deg,
) -> dict:
    """The predicted emissivity and its misfit, as attributes of `Fit`."""
    predicted = curve(best.u[None])[0][0]
    return {
        "emissivity": (theta, predicted),
        "emissivity_rms": emissivity_error(measured, predicted, max_angle_deg),
    }


def emissivity_error(
    measured: reading.DirectionalData | None, predicted, max_angle_deg: float
) -> float | None:
    """Root mean square error of the predicted emissivity up to max_angle_deg [degrees].

    None if no emissivity was measured up to this angle.
    """
    if measured is None:
        return None
    inside = np.asarray(measured.theta) <= np.radians(max_angle_deg) + 1e-9
    if not inside.any():
        return None
    return float(np.sqrt(np.mean(np.square(predicted - measured.value)[inside])))
