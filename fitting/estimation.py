"""From measurements to parameters: `fit` and what it gives back."""

from dataclasses import dataclass
from time import perf_counter

import drjit as dr
import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.fitting.cube import parameters_at
from mi_lcair.fitting.data import Data, select, with_std
from mi_lcair.fitting.loss import SCALES
from mi_lcair.fitting.model import Hemispherical
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.fitting.search import COARSE, compare, descend
from mi_lcair.fitting.selection import AUTO, Candidate, Variant, variants
from mi_lcair.fitting.verdict import judge
from mi_lcair.progress import stepper

CONVERGED = 1e-9  # relative gradient
JOINT_STARTS = 16
GIVE_WAY = 1.2  # how much worse than alone a BRDF may fit beside an emissivity
EMISSIVITY_ANGLES = np.radians(np.arange(0.0, 86.0, 5.0))


@dataclass
class Fit:
    """Parameters of a surface with all that is known about them.

    parameters, standard_error, interval (95 %, low and high) and verdict by name; correlation (n,
    n) in the same order. model: name of the reflection model; form: of its equations; restriction:
    name of a simpler case, None for the whole model. rms_dex: root mean square of log10(data /
    model). used_points: mask over the measurements, used their number, dropped the others by
    reason; effective_points: how many independent ones they are worth; outliers: how many lie far
    from the model. gradient_norm: relative, at round-off if converged. starts_in_basin: share of
    the starts that reached this minimum. candidates: the variants compared. emissivity: (theta
    [radians], predicted 1 - HDR); emissivity_rms: its error against the measured one up to the
    largest angle that is fitted, None without one. seconds: all in all, compile_seconds: of these,
    for kernels.
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


def fit(
    measurements: Measurements,
    *,
    emissivity: DirectionalData | None = None,
    dhr: DirectionalData | None = None,
    model: str = AUTO,
    form: str = AUTO,
    starts: int = 64,
    seed: int = 0,
    loss: str = "log",
    robust: bool = False,
    max_angle_deg: float = 80,
    min_brdf: float = 1e-4,
    source_half_angle_deg: float | None = None,
    progress=None,
) -> Fit:
    """Fit a reflection model to measured BRDFs, jointly with an emissivity or DHR where one is
    given.

    model: a name, or "auto" for all. form: one of the model's, or "auto" for all of them and for
    their restrictions. Of what is compared, the simplest that is not significantly worse is taken.
    starts: descents at once, from
    points that `seed` sets. loss: scale on which BRDFs are compared, "log", "cube_root" or
    "linear". robust: outliers get little weight. Points beyond max_angle_deg or not above min_brdf
    [1/sr] are left out. source_half_angle_deg: as the measurements say if None, 0 for a point
    source. progress: called as progress(done, total). InputError for settings out of range and for
    too few points.
    """
    began, asked = perf_counter(), starts
    half_angle = (
        measurements.source_half_angle
        if source_half_angle_deg is None
        else np.radians(source_half_angle_deg)
    )
    compared = variants(model, form)
    check_settings(starts, loss, max_angle_deg, min_brdf, half_angle)
    sizes = {one.model: len(one.model.parameters) for one in compared}
    data, used, dropped = select(
        measurements, loss, float(half_angle), max_angle_deg, min_brdf, min(sizes.values())
    )
    compared = [one for one in compared if sizes[one.model] <= data.points]
    whole = [one for one in compared if one.restriction is None]
    tables = [
        with_std(table, quantity)
        for table, quantity in ((emissivity, "emissivity"), (dhr, "dhr"))
        if table
    ]
    # at most: the last comparison may not be needed
    total = len(compared) + (len(whole) + len(compared) if tables else 0) + 1
    step = stepper(progress, total)

    compile_seconds, candidates = warm_up(data, whole), []
    if tables:  # the misfit of the BRDF alone says what a BRDF point weighs beside an emissivity
        alone, candidates, noise = compare(data, whole, starts, seed, robust, step)
        data, most = data.jointly(noise.variance, tables), GIVE_WAY * rms_dex(data, alone)
        compile_seconds += warm_up(data, whole)
        starts = min(starts, JOINT_STARTS)  # hemispherical integrals cost much more than BRDFs
    best, candidates, noise = compare(data, compared, starts, seed, robust, step, candidates)
    if tables and rms_dex(data, best) > most:
        data = relieved(data, best, most)
        best, candidates, noise = compare(data, compared, starts, seed, robust, step, candidates)
    known = judge(data, best, noise, robust)
    if progress:
        progress(total, total)
    theta = EMISSIVITY_ANGLES if emissivity is None else np.asarray(emissivity.theta, dtype=float)
    chosen = best.variant
    predicted = Hemispherical(chosen.model, chosen.form, theta, "emissivity")(best.u[None])[0][0]
    return Fit(
        parameters=parameters_of(best),
        **known,
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
        candidates=[as_row(one, data, one is best) for one in candidates],
        emissivity=(theta, predicted),
        emissivity_rms=emissivity_error(emissivity, predicted, max_angle_deg),
        seconds=perf_counter() - began,
        compile_seconds=compile_seconds,
        settings={
            "model": model,
            "form": form,
            "starts": asked,
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
    )


def check_settings(starts, loss, max_angle_deg, min_brdf, half_angle) -> None:
    """InputError for the first setting that is out of its range."""
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
    """Compile the kernels of the variants; the seconds that it took."""
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
    """The data with the tables' standard deviations raised until the BRDF's rms is no more than
    `most` [decades].

    Where the model cannot follow both, they share the misfit: a table may spoil the BRDF that far
    and no further.
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
    """Root mean square of log10(model / data) over the points [decades], whatever the loss."""
    f = data.residuals(candidate.variant).instrument(candidate.u[None])[0][0]
    return float(np.sqrt(np.mean(np.square(np.log10(np.maximum(f, 1e-30) / data.brdf)))))


def names_of(variant: Variant) -> dict[str, str | None]:
    """The names of its model, form and restriction."""
    restriction = variant.restriction and variant.restriction.name
    return {"model": variant.model.name, "form": variant.form, "restriction": restriction}


def parameters_of(candidate: Candidate) -> dict[str, float]:
    model = candidate.variant.model
    return dict(zip(model.names, parameters_at(model, candidate.u[None])[0][0].tolist()))


def as_row(candidate: Candidate, data: Data, chosen: bool) -> dict:
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
    if measured is None:
        return None
    inside = np.asarray(measured.theta) <= np.radians(max_angle_deg) + 1e-9
    if not inside.any():
        return None
    return float(np.sqrt(np.mean(np.square(predicted - measured.value)[inside])))
