"""Write the page docs/validation/paths.md: paths and time to an error, with independent and lattice
points.

    python -m docs.studies.paths [PAGE]

For each scene the intensity is computed with SEEDS seeds at a series of path counts. Its rms error
is taken against a closed form or against a long run. The page gives the paths to 1 % and to 0.1 %
and the ratio of the times to 0.1 %, the same for the pixels of two images, and the paths that a
tolerance takes. The text is paths.template.md, whose {fields} are filled in. The script takes about
five minutes.
"""

import math
import sys
import time
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from statistics import median
from unittest.mock import patch

import numpy as np

import mi_lcair
from benchmarks.chart import digits, duration
from benchmarks.errors import track_openings
from benchmarks.methods.propagation import exact
from docs.studies.page import label, write_page
from mi_lcair.drawing import drawing
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.hot_parts import HotParts
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.measurands import IntensityInterval, Measurands
from mi_lcair.rendering.measure import aim_at_model, measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import RANDOMISATIONS, Windows, window_area

SEEDS = 20
ROUNDS = 3  # alternating timed runs of each contestant
COUNTS = [4**k for k in range(3, 11)]  # path counts that are tried of lattice points
PIXELS = 96  # along a side of the film of independent points: as many as the bundled scenes have
SAMPLES = [4**k for k in range(6)]  # independent points in each pixel that are tried
MOST_SECONDS = 8.0  # processor time of a path count, after which no larger one is tried
MOST_TIMED = 2**25  # largest number of paths in a timed run
TOLERANCES = (0.01, 0.001)
SCENES = [
    ("two_plates", {}),
    ("open_box", {}),
    ("cavity", {"opening": 8}),
    ("cylinder_ir_range", {}),
    ("a340_landing", {"position": 3, "band": "LWIR"}),
]
OPENINGS = (8, 16, 24, 36)  # facets removed from the cavity
TOLERANCE_SEEDS = 3
REFERENCE_PATHS = 2**20  # paths of each of the eight runs of a reference
IMAGES = SCENES[3:]
RESOLUTION, IMAGE_COUNTS, IMAGE_SEEDS = 64, (4, 8, 16, 32, 64, 128, 256), 2
CONVERGED = 2**12  # paths for each pixel of the image that stands for the exact one
LINES = {  # contestants and their style in the picture
    "independent": {"color": "C0", "marker": "o"},
    "lattice": {"color": "C1", "marker": "s"},
    "lattice, aimed": {"color": "C2", "marker": "^"},
}


@dataclass
class Curve:
    """Rms errors of one contestant by the number of paths."""

    errors: dict[int, float] = field(default_factory=dict)

    def paths_to(self, tolerance: float, independent: bool) -> float | None:
        """Paths to an rms error; None if the largest number of paths does not reach it.

        The error of independent paths falls as the square root of their number, so that the mean of
        error^2 x paths over all runs gives the answer. Otherwise error and paths are interpolated
        as powers of each other, where the error falls below the tolerance for good.
        """
        if independent:
            variance = np.mean([error**2 * count for count, error in self.errors.items()])
            return variance / tolerance**2
        counts = sorted(self.errors)
        above = [count for count in counts if self.errors[count] > tolerance]
        if not above:
            return counts[0]
        if above[-1] == counts[-1]:
            return None
        a, b = above[-1], counts[counts.index(above[-1]) + 1]
        share = math.log(self.errors[a] / tolerance) / math.log(self.errors[a] / self.errors[b])
        return a * (b / a) ** share


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def intensity(scene, paths: int, seed: int) -> float:
    """Intensity of the target with a number of paths [W/sr]; the film has one pixel."""
    return mi_lcair.signature(scene, spp=paths, seed=seed).target.intensity


