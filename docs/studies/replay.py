"""Measure derivatives by `mi.render` and `dr.backward`: exactness, recovery of parameters, time.

    python -m docs.studies.replay [PAGE]

The script writes docs/validation/replay.md from replay.template.md. It takes about twenty minutes.
"""

import re
import sys
import tempfile
from pathlib import Path
from time import process_time

import drjit as dr
import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.speed import BACKWARD, backward
from benchmarks.throughput import NEVER
from docs.studies.page import write_page
from mi_lcair.physics import reflection
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance

SEEDS, SPP = 16, 256
TEXELS, SKY, HOT = (300.0, 310.0, 330.0, 340.0), 250.0, 600.0  # plate's picture, sky, disc [K]
ANGLE, DISTANCE = np.pi / 4, 10.0  # at which the plate is seen; to the disc [m]
MANY = 8192  # samples per pixel with which sums in Float32 are rounded
STEP = 1e-5  # of differences of Float64 numbers, relative to the value
# Lobe, model, parameters, and half the angle of the disc in the mirror direction [rad]
SURFACES = [
    ("broad", "sandford_robertson", (0.7, 0.1, 0.2, 0.3), 0.3),
    ("narrow", "sandford_robertson", (0.7, 0.1, 0.2, 0.01), 0.01),
    ("broad", "microfacet", (0.3, 2.0, 3.0, 2.0, 0.2), 0.3),
    ("narrow", "microfacet", (0.01, 2.0, 3.0, 2.0, 0.2), 0.02),
]
# True value, start, first step and bounds
UNKNOWNS = {
    "floor.emitter.temperature": (500.0, 450.0, 10.0, 200.0, 700.0),
    "floor.bsdf.emissivity": (0.5, 0.7, 0.05, 0.02, 0.98),
}
ROUNDS = {
    "open_box": 40,
    "cavity": 40,
    "furnace": 20,
    "cylinder_ir_range": 20,
}  # of each integrator, for times and variances
STEPS, RUNS, FIRST = 60, 20, 10**6  # steps of a loop, loops, and seed of the first image


def B(kelvin, name="LWIR"):
    """Radiance of a blackbody [W m^-2 sr^-1], Float64."""
    return in_band_radiance(band(name), dr.llvm.ad.Float64(kelvin)).numpy()


def slope(function, value: float) -> float:
    """Derivative of a function of a number by a central difference."""
    h = STEP * value
    return float(np.ravel(function(value + h) - function(value - h))[0]) / (2 * h)


def plate_radiance(model, values, half: float, kelvin: float) -> float:
    """Radiance of the plate: its emission, and a quadrature over sky and disc.

    The disc is a cone around the mirror direction, in which nodes are dense near the middle.
    """
    Float, V = dr.llvm.ad.Float64, dr.llvm.ad.Array3f64
    S = model.surface_of(tuple(values), model.forms[0])
    HDR = float(model.HDR(S, Float(ANGLE))[0])
    x, w = np.polynomial.legendre.leggauss(400)
    t, azimuth = (1 + x) / 2, np.pi * (1 + x[:, None]) / 2  # both halves of the cone are alike
    angle = half * t**3
    weight = w[:, None] * np.pi * w * 1.5 * half * t**2 * np.sin(angle)
    (s, c), along = (np.sin(ANGLE), np.cos(ANGLE)), np.sin(angle) * np.cos(azimuth)
    i = (
        np.cos(angle) * s + along * c,
        np.sin(angle) * np.sin(azimuth),
        np.cos(angle) * c - along * s,
    )
    i = [np.broadcast_to(part, weight.shape).ravel() for part in i]
    f = model.f(S, V(*map(Float, i)), V(-float(s), 0, float(c))).numpy()
    plate, sky, hot = B([kelvin, SKY, HOT])
    return (1 - HDR) * plate + HDR * sky + np.sum(f * i[2] * weight.ravel()) * (hot - sky)


