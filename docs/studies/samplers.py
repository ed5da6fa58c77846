"""Write the page docs/validation/samplers.md: `lattice` against Mitsuba's samplers in its scenes.

    python -m docs.studies.samplers [PAGE]

Five scenes of Mitsuba's own plugins are rendered with `path` and each sampler. All are unbiased, so
that the variance over SEEDS seeds is the error. The script takes about three minutes.
"""

import logging
import sys
import time
from pathlib import Path

import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.chart import digits
from docs.studies.page import write_page

VARIANT, SIDE, DEPTH = "llvm_ad_mono", 32, 6
OURS, STOCK = "lattice", ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
COUNTS, MIDDLE = (16, 64, 256), 1  # samples per pixel, and which of them sets the time
SEEDS, DRAWS = 12, 400  # renders, and draws of seeds with replacement for the error of a ratio
TOLERANCE, MOST = 0.05, 2**14  # of `render_with_errors`, and its largest number of samples
TO_TOLERANCE = (OURS, "multijitter", "independent")


def scenes() -> dict[str, dict]:
    """Descriptions of the five scenes without their samplers."""
    T = mi.ScalarTransform4f
    floor = {"type": "rectangle", "to_world": T().translate([0, 0, -1]).scale(6)}
    ball = lambda x, bsdf: {"type": "sphere", "center": [x, 0, 0], "radius": 0.9, "bsdf": bsdf}

    def lamp(x: float, side: float, radiance: float) -> dict:
        place = T().look_at([x, -2, 5], [0, 0, 0], [0, 1, 0]).scale(side)
        emitter = {"type": "area", "radiance": radiance}
        return {"type": "rectangle", "to_world": place, "emitter": emitter}

    def seen(sensor: dict | None = None, **parts) -> dict:
        place = T().look_at([0, -7, 3], [0, 0, -0.3], [0, 0, 1])
        sensor = {"type": "perspective", "fov": 30, "to_world": place, "film": {}} | (sensor or {})
        return {"type": "scene", "floor": floor, "sensor": sensor, **parts}

    grey = {"type": "diffuse", "reflectance": 0.5}
    metal = {"type": "roughconductor", "alpha": 0.15}
    return {
        "Cornell box": mi.cornell_box(),
        "diffuse ball under an even sky": seen(ball=ball(0, grey), sky={"type": "constant"}),
        "rough metal, two lamps": seen(
            ball=ball(0, metal), large=lamp(-3, 1.5, 2.0), small=lamp(3, 0.3, 40.0)
        ),
        "glass ball and its caustic": seen(
            ball=ball(0, {"type": "dielectric"}), lamp=lamp(-2, 1.0, 10.0)
        ),
        "balls out of focus": seen(
            sensor={"type": "thinlens", "aperture_radius": 0.4, "focus_distance": 7.0},
            **{f"ball_{k}": ball(x, grey) for k, x in enumerate((-2.0, 0.0, 2.0))},
            sky={"type": "constant"},
            lamp=lamp(2, 0.7, 10.0),
        ),
    }


def loaded(description: dict, sampler: str) -> mi.Scene:
    film = {"type": "hdrfilm", "width": SIDE, "height": SIDE, "rfilter": {"type": "box"}}
    sensor = description["sensor"] | {"film": film, "sampler": {"type": sampler}}
    integrator = {"type": "path", "max_depth": DEPTH}
    return mi.load_dict(description | {"sensor": sensor, "integrator": integrator})


def measured(description: dict) -> tuple[dict, dict]:
    """Images (counts, seeds, pixels), and processor times (counts,), by sampler, in turn."""
    names = (OURS, *STOCK)
    loads = {name: loaded(description, name) for name in names}
    images = {name: np.empty((len(COUNTS), SEEDS, SIDE**2)) for name in names}
    times = {name: np.empty((len(COUNTS), SEEDS)) for name in names}
    for k, count in enumerate(COUNTS):
        for seed in range(-1, SEEDS):  # the first render compiles
            for name, scene in loads.items():
                start = time.process_time()
                image = np.array(mi.render(scene, seed=seed + 1, spp=count), dtype=float)
                times[name][k, seed] = time.process_time() - start
                images[name][k, seed] = image.ravel()
    return images, {name: np.median(values, axis=1) for name, values in times.items()}


