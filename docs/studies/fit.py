"""Long studies of the fit, run by hand.

    python -m docs.studies.fit STUDY [MODEL...] [SURFACES]

STUDY: recovery, coverage, emissivity, choice, surfaces, joint, losses, time; or claims, which
writes the page docs/validation/fits.md from what is measured, docs/validation/fits/claims.json.
"""

import json
import sys
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.optimize import least_squares

import mi_lcair  # noqa: F401  it chooses the LLVM and must precede the import of Dr.Jit
from docs.studies.page import write_page
from mi_lcair.files import replacing
from mi_lcair.fitting import fit, read
from mi_lcair.fitting.data import AUTO, COMPARED, Variant, select
from mi_lcair.fitting.estimation import emissivity_error
from mi_lcair.fitting.model import Hemispherical, Scatterometer, directional, model_of
from mi_lcair.fitting.scatterometer.reading import pool, read_directional
from mi_lcair.fitting.search import COARSE, ROUND_OFF, explore, levenberg_marquardt
from mi_lcair.physics.reflection.models import MODELS
from tests.fitting.synthetic import ROUGH, THESIS_SETS, relative_errors, scan_of

SURFACES = Path(__file__).parents[2].parent / "shared" / "data" / "mwir_brdf"
NAMES_OF_SURFACES = (
    "aluminium",
    "aluminium_sandblasted",
    "copper",
    "paint_rough",
    "paint_smooth",
    "steel_sandblasted",
)
KNOWN = {  # model -> surfaces with known parameters
    "sandford_robertson": {**THESIS_SETS, "rough": ROUGH},
    "microfacet": {
        "paint": (0.2, 1.7, 1.5, 0.4, 0.1),
        "dielectric": (0.05, 2.0, 1.5, 0.0, 0.02),
        "metal": (0.1, 1.3, 2.5, 3.0, 0.3),
        "bright metal": (0.02, 1.2, 5.0, 15.0, 0.0),
    },
}


def known(models):
    """Yield (model, surface, parameters) of the surfaces with known parameters."""
    for model in models:
        for surface, parameters in KNOWN[model].items():
            yield MODELS[model], surface, parameters


def recovery(models, seeds=20):
    """Print the largest relative error of any parameter over the seeds, for data without noise."""
    for model, surface, parameters in known(models):
        data = scan_of(model, parameters, step=0.5)
        fits = [fit(data, model=model.name, seed=seed) for seed in range(seeds)]
        zero = np.array(parameters) == 0
        worst = [relative_errors(result, np.where(zero, 1, parameters)) for result in fits]
        # The error is absolute where the true value is 0.
        worst = np.max(np.abs(np.array(worst) - zero), axis=0)
        print(
            f"{model.name}, {surface}: worst relative error {worst.max():.1e}, "
            f"converged {all(result.converged for result in fits)}, "
            f"{ {model_of(result) for result in fits} }, "
            f"starts in basin >= {min(result.starts_in_basin for result in fits):.2f}",
            flush=True,
        )


def coverage(models, repetitions=200):
    """Print how often 2 standard errors and the 95 % interval contain the true value, at 5 % noise.

    Only fits that determine the parameter are counted, except for the last number.
    """
    for model, surface, parameters in known(models):
        shape = repetitions, len(parameters)
        inside, interval, determined = (np.zeros(shape, bool) for _ in range(3))
        for k in range(repetitions):
            data = scan_of(model, parameters, step=0.5, noise=0.05, seed=k)
            result = fit(data, model=model.name, form=model.forms[0], starts=8, seed=k)
            for j, key in enumerate(model.names):
                determined[k, j] = result.verdict[key] == "determined"
                error = abs(result.parameters[key] - parameters[j])
                inside[k, j] = error <= 2 * result.standard_error[key]
                low, high = result.interval[key]
                interval[k, j] = low <= parameters[j] <= high
        print(
            model.name,
            surface,
            {
                key: f"determined {d.sum()}, 2 se {100 * i[d].mean():.1f} %, "
                f"interval {100 * v[d].mean():.1f} %"
                for key, d, i, v in zip(model.names, determined.T, inside.T, interval.T)
                if d.any()
            },
            f"all intervals {100 * interval.mean():.1f} %",
            flush=True,
        )


def emissivity(models, surfaces_of_model=100):
    """Print how often 95 % intervals of emissivity and BRDF contain the true ones, at 5 % noise.

    The surfaces are random. The emissivities are those at 0 to 80 degrees.
    """
    for model in (MODELS[name] for name in models):
        starts = model.starting_points(surfaces_of_model, seed=12)
        inside = [intervals_hold(model, model.values_at(u), k) for k, u in enumerate(starts)]
        for name, held in zip(("emissivity", "BRDF"), zip(*inside)):
            share = 100 * np.mean([np.mean(of_surface) for of_surface in held])
            print(f"{model.name}, {name}: {share:.1f} % of {len(held)} surfaces", flush=True)


