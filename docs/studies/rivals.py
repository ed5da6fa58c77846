"""Write the page docs/validation/rivals.md: time to an error, ours and that of Mitsuba alone.

    python -m docs.studies.rivals [PAGE]

The bundled scenes are rendered by Mitsuba's `path` and `prb_basic` with each of its samplers, and
by `mi_lcair.signature` and `mi_lcair.render`. All have the same plugins of emitters and surfaces.
The script compares processor times. It takes about thirty minutes.
"""

import logging
import sys
from itertools import product
from pathlib import Path
from time import process_time

import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.chart import digits
from benchmarks.errors import SCENES
from docs.studies.page import write_page
from mi_lcair.rendering.scene import changed

GOALS = 0.001, 0.0001  # relative rms errors
SIDE = 32  # pixels along each side of Mitsuba's film
SPP = 4 ** np.arange(6)  # its samples per pixel
PATHS = 4 ** np.arange(5, 11)  # ours
SEEDS = 16
LONGEST = 0.5  # seconds of a render after which no larger one is tried
PIXELS, IMAGE_SPP, IMAGE_SEEDS = 32, (16, 64), 8  # of the images
INTEGRATORS = "path", "prb_basic"
SAMPLERS = "independent", "stratified", "multijitter", "orthogonal", "ldsampler"
NEVER = 10_000  # depth at which Mitsuba begins to end paths at random


def runs(render, counts) -> tuple[np.ndarray, np.ndarray]:
    """Median processor time [s] of a render and its relative rms error by number of samples.

    render: gives a value from a number of samples and a seed. Seeds differ in their random numbers.
    """
    seconds, errors = [], []
    for count in counts:
        render(count, 0)  # compiles
        values, times = [], []
        for seed in range(1, SEEDS + 1):
            start = process_time()
            values.append(render(count, seed))
            times.append(process_time() - start)
        seconds.append(np.median(times))
        errors.append(np.std(values, ddof=1) / np.mean(values))
        if seconds[-1] > LONGEST:
            break
    return np.array(seconds), np.array(errors)


def time_to_goal(seconds: np.ndarray, errors: np.ndarray, goal: float) -> float:
    """Time to an error: along a line in logarithms, which passes near all measured errors.

    Errors of few seeds scatter, so that the fit takes all that lie within a factor of 8. No time is
    shorter than that of the smallest render.
    """
    near = np.abs(np.log(errors / goal)) < np.log(8)
    if near.sum() < 2:
        last = np.argmin(np.abs(np.log(errors / goal)))
        return float(max(seconds[last] * (errors[last] / goal) ** 2, seconds[0]))
    slope, start = np.polyfit(np.log(errors[near]), np.log(seconds[near]), 1)
    return float(max(np.exp(start + slope * np.log(goal)), seconds[0]))


