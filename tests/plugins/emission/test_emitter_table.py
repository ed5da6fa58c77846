"""Drawing emitters: the density of what is drawn, near and edge-on, in fine meshes, and lights that
no path can hit; against closed forms.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.emission.triangles import Choice, TriangleTable, random_integer, set_triangles
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from tests.plugins.conftest import plate  # noqa: F401, fixture
from tests.plugins.small_scenes import camera, scene

GREY = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
DRAWING = {"type": "bounce_path", "max_bounces": 1, "emitter_sampling": True}
HEIGHT = 0.5  # m, of the hot plate over the floor
WINDOW = 0.2  # m, side of the part of the floor that the camera sees
PIXELS = 256


def grid_mesh(n, height, facing_down=True, side=1.0):
    """A horizontal square of 2 n^2 triangles around the z axis, as a mesh's arrays."""
    x = np.linspace(-side / 2, side / 2, n + 1)
    vertices = np.stack([*np.meshgrid(x, x, indexing="ij"), np.full((n + 1, n + 1), height)], -1)
    i, j = (index.ravel() for index in np.meshgrid(range(n), range(n), indexing="ij"))
    a, b, c, d = ((i + k) * (n + 1) + j + m for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return vertices.reshape(-1, 3), faces[:, ::-1] if facing_down else faces


def mesh_file(path, vertices, faces):
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    mesh.write_ply(str(path))
    return {"type": "ply", "filename": str(path), "face_normals": True}


def view_factor_of_unit_square(x, y, height):
    """From a horizontal element at (x, y) to the unit square around the z axis at that height; four
    rectangles with a corner above the element (Howell, B-4).
    """

    def corner(a, b):
        A, B = a / height, b / height
        return (
            A / np.sqrt(1 + A**2) * np.arctan(B / np.sqrt(1 + A**2))
            + B / np.sqrt(1 + B**2) * np.arctan(A / np.sqrt(1 + B**2))
        ) / (2 * np.pi)

    return sum(corner(a, b) for a in (0.5 - x, 0.5 + x) for b in (0.5 - y, 0.5 + y))


def floor_radiance():
    """Mean radiance of the part of the grey floor in view, under the plate of radiance 1."""
    x, weight = np.polynomial.legendre.leggauss(16)
    x, y = np.meshgrid(x * WINDOW / 2, x * WINDOW / 2)
    return 0.5 * np.sum(view_factor_of_unit_square(x, y, HEIGHT) * weight[:, None] * weight / 4)


def floor_scene(integrator, **shapes):
    """A grey floor that the camera sees from below the plate."""
    floor = {"type": "rectangle", "bsdf": GREY, "to_world": mi.ScalarTransform4f().scale(5)}
    sensor = camera(16, WINDOW, origin=(0, 0, 0.4))
    return scene(integrator, sensor, floor=floor, **shapes)


def observed(loaded, spp, passes):
    """(mean radiance of the image, its standard error)."""
    integrator, sensor = loaded.integrator(), loaded.sensors()[0]
    width, height = sensor.film().crop_size()
    with integrator.prepared(loaded) as tracer:
        means = [
            tracer.trace(
                sensor,
                Launch(width, height, seed, 1, spp, windows=width * height),
                Channels(None),
            ).radiance.mean()
            / spp
            for seed in range(passes)
        ]
    return np.mean(means), np.std(means, ddof=1) / np.sqrt(passes)


@pytest.mark.slow
def test_fine_meshes(tmp_path):
    """A hot plate of 0.3 million triangles over a grey floor: the closed form, to 0.3 %.

    One random number for triangle and place misses by 1.4 % with 0.5 million.
    """
    hot = mesh_file(tmp_path / "hot.ply", *grid_mesh(400, HEIGHT))
    emitter = {"type": "thermal", "radiance": 1.0}
    loaded = floor_scene(DRAWING, hot={**hot, "bsdf": BLACK, "emitter": emitter})
    mean, error = observed(loaded, 512, 4)
    assert error < 8e-4 * mean
    assert mean == pytest.approx(floor_radiance(), abs=4 * error)


@pytest.mark.parametrize("side", [1, -1])
def test_a_mirrored_rectangle(side):
    """Mitsuba gives a rectangle that a negative scale mirrors another normal at hits."""
    T = mi.ScalarTransform4f()
    place = T.translate([0, 0, HEIGHT]) @ T.rotate([1, 0, 0], 180) @ T.scale([side / 2, 0.5, 1])
    emitter = {"type": "thermal", "radiance": 1.0}
    hot = {"type": "rectangle", "to_world": place, "bsdf": BLACK, "emitter": emitter}
    mean, error = observed(floor_scene(DRAWING, hot=hot), 64, 4)
    assert mean == pytest.approx(floor_radiance(), abs=4 * error, rel=1e-3)


@pytest.mark.slow
def test_one_hot_triangle_among_many(tmp_path):
    """One of 80,000 triangles is 60,000 times as bright as the others: closed form of both."""
    vertices, faces = grid_mesh(200, HEIGHT)
    radiance = np.ones(len(faces))
    radiance[12345] = 6e4
    centre = vertices[faces[12345]].mean(axis=0)
    mesh = mi.Mesh("hot", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    mesh.add_attribute("face_radiance", 1, radiance.tolist())
    mesh.write_ply(str(tmp_path / "hot.ply"))
    texture = {"type": "mesh_attribute", "name": "face_radiance"}
    hot = {
        "type": "ply",
        "filename": str(tmp_path / "hot.ply"),
        "face_normals": True,
        "bsdf": BLACK,
        "emitter": {"type": "area", "radiance": texture},
    }
    mean, error = observed(floor_scene(DRAWING, hot=hot), 1024, 4)
    x, weight = np.polynomial.legendre.leggauss(16)
    x, y = np.meshgrid(x * WINDOW / 2, x * WINDOW / 2)
    d2 = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + HEIGHT**2
    from_hot = 0.5 * (6e4 - 1) * (0.5 / 200**2) * HEIGHT**2 / d2**2 / np.pi
    expected = floor_radiance() + np.sum(from_hot * weight[:, None] * weight / 4)
    assert from_hot.mean() > 0.4 * expected
    assert error < 8e-4 * mean
    assert mean == pytest.approx(expected, abs=4 * error)


@pytest.mark.slow
def test_what_is_drawn_has_its_probability():
    """A million indices, with weights over nine decades: frequencies are the stated probabilities,
    which are the weights' to 2^-32.
    """
    weights = np.random.default_rng(1).lognormal(0, 3, 10**6)
    choice = Choice(weights)
    assert np.abs(choice.probability - weights / weights.sum()).max() <= 2.0**-32
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 2**24)
    counts = np.bincount(choice.pick(random_integer(sampler.next_2d())).numpy(), minlength=10**6)
    often = choice.probability * 2**24 > 50
    deviations = (counts - choice.probability * 2**24)[often] / np.sqrt(
        choice.probability[often] * 2**24
    )
    assert deviations.std() == pytest.approx(1, abs=0.03) and abs(deviations.mean()) < 0.05


def test_meshes_and_other_emitters_share_the_draws():
    """Half of the draws go to the panels of a cube, the others evenly to three spheres."""
    lamp = {"type": "area", "radiance": {"type": "uniform", "value": 1.0}}
    shapes = {"cube": {"type": "cube", "bsdf": BLACK, "emitter": lamp}}
    for k in range(3):
        place = {"center": [4.0, 4.0 * k, 0.0], "radius": 0.5}
        shapes[f"sphere{k}"] = {"type": "sphere", **place, "bsdf": BLACK, "emitter": dict(lamp)}
    loaded = scene(DRAWING, camera(4, 1.0), **shapes)
    (table,) = EmitterTable(loaded, True).tables
    receiver = Receiver(mi.Point3f(0, 0, 5), mi.Normal3f(0, 0, -1))
    numbers = mi.UInt32((np.arange(6000) + 0.5) / 6000 * 2.0**32)
    index = table.pick(numbers, receiver, mi.Bool(True))[0].numpy()
    others = np.bincount(index[index >= table.panel_count] - table.panel_count, minlength=3)
    assert others == pytest.approx([1000] * 3, abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 512])
