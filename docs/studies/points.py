"""Measure which random points paths should use, in how many randomisations, and their intervals.

    python -m docs.studies.points [PAGE]

The script writes docs/validation/points.md from points.template.md. It takes about ten minutes.
"""

import sys
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.stats import qmc
from tqdm import tqdm

import mi_lcair
from docs.studies.page import label, write_page
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.plugins.recorders.radiance import FirstHit
from mi_lcair.plugins.recorders.recorder import Recorders
from mi_lcair.plugins.samplers.lattice import Lattice, hashed
from mi_lcair.rendering import window
from mi_lcair.rendering.statistics import student_factor

SCENES = [
    ("two_plates", {}),
    ("open_box", {}),
    ("cavity", {}),
    ("furnace", {}),
    ("cylinder_ir_range", {}),
    ("a340_landing", {"position": 3, "band": "LWIR"}),
]
RUNS, COVERAGE_PATHS = 200, (2**12, 2**14, 2**16)
REPETITIONS, POINTS = 128, (2**8, 2**11)  # randomisations, and their points, of each kind of point
COUNTS = (2, 4, 8, 16)  # numbers of randomisations that are compared
LEAST_SHARE = 0.02  # smallest share of the intensity of a channel whose coverage is stated
IMAGES = {"cylinder_ir_range": 48, "a340_landing": 96}  # resolutions
SPP, SEEDS = (16, 64, 256), 8


# ---------------------------------------------------------------- Kinds of points


class Korobov(Lattice):
    """A lattice whose generating vector are the powers of one number (L'Ecuyer's choice)."""

    MULTIPLIER = 71189  # 17797 * 4 + 1

    def next_1d(self, active=True):
        u = self.reversed_index + hashed(self.key + self.dimension * 0x9E3779B9)
        self.dimension += 1
        self.reversed_index = self.reversed_index * mi.UInt32(self.MULTIPLIER)
        return mi.Float(u >> 8) * 2.0**-24


class Baker(Lattice):
    """The lattice with the baker's transform, which makes an integrand periodic."""

    def next_1d(self, active=True):
        u = super().next_1d(active)
        return dr.minimum(1 - dr.abs(2 * u - 1), 1 - 2.0**-24)


class Table(Lattice):
    """Numbers from a table, `numbers`: those of a dimension follow each other, `stride` of them."""

    def next_1d(self, active=True):
        index = self.dimension * self.stride + self.reversed_index
        self.dimension += 1
        return dr.gather(mi.Float, self.numbers, index)


def sobol(points: int, dimensions: int):
    """Owen-scrambled Sobol points of REPETITIONS randomisations, (dimensions, paths)."""
    rng = np.random.default_rng(1)
    numbers = [
        qmc.Sobol(dimensions, scramble=True, seed=rng, bits=32).random(points).T
        for _ in range(REPETITIONS)
    ]
    return np.minimum(np.concatenate(numbers, axis=1), 1 - 2.0**-24).astype(np.float32)