def plate_scene(model, values, half: float):
    """A small part of a plate with a picture of temperatures, under a black sky with a hot disc."""
    look = mi.ScalarTransform4f().look_at
    s, c = float(np.sin(ANGLE)), float(np.cos(ANGLE))
    black = {"type": "diffuse", "reflectance": 0.0}
    picture = {"type": "bitmap", "data": mi.TensorXf(np.reshape(TEXELS, (2, 2, 1))), "raw": True}
    plate, disc, sky = (
        {"type": "thermal", "band": "LWIR", "temperature": value} for value in (picture, HOT, SKY)
    )
    film = {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "luminance"}
    camera = look([-s, 0, c], [0, 0, 0], [0, 1, 0]).scale([1e-4, 1e-4, 1])
    place = look([DISTANCE * s, 0, DISTANCE * c], [0, 0, 0], [0, 1, 0])
    place = place.scale(float(DISTANCE * np.tan(half)))
    bsdf = {"type": model.name, **dict(zip(model.names, values))}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 1},
            "sensor": {"type": "orthographic", "to_world": camera, "film": film},
            "plate": {"type": "rectangle", "bsdf": bsdf, "emitter": plate},
            "disc": {"type": "disk", "to_world": place, "bsdf": black, "emitter": disc},
            "sky": {
                "type": "sphere",
                "radius": 30.0,
                "flip_normals": True,
                "bsdf": black,
                "emitter": sky,
            },
        },
        optimize=False,
    )


def rows_of(label: str, scene, exact: dict, spp: int = SPP) -> list[str]:
    """Rows of derivatives of the mean radiance by `dr.backward`, with their standard errors."""
    run = backward(scene, None, list(exact), spp)
    runs = np.array([run(seed) for seed in range(SEEDS)])
    rows = []
    for key, value, found in zip(exact, exact.values(), runs.T):
        mean, error = found.mean(), found.std(ddof=1) / np.sqrt(SEEDS)
        off = abs(mean - value)
        apart = f"{off / error:.1f}" if error > 1e-5 * abs(value) else f"{off / abs(value):.0e}"
        rows.append(f"| {label} | {key} | {value:.5g} | {mean:.5g} ± {error:.1g} | {apart} |")
    return rows


def of_surfaces() -> list[str]:
    """Rows of the plate, with the temperature of one of its four texels."""
    rows, kelvin = [], np.mean(TEXELS)
    for lobe, name, values, half in tqdm(SURFACES):
        model = reflection.model(name)
        of_texel = lambda K: plate_radiance(model, values, half, K) / len(TEXELS)
        exact = {"plate.emitter.temperature.data": slope(of_texel, kelvin)}
        for k, key in enumerate(model.names):
            at = lambda v: plate_radiance(model, (*values[:k], v, *values[k + 1 :]), half, kelvin)
            exact[f"plate.bsdf.{key}"] = slope(at, values[k])
        rows += rows_of(f"plate, {name}, {lobe}", plate_scene(model, values, half), exact)
    return rows


def of_scenes() -> list[str]:
    """Rows of the bundled scenes with closed forms, with and without drawn emitters."""
    (hot, cold), rows = B([800.0, 300.0], "total"), []
    dB = lambda kelvin: slope(lambda K: B(K, "total"), kelvin)
    plates, box = 0.02 * 0.1492997958867619 / 0.24**2, np.sqrt(0.5) * 0.02 / 0.16**2
    view = 0.24063600617696168
    exact = {
        "two_plates": {
            "emitter.emitter.temperature": plates * dB(800.0),
            "reflector.bsdf.emissivity": -plates * hot,
        },
        "open_box": {
            "wall.emitter.temperature": box * 0.5 * view * dB(800.0),
            "floor.emitter.temperature": box * 0.5 * dB(300.0),
            "floor.bsdf.emissivity": box * (cold - view * hot),
        },
        "furnace": {"room.bsdf.emissivity": 0.0, "body.epsilon": 0.0},
    }
    for name, of_keys in tqdm(exact.items()):
        for draws in ("false", "true")[: 1 + (name != "furnace")]:
            scene = mi_lcair.load(name, resolution=16, emitter_sampling=draws).mi
            rows += rows_of(f"{name}, {'drawn' if draws == 'true' else 'not'}", scene, of_keys)
    scene = mi_lcair.load("open_box", resolution=16, emitter_sampling="true").mi
    rows += rows_of(f"open_box, drawn, {MANY} samples", scene, exact["open_box"], MANY)
    return rows


def loop():
    """The function `recovered` of the page on Python."""
    page = (Path(__file__).parents[1] / "howto" / "python.md").read_text(encoding="utf-8")
    space = {"mi": mi, "dr": dr}
    exec(re.search(r"```python\n(import numpy.*?)\n\n\nbox = ", page, re.DOTALL)[1], space)
    return space["recovered"]


