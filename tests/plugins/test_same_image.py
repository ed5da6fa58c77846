"""The same image from every integrator, stock ones included: emission, reflection and every way to
sample them agree.
"""

import mitsuba as mi
import numpy as np
import pytest

from tests.plugins.conftest import FILM
from tests.plugins.small_scenes import (
    BROAD,
    GREY,
    INTEGRATORS,
    SQUARE,
    blackbody,
    camera,
    runs,
    scene,
    with_emitter,
)

# standard errors, and Student's t with 30 degrees of freedom: wrong once in 10,000 comparisons
SIGMAS = 4.5


def furniture(plate, bsdf=BROAD):
    """Shapes that face each other: a floor and a wall with facet temperatures, a sphere, a source
    of given radiance.
    """
    T = mi.ScalarTransform4f
    ball = {"type": "thermal", "band": "LWIR", "temperature": 700.0, "group": "ball"}
    return {
        "floor": plate("floor", SQUARE, bsdf, [350, 550]),
        "wall": plate("wall", [[5, -5, 5], [5, 5, 5], [5, 5, 0], [5, -5, 0]], GREY, [800, 320]),
        "ball": {"type": "sphere", "center": [1, 1, 3], "radius": 1, "bsdf": GREY, "emitter": ball},
        "lamp": {
            "type": "rectangle",
            "to_world": T().translate([-3, 3, 4]) @ T().rotate([1, 0, 0], 180),
            "bsdf": GREY,
            "emitter": {"type": "thermal", "radiance": 300.0},
        },
    }


def room(plate, integrator, sensor, bsdf=BROAD, sky=20.0):
    """The furniture under a uniform sky, or none."""
    shapes = furniture(plate, bsdf)
    if sky:
        shapes["sky"] = {"type": "constant", "radiance": {"type": "uniform", "value": sky}}
    return scene(integrator, sensor, **shapes)


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["brdf", "mirror"])
def test_stock_integrators_render_the_same_image(plate, lobe):
    """Pixel by pixel over 16 independent renders each, against bounce_path without emitter
    sampling.
    """
    count, images, sensor = 16, {}, camera(4, 9, (0, 0, 1), (-12, -3, 12))
    for k, (name, integrator) in enumerate(INTEGRATORS.items()):
        images[name] = runs(
            room(plate, integrator, sensor, {**BROAD, "lobe": lobe}), count, 256, first_seed=100 * k
        )
    reference = images.pop("bounce_path")
    for name, found in images.items():
        error = np.sqrt((found.var(axis=0, ddof=1) + reference.var(axis=0, ddof=1)) / count)
        z = (found.mean(axis=0) - reference.mean(axis=0)) / np.maximum(error, 1e-6)
        assert np.abs(z).max() < SIGMAS, (name, z)
        overall = found.mean(axis=(1, 2)), reference.mean(axis=(1, 2))
        difference, error = (
            overall[0].mean() - overall[1].mean(),
            np.sqrt((overall[0].var(ddof=1) + overall[1].var(ddof=1)) / count),
        )
        assert abs(difference) < SIGMAS * error, name


@pytest.mark.slow
def test_the_particle_tracer_agrees(plate):
    """Stock `ptracer` starts at the emitters (sample_position, sample_ray) and meets the BSDFs in
    Importance mode: the adjoint of all the rest. Seen by a perspective camera, because it connects
    to the sensor; mean over the image.
    """
    T = mi.ScalarTransform4f
    look = T().look_at(origin=[-8, -6, 10], target=[0, 0, 1], up=[0, 0, 1])
    sensor = {
        "type": "perspective",
        "fov": 40,
        "to_world": look,
        "film": {**FILM, "width": 4, "height": 4},
    }
    both_sides = {"type": "twosided", "bsdf": BROAD}
    tracers = (
        ({"type": "ptracer", "max_depth": 3, "rr_depth": 100}, 4096),
        ({"type": "bounce_path", "max_bounces": 2, "emitter_sampling": True}, 512),
    )
    light, eye = (
        runs(room(plate, tracer, sensor, both_sides, sky=None), 16, spp).mean(axis=(1, 2))
        for tracer, spp in tracers
    )
    error = np.sqrt((light.var(ddof=1) + eye.var(ddof=1)) / 16)
    assert error < 0.005 * eye.mean()
    assert abs(light.mean() - eye.mean()) < SIGMAS * error


CHECKERBOARD = {
    "type": "checkerboard",
    "color0": {"type": "uniform", "value": 300.0},
    "color1": {"type": "uniform", "value": 700.0},
}