def by_pixels(scene, paths: int, seed: int) -> float:
    """The function `intensity` with independent points in each of PIXELS x PIXELS pixels."""
    sensor, spp = scene.sensor(0), -(-paths // PIXELS**2)
    windows = Windows(sensor, PIXELS, PIXELS, randomisations=1)
    total = measure(scene, windows, Sampling(paths=spp, seed=seed), Measurands.of("target"))
    return float(total.mean("target").mean()) * window_area(sensor, scene.name)


def aimed(scene):
    """The function `intensity` with start positions aimed at the model, after one pilot."""
    sensor = scene.sensor(0)
    area = window_area(sensor, scene.name)
    with scene.prepared() as tracer:
        aim = aim_at_model(scene, tracer, sensor, 1_000_000, Measurands.of("target"))

    def run(scene, paths: int, seed: int) -> float:
        points = paths // RANDOMISATIONS
        launch = Launch(1, 1, seed, randomisations=RANDOMISATIONS, points=points, aim=aim)
        with scene.prepared() as tracer:
            sums = tracer.trace(sensor, launch, Channels("target"))
        return float(sums.channels["target"].sum() / sums.valid.sum()) * area

    return run


def reference(name: str, scene) -> tuple[float, float]:
    """Intensity of a scene and its standard error [W/sr]; the error of a closed form is 0."""
    L = lambda T: float(in_band_radiance(scene.band, T))
    if name == "two_plates":
        return exact.two_plates_intensity(L(800)), 0.0
    if name == "open_box":
        return exact.open_box_intensity(L(800), L(300)), 0.0
    if name == "cavity":
        return exact.cavity_emissivity(8) * L(800) * window_area(scene.sensor(0), name), 0.0
    run = aimed(scene)
    values = [run(scene, REFERENCE_PATHS, 1_000_000 + seed) for seed in range(8)]
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(8))


def errors(run, scene, expected: float, counts=COUNTS) -> Curve:
    """Rms errors of a contestant at rising numbers of paths."""
    curve = Curve()
    for count in counts:
        start = time.process_time()
        curve.errors[count] = rms([run(scene, count, seed) / expected - 1 for seed in range(SEEDS)])
        if time.process_time() - start > MOST_SECONDS:
            break
    return curve


def seconds(runs) -> list[list[float]]:
    """Processor times, on all threads, of functions that run in turn; a list for each.

    The first runs, which compile, do not count.
    """
    times = [[] for _ in runs]
    for turn in range(ROUNDS + 1):
        for run, own in zip(runs, times):
            start = time.process_time()
            run(turn)
            own.append(time.process_time() - start)
    return [own[1:] for own in times]


def measured(name: str, parameters: dict) -> tuple[str, dict[str, Curve]]:
    """A scene's row of the table of intensities, and the curves of its contestants."""
    both = {
        sampler: mi_lcair.load(name, resolution=1, sampler=sampler, **parameters)
        for sampler in ("independent", "lattice")
    }
    expected, error = reference(name, both["lattice"])
    runs = {"independent": by_pixels, "lattice": intensity}
    counts = [PIXELS**2 * spp for spp in SAMPLES]
    curves = {"independent": errors(by_pixels, both["independent"], expected, counts)}
    curves["lattice"] = errors(intensity, both["lattice"], expected)
    curves["lattice, aimed"] = errors(aimed(both["lattice"]), both["lattice"], expected)
    cells = [label(name, parameters), f"{error / expected:.1e}" if error else "closed form"]
    for tolerance in TOLERANCES:
        needs = {key: c.paths_to(tolerance, key == "independent") for key, c in curves.items()}
        cells += [count_text(needs.get(key)) for key in LINES]
        cells += [
            digits(needs["independent"] / needs[key]) if needs[key] else "-"
            for key in ("lattice", "lattice, aimed")
        ]
        lattice = needs["lattice"]
    if lattice is None:
        return f"| {' | '.join([*cells, '-', '-', '-'])} |", curves
    counts = [min(MOST_TIMED, round(needs[sampler])) for sampler in both]
    one, two = seconds(
        [
            lambda seed, name=name, count=count: runs[name](both[name], count, seed)
            for name, count in zip(runs, counts)
        ]
    )
    # Where independent paths are too many to be timed, their time is proportional to their number
    scale = needs["independent"] / counts[0]
    ratio = median(a * scale / b for a, b in zip(one, two))
    cells += [duration(median(one) * scale), duration(median(two)), digits(ratio)]
    return f"| {' | '.join(cells)} |", curves


def count_text(count: float | None) -> str:
    return "-" if count is None else digits(count)


def image(name: str, parameters: dict) -> tuple[str, dict[str, Curve]]:
    """A scene's row of the table of images, and the curves of its contestants.

    The rms error is taken over the pixels, as a fraction of the mean radiance.
    """
    scenes = {
        sampler: mi_lcair.load(name, resolution=RESOLUTION, sampler=sampler, **parameters)
        for sampler in ("independent", "lattice")
    }
    pixels = lambda scene, spp, seed: mi_lcair.render(scene, spp=spp, seed=seed).channels["Y"]
    converged = pixels(scenes["lattice"], CONVERGED, 1_000_000)
    curves = {
        sampler: Curve(
            {
                spp: rms(
                    [pixels(scene, spp, seed) - converged for seed in range(IMAGE_SEEDS)]
                    / converged.mean()
                )
                for spp in IMAGE_COUNTS
            }
        )
        for sampler, scene in scenes.items()
    }
    needs = {key: c.paths_to(0.01, key == "independent") for key, c in curves.items()}
    lattice = needs["lattice"]
    cells = [
        label(name, parameters),
        *map(count_text, needs.values()),
        digits(needs["independent"] / lattice) if lattice else "-",
    ]
    return f"| {' | '.join(cells)} |", curves


