"""`fit`, which determines a model's parameters from measurements, and its result `Fit`."""

from dataclasses import dataclass
from os import PathLike
from time import perf_counter

import drjit as dr
import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.fitting import report
from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.data import Data, select, with_std
from mi_lcair.fitting.loss import SCALES
from mi_lcair.fitting.model import Hemispherical
from mi_lcair.fitting.quality import Quality, quality
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.scatterometer.reading import read, read_directional
from mi_lcair.fitting.search import COARSE, Noise, compare, descend
from mi_lcair.fitting.selection import AUTO, Candidate, Variant, variants
from mi_lcair.fitting.verdict import judge
from mi_lcair.physics.reflection import MODELS
from mi_lcair.progress import Progress, stepper
from mi_lcair.results import Result

CONVERGED = 1e-9  # relative gradient below which a fit is called converged
JOINT_STARTS = 16  # largest number of starts of a fit with an emissivity or DHR
# Largest factor by which the BRDF's rms deviation may grow when an emissivity or DHR is fitted with
# it.
LARGEST_RMS_RATIO = 1.2
# Angles at which the emissivity is predicted if none was measured [radians].
EMISSIVITY_ANGLES = np.radians(np.arange(0.0, 86.0, 5.0))


@dataclass(repr=False)
class Fit(Result):
    """Parameters of a surface, how well they are determined, and how they were found.

    Attributes
    ----------
    parameters
        Values by parameter name, in the model's units.
    standard_error
        Standard errors by parameter name.
    interval
        95 % intervals (low, high) by parameter name.
    verdict
        How well each parameter is determined, in words.
    correlation
        Correlation matrix of the parameters in their order, (n, n).
    model, form
        Names of the reflection model and of the form of its equations.
    restriction
        Name of the simpler case; None for the whole model.
    rms_dex
        Root mean square of log10(data / model) [decades].
    used, used_points
        Number of fitted points, and their mask over the measurements.
    dropped
        Number of points that were left out, by reason.
    effective_points
        Number of independent points that the correlated points are worth.
    outliers
        Number of points that lie far from the model.
    converged, gradient_norm
        Whether the minimum was reached, and the relative gradient there.
    starts_in_basin
        Share of the starts that reached this minimum.
    candidates
        The variants that were compared, one report each.
    emissivity
        Angles [radians] and the emissivities 1 - HDR that the model predicts there.
    emissivity_rms
        Root mean square error of the predicted emissivity up to the largest fitted angle; None
        without a measured one.
    seconds, compile_seconds
        Time of the whole fit, and the part of it spent on compiling kernels.
    settings
        The settings of the fit.
    quality
        Whether the model describes the data, see `Quality`.
    measurements, directional
        The data, and the tables of "emissivity" and "dhr" that were given, by quantity.
    """

    parameters: dict[str, float]
    standard_error: dict[str, float]
    interval: dict[str, tuple[float, float]]
    verdict: dict[str, str]
    correlation: np.ndarray
    model: str
    form: str
    restriction: str | None
    rms_dex: float
    used: int
    used_points: np.ndarray
    dropped: dict[str, int]
    effective_points: float
    outliers: int
    converged: bool
    gradient_norm: float
    starts_in_basin: float
    candidates: list[dict]
    emissivity: tuple[np.ndarray, np.ndarray]
    emissivity_rms: float | None
    seconds: float
    compile_seconds: float
    settings: dict
    quality: Quality
    measurements: Measurements
    directional: dict[str, DirectionalData]

    kind = report.KIND
    drawn_by = "mi_lcair.reports.pictures.fit:figure"

    def summary(self) -> str:
        """One line: model, surface, parameters with standard errors, misfit."""
        values = ", ".join(
            f"{name} {value:.4g} +- {self.standard_error[name]:.1g}"
            for name, value in self.parameters.items()
        )
        judged = {True: "; LACK OF FIT", False: "", None: "; fit not judged"}
        return (
            f"fit of {self.model} to {self.measurements.name}: {values}; rms {self.rms_dex:.3g} "
            f"decades{judged[self.quality.lack_of_fit]}"
        )

    def entries(self) -> dict:
        """Entries of the JSON report, which is a material for scenes."""
        return report.entries(self.measurements, self, self.directional)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each parameter: value, standard error, 95 % interval, unit and verdict.

        The unit "1" is that of a number without one.
        """
        units = {own.name: own.unit for own in MODELS[self.model].parameters}
        names = list(self.parameters)
        low, high = np.array([self.interval[name] for name in names], dtype=float).T
        return {
            "parameter": np.array(names),
            "value": np.array([self.parameters[name] for name in names], dtype=float),
            "standard_error": np.array([self.standard_error[name] for name in names], dtype=float),
            "low": low,
            "high": high,
            "unit": np.array([units[name] for name in names]),
            "verdict": np.array([self.verdict[name] for name in names]),
        }


def fit(
    measurements: Measurements | str | PathLike[str],
    *,
    emissivity: DirectionalData | str | PathLike[str] | None = None,
    dhr: DirectionalData | str | PathLike[str] | None = None,
    quantity: str | None = None,
    theta_r_positive: str | None = None,
    model: str = AUTO,
    form: str = AUTO,
    starts: int = 64,
    seed: int = 0,
    loss: str = "log",
    robust: bool = False,
    max_angle_deg: float = 80,
    min_brdf: float = 1e-4,
    source_half_angle_deg: float | None = None,
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
    quantity, theta_r_positive
        What a file of measurements does not state, see `mi_lcair.fitting.scatterometer.reading`.
    model
        Name of a model, or "auto" for all models.
    form
        A form of the model, or "auto" for all its forms and their restrictions.
    starts
        Number of starting points of the search.
    seed
        Seed of the random starting points.
    loss
        Scale on which BRDFs are compared: "log", "cube_root" or "linear".
    robust
        Whether outliers get little weight.
    max_angle_deg
        Largest angle of source and observer that is used [degrees].
    min_brdf
        BRDF above which points are used [1/sr].
    source_half_angle_deg
        Angular radius of the source [degrees], 0 for a point source; None takes it from the
        measurements.
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
        measurements = read(measurements, quantity, theta_r_positive)
    if isinstance(emissivity, (str, PathLike)):
        emissivity = read_directional(emissivity, "emissivity")
    if isinstance(dhr, (str, PathLike)):
        dhr = read_directional(dhr, "dhr")
    half_angle = (
        measurements.source_half_angle
        if source_half_angle_deg is None
        else np.radians(source_half_angle_deg)
    )
    compared = variants(model, form)
    check_settings(starts, loss, max_angle_deg, min_brdf, half_angle)
    sizes = {variant.model: len(variant.model.parameters) for variant in compared}
    data, used, dropped = select(
        measurements, loss, float(half_angle), max_angle_deg, min_brdf, min(sizes.values())
    )
    selected = data
    compared = [variant for variant in compared if sizes[variant.model] <= data.points]
    tables = [
        with_std(table, quantity)
        for table, quantity in ((emissivity, "emissivity"), (dhr, "dhr"))
        if table
    ]
    # This is the largest number of steps: the last comparison of a joint fit is not always needed.
    joint_steps = len(compared) + sum(variant.restriction is None for variant in compared)
    total = len(compared) + (joint_steps if tables else 0) + 1
    data, best, candidates, noise, compile_seconds = search_variants(
        data, compared, tables, starts, seed, robust, stepper(progress, total)
    )
    certainty = judge(data, best, noise, robust)
    fit_quality = quality(selected, best, robust, measurements.sigma_freedom)
    if progress:
        progress(total, total)
    theta = EMISSIVITY_ANGLES if emissivity is None else np.asarray(emissivity.theta, dtype=float)
    chosen = best.variant
    predicted = Hemispherical(chosen.model, chosen.form, theta, "emissivity")(best.u[None])[0][0]
    return Fit(
        parameters=parameters_of(best),
        **certainty,
        **names_of(chosen),
        rms_dex=rms_dex(data, best),
        used=data.points,
        used_points=used,
        dropped=dropped,
        effective_points=noise.effective,
        outliers=noise.outliers,
        converged=bool(best.gradient < CONVERGED),
        gradient_norm=best.gradient,
        starts_in_basin=best.share,
        candidates=[as_row(candidate, data, candidate is best) for candidate in candidates],
        emissivity=(theta, predicted),
        emissivity_rms=emissivity_error(emissivity, predicted, max_angle_deg),
        seconds=perf_counter() - began,
        compile_seconds=compile_seconds,
        settings={
            "model": model,
            "form": form,
            "starts": starts,
            "seed": seed,
            "loss": loss,
            "robust": robust,
            "max_angle_deg": max_angle_deg,
            "min_brdf": min_brdf,
            "source_half_angle_deg": float(np.degrees(half_angle)),
            "joint": {
                table.quantity: {"std_factor": data.std_factor} for table in data.directional
            },
        },
        quality=fit_quality,
        measurements=measurements,
        directional={
            name: table for name, table in (("emissivity", emissivity), ("dhr", dhr)) if table
        },
    )


def search_variants(
    data: Data,
    compared: list[Variant],
    tables: list[DirectionalData],
    starts: int,
    seed: int,
    robust: bool,
    step,
) -> tuple[Data, Candidate, list[Candidate], Noise, float]:
    """Search all variants, and join the directional tables to the BRDF points.

    Parameters
    ----------
    data
        The BRDF points.
    compared
        Variants to compare, whole ones first.
    tables
        Directional tables to be fitted with the points; may be empty.
    starts, seed, robust
        As in `fit`.
    step
        Function that is called after each search.

    Returns
    -------
    tuple
        The data with the tables, the chosen candidate, all candidates, the noise, and the seconds
        spent on compiling.
    """
    whole = [variant for variant in compared if variant.restriction is None]
    compile_seconds, candidates = warm_up(data, whole), []
    if tables:
        # The misfit of the BRDF alone gives the weight of a BRDF point beside an emissivity.
        alone, candidates, noise = compare(data, whole, starts, seed, robust, step)
        largest_rms = LARGEST_RMS_RATIO * rms_dex(data, alone)
        data = data.jointly(noise.variance, tables)
        compile_seconds += warm_up(data, whole)
        starts = min(starts, JOINT_STARTS)  # hemispherical integrals cost much more than BRDFs
    best, candidates, noise = compare(data, compared, starts, seed, robust, step, candidates)
    if tables and rms_dex(data, best) > largest_rms:
        # The tables spoil the BRDF too much. They get less weight, and the search is repeated.
        data = relieved(data, best, largest_rms)
        best, candidates, noise = compare(data, compared, starts, seed, robust, step, candidates)
    return data, best, candidates, noise, compile_seconds


def check_settings(starts, loss, max_angle_deg, min_brdf, half_angle) -> None:
    """Raise InputError for the first setting that is out of its range."""
    if loss not in SCALES:
        raise unknown("loss", loss, list(SCALES))
    for name, value, valid, right in (
        ("starts", starts, starts >= 1, "at least 1"),
        ("max_angle_deg", max_angle_deg, 0 < max_angle_deg <= 90, "in 0..90, 0 excluded"),
        ("min_brdf", min_brdf, min_brdf >= 0, "at least 0"),
        (
            "source_half_angle_deg",
            np.degrees(half_angle),
            0 <= half_angle < 0.5 * np.pi,
            "in 0..90, 90 excluded",
        ),
    ):
        if not valid:
            raise InputError(f"{name} = {value:g} is out of range; it must be {right}")


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


def relieved(data: Data, best: Candidate, most: float) -> Data:
    """Raise the tables' standard deviations until the BRDF's rms deviation is acceptable.

    A model that cannot describe both BRDF and tables fits both worse. This limits how much worse it
    fits the BRDF.

    Parameters
    ----------
    data
        Points and tables.
    best
        The candidate from which the descents start.
    most
        Largest rms deviation of the BRDF [decades].

    Returns
    -------
    Data
        The data with a larger std_factor, at most 32.
    """
    low, high = 1.0, 32.0
    for _ in range(7):
        middle = np.sqrt(low * high)
        trial = data.with_std_factor(middle)
        if rms_dex(trial, descend(best, trial.residuals(best.variant), COARSE)) > 0.995 * most:
            low = middle
        else:
            high = middle
    return data.with_std_factor(high)


def rms_dex(data: Data, candidate: Candidate) -> float:
    """Root mean square of log10(model / data) over the BRDF points [decades], for any loss."""
    f = data.residuals(candidate.variant).instrument(candidate.u[None])[0][0]
    return float(np.sqrt(np.mean(np.square(np.log10(np.maximum(f, 1e-30) / data.brdf)))))


def names_of(variant: Variant) -> dict[str, str | None]:
    """The names of a variant's model, form and restriction."""
    restriction = variant.restriction and variant.restriction.name
    return {"model": variant.model.name, "form": variant.form, "restriction": restriction}


def parameters_of(candidate: Candidate) -> dict[str, float]:
    """A candidate's parameters by name."""
    model = candidate.variant.model
    return dict(zip(model.names, parameters_at(model, candidate.u[None])[0][0].tolist()))


def as_row(candidate: Candidate, data: Data, chosen: bool) -> dict:
    """The report on one candidate of the comparison."""
    return {
        **names_of(candidate.variant),
        "free_parameters": candidate.size,
        "rms_dex": rms_dex(data, candidate),
        "criterion": candidate.criterion,
        "parameters": parameters_of(candidate),
        "chosen": chosen,
    }


def emissivity_error(
    measured: DirectionalData | None, predicted, max_angle_deg: float
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
