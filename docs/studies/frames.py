"""Measure derivatives of frames along motions, beside Mitsuba's prb_projective and differences.

    python -m docs.studies.frames [PAGE]

The script writes docs/validation/frames.md from frames.template.md. It takes about ten minutes.
"""

import sys
import warnings
from pathlib import Path
from statistics import median
from time import process_time
from unittest.mock import patch

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.derivatives import common_numbers, images
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from mi_lcair.rendering.statistics import student_factor
from tests.derivatives.motions.test_differences import L, convex_hull, mesh
from tests.derivatives.test_frames import TURNED, camera, expected, scene_of

PAGE = Path(__file__).parents[1] / "validation" / "frames.md"
SIZE, RUNS, GREY = 64, 3, 0.5
SPP, TRUTH_SPP, COVERED = (16, 64, 256), 2**12, 20
KELVIN = {"ball": 320.0, "box": 300.0, "cube": 300.0}
SHIFT, SHORT = "y_m", 0.02  # motion, and step of the differences for the check [pixels]


def bodies(reflectance: float) -> list:
    """A ball of 24 facets before a box that is colder."""
    random = np.random.default_rng(3)
    ball = random.normal(size=(14, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    box = np.array([[x, y, z] for x in (-0.5, 0.0) for y in (-0.8, 0.8) for z in (-0.6, 0.6)])
    parts = {"ball": 0.4 * ball + [0.9, 0.1, 0.3], "box": box}
    return [
        mesh(name, points, triangle_vertices(convex_hull(name, points)), reflectance, KELVIN[name])
        for name, points in parts.items()
    ]


def projective(shapes: dict, reflectance: float, max_bounces: int, split: bool, **settings):
    """The same scene for Mitsuba's `prb_projective`. shapes: meshes by name."""
    settings = {"max_depth": max_bounces + 1, **settings}
    sensor = camera(size=SIZE, sampler={"type": "independent"})
    scene = {
        "type": "scene",
        "integrator": {"type": "prb_projective", **settings},
        "sensor": sensor,
    }
    for name, shape in shapes.items():
        corners, triangles = vertex_positions(shape), triangle_vertices(shape)
        if split:
            corners = corners[triangles].reshape(-1, 3)
            triangles = np.arange(len(corners)).reshape(-1, 3)
        radiance = (1 - reflectance) * L * (KELVIN[name] / 300) ** 4
        values = mi.Properties()
        values["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": reflectance})
        values["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        values["face_normals"] = True
        copy = mi.Mesh(name, len(corners), len(triangles), values)
        buffers = mi.traverse(copy)
        buffers["vertex_positions"] = np.ravel(corners).astype(np.float32)
        buffers["faces"] = np.ravel(triangles).astype(np.uint32)
        buffers.update()
        scene[name] = copy
    return mi.load_dict(scene, optimize=False)


def projective_derivative(scene, name: str, spp: int, seed: int) -> np.ndarray:
    """Derivative of the pixels along a shift, by forward mode of `prb_projective`."""
    parameters, key = mi.traverse(scene), f"{name}.vertex_positions"
    before, shift = mi.Float(parameters[key]), mi.Float(0)
    dr.enable_grad(shift)
    along = dr.arange(mi.UInt32, dr.width(before)) % 3 == 1
    parameters[key] = before + dr.select(along, shift, 0)
    parameters.update()
    image = mi.render(scene, parameters, spp=spp, seed=seed)
    dr.forward(shift)
    result = dr.grad(image).numpy()[..., 0]
    parameters[key] = before
    parameters.update()
    return result


def measured(derivative, truth: np.ndarray) -> tuple[float, float]:
    """Processor time [s] and squared error, summed over the pixels, of a function of the seed.

    Medians, and means, of runs without compilation.
    """
    derivative(0)
    times, errors = [], []
    for seed in range(1, 1 + RUNS):
        start = process_time()
        found = derivative(seed)
        times.append(process_time() - start)
        errors.append(np.sum((found - truth) ** 2))
    return median(times), float(np.mean(errors))


def ours(scene, name: str, spp: int, seed: int) -> np.ndarray:
    return mi_lcair.derivative_images(scene, [name], spp=spp, seed=seed).derivative[0]


def differences(scene, name: str, spp: int, seed: int) -> np.ndarray:
    """Derivative of the pixels by differences of two images."""
    with patch.object(images, "along_frame", lambda *arguments: {}):
        return ours(scene, name, spp, seed)


def table(scene, name: str, truth: np.ndarray, rivals: list) -> list[str]:
    """Rows of a scene's derivative along a shift of a group. rivals: titles, scenes and samples."""
    results, best = [], {}
    own = [("edges and attached paths", ours, SPP), ("differences", differences, SPP)]
    methods = [(title, of, scene, f"{name}.{SHIFT}", spp) for title, of, spp in own]
    methods += [(title, projective_derivative, other, name, spp) for title, other, spp in rivals]
    for title, of, place, moved, samples in methods:
        for spp in samples:
            time, error = measured(lambda seed: of(place, moved, spp, seed), truth)  # noqa: B023
            results.append((title, spp, time, error))
            best[title] = min(best.get(title, np.inf), time * error)
    of_all, least = np.sum(truth**2), best[own[0][0]]
    rows = []
    for title, spp, time, error in results:
        ratio = f"{best[title] / least:.2g}"
        rows.append(f"| {title} | {spp} | {time:.2f} | {np.sqrt(error / of_all):.2g} | {ratio} |")
    return rows


def black_cube() -> dict[str, str]:
    """A black cube, whose derivatives follow from the areas that it covers of the pixels."""
    shape = convex_hull("cube", TURNED)
    truth = expected(TURNED, lambda points, x: points + [0, x, 0], size=SIZE)
    scene, fields = scene_of(shape, size=SIZE), {}
    for split in (False, True):
        of = projective({"cube": shape}, 0, 0, split, sppi=0)
        rivals = [(f"`prb_projective`, {'split' if split else 'shared'} vertices", of, SPP)]
        if split:
            corners = vertex_positions(shape)[triangle_vertices(shape)].reshape(-1, 3)
            scene = scene_of(mesh("cube", corners, np.arange(len(corners))), size=SIZE)
        fields["split" if split else "shared"] = "\n".join(table(scene, "cube", truth, rivals))
    return fields


def grey_bodies() -> dict[str, object]:
    """A grey ball before a box, with two reflections; the truth is a long run."""
    shapes, name = bodies(GREY), f"ball.{SHIFT}"
    by_name = dict(zip(("ball", "box"), shapes))
    scene = scene_of(*shapes, max_bounces=2, size=SIZE)
    truth = ours(scene, name, TRUTH_SPP, 99)
    rivals = [
        (f"`prb_projective`, guiding {how}", projective(by_name, GREY, 2, False, guiding=how), spp)
        for how, spp in (("none", SPP), ("octree", SPP[-1:]))
    ]
    fields = {"grey": "\n".join(table(scene, "ball", truth, rivals))}
    without = patch.object(images, "along_frame", lambda *arguments: {})
    with without, patch.object(common_numbers, "PIXELS", SHORT):
        found = mi_lcair.derivative_images(scene, [name], spp=2**14)
    apart, error = found.derivative[0] - truth, found.derivative_error[0]
    fields["apart"] = f"{np.sqrt(np.sum(apart**2) / np.sum(error**2)):.2f}"
    inside = []
    for seed in range(COVERED):
        found = mi_lcair.derivative_images(scene, [name], spp=SPP[0], seed=seed)
        half = student_factor(np.inf) * found.derivative_error[0]
        inside.append((np.abs(found.derivative[0] - truth) <= half)[truth != 0].mean())
    return fields | {"seeds": COVERED, "inside": f"{100 * np.mean(inside):.0f} %"}


def main(page: Path) -> None:
    warnings.simplefilter("ignore")
    mi.set_log_level(mi.LogLevel.Error)
    write_page(
        page, "frames", size=SIZE, truth_spp=TRUTH_SPP, spp=SPP[0], **black_cube(), **grey_bodies()
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE)
