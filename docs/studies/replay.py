"""Measure derivatives by `mi.render` and `dr.backward` against exact values.

    python -m docs.studies.replay [PAGE]

The script writes docs/validation/replay.md from replay.template.md. It takes about two minutes.
"""

import sys

import drjit as dr
import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.speed import backward
from docs.studies.page import write_page
from mi_lcair.physics import reflection
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance

SEEDS, SPP = 16, 256
TEXELS, SKY, HOT = (300.0, 310.0, 330.0, 340.0), 250.0, 600.0  # plate's picture, sky, disc [K]
ANGLE, DISTANCE = np.pi / 4, 10.0  # at which the plate is seen; to the disc [m]
STEP = 1e-5  # of differences of Float64 numbers, relative to the value
# Lobe, model, parameters, and half the angle of the disc in the mirror direction [rad]
SURFACES = [
    ("broad", "sandford_robertson", (0.7, 0.1, 0.2, 0.3), 0.3),
    ("narrow", "sandford_robertson", (0.7, 0.1, 0.2, 0.01), 0.01),
    ("broad", "microfacet", (0.3, 2.0, 3.0, 2.0, 0.2), 0.3),
    ("narrow", "microfacet", (0.01, 2.0, 3.0, 2.0, 0.2), 0.02),
]


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


def rows_of(label: str, scene, exact: dict) -> list[str]:
    """Rows of derivatives of the mean radiance by `dr.backward`, with their standard errors."""
    run = backward(scene, None, list(exact), SPP)
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
    return rows


def main(page="docs/validation/replay.md") -> None:
    rows = "\n".join(of_scenes() + of_surfaces())
    write_page(page, "replay", rows=rows, seeds=SEEDS)


if __name__ == "__main__":
    main(*sys.argv[1:])
