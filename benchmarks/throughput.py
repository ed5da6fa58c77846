"""Measure paths and rays per second of `bounce_path` and of Mitsuba's own integrators.

    python -m benchmarks.throughput [--quick] [-o FOLDER]

All render the same scenes. The rate of ray intersection alone is measured, too. Printed and written
are paths and rays per second and times in s. This takes about three minutes.
"""

import time
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import median

import drjit as dr
import mitsuba as mi
import numpy as np

from benchmarks import command
from mi_lcair import formats, scenes
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.progress import stepper
from mi_lcair.rendering.views import film

# `rr_depth` of the stock integrators. It is so deep that Russian roulette never ends a path.
NEVER = 1000
RAW = "ray intersection alone"
RADIUS = 0.2  # of the analytic sphere, as of the mesh [m]
# Name of each scene, and its bodies inside the emitting room. `sphere` is a mesh; `analytic sphere`
# is Mitsuba's own shape, which is not drawn from the table of triangles.
SCENES = {
    "furnace": ("sphere", "slabs"),
    "box with a sphere": ("sphere",),
    "box with an analytic sphere": ("analytic sphere",),
}


@dataclass(frozen=True)
class Row:
    """Speed of one contestant in one scene, see `SCENES`.

    The speeds are medians over the repetitions. `ratio` is the speed relative to the contestant
    named in `against`, or None where `against` is empty. `compile_seconds` is the time of the first
    run less the median of the later ones.
    """

    scene: str
    name: str
    paths_per_second: float
    rays_per_second: float
    against: str
    ratio: float | None
    compile_seconds: float


@dataclass(frozen=True)
class ThroughputChart:
    """The table of speeds and the conditions under which it was measured."""

    rows: list[Row]
    bounces: int
    spp: int
    resolution: int
    repeats: int


def measure(
    bounces: int = 5, spp: int = 64, resolution: int = 128, repeats: int = 9, progress=None
) -> ThroughputChart:
    """Measure the speed of `bounce_path` and of Mitsuba's own integrators in three scenes.

    All contestants run in turn in one process. They trace the same geometry with the same number of
    bounces and samples. `bounce_path` uses `thermal` and the material bare aluminum (MWIR), in one
    row the microfacet model with a lobe of that width. The stock integrators use `roughconductor`
    (GGX with that width) and `area`. Speeds are medians after the compile. Ratios are those of
    speeds, ours / theirs. The last row compares `bounce_path` with the rate at which the same scene
    answers random rays, when nothing else is computed.

    Parameters
    ----------
    bounces
        Reflections after which a path ends.
    spp
        Paths per pixel.
    resolution
        Pixels along each side of the image.
    repeats
        Timed runs of each contestant, after one run that compiles.
    progress
        Function of (steps done, steps in total), called after each run.

    Returns
    -------
    ThroughputChart
        One row for each contestant in each scene, and one for `bounce_path` against ray
        intersection alone.
    """

    paths = resolution**2 * spp
    in_scenes = {name: contestants(name, bounces, spp, resolution) for name in SCENES}
    step = stepper(progress, (repeats + 1) * sum(map(len, in_scenes.values())))
    rows = []
    for scene, of_scene in in_scenes.items():
        times = {name: [] for name in of_scene}
        # The contestants run in turn, so that a change of the machine's load concerns all of them.
        for repeat in range(repeats + 1):
            for name, (run, _, _) in of_scene.items():
                times[name].append(timed(run, repeat))
                step()
        first = {name: values.pop(0) for name, values in times.items()}
        seconds = {name: median(values) for name, values in times.items()}
        rows += [
            Row(
                scene,
                name,
                paths / seconds[name],
                paths * rays / seconds[name],
                against,
                median(b / a for a, b in zip(times[name], times[against])) if against else None,
                max(0.0, first[name] - seconds[name]),
            )
            for name, (_, rays, against) in of_scene.items()
        ]
    # The last row compares the first contestant with ray intersection alone.
    bare_row, raw_row = rows[0], next(row for row in rows if row.name == RAW)
    ratio = bare_row.rays_per_second / raw_row.rays_per_second
    rows.append(replace(bare_row, against=raw_row.name, ratio=ratio))
    return ThroughputChart(rows, bounces, spp, resolution, repeats)


def contestants(scene: str, bounces: int, spp: int, resolution: int) -> dict:
    """Load one of `SCENES` for each contestant; the other parameters are those of `measure`.

    Returns, for each name, a function of the seed that renders once, the number of rays of a path,
    and the name of the contestant with which the speed is compared ("" for none). The channels and
    ray intersection alone are measured in the furnace.
    """

    def ours(body="material", **options):
        integrator = {"type": "bounce_path", "max_bounces": bounces, **options}
        return room(integrator, body, resolution, SCENES[scene])

    def stock(kind):
        integrator = {"type": kind, "max_depth": bounces + 1, "rr_depth": NEVER}
        return room(integrator, "roughconductor", resolution, SCENES[scene])

    def renders(loaded):
        return lambda seed: loaded.integrator().render(loaded, seed=seed, spp=spp)

    bare = ours()
    contestants = {
        "bounce_path": (renders(bare), bounces + 1, "prb_basic"),
        "bounce_path, microfacet": (renders(ours("microfacet")), bounces + 1, "prb_basic"),
        "prb_basic": (renders(stock("prb_basic")), bounces + 1, ""),
        "bounce_path, emitter sampling": (
            renders(ours(emitter_sampling=True)),
            2 * bounces + 1,
            "path",
        ),
        "path": (renders(stock("path")), 2 * bounces + 1, ""),
    }
    if scene != "furnace":
        return contestants
    split, whole = ours(), ours()
    paths = resolution**2 * spp
    return contestants | {
        "bounce_path, split into channels": (
            observes(split, spp, "image"),
            bounces + 1,
            "bounce_path, total only",
        ),
        "bounce_path, total only": (observes(whole, spp, None), bounces + 1, ""),
        RAW: (lambda seed: intersect(bare, paths, bounces + 1, seed), bounces + 1, ""),
    }