def sources_that_vary(tmp_path):
    """A wall whose temperature varies over a rectangle, over a mesh with uv, and from vertex to
    vertex; and one whose emissivity does.
    """
    T = mi.ScalarTransform4f
    upright = T().translate([5, 0, 2.5]) @ T().rotate([0, 1, 0], -90) @ T().scale([2.5, 5, 1])
    mesh = mi.Mesh("vertices", 4, 2)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.array(
        [[5, -5, 5], [5, 5, 5], [5, 5, 0], [5, -5, 0]], dtype=np.float32
    ).ravel()
    parameters["faces"] = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32)
    parameters.update()
    mesh.add_attribute("vertex_temperature", 1, [300.0, 400.0, 700.0, 500.0])
    mesh.write_ply(str(tmp_path / "vertices.ply"))
    textured = {"type": "thermal", "band": "LWIR", "temperature": CHECKERBOARD}
    by_vertex = {
        "type": "thermal",
        "band": "LWIR",
        "temperature": {"type": "mesh_attribute", "name": "vertex_temperature"},
    }
    patchy = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    cube = {"type": "cube", "to_world": T().translate([6, 0, 2.5]) @ T().scale([1, 5, 2.5])}
    return {
        "rectangle": {"type": "rectangle", "to_world": upright, "bsdf": GREY, "emitter": textured},
        "cube": {**cube, "bsdf": GREY, "emitter": textured},
        "vertices": {
            "type": "ply",
            "filename": str(tmp_path / "vertices.ply"),
            "face_normals": True,
            "bsdf": GREY,
            "emitter": by_vertex,
        },
        "emissivity": {
            **cube,
            "bsdf": patchy,
            "emitter": {"type": "thermal", "band": "LWIR", "temperature": 600.0},
        },
    }


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rectangle", "cube", "vertices", "emissivity"])
def test_emission_that_varies_inside_a_facet(plate, tmp_path, kind):
    """Light on a grey floor: emitter sampling must find the same radiance as a path that happens to
    hit the source.
    """
    source, seen = sources_that_vary(tmp_path)[kind], {}
    for k, (name, integrator) in enumerate(INTEGRATORS.items()):
        foot_of_the_wall = scene(
            integrator,
            camera(2, 3, (3.5, 0, 0), (3.5, 0, 20)),
            source=source,
            floor=plate("floor", SQUARE, GREY),
        )
        seen[name] = runs(foot_of_the_wall, 16, 2048, 100 * k).mean(axis=(1, 2))
    reference = seen.pop("bounce_path")
    for name, found in seen.items():
        error = np.sqrt((found.var(ddof=1) + reference.var(ddof=1)) / 16)
        assert error < 0.02 * reference.mean()
        assert abs(found.mean() - reference.mean()) < SIGMAS * error, name


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_emitted_and_reflected_are_counted_once(plate, integrator):
    """A plate under a uniform sky: emissivity 1 shows only itself, 0 only the sky, Kirchhoff's at
    the sky's temperature the blackbody, and a plate that is given an emissivity of 1 although it
    reflects shows both in full.
    """
    sky, own = 20.0, blackbody(400)
    equal = blackbody(350)
    ideal = {"type": "sandford_robertson", "b": 0.0, "e": 1.0}
    cases = [
        ({**ideal, "epsilon": 1.0, "rho_d": 0.0}, {}, 400, sky, own),
        ({**ideal, "epsilon": 0.0, "rho_d": 1.0}, {}, 400, sky, sky),
        (BROAD, {}, 350, equal, equal),
        ({**BROAD, "lobe": "mirror"}, {}, 350, equal, equal),
        (GREY, {"emissivity": 0.0}, 400, sky, 0.3 * sky),
        (GREY, {"emissivity": 1.0}, 400, sky, own + 0.3 * sky),
    ]
    for bsdf, given, temperature, radiance, expected in cases:
        shape = with_emitter(plate("p", SQUARE, bsdf, temperature), **given)
        one_plate = scene(
            INTEGRATORS[integrator],
            camera(2),
            p=shape,
            sky={"type": "constant", "radiance": {"type": "uniform", "value": radiance}},
        )
        images = runs(one_plate, 8, 512)
        error = images.mean(axis=(1, 2)).std(ddof=1) / np.sqrt(8)
        assert abs(images.mean() - expected) < 6 * error + 2e-5 * expected, (
            bsdf,
            given,
        )  # t with 7 degrees of freedom: 1 in 2000