def samplers(points: int, tracer):
    """Yield (name, sampler) of each kind of points, placed at REPETITIONS randomisations."""
    paths = REPETITIONS * points
    lane = dr.arange(mi.UInt32, paths)
    independent = mi.load_dict({"type": "independent"})
    independent.seed(1, paths)
    yield "independent", independent
    for name, kind in (
        ("lattice", Lattice),
        ("lattice, baker", Baker),
        ("Korobov", Korobov),
        ("Sobol", Table),
    ):
        sampler = kind(mi.Properties())
        sampler.place(lane // points, lane % points, mi.UInt32(1))
        if kind is Table:
            per_reflection = 7 if tracer.emitters.draws else 3
            numbers = sobol(points, 2 + per_reflection * (tracer.max_bounces + 2))
            sampler.numbers, sampler.reversed_index = mi.Float(numbers.ravel()), lane
            sampler.stride = dr.opaque(mi.UInt32, paths)
        yield name, sampler


def variances(scene, points: int) -> dict[str, float]:
    """Return the variance of the target's mean radiance over one randomisation, by kind."""
    sensor, found = scene.sensor(0), {}
    with scene.prepared() as tracer, dr.suspend_grad():
        for name, sampler in samplers(points, tracer):
            ray, _ = sensor.sample_ray(0, 0, sampler.next_2d(), mi.Point2f(0.5))
            first_hit = FirstHit.of(tracer.scene, tracer.emitters, model_only=True)
            hit = tracer.scene.ray_intersect_preliminary(ray)
            (L, _), _, recorders = tracer.paths.walk(
                sampler, (ray, hit), mi.Bool(True), Recorders([first_hit])
            )
            of_model = recorders.of(FirstHit).of_model
            means = dr.block_sum(L[0] * of_model, points).numpy().astype(float) / points
            found[name] = means.var(ddof=1)
    return found


def gains(scenes) -> str:
    """Return the rows of the table of gains over independent points."""
    rows = []
    for text, scene in tqdm(scenes):
        for points in POINTS:
            found = variances(scene, points)
            independent = found.pop("independent")
            ratios = " | ".join(f"{independent / variance:.1f}" for variance in found.values())
            rows.append(f"| {text} | {points} | {ratios} |")
    return "\n".join(rows)


# ---------------------------------------------------------------- Intervals


def runs(scene, tracer, paths: int, randomisations: int, seed: int):
    """Return the sums of RUNS independent runs: name -> (RUNS, randomisations), means."""
    points = paths // randomisations
    parts = []
    for k in range(10):
        launch = Launch(1, 1, 100 * seed + k, RUNS * randomisations // 10, points)
        parts.append(tracer.trace(scene.sensor(0), launch, Channels("target")).channels)
    return {
        name: np.concatenate([part[name].ravel() for part in parts]).reshape(RUNS, -1) / points
        for name in parts[0]
    }


def covered(means: np.ndarray, truth: float, systematic=0.0, missed=0.0) -> float:
    """Return the share of the runs whose 95 % interval holds the truth."""
    R, mean = means.shape[1], means.mean(axis=1)
    scatter = student_factor(R - 1) * means.std(axis=1, ddof=1) / np.sqrt(R)
    half = np.sqrt(scatter**2 + (student_factor(np.inf) * systematic * mean) ** 2 + missed**2)
    return float(np.mean(np.abs(mean - truth) <= half))


def coverage(scene, numbers_of_paths) -> list[tuple[int, float, float, list[float]]]:
    """Return rows (paths, coverage by scatter, stated coverage, those of the channels)."""
    R = window.RANDOMISATIONS
    rows, truth = [], None
    with scene.prepared() as tracer:
        for paths in sorted(numbers_of_paths, reverse=True):
            found = runs(scene, tracer, paths, R, paths)
            if truth is None:
                truth = {name: values.mean() for name, values in found.items()}
            missed = tracer.unmet_sources(scene.sensor(0)).in_view / paths
            parts = [
                covered(values, truth[name])
                for name, values in found.items()
                if name.startswith(("target.group.", "target.bounce.", "target.hit"))
                and truth[name] > LEAST_SHARE * truth["target"]
            ]
            of_target = found["target"], truth["target"]
            stated = covered(*of_target, tracer.systematic_error, missed)
            rows.append((paths, covered(*of_target), stated, parts))
    return rows[::-1]


def intervals(scenes) -> str:
    """Return the rows of the table of intervals."""
    return "\n".join(
        f"| {text} | {paths} | {scatter:.1%} | {stated:.1%} | {min(parts):.1%} - {max(parts):.1%} |"
        for text, scene in tqdm(scenes)
        for paths, scatter, stated, parts in coverage(scene, COVERAGE_PATHS)
    )


def counts(scenes, paths: int = 2**13) -> str:
    """Return the rows of the table of numbers of randomisations."""
    rows = []
    for text, scene in tqdm(scenes):
        widths = []
        with scene.prepared() as tracer:
            for R in COUNTS:
                means = runs(scene, tracer, paths, R, R)["target"]
                scatter = means.std(axis=1, ddof=1) / np.sqrt(R)
                widths.append(student_factor(R - 1) * scatter.mean() / means.mean())
        rows.append(f"| {text} | {' | '.join(f'{width:.2%}' for width in widths)} |")
    return "\n".join(rows)


# ---------------------------------------------------------------- Images


def image_gains() -> str:
    """Return the rows of the table of images: variance of a pixel, independent / lattice."""
    rows = []
    for name, resolution in IMAGES.items():
        text, parameters = next((label(*case), case[1]) for case in SCENES if case[0] == name)
        scene = mi_lcair.load(name, resolution=resolution, **parameters)
        sensor = scene.sensor(0)
        with scene.prepared() as tracer:
            for spp in SPP:
                pixels = resolution**2
                found = []
                for R in (1, *COUNTS):
                    # With a point for each randomisation, the numbers are independent
                    images = [
                        tracer.trace(
                            sensor,
                            Launch(resolution, resolution, seed, R, spp // R, windows=pixels),
                            Channels(None),
                        ).radiance.sum(axis=1)
                        / spp
                        for seed in range(SEEDS)
                    ]
                    found.append(np.var(images, axis=0, ddof=1).mean())
                launches = (
                    Launch(resolution, resolution, seed, spp, 1, windows=pixels)
                    for seed in range(SEEDS)
                )
                images = [
                    tracer.trace(sensor, one, Channels(None)).radiance.mean(axis=1)
                    for one in launches
                ]
                independent = np.var(images, axis=0, ddof=1).mean()
                rms = np.sqrt(independent) / np.mean(images)
                ratios = " | ".join(f"{independent / variance:.1f}" for variance in found)
                rows.append(f"| {text} | {spp} | {rms:.2%} | {ratios} |")
    return "\n".join(rows)


def main(page):
    """Write the page."""
    scenes = [
        (label(name, parameters), mi_lcair.load(name, **parameters)) for name, parameters in SCENES
    ]
    write_page(
        page,
        "points",
        repetitions=REPETITIONS,
        runs=RUNS,
        share=LEAST_SHARE,
        windows=window.RANDOMISATIONS,
        pixels=window.PIXEL_RANDOMISATIONS,
        gains=gains(scenes),
        counts=counts(scenes),
        images=image_gains(),
        coverage=intervals(scenes),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/points.md"))