def times_to_goals(seconds: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Times to all GOALS."""
    return np.array([time_to_goal(seconds, errors, goal) for goal in GOALS])


def combinations(name: str, side: int):
    """Yield Mitsuba's integrators with each sampler: their names and a function of (spp, seed)."""
    for sampler in SAMPLERS:
        loaded = mi_lcair.load(name, resolution=side, sampler=sampler, **SCENES[name]).mi
        depth = loaded.integrator().max_bounces + 1
        for kind in INTEGRATORS:
            integrator = mi.load_dict({"type": kind, "max_depth": depth, "rr_depth": NEVER})
            yield (
                f"`{kind}`, `{sampler}`",
                lambda spp, seed, integrator=integrator, loaded=loaded: np.array(
                    integrator.render(loaded, seed=seed, spp=int(spp)), float
                ),
            )


def of_mitsuba(name: str) -> dict[str, np.ndarray]:
    """Times of the mean over the film to the GOALS, by integrator and sampler."""
    return {
        words: times_to_goals(*runs(lambda spp, seed: float(np.mean(image(spp, seed))), SPP))
        for words, image in combinations(name, SIDE)
    }


def of_ours(name: str, part: str, **options) -> np.ndarray:
    """Times of an intensity, of the `part` target or scene, to the GOALS."""
    scene = mi_lcair.load(name, resolution=1, **SCENES[name])
    with changed(scene, **options):
        intensity = lambda paths, seed: (
            getattr(
                mi_lcair.signature(scene, spp=int(paths), seed=seed, parts=False), part
            ).intensity
        )
        return times_to_goals(*runs(intensity, PATHS))


def to_tolerance(name: str) -> float:
    """Time of a signature whose 95 % interval is twice the first goal, all chosen by it."""
    scene = mi_lcair.load(name, resolution=1, **SCENES[name])
    seconds, _ = runs(
        lambda limit, seed: (
            mi_lcair.signature(
                scene, tolerance=2 * GOALS[0], max_spp=int(limit), seed=seed, parts=False
            ).intensity
        ),
        [2**28],
    )
    return float(seconds[0])


def labelled(name: str) -> str:
    """A scene with its parameters."""
    values = " ".join(f"{key}={value}" for key, value in SCENES[name].items())
    return f"{name} {values}".strip()


def drawn(name: str) -> list[dict[str, bool]]:
    """Settings of what is drawn that are tried in a scene."""
    pairs = product((False, True), (False, True) if name == "cavity" else (False,))
    return [{"emitter_sampling": e, "opening_sampling": o} for e, o in pairs]


def row(name: str) -> str:
    """A scene's row of the table of intensities."""
    stock = of_mitsuba(name)
    best = min(stock, key=lambda words: stock[words][0])
    fastest = np.min(list(stock.values()), axis=0)
    scene, target = (
        np.min([of_ours(name, part, **options) for options in drawn(name)], axis=0)
        for part in ("scene", "target")
    )
    milliseconds = lambda value: f"{digits(1e3 * value)} ms"
    cells = [labelled(name), best, milliseconds(fastest[0])]
    cells += [milliseconds(scene[0]), *map(digits, fastest / scene)]
    cells += [milliseconds(target[0]), milliseconds(to_tolerance(name))]
    return f"| {' | '.join(cells)} |"


def cost(image, spp: int) -> float:
    """Processor time of an image [s] times its squared error, the mean over the pixels.

    The error is relative to the mean of the image.
    """
    image(spp, 0)  # compiles
    start = process_time()
    images = np.array([image(spp, seed) for seed in range(1, IMAGE_SEEDS + 1)])
    seconds = (process_time() - start) / IMAGE_SEEDS
    return float(seconds * images.var(axis=0, ddof=1).mean() / images.mean() ** 2)


def image_rows(name: str) -> list[str]:
    """A scene's rows of the table of images."""
    scene = mi_lcair.load(name, resolution=PIXELS, **SCENES[name])
    ours = lambda spp, seed: mi_lcair.render(scene, spp=spp, seed=seed).channels["Y"]
    rows = []
    for spp in IMAGE_SPP:
        stock = {words: cost(image, spp) for words, image in combinations(name, PIXELS)}
        best, least = min(stock, key=stock.get), np.inf
        for options in drawn(name):
            with changed(scene, **options):
                least = min(least, cost(ours, spp))
        rows.append(f"| {labelled(name)} | {spp} | {best} | {digits(stock[best] / least)} |")
    return rows


def main(page):
    """Write the page."""
    mi.set_variant("llvm_ad_mono")
    logging.getLogger("mitsuba").setLevel(logging.ERROR)  # orthogonal rounds its counts
    rows, images = [], []
    for name in tqdm(SCENES):
        rows.append(row(name))
        images += image_rows(name)
        print(rows[-1], *images[-len(IMAGE_SPP) :], sep="\n", flush=True)
    write_page(
        page,
        "rivals",
        goal=f"{GOALS[0]:.1%}",
        far=f"{GOALS[1]:.2%}",
        twice=f"{2 * GOALS[0]:.1%}",
        seeds=SEEDS,
        side=SIDE,
        samplers=", ".join(f"`{name}`" for name in SAMPLERS),
        rows="\n".join(rows),
        images="\n".join(images),
        pixels=PIXELS,
        image_seeds=IMAGE_SEEDS,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/rivals.md"))