def with_tolerances(name: str, parameters: dict) -> str:
    """A scene's row of the table of paths that a tolerance takes: the fewest and the most."""
    scene, cells = mi_lcair.load(name, **parameters), [label(name, parameters)]
    for tolerance in TOLERANCES:
        counts = [
            mi_lcair.signature(scene, tolerance=tolerance, seed=seed).paths
            for seed in range(TOLERANCE_SEEDS)
        ]
        cells.append(" to ".join(f"{count:,}" for count in sorted({min(counts), max(counts)})))
    return f"| {' | '.join(cells)} |"


def with_facets(position: int, band: str) -> str:
    """A row of the table of paths to 1 %: one path for both parts, rays to facets, guided rays."""
    scene = mi_lcair.load("a340_landing", position=position, band=band)
    whole, texts = Windows.whole(scene.sensor(0)), []
    for follows, hot_parts in ((False, no_parts), (True, no_parts), (True, HotParts.of)):
        windows, totals = replace(whole, may_follow_facets=follows), []
        with patch.object(HotParts, "of", hot_parts):
            for seed in range(TOLERANCE_SEEDS):
                plan = Sampling(tolerance=0.01, seed=seed), Measurands.of("target")
                totals.append(measure(scene, windows, *plan, IntensityInterval(0.01)))
        texts.append(", ".join(f"{int(total.traced[0]):,}" for total in totals))
    emission = float(totals[0].mean("target.bounce.0")[0] / totals[0].mean("target")[0])
    return f"| {position}, {band} | {emission:.0%} | {' | '.join(texts)} |"


def no_parts(emitters) -> None:
    """In place of `HotParts.of`, so that no rays are guided."""


def draw(path, panels: dict[str, tuple[str, dict[str, Curve]]]) -> None:
    """Write a PNG with a panel for each scene: rms error against the number of paths.

    panels: for each title the label of the abscissa and the curves.
    """
    with drawing(path, (11, 11), dpi=110, layout="constrained") as figure:
        axes = figure.subplots(-(-len(panels) // 2), 2).ravel()
        for axis in axes[len(panels) :]:
            axis.set_visible(False)
        for axis, (title, (abscissa, curves)) in zip(axes, panels.items()):
            for name, curve in curves.items():
                axis.loglog(*zip(*curve.errors.items()), label=name, markersize=4, **LINES[name])
            for tolerance in TOLERANCES:
                axis.axhline(tolerance, color="0.6", linewidth=0.6, linestyle=":")
            axis.set_title(title, fontsize=10, loc="left")
            axis.set_xlabel(abscissa)
            axis.set_ylabel("relative rms error")
            axis.legend(fontsize=8, frameon=False)


def main(page):
    """Write the page and its picture."""
    import drjit as dr
    from tqdm import tqdm

    rows, image_rows, panels = [], [], {}
    for case in tqdm(SCENES):
        row, curves = measured(*case)
        panels[label(*case)] = "paths", curves
        rows.append(row)
        print(row, flush=True)
    for case in tqdm(IMAGES):
        row, curves = image(*case)
        panels[f"image of {label(*case)}"] = "paths for each pixel", curves
        image_rows.append(row)
        print(row, flush=True)
    draw(page.with_suffix(".png"), panels)
    write_page(
        page,
        "paths",
        seeds=SEEDS,
        rounds=ROUNDS,
        threads=dr.thread_count(),
        pixels=PIXELS,
        least=PIXELS**2,
        resolution=RESOLUTION,
        converged=CONVERGED,
        randomisations=RANDOMISATIONS,
        rows="\n".join(rows),
        images="\n".join(image_rows),
        openings="\n".join(f"| {k} | {digits(track_openings(k))} |" for k in OPENINGS),
        tolerance_seeds=TOLERANCE_SEEDS,
        tolerances="\n".join(with_tolerances(*case) for case in SCENES),
        facets="\n".join(with_facets(*case) for case in product((1, 2, 3), ("LWIR", "MWIR"))),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/paths.md"))
