"""Time to an error, lattice points against independent points."""

import numpy as np

import mi_lcair
from benchmarks.timing import ratio, seconds
from mi_lcair.rendering.scene import changed

# Half of the 95 % interval. The rms error is then about 0.1 %.
TOLERANCE = 0.002
MOST_PATHS = 2**28
SCENES = {
    "two_plates": {},
    "open_box": {},
    "cavity": {"opening": 8},
    "furnace": {"max_bounces": 8},
    "cylinder_ir_range": {},
    "a340_landing": {"position": 3, "band": "LWIR"},
}


def track_time_to_error(name, tolerance=TOLERANCE, rounds=3):
    """Time of an intensity with independent points / with lattice points, to one tolerance."""
    scenes = [
        mi_lcair.load(name, resolution=1, sampler=sampler, **SCENES[name])
        for sampler in ("independent", "lattice")
    ]
    run = lambda scene: (
        lambda seed: mi_lcair.signature(scene, tolerance=tolerance, max_spp=MOST_PATHS, seed=seed)
    )
    return ratio(*map(run, scenes), rounds)


track_time_to_error.params = list(SCENES)
track_time_to_error.param_names = ["scene"]
track_time_to_error.unit = "independent / lattice"
track_time_to_error.timeout = 900


def track_openings(opening=8, paths=2**13, seeds=24):
    """Time of a cavity to an error, independent points / lattice points kept from its opening."""
    cost = []
    for sampler, away in (("independent", False), ("lattice", True)):
        scene, values = mi_lcair.load("cavity", opening=opening, sampler=sampler), []
        run = lambda seed, scene=scene, values=values: values.append(
            mi_lcair.signature(scene, spp=-(-paths // 64**2), seed=seed).target.intensity
        )
        with changed(scene, opening_sampling=away):
            run(0)  # compiles
            time = sum(seconds(run, 1 + seed) for seed in range(seeds))
        cost.append(time * np.var(values[1:], ddof=1))
    return cost[0] / cost[1]


track_openings.unit = "independent / kept from the opening"
track_openings.timeout = 900


def track_small_launch(rounds=9):
    """Time of an intensity from 2^12 paths / from 2^20 paths, both recorded before."""
    scene = mi_lcair.load("two_plates", resolution=1)
    run = lambda paths: lambda seed: mi_lcair.signature(scene, spp=paths, seed=seed)
    return ratio(run(2**12), run(2**20), rounds)


track_small_launch.unit = "small / large"
track_small_launch.timeout = 900


def track_image(spp=64, rounds=3):
    """Time of an image of the cylinder with lattice points / with independent points."""
    scenes = [
        mi_lcair.load("cylinder_ir_range", resolution=128, sampler=sampler)
        for sampler in ("lattice", "independent")
    ]
    run = lambda scene: lambda seed: mi_lcair.render(scene, spp=spp, seed=seed)
    return ratio(*map(run, scenes), rounds)


track_image.unit = "lattice / independent"
track_image.timeout = 900


IMAGES = {
    "cylinder": ("cylinder_ir_range", {}, 0.0015),
    "open_box": ("open_box", {}, 0.1),
    **{
        f"airliner, position {k}": ("a340_landing", {"position": k, "resolution": 128}, 0.2)
        for k in (1, 2, 3)
    },
}


def track_shared_samples(name):
    """Variance of an image with the same samples in all pixels / by need, at equal time."""
    scene, parameters, tolerance = IMAGES[name]
    scene, images = mi_lcair.load(scene, **parameters), {}

    def by_need(seed):
        images["by need"] = mi_lcair.render(scene, tolerance=tolerance, seed=seed)

    def even(seed):
        images["even"] = mi_lcair.render(scene, spp=images["by need"].spp, seed=seed)

    cost = {}
    for run, kind in ((by_need, "by need"), (even, "even")):
        run(1)  # compiles
        cost[kind] = min(seconds(run, 1) for _ in range(3)) * images[kind].rms_error ** 2
    return cost["even"] / cost["by need"]


track_shared_samples.params = list(IMAGES)
track_shared_samples.param_names = ["image"]
track_shared_samples.unit = "even / by need"
track_shared_samples.timeout = 900


def track_reflections(rounds=9):
    """Time of an image of the cylinder to 0.1 % with chosen reflections / with the four needed."""
    scene = mi_lcair.load("cylinder_ir_range")
    run = lambda number: (
        lambda seed: mi_lcair.render(scene, tolerance=1e-3, seed=seed, max_bounces=number)
    )
    return ratio(run("auto"), run(4), rounds)


track_reflections.unit = "auto / 4"
track_reflections.timeout = 900