def rms(images: np.ndarray) -> np.ndarray:
    """Rms error of the pixels as a fraction of their mean, (counts,)."""
    return np.sqrt(images.var(axis=1, ddof=1).mean(axis=1)) / images.mean(axis=(1, 2))


def at_time(seconds: float, times: np.ndarray, errors: np.ndarray) -> float:
    """The error at a time, by lines through the measured ones in logarithms, also beyond them."""
    k = int(np.clip(np.searchsorted(times, seconds), 1, len(times) - 1))
    slope = np.log(errors[k] / errors[k - 1]) / np.log(times[k] / times[k - 1])
    return float(errors[k] * (seconds / times[k]) ** slope)


def row(name: str, description: dict) -> str:
    """A scene's row: error of the lattice, and those of the others at its time as ratios."""
    images, times = measured(description)
    seconds, rng = times[OURS][MIDDLE], np.random.default_rng(0)
    draws = [np.arange(SEEDS), *rng.integers(SEEDS, size=(DRAWS, SEEDS))]
    # A seed that is drawn twice lowers the variance: by (n - 1) / n on average, for all alike
    ours = [rms(images[OURS][:, draw])[MIDDLE] for draw in draws]
    cells = [name, f"{ours[0]:.2%} ± {np.std(ours[1:]):.2%}", f"{1e3 * seconds:.0f} ms"]
    for other in STOCK:
        ratios = [
            at_time(seconds, times[other], rms(images[other][:, draw])) / error
            for draw, error in zip(draws, ours)
        ]
        cells.append(f"{ratios[0]:.2f} ± {np.std(ratios[1:]):.2f}")
    return f"| {' | '.join(cells)} |"


def row_to_tolerance(name: str, description: dict) -> str:
    """Samples per pixel that a tolerance takes, and the true error in units of the stated one."""
    cells = [name]
    for sampler in TO_TOLERANCE:
        scene = loaded(description, sampler)
        runs = [
            mi_lcair.render_with_errors(scene, tolerance=TOLERANCE, max_spp=MOST, seed=seed)
            for seed in range(4)
        ]
        images = np.array([run.image for run in runs])
        true = np.sqrt(images.var(axis=0, ddof=1).mean()) / images.mean()
        stated = np.sqrt(np.mean([run.rms_error**2 for run in runs]))
        reached = "" if all(run.reached for run in runs) else " (not reached)"
        cells += [f"{digits(np.mean([run.spp for run in runs]))}{reached}", f"{true / stated:.2f}"]
    return f"| {' | '.join(cells)} |"


def main(page):
    """Write the page."""
    mi.set_variant(VARIANT)
    logging.getLogger("mitsuba").setLevel(logging.ERROR)  # orthogonal rounds its counts
    rows, rows_to_tolerance = [], []
    for case in tqdm(scenes().items()):
        rows.append(row(*case))
        rows_to_tolerance.append(row_to_tolerance(*case))
        print(rows[-1], rows_to_tolerance[-1], sep="\n", flush=True)
    write_page(
        page,
        "samplers",
        variant=VARIANT,
        side=SIDE,
        depth=DEPTH,
        seeds=SEEDS,
        middle=COUNTS[MIDDLE],
        counts=", ".join(map(str, COUNTS)),
        names=" | ".join(f"`{name}`" for name in STOCK),
        lines="|".join(["---"] * len(STOCK)),
        rows="\n".join(rows),
        tolerance=f"{TOLERANCE:.0%}",
        rows_to_tolerance="\n".join(rows_to_tolerance),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/samplers.md"))
