"""Long studies of the fit, run by hand.

python -m docs.studies.fit recovery|coverage|surfaces|joint|time|losses
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.optimize import least_squares

import mi_lcair  # noqa: F401  it chooses the LLVM and must precede the import of Dr.Jit
from mi_lcair.fitting import fit, read
from mi_lcair.fitting.data import select
from mi_lcair.fitting.descent import ROUND_OFF, explore, levenberg_marquardt
from mi_lcair.fitting.model import Hemispherical
from mi_lcair.fitting.parameters import E_MIN, NAMES, starting_points, to_cube
from mi_lcair.fitting.scatterometer.reading import read_directional
from mi_lcair.fitting.search import COARSE
from tests.fitting import numpy_model
from tests.fitting.synthetic import ROUGH, THESIS_SETS, relative_errors, scan

SURFACES = Path(__file__).parents[2].parent / "shared" / "data" / "mwir_brdf"
NAMES_OF_SURFACES = (
    "aluminium",
    "aluminium_sandblasted",
    "copper",
    "paint_rough",
    "paint_smooth",
    "steel_sandblasted",
)


def recovery(seeds=20):
    """Print the largest relative error of any parameter over the seeds, for data without noise."""
    for name, parameters in THESIS_SETS.items():
        data = scan(parameters)
        fits = [fit(data, seed=seed) for seed in range(seeds)]
        forms = {(result.form, result.restriction) for result in fits}
        worst = np.max([relative_errors(result, parameters) for result in fits], axis=0)
        print(
            f"{name}: worst relative error {worst.max():.1e}, "
            f"converged {all(result.converged for result in fits)}, "
            f"forms {forms}, "
            f"starts in basin >= {min(result.starts_in_basin for result in fits):.2f}",
            flush=True,
        )


def coverage(repetitions=200):
    """Print how often 2 standard errors and the 95 % interval contain the true value, at 5 % noise.

    Only fits that determine the parameter are counted.
    """
    for name, parameters in {**THESIS_SETS, "rough": ROUGH}.items():
        inside, interval, determined = (np.zeros((repetitions, 4), bool) for _ in range(3))
        for k in range(repetitions):
            result = fit(scan(parameters, noise=0.05, seed=k), starts=8, seed=k, form="thesis")
            for j, key in enumerate(NAMES):
                determined[k, j] = result.verdict[key] == "determined"
                inside[k, j] = (
                    abs(result.parameters[key] - parameters[j]) <= 2 * result.standard_error[key]
                )
                interval[k, j] = result.interval[key][0] <= parameters[j] <= result.interval[key][1]
        print(
            name,
            {
                key: f"determined {d.sum()}, 2 se {100 * i[d].mean():.1f} %, "
                f"interval {100 * v[d].mean():.1f} %"
                for key, d, i, v in zip(NAMES, determined.T, inside.T, interval.T)
                if d.any()
            },
            flush=True,
        )


def surfaces():
    """Print the rms residual in decades of each form of the model on the six real surfaces."""
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        fits = [fit(data, form=form, source_half_angle_deg=0) for form in ("thesis", "normalized")]
        print(
            name,
            " / ".join(f"{result.rms_dex:.5f}" for result in fits),
            [result.converged for result in fits],
            flush=True,
        )


def joint():
    """Compare the fit to the BRDF alone with the joint fit to BRDF and emissivity.

    It prints the rms residual in decades and the rms error of the emissivity up to 80 degrees.
    """
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        table = read_directional(SURFACES / f"{name}_emissivity.csv", "emissivity")
        alone = fit(data, source_half_angle_deg=0)
        both = fit(data, emissivity=table, source_half_angle_deg=0)
        u = to_cube([list(alone.parameters.values())])
        inside = table.theta <= np.radians(80.001)
        error = Hemispherical(table.theta, "emissivity", alone.form)(u)[0][0] - table.value
        print(
            f"{name}: rms {alone.rms_dex:.4f} -> {both.rms_dex:.4f} "
            f"({both.rms_dex / alone.rms_dex:.2f}), emissivity "
            f"{np.sqrt(np.mean(error[inside] ** 2)):.4f} -> {both.emissivity_rms:.4f}, "
            f"{both.form} {both.restriction}, {both.settings['joint']}, {both.seconds:.1f} s",
            flush=True,
        )


def losses():
    """Print the rms residual in decades of the fit with each loss on the real surfaces."""
    for name in NAMES_OF_SURFACES:
        data = read(SURFACES / f"{name}.csv")
        print(
            name,
            {
                loss: round(fit(data, loss=loss, form="thesis", source_half_angle_deg=0).rms_dex, 4)
                for loss in ("log", "cube_root", "linear")
            },
            flush=True,
        )


def time(repetitions=5):
    """Print the time of a search from 64 starts, on 720 and on about 10,000 points.

    The 720 points are those of a real surface. For them SciPy's time is printed as well.
    """
    for name in ("aluminium", "paint_rough"):
        measurements = read(SURFACES / f"{name}.csv")
        for copies in (1, 14):
            data, _, _ = select(measurements, "log", 0.0, 80, 1e-4)
            theta_i, theta_r, brdf, spread = (
                np.tile(column, copies)
                for column in (data.theta_i, data.theta_r, data.brdf, data.spread)
            )
            data = type(data)(theta_i, theta_r, brdf, 0.0, "log", spread, False)
            residuals = data.residuals("thesis")
            starts = starting_points(64, 0)
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
                f"{name}, {len(brdf)} points: first {seconds[0]:.2f} s with the compile, "
                f"then {min(seconds[1:]):.2f} s, "
                f"rms {np.sqrt(2 * best.cost[0] / len(brdf)):.5f}, gradient {best.gradient[0]:.1e}",
                flush=True,
            )
            if copies == 1:
                began = perf_counter()
                costs = [
                    least_squares(
                        numpy_residuals,
                        np.clip(u, 1e-9, 1 - 1e-9),
                        bounds=(1e-12, 1 - 1e-12),
                        args=(theta_i, theta_r, brdf),
                    ).cost
                    for u in starts
                ]
                print(
                    f"  scipy.optimize.least_squares: {perf_counter() - began:.2f} s, "
                    f"rms {np.sqrt(2 * min(costs) / len(brdf)):.5f}",
                    flush=True,
                )


def numpy_residuals(u, theta_i, theta_r, brdf):
    """Return the residuals log10(model) - log10(brdf) at a point u of the unit cube, in NumPy."""
    b = np.sqrt(u[2])
    G = numpy_model.G(b)
    model = numpy_model.brdf(
        theta_i, theta_r, G * u[0], G * (1 - u[0]) * u[1], b, E_MIN ** (1 - u[3])
    )
    return np.log10(np.maximum(model, 1e-30)) - np.log10(brdf)


if __name__ == "__main__":
    studies = (recovery, coverage, surfaces, joint, losses, time)
    {study.__name__: study for study in studies}[sys.argv[1]]()