def test_points_from_two_numbers(n):
    """Where Mitsuba's interface gives two numbers for triangle and point: both are uniform."""
    vertices, faces = grid_mesh(n, 0.0)
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    table = TriangleTable([mesh])
    choice = Choice(table.area)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 2**22)
    triangle, rest = choice.pick_and_rest(sampler.next_2d())
    uv, _, _ = table.point(triangle, rest)
    # of a point uniform over a triangle: means 1/3, mean squares 1/6, mean product 1/12
    noise = 4 / np.sqrt(2**22)
    for value, expected in ((uv.x, 1 / 3), (uv.y, 1 / 3), (uv.x**2, 1 / 6), (uv.x * uv.y, 1 / 12)):
        assert float(dr.mean(value)[0]) == pytest.approx(expected, abs=0.3 * noise)
    first = mi.Float(dr.select(triangle < len(faces) // 2, 1, 0))
    assert float(dr.mean(first)[0]) == pytest.approx(0.5, abs=0.5 * noise)


def test_kernels_do_not_depend_on_the_place_in_memory():
    """Dr.Jit compiles other kernels for rows that are not aligned, as NumPy's are by chance."""
    for n in range(1, 9):
        mesh = mi.Mesh("mesh", (n + 1) ** 2, 2 * n**2)
        set_triangles(mesh, *grid_mesh(n, 0.0))
        assert TriangleTable([mesh]).rows.numpy().ctypes.data % 64 == 0


@pytest.mark.slow
def test_near_hits_on_an_analytic_shape():
    """Inside a sphere of reflectance 0.5 that radiates 1, every path of N reflections brings the
    same sum: 1, 0.5, 0.25, ... Points drawn near the ray's own start count as well.
    """
    ball = {
        "type": "sphere",
        "flip_normals": True,
        "bsdf": GREY,
        "emitter": {"type": "thermal", "radiance": 1.0},
    }
    sensor = camera(16, 0.5, origin=(0, 0, 0.5))
    mean, error = observed(scene({**DRAWING, "max_bounces": 2}, sensor, ball=ball), 1024, 4)
    assert mean == pytest.approx(1.75, abs=1e-5) and error < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("tilt_deg", [45.0, 45.2])
@pytest.mark.parametrize("e", [0.1, 0.0042])
def test_a_rectangle_seen_edge_on(e, tilt_deg):
    """A source in whose plane the reflected rays run, but for the width of the lobe: the same
    radiance whether it is drawn or met by chance. A shift of the ray by its offset moves the hit
    by far more.
    """
    T = mi.ScalarTransform4f
    source = {
        "type": "rectangle",
        "to_world": T().translate([0, 1, 1]) @ T().rotate([1, 0, 0], tilt_deg) @ T().scale(0.2),
        "bsdf": {"type": "twosided", "bsdf": BLACK},
        "emitter": {"type": "thermal", "radiance": 1.0},
    }
    lobe = {"type": "sandford_robertson", "epsilon": 0.1, "rho_d": 0.0, "b": 0.1, "e": e}
    floor = {"type": "rectangle", "bsdf": lobe, "to_world": T().scale(5)}
    sensor = camera(16, 0.02, origin=(0, -0.5, 0.5))
    (on, on_error), (off, off_error) = (
        observed(
            scene({**DRAWING, "emitter_sampling": drawn}, sensor, floor=floor, source=source),
            1024,
            8,
        )
        for drawn in (True, False)
    )
    assert on == pytest.approx(off, abs=5 * np.hypot(on_error, off_error))
    assert np.hypot(on_error, off_error) < 0.03 * off


def lamp(kind):
    return {
        "point": {
            "type": "point",
            "position": [0.0, 0.0, HEIGHT],
            "intensity": {"type": "uniform", "value": 1.0},
        },
        "spot": {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, HEIGHT], [0, 0, 0], [0, 1, 0]),
            "intensity": {"type": "uniform", "value": 1.0},
            "cutoff_angle": 60,
            "beam_width": 59,
        },
        "directional": {
            "type": "directional",
            "direction": [0, 0.6, -0.8],
            "irradiance": {"type": "uniform", "value": 1.0},
        },
    }[kind]


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", [False, True])
@pytest.mark.parametrize("kind", ["point", "spot", "directional"])
def test_lights_that_no_path_can_hit(kind, emitter_sampling):
    """A point and a parallel beam light the floor with and without emitter sampling. Closed form:
    0.5/pi I cos/d^2 below the point, 0.5/pi E cos of the beam.
    """
    loaded = floor_scene({**DRAWING, "emitter_sampling": emitter_sampling}, lamp=lamp(kind))
    mean, error = observed(loaded, 256, 4)
    x = (np.arange(256) + 0.5) / 256 * WINDOW - WINDOW / 2
    d2 = x[:, None] ** 2 + x**2 + HEIGHT**2
    irradiance = 0.8 if kind == "directional" else np.mean(HEIGHT / d2**1.5)
    assert mean == pytest.approx(0.5 * irradiance / np.pi, rel=2e-3)