def intervals_hold(model, parameters, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Which intervals of a fit to a surface with these parameters contain the true values.

    Those of the emissivity at 0 to 80 degrees, (a,), and those of the BRDF at the points, (p,).
    """
    scan = partial(scan_of, model, parameters, step=5, seed=seed)
    data, true_brdf = scan(noise=0.05), scan(noise=0).brdf
    settings = {"model": model.name, "form": model.forms[0], "source_half_angle_deg": 0}
    result = fit(data, starts=6, seed=seed, **settings)
    theta = result.emissivity[0]
    true = Hemispherical(model, model.forms[0], theta, "emissivity")(model.to_cube([parameters]))
    inside = within(true[0][0], result.emissivity_interval)
    return (
        inside[np.degrees(theta) <= 80.1],
        within(true_brdf[result.used_points], result.brdf_interval),
    )


def within(values, intervals) -> np.ndarray:
    """Which values (n,) lie in their intervals (n, 2), up to rounding."""
    low, high = intervals.T
    return (low - 1e-9 <= values) & (values <= high + 1e-9)


def choice(models, repetitions=20):
    """Print the models that `auto` chooses for the data of each surface, at 5 % noise."""
    for model, surface, parameters in known(models):
        taken = [
            model_of(fit(scan_of(model, parameters, noise=0.05, seed=k), seed=k))
            for k in range(repetitions)
        ]
        counts = {choice: taken.count(choice) for choice in sorted(set(taken))}
        print(f"{model.name}, {surface}: {counts}", flush=True)


def surfaces(models):
    """Print the rms residual in decades of each form on the six real surfaces, and the seconds."""
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        for model in models:
            for form in MODELS[model].forms:
                result = fit(data, model=model, form=form, source_half_angle_deg=0)
                print(
                    f"{name}, {model} {form}: {result.rms_dex:.5f}, "
                    f"converged {result.converged}, {result.seconds:.1f} s",
                    flush=True,
                )


def joint(models):
    """Compare the fit to the BRDF alone with the joint fit to BRDF and emissivity.

    It prints the rms residual in decades and the rms error of the emissivity up to 80 degrees.
    """
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        table = read_directional(SURFACES / f"{name}_emissivity.csv", "emissivity")
        for model in models:
            settings = {"model": model, "source_half_angle_deg": 0}
            alone, both = fit(data, **settings), fit(data, emissivity=table, **settings)
            error = emissivity_error(table, directional(alone, "emissivity", table.theta), 80)
            print(
                f"{name}: rms {alone.rms_dex:.4f} -> {both.rms_dex:.4f} "
                f"({both.rms_dex / alone.rms_dex:.2f}), emissivity {error:.4f} -> "
                f"{both.emissivity_rms:.4f}, {model_of(both)}, {both.settings['joint']}, "
                f"{both.seconds:.1f} s",
                flush=True,
            )


def losses(models):
    """Print the rms residual in decades of the fit with each loss on the real surfaces."""
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        for model in models:
            settings = {"model": model, "form": MODELS[model].forms[0], "source_half_angle_deg": 0}
            rms = {
                loss: round(fit(data, loss=loss, **settings).rms_dex, 4)
                for loss in ("log", "cube_root", "linear")
            }
            print(name, model, rms, flush=True)


def time(models, repetitions=5):
    """Print the time of a search from 64 starts, on 720 and on about 10,000 points.

    The 720 points are those of a real surface. For them the time of SciPy is printed as well. It
    uses the same residuals and derivatives, one start after the other.
    """
    for name in ("aluminium", "paint_rough"):
        measurements = read(SURFACES / f"{name}.csv")
        for model, copies in ((MODELS[model], copies) for model in models for copies in (1, 14)):
            data, _, _ = select(measurements, "log", 0.0, 80, 1e-4, len(model.parameters))
            theta_i, theta_r, brdf, spread = (
                np.tile(column, copies)
                for column in (data.theta_i, data.theta_r, data.brdf, data.spread)
            )
            data = type(data)(theta_i, theta_r, brdf, 0.0, "log", spread, False)
            residuals = data.residuals(Variant(model, model.forms[0]))
            starts = model.starting_points(64, 0)
            seconds = []
            for _ in range(repetitions if copies == 1 else 2):
                began = perf_counter()
                minima = levenberg_marquardt(
                    residuals, explore(residuals, starts), tolerance=COARSE
                )
                best = levenberg_marquardt(
                    residuals, minima.u[[np.argmin(minima.cost)]], tolerance=ROUND_OFF
                )
                seconds.append(perf_counter() - began)
            print(
                f"{name}, {model.name}, {len(brdf)} points: first {seconds[0]:.2f} s with the "
                f"compile, then {min(seconds[1:]):.2f} s, "
                f"rms {np.sqrt(2 * best.cost[0] / len(brdf)):.5f}, "
                f"gradient {best.gradient[0]:.1e}",
                flush=True,
            )
            if copies == 1:
                began = perf_counter()
                costs = [
                    least_squares(
                        lambda u: residuals(u[None])[0][0],
                        u,
                        lambda u: residuals(u[None])[1][0],
                        bounds=(0, 1),
                    ).cost
                    for u in starts
                ]
                print(
                    f"  scipy.optimize.least_squares: {perf_counter() - began:.2f} s, "
                    f"rms {np.sqrt(2 * min(costs) / len(brdf)):.5f}",
                    flush=True,
                )


# The generator of fits
# ---------------------
# Each row of the page is a kind of data. Each of its surfaces has other parameters, drawn over the
# feasible set, other angles and other noise.

LEVELS = (0.02, 0.05, 0.10)  # standard deviation of the noise, relative
FALSE = 3  # a verdict "determined" is false if the value is off by more of its standard errors
CALIBRATION = 0.05  # standard deviation of the common factor of all readings
PAGE = Path(__file__).parents[1] / "validation" / "fits.md"
MEASURED = PAGE.with_suffix("") / "claims.json"
COUNTED = ("determined", "false", "told", "lack of fit", "cause")
LEVEL_WORDS = "if the level is calibrated"


def of_truth(truth, s, rng):
    """Noise proportional to the true value; its standard deviation is given."""
    return truth * (1 + s * rng.standard_normal(truth.size)), s * truth


def of_reading(truth, s, rng):
    """The same noise; the given standard deviation is proportional to the reading."""
    brdf = of_truth(truth, s, rng)[0]
    return brdf, s * np.abs(brdf)


def unstated(truth, s, rng):
    """The same noise; no standard deviation is given."""
    return of_truth(truth, s, rng)[0], None


def additive(truth, s, rng):
    """Equal noise for all readings, relative to their median; it is given."""
    size = np.full(truth.size, s * np.median(truth))
    return truth + size * rng.standard_normal(truth.size), size


def shot(truth, s, rng):
    """Noise proportional to the square root of the true value; it is given for each reading."""
    unit = s**2 * np.median(truth)
    brdf = truth + np.sqrt(unit * truth) * rng.standard_normal(truth.size)
    return brdf, np.sqrt(unit * np.maximum(brdf, unit))


def repeated(truth, s, rng):
    """The mean of three scans; the standard deviation comes from their scatter."""
    scans = truth * (1 + s * np.sqrt(3) * rng.standard_normal((3, truth.size)))
    angle = np.tile(np.arange(truth.size) / 1e3, 3)
    return pool(angle, angle, scans.ravel())[2:]


NOISES = (of_truth, of_reading, unstated, additive, shot, repeated)


def dense(data, rng):
    """Scans as they are."""
    return data


def sparse(data, rng):
    """One angle of incidence, every third angle of observation."""
    return kept(data, (data.theta_i == data.theta_i[0]) & (np.arange(len(data.brdf)) % 3 == 0))


def gap(data, rng):
    """Without the points within 6 degrees of the mirror direction."""
    return kept(data, np.abs(data.theta_r - data.theta_i) > np.radians(6))


def calibrated(data, rng):
    """All readings times one random factor; its standard deviation is given."""
    return replace(uncalibrated(data, rng), calibration=CALIBRATION)


def uncalibrated(data, rng):
    """The same factor; its standard deviation is not given."""
    return scaled(data, 1 + CALIBRATION * rng.standard_normal())


def times_cos(data, rng):
    """A mistake: the readings are BRDF x cos theta_r."""
    return scaled(data, np.cos(data.theta_r))


def offset(data, rng):
    """A mistake: a constant background, a tenth of the median, is not subtracted."""
    return replace(data, brdf=data.brdf + 0.1 * np.median(data.brdf))


def unstated_floor(data, rng):
    """A mistake: further noise of half the median, which is not given."""
    size = 0.5 * np.median(data.brdf) * rng.standard_normal(data.brdf.size)
    return replace(data, brdf=np.abs(data.brdf + size))


def opposite(data, rng):
    """A mistake: theta_r has the opposite sign."""
    return replace(data, theta_r=-data.theta_r)


def wide_source(data, rng):
    """A mistake: the source has a half-angle of 2 degrees, which is not given."""
    return data


GEOMETRIES = (sparse, gap, calibrated, uncalibrated)
MISTAKES = (times_cos, offset, unstated_floor, wide_source, opposite)


def scaled(data, factor):
    """The measurements with readings and sigma times a factor."""
    sigma = None if data.sigma is None else data.sigma * factor
    return replace(data, brdf=data.brdf * factor, sigma=sigma)


def kept(data, mask):
    """The measurements at the points of a mask."""
    names = ("theta_i", "theta_r", "brdf", "sigma")
    return replace(
        data, **{n: getattr(data, n)[mask] for n in names if getattr(data, n) is not None}
    )


def through_wide_source(model, parameters, data):
    """The readings (p,) with a source whose angular radius is 2 degrees."""
    instrument = Scatterometer(model, model.forms[0], data.theta_i, data.theta_r, np.radians(2))
    return instrument(model.to_cube([parameters]))[0][0]


def claims_of(model, title, noise, s, change, count: int) -> dict:
    """How many claims about `count` random surfaces are true; see `cases` for the arguments."""
    tally = Counter()
    for k, parameters in enumerate(map(model.values_at, model.starting_points(count, seed=12))):
        rng = np.random.default_rng((k, round(1000 * s)))
        first = rng.uniform(10, 30)
        data = scan_of(model, parameters, incidence=(first, first + 20, first + 40), step=2)
        if change is wide_source:
            data = replace(data, brdf=through_wide_source(model, parameters, data))
        brdf, sigma = noise(data.brdf, s, rng)
        freedom = 2.0 * len(brdf) if noise is repeated else np.inf
        data = change(replace(data, brdf=brdf, sigma=sigma, sigma_freedom=freedom), rng)
        form = AUTO if len(model.forms) == 1 else model.forms[0]
        result = fit(data, model=model.name, form=form, starts=6, seed=k, source_half_angle_deg=0)
        tally.update(judged_by_truth(model, result, parameters))
    return {"title": title, "s": s, "names": model.names, "tally": tally}


def judged_by_truth(model, result, parameters) -> Counter:
    """How many claims of a fit there are, by kind, and how many are true."""
    tally = Counter(fits=1)
    tally["lack of fit"] = int(bool(result.quality.lack_of_fit))
    tally["cause"] = int("it fits" in result.quality.verdict)
    for name, true in zip(model.names, parameters):
        low, high = result.interval[name]
        error, words = abs(result.parameters[name] - true), result.verdict[name]
        is_determined = words.startswith("determined")
        is_false = is_determined and error > FALSE * result.standard_error[name]
        has_words = LEVEL_WORDS in words
        tally[f"{name} held"] += low - 1e-9 <= true <= high + 1e-9
        tally["determined"] += is_determined
        tally["false"] += is_false and not has_words
        tally["told"] += is_false and has_words
    return tally


def row_of(of: dict) -> str:
    """A row of the page."""
    tally = of["tally"]
    held = [f"{tally[f'{name} held'] / tally['fits']:.3f}" for name in of["names"]]
    counts = [str(tally[name]) for name in COUNTED]
    row = [of["title"], f"{100 * of['s']:g} %", str(tally["fits"]), *held, *counts]
    print(*row, sep=" | ", flush=True)
    return f"| {' | '.join(row)} |"


def cases(surfaces: int) -> list[tuple]:
    """Title, noise, relative size, change of the data and number of surfaces of each row."""
    noises = [(first_line(noise), noise, s, dense, surfaces) for noise in NOISES for s in LEVELS]
    few = max(surfaces // 5, 5)
    data = [(first_line(change), of_reading, 0.05, change, surfaces) for change in GEOMETRIES]
    return noises + data + [(first_line(c), of_reading, 0.05, c, few) for c in MISTAKES]


def first_line(function) -> str:
    """The first line of a docstring, without its full stop."""
    return function.__doc__.splitlines()[0].rstrip(".")


def claims(models, surfaces=200, page=PAGE):
    """Measure how many claims of fits are true; write the page of all models measured so far.

    Each row is saved when it is measured. Rows with as many surfaces or more are kept.
    """
    known = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}
    for name in models:
        parameters = " | ".join(f"`{parameter}`" for parameter in MODELS[name].names)
        head = f"| data | noise | fits | {parameters} | {' | '.join(COUNTED)} |"
        top = [head, "|---" * (head.count("|") - 1) + "|"]
        rows = known.get(name, "").splitlines()[2:]
        for at, case in enumerate(cases(surfaces)):
            if at < len(rows) and int(rows[at].split("|")[3]) >= case[-1]:
                continue
            rows[at : at + 1] = [row_of(claims_of(MODELS[name], *case))]
            known[name] = "\n".join([*top, *rows])
            with replacing(MEASURED) as part:
                part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    if set(COMPARED) <= set(known):
        write_page(page, "fits", **known)


STUDIES = (recovery, coverage, emissivity, choice, surfaces, joint, losses, time, claims)

if __name__ == "__main__":
    chosen, *rest = sys.argv[1:]
    counts = [int(word) for word in rest if word.isdigit()]
    models = [word for word in rest if not word.isdigit()] or list(COMPARED)
    {study.__name__: study for study in STUDIES}[chosen](models, *counts)