def timed(run, seed: int) -> float:
    """Seconds of one run, from its start until its result has been computed."""
    dr.sync_thread()
    start = time.perf_counter()
    dr.eval(run(seed))
    dr.sync_thread()
    return time.perf_counter() - start


def observes(loaded, spp: int, split: str | None):
    """Return a function of the seed that renders without an image, with or without channels."""
    integrator, sensor = loaded.integrator(), loaded.sensors()[0]
    width, height = sensor.film().crop_size()
    kept = {}  # a new tracer for each run would record its launches again

    def run(seed):
        with integrator.prepared(loaded, kept=kept) as tracer:
            launch = Launch(width, height, seed, 1, spp, windows=width * height)
            return tracer.trace(sensor, launch, Channels(split)).valid

    return run


@dr.syntax
def intersect(loaded, paths: int, rays: int, seed: int):
    """Count the hits of random rays from random points of the room.

    Each of the `paths` lanes traces `rays` rays, one after the other.
    """
    random = mi.PCG32(size=paths, initstate=seed)
    hits, k = mi.UInt32(0), mi.UInt32(0)
    while k < rays:
        number = mi.Point3f(random.next_float32(), random.next_float32(), random.next_float32())
        origin = 1.8 * number - 0.9
        direction = mi.warp.square_to_uniform_sphere(
            mi.Point2f(random.next_float32(), random.next_float32())
        )
        hits += dr.select(
            loaded.ray_intersect_preliminary(mi.Ray3f(origin, direction)).is_valid(), 1, 0
        )
        k += 1
    return hits


def room(integrator: dict, model: str, resolution: int, bodies: tuple[str, ...]):
    """Return the furnace's room and camera with this project's plugins or with Mitsuba's own.

    bodies: what is in the room, see `SCENES`. model: the bodies' BSDF, all metals with lobes of one
    width. A reflection model goes with `thermal`, `roughconductor` with `area`.
    """
    T = mi.ScalarTransform4f
    metal = material("bare_aluminum", band("MWIR"))
    width = float(metal.model.lobe_width(metal.surface())[0])
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.2}}
    body = {
        "material": {"material": "bare_aluminum", "band": "MWIR"},
        "microfacet": {"alpha": width, "gamma": 2.0, "n": 10.0, "k": 30.0, "rho_d": 0.0},
        "roughconductor": {"distribution": "ggx", "alpha": width},
    }[model] | {"type": model}
    emitter = (
        {"type": "area", "radiance": {"type": "uniform", "value": 1.87}}
        if model == "roughconductor"
        else {"type": "thermal", "band": "MWIR", "temperature": 300.0}
    )
    meshes = scenes.FOLDER / "meshes"

    def shape(name, bsdf, to_world=T()):
        mesh = {
            "type": "ply",
            "filename": str(meshes / f"furnace_{name}.ply"),
            "face_normals": True,
        }
        return mesh | {"to_world": to_world, "bsdf": bsdf, "emitter": emitter}

    choices = {
        "sphere": {"sphere": shape("sphere", body)},
        "analytic sphere": {
            "sphere": {"type": "sphere", "radius": RADIUS, "bsdf": body, "emitter": emitter}
        },
        "slabs": {
            "slab_1": shape("slab", body, T().translate([-0.45, 0, 0]) @ T().rotate([0, 0, 1], 65)),
            "slab_2": shape("slab", body, T().translate([0.45, 0, 0]) @ T().rotate([0, 0, 1], -65)),
        },
    }

    camera = T().look_at(origin=[0, -0.75, 0.3], target=[0, 0, 0], up=[0, 0, 1]) @ T().scale(
        [0.5, 0.5, 1]
    )
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sensor": {
                "type": "orthographic",
                "to_world": camera,
                "film": film(resolution, resolution),
                "sampler": {"type": "independent"},
            },
            "room": shape("room", grey),
            **{name: of_one for kind in bodies for name, of_one in choices[kind].items()},
        },
        optimize=False,
        parallel=False,
    )


def measured(quick: bool, progress) -> ThroughputChart:
    """The speeds, in a third of the runs if `quick`."""
    return measure(repeats=3 if quick else 9, progress=progress)


def columns(result: ThroughputChart) -> dict[str, list]:
    """The fields of the rows by name."""
    return {of.name: [getattr(row, of.name) for row in result.rows] for of in fields(Row)}


def write(folder: Path, result: ThroughputChart) -> None:
    """Write throughput.csv to a folder; a ratio is NaN where nothing is compared."""
    table = columns(result)
    table["ratio"] = [np.nan if ratio is None else ratio for ratio in table["ratio"]]
    formats.write_csv(folder / "throughput.csv", table)


def printed(result: ThroughputChart) -> tuple:
    """JSON and table of the speeds."""
    table = columns(result)
    return asdict(result), command.cells(table, zip(*table.values()))


def main(arguments: list[str] | None = None) -> None:
    """Measure, write the table and print it."""
    command.run("throughput", __doc__, measured, write, printed, arguments)


if __name__ == "__main__":
    main()