@pytest.mark.parametrize("emitter_sampling", [False, True])
@pytest.mark.parametrize("backward", [False, True])
def test_derivatives_of_a_point_light(emitter_sampling, backward):
    """The image is proportional to the light's intensity and to the floor's reflectance."""
    loaded = floor_scene({**DRAWING, "emitter_sampling": emitter_sampling}, lamp=lamp("point"))
    parameters = mi.traverse(loaded)
    for key, value in (("lamp.intensity.value", 1.0), ("floor.bsdf.reflectance.value", 0.5)):
        dr.enable_grad(parameters[key])
        if backward:
            image = mi.render(loaded, parameters, spp=64)
            mean = dr.mean(image, axis=None)
            dr.backward(mean)
            slope = float(dr.grad(parameters[key])[0])
        else:
            dr.set_grad(parameters[key], 1.0)
            parameters.update()
            image = mi.render(loaded, parameters, spp=64)
            slope = float(dr.mean(dr.forward_to(image), axis=None).array[0])
            mean = dr.mean(image, axis=None)
        assert slope * value == pytest.approx(float(dr.detach(mean).array[0]), rel=1e-3)
        dr.disable_grad(parameters[key])


def test_derivative_at_a_radiance_of_zero():
    """A lamp that is off gets no ray of emitter sampling in the primal pass. The derivative with
    respect to its radiance is still the floor's reflectance times the lamp's form factor.
    """
    lamp = {"type": "sphere", "center": [0, 0, 1.0], "radius": 0.2, "bsdf": BLACK}
    lamp["emitter"] = {"type": "thermal", "radiance": 0.0}
    loaded = floor_scene(DRAWING, lamp=lamp)
    params = mi.traverse(loaded)
    (key,) = [name for name, _ in params if name.endswith("emitter.radiance")]
    dr.enable_grad(params[key])
    params.update()
    dr.backward(dr.mean(mi.render(loaded, params, spp=1024).array))
    # Form factor of a sphere at distance d: cos(theta) (R / d)^2, averaged over the window
    form_factor = 0.2**2 * (1 - 1.5 * WINDOW**2 / 6)
    assert float(dr.grad(params[key])[0]) == pytest.approx(0.5 * form_factor, rel=0.01)


def test_the_brightest_in_view_follows_the_sensor_and_the_scene():
    """Triangles are compared with a field of view once, and again for another one or state."""
    loaded = mi_lcair.load("open_box")
    sensor = loaded.sensors[0]
    of_sensor, of_scene = mi.traverse(sensor), mi.traverse(loaded.mi)
    kind = type(of_sensor["to_world"])
    here = kind(of_sensor["to_world"])

    def seen(place=here, kelvin=None) -> float:
        of_sensor["to_world"] = place
        of_sensor.update()
        if kelvin is not None:
            of_scene["wall.emitter.temperature"] = kelvin
            of_scene.update()
        with loaded.prepared() as tracer:
            again = tracer.emitters.brightest_in_view(sensor)
            assert tracer.emitters.brightest_in_view(sensor) == again
            return again

    first, aside = seen(), here @ kind().translate([100.0, 0, 0])
    assert first > 0 and seen(aside) == 0 and seen() == first
    hotter = seen(kelvin=900.0)
    assert hotter > first and seen(aside) == 0 and seen(kelvin=800.0) < hotter
