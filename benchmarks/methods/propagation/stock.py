"""Mitsuba's own integrator `path` on the diffuse scenes, with its independent sampler.

It renders an image of the same meshes, with the BSDF `diffuse` and the emitter `area`, and the
intensity is the mean radiance times the area of the window. `path` samples emitters and BSDF and
combines both by multiple importance sampling. Russian roulette is switched off.
"""

from functools import cache

import mitsuba as mi
import numpy as np

from benchmarks.methods.propagation.path_tracing import EFFORTS
from benchmarks.methods.propagation.problem import Method, Problem
from benchmarks.throughput import NEVER
from mi_lcair import scenes
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.views import film

# Mesh, reflectance and temperature [K] of the shapes of each scene. The temperature is None where
# nothing is emitted. The emissivity is 1 - reflectance.
SHAPES = {
    "two_plates": [("two_plates_reflector", 1.0, None), ("two_plates_emitter", 0.0, 800.0)],
    "open_box": [("open_box_floor", 0.5, 300.0), ("open_box_wall", 0.0, 800.0)],
    "cavity": [("cavity_8", 0.5, 800.0)],
}
SIDE = 64  # pixels along each side of the image, or fewer where there are fewer paths


@cache
def stock_scene(problem_name: str, band, camera: str, bounces: int, side: int) -> mi.Scene:
    """The scene of a problem with Mitsuba's own plugins.

    camera: text of the sensor's matrix, rows one after another. side: pixels along each side.
    """
    shapes = {}
    for mesh, reflectance, temperature in SHAPES[problem_name]:
        shapes[mesh] = {
            "type": "ply",
            "filename": str(scenes.FOLDER / "meshes" / f"{mesh}.ply"),
            "face_normals": True,
            "bsdf": {"type": "diffuse", "reflectance": uniform(reflectance)},
        }
        if temperature is not None:
            radiance = (1 - reflectance) * float(in_band_radiance(band, temperature))
            shapes[mesh]["emitter"] = {"type": "area", "radiance": uniform(radiance)}
    matrix = np.array(camera.split(), dtype=float).reshape(4, 4)
    return mi.load_dict(
        {
            "type": "scene",
            "embree_use_robust_intersections": True,  # as in `mi_lcair.load`
            "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": NEVER},
            "sensor": {
                "type": "orthographic",
                "to_world": mi.ScalarTransform4f(matrix),
                "film": film(side, side),
                "sampler": {"type": "independent"},
            },
            **shapes,
        },
        optimize=False,
        parallel=False,
    )


def uniform(value: float) -> dict:
    """A spectrum that has one value at all wavelengths."""
    return {"type": "uniform", "value": value}


def run(problem: Problem, effort: int, seed: int) -> tuple[float, int]:
    """Run `path` with `effort` paths, a power of 4."""
    side = min(SIDE, round(effort**0.5))
    matrix = np.array(mi.traverse(problem.scene.sensor(0))["to_world"].matrix).reshape(4, 4)
    camera = " ".join(map(repr, matrix.astype(float).ravel().tolist()))
    scene = stock_scene(problem.name, problem.scene.band, camera, problem.bounces, side)
    image = scene.integrator().render(scene, seed=seed, spp=effort // side**2)
    mean = float(np.mean(image.numpy(), dtype=float))
    # Its last numbers of every path are not computed yet; the next recorded call would do it.
    scene.sensors()[0].sampler().seed(0, 1)
    return mean * problem.window_area, effort * (1 + 2 * problem.bounces)


STOCK = Method("Mitsuba's path", "", run, lambda problem: EFFORTS if problem.name in SHAPES else [])