def recoveries(folder: Path) -> np.ndarray:
    """Values for images of 16 samples: loop, without weights, `invert`, its half-widths."""
    recovered, found = loop(), []
    scene = mi_lcair.load("open_box", band="LWIR", resolution=16, spp=16)
    mi.traverse(scene).update({key: value[0] for key, value in UNKNOWNS.items()})
    images = [np.array(mi.render(scene, seed=FIRST + run)) for run in range(RUNS)]
    noise = np.std([mi.render(scene, seed=2 * FIRST + run) for run in range(64)], axis=0)
    noise = np.maximum(noise, 1e-3 * np.max(images[0]))
    np.save(folder / "noise.npy", noise[..., 0])
    data = {"scene": "open_box", "parameters": {"band": "LWIR", "resolution": 16}}
    data |= {"image": str(folder / "image.npy"), "sigma_image": str(folder / "noise.npy")}
    data |= {"quantity": "radiance", "camera_sigma": "0", "model_sigma": "0"}
    names = {"floor.temperature": {"start": 450.0}, "diffuse.emissivity": {"start": 0.7}}
    unknowns = {key: value[1:] for key, value in UNKNOWNS.items()}
    for run, image in enumerate(tqdm(images)):
        np.save(folder / "image.npy", image[..., 0])
        answers = mi_lcair.invert({"data": [data], "unknowns": names}, advise=False).answers
        weighings = noise, np.full_like(noise, np.mean(noise))
        loops = [
            recovered(scene, *map(mi.TensorXf, (image, sigma)), unknowns, STEPS, seed=1 + run)
            for sigma in weighings
        ]
        rows = [list(values.values()) for values in loops]
        half = [(answer.upper - answer.lower) / 2 for answer in answers]
        found.append([*rows, [answer.value for answer in answers], half])
    return np.array(found)


def of_recoveries(found: np.ndarray) -> list[str]:
    """Rows of the loop, the loop without weights, and `invert`."""
    truth, half, rows = [value[0] for value in UNKNOWNS.values()], found[:, 3], []
    labels = "loop", "loop without weights", "`invert`"
    for label, values in zip(labels, np.swapaxes(found[:, :3], 0, 1)):
        off, cells = values - truth, []
        from_invert = np.abs(values - found[:, 2]) / half
        of_truth = np.sum(np.abs(off) < half, axis=0)
        for k in range(2):
            mean, spread = off[:, k].mean(), off[:, k].std(ddof=1)
            cells += [f"{mean:.1g} ± {spread / len(off) ** 0.5:.1g}", f"{spread:.2g}"]
            cells += [f"{from_invert[:, k].max():.2f}", f"{np.sum(from_invert[:, k] < 1)}"]
            cells += [f"{of_truth[k]}"]
        rows.append(f"| {label} | {' | '.join(cells)} |")
    return rows


def of_times() -> list[str]:
    """Rows of time, variance, and both together, relative to `prb_basic` at equal reflections."""
    rows = []
    for name, rounds in tqdm(ROUNDS.items()):
        parameters, spp, keys = BACKWARD[name]
        loaded = mi_lcair.load(name, sampler="independent", **parameters).mi
        most = loaded.integrator().max_bounces
        plugins = [{"type": "prb_basic", "max_depth": most + 1, "rr_depth": NEVER}]
        plugins += [
            {"type": "bounce_path", "max_bounces": most, "emitter_sampling": draws}
            for draws in (True, False)
        ]
        runs = [backward(loaded, mi.load_dict(plugin), keys, spp) for plugin in plugins]
        times, found = np.empty((rounds, 3)), np.empty((rounds, 3, len(keys)))
        for seed in range(-1, rounds):  # the first round compiles, and the last one takes its place
            for number, run in enumerate(runs):
                start = process_time()
                values = run(seed + 1)
                times[seed, number], found[seed, number] = process_time() - start, values
        longer = np.median(times[:, 1:] / times[:, :1], axis=0)
        variance = found.var(axis=0, ddof=1)
        for k, key in enumerate(keys):
            noisier = variance[1:, k] / variance[0, k]
            numbers = np.transpose([longer, noisier, longer * noisier]).ravel()
            cells = " | ".join(f"{number:.2g}" for number in numbers)
            rows.append(f"| {name} | {key} | {cells} |")
    return rows


def main(page="docs/validation/replay.md") -> None:
    with tempfile.TemporaryDirectory() as folder:
        recovered = recoveries(Path(folder))
    write_page(
        page,
        "replay",
        rows="\n".join(of_scenes() + of_surfaces()),
        recovered="\n".join(of_recoveries(recovered)),
        times="\n".join(of_times()),
        seeds=SEEDS,
        runs=RUNS,
        steps=STEPS,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
