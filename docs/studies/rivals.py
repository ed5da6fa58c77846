"""Write the page docs/validation/rivals.md: time to an error, ours and that of Mitsuba alone.

    python -m docs.studies.rivals [PAGE]

The bundled scenes are rendered by Mitsuba's `path` and `prb_basic` with each of its samplers, and
by `mi_lcair.signature`. Both have the same plugins of emitters and surfaces. The script takes about
ten minutes and needs a machine that does nothing else, because it compares times.
"""

import logging
import sys
from itertools import product
from pathlib import Path
from time import perf_counter

import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.chart import digits
from benchmarks.errors import SCENES
from docs.studies.page import write_page
from mi_lcair.rendering.scene import changed

GOAL = 0.001  # relative rms error
SIDE = 32  # pixels along each side of Mitsuba's film
SPP = 4 ** np.arange(6)  # its samples per pixel
PATHS = 4 ** np.arange(5, 11)  # ours
SEEDS = 16
LONGEST = 0.2  # seconds of a render after which no larger one is tried
INTEGRATORS = "path", "prb_basic"
SAMPLERS = "independent", "stratified", "multijitter", "orthogonal", "ldsampler"
NEVER = 10_000  # depth at which Mitsuba begins to end paths at random


def runs(render, counts) -> tuple[np.ndarray, np.ndarray]:
    """Median time [s] of a render and its relative rms error by number of samples.

    render: gives a value from a number of samples and a seed. Seeds differ in their random numbers.
    """
    seconds, errors = [], []
    for count in counts:
        render(count, 0)  # compiles
        values, times = [], []
        for seed in range(1, SEEDS + 1):
            start = perf_counter()
            values.append(render(count, seed))
            times.append(perf_counter() - start)
        seconds.append(np.median(times))
        errors.append(np.std(values, ddof=1) / np.mean(values))
        if seconds[-1] > LONGEST:
            break
    return np.array(seconds), np.array(errors)


def time_to_goal(seconds: np.ndarray, errors: np.ndarray) -> float:
    """Time to the error GOAL: along a line in logarithms, which passes near all measured errors.

    Errors of few seeds scatter, so that the fit takes all that lie within a factor of 8. No time is
    shorter than that of the smallest render.
    """
    near = np.abs(np.log(errors / GOAL)) < np.log(8)
    if near.sum() < 2:
        last = np.argmin(np.abs(np.log(errors / GOAL)))
        return float(max(seconds[last] * (errors[last] / GOAL) ** 2, seconds[0]))
    slope, start = np.polyfit(np.log(errors[near]), np.log(seconds[near]), 1)
    return float(max(np.exp(start + slope * np.log(GOAL)), seconds[0]))


def of_mitsuba(name: str) -> dict[tuple[str, str], float]:
    """Time of the mean over the film to the error GOAL, by integrator and sampler."""
    result = {}
    for sampler in SAMPLERS:
        loaded = mi_lcair.load(name, resolution=SIDE, sampler=sampler, **SCENES[name]).mi
        depth = loaded.integrator().max_bounces + 1
        for kind in INTEGRATORS:
            integrator = mi.load_dict({"type": kind, "max_depth": depth, "rr_depth": NEVER})
            mean = lambda spp, seed, integrator=integrator, loaded=loaded: float(
                np.mean(np.array(integrator.render(loaded, seed=seed, spp=int(spp))))
            )
            result[kind, sampler] = time_to_goal(*runs(mean, SPP))
    return result


def of_ours(name: str, part: str, **options) -> float:
    """Time of an intensity, of the `part` target or scene, to the error GOAL."""
    scene = mi_lcair.load(name, resolution=1, **SCENES[name])
    with changed(scene, **options):
        intensity = lambda paths, seed: (
            getattr(mi_lcair.signature(scene, spp=int(paths), seed=seed), part).intensity
        )
        return time_to_goal(*runs(intensity, PATHS))


def to_tolerance(name: str) -> float:
    """Time of a signature whose 95 % interval is twice GOAL, with all that a tolerance chooses."""
    scene = mi_lcair.load(name, resolution=1, **SCENES[name])
    seconds, _ = runs(
        lambda limit, seed: (
            mi_lcair.signature(scene, tolerance=2 * GOAL, max_spp=int(limit), seed=seed).intensity
        ),
        [2**28],
    )
    return float(seconds[0])


def row(name: str) -> str:
    """A scene's row of the page."""
    stock = of_mitsuba(name)
    best = min(stock, key=stock.get)
    settings = [
        {"emitter_sampling": drawn, "opening_sampling": openings}
        for drawn, openings in product(
            (False, True), (False, True) if name == "cavity" else (False,)
        )
    ]
    times = {
        part: min(of_ours(name, part, **options) for options in settings)
        for part in ("scene", "target")
    }
    times["tolerance"] = to_tolerance(name)
    milliseconds = lambda value: f"{digits(1e3 * value)} ms"
    values = " ".join(f"{key}={value}" for key, value in SCENES[name].items())
    cells = [f"{name} {values}".strip(), f"`{best[0]}`, `{best[1]}`", milliseconds(stock[best])]
    cells += [milliseconds(times["scene"]), digits(stock[best] / times["scene"])]
    cells += [milliseconds(times["target"]), milliseconds(times["tolerance"])]
    return f"| {' | '.join(cells)} |"


def main(page):
    """Write the page."""
    mi.set_variant("llvm_ad_mono")
    logging.getLogger("mitsuba").setLevel(logging.ERROR)  # orthogonal rounds its counts
    rows = []
    for name in tqdm(SCENES):
        rows.append(row(name))
        print(rows[-1], flush=True)
    write_page(
        page,
        "rivals",
        goal=f"{GOAL:.1%}",
        twice=f"{2 * GOAL:.1%}",
        seeds=SEEDS,
        side=SIDE,
        samplers=", ".join(f"`{name}`" for name in SAMPLERS),
        rows="\n".join(rows),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/rivals.md"))
