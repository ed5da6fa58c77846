"""Rays leave surfaces without hitting them, also at small parts far from the origin."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.paths.launch import (
    Launch,
    Offsets,
    ParallelRays,
    extent,
    rounding_error,
)
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.loading.remarks import remarks_on_triangles
from mi_lcair.rendering.window import window
from tests.plugins.conftest import FILM

SQUARES = np.array(  # the inner sides of a cube that is open at the top
    [
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
        [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)],
        [(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)],
        [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
        [(1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)],
    ],
    dtype=float,
)


def mesh(path, corners):
    """A mesh of triangles with these corners, (n, 3, 3) [m]."""
    made = mi.Mesh(path.stem, 3 * len(corners), len(corners))
    buffers = mi.traverse(made)
    buffers["vertex_positions"] = corners.astype(np.float32).ravel()
    buffers["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    buffers.update()
    made.write_ply(str(path))
    return {"type": "ply", "filename": str(path), "face_normals": True}


def seen_from(middle, direction, size):
    """An orthographic sensor that looks at a place from a direction; its window is 1.5 x size."""
    T = mi.ScalarTransform4f
    origin = np.add(middle, np.multiply(direction, 2 * size))
    look = T().look_at(origin=list(origin), target=list(middle), up=[0.1, 1, 0])
    return {
        "type": "orthographic",
        "near_clip": 1e-4 * size,
        "to_world": look @ T().scale([0.75 * size, 0.75 * size, 1]),
        "film": {**FILM, "width": 1, "height": 1},
        "sampler": {"type": "lattice"},
    }


def lit(shape, reflectance=0.5):
    return {
        **shape,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}},
        "emitter": {"type": "thermal", "band": "total", "temperature": 300.0},
    }


def open_cube(folder, size, place, far=None):
    """An open cube of reflectance 0.5; far: two more parts at this distance from the origin [m]."""
    at = np.multiply(place, [1.0, 0.7, 0.3])
    halves = SQUARES[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    middle = at + np.array([0.5, 0.5, 1.0]) * size
    shapes = {"cube": lit(mesh(folder / "cube.ply", at + size * halves))}
    for k, sign in enumerate((-1, 1) if far else ()):
        corners = 0.1 * far * halves + np.array([sign, sign, -1]) * far
        shapes[f"far{k}"] = mesh(folder / f"far{k}.ply", corners)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 20},
            "sensor": seen_from(middle, (0, 0, 1), size),
            **shapes,
        },
        optimize=False,
    )


def intensity(scene, size):
    return mi_lcair.signature(scene, spp=2**16, seed=1).scene.intensity / size**2


def floor_of(folder, side):
    """A scene with a square in the plane z = 0, and its hit at (3, 2, 0) from 30 degrees."""
    corners = side * (SQUARES[0] - [0.5, 0.5, 0])[[[0, 1, 2], [0, 2, 3]]]
    scene = mi.load_dict({"type": "scene", "floor": mesh(folder / "floor.ply", corners)})
    observer = np.array([0.5, 0, np.sqrt(0.75)])

    def hit(distance=40.0):
        start = np.array([3, 2, 0]) + distance * observer
        return scene.ray_intersect(mi.Ray3f(mi.Point3f(start), mi.Vector3f(-observer)))

    return scene, hit, observer


def test_offset_of_a_hit(tmp_path):
    """3 roundings of the largest coordinate, 3 m, and 64 of the longest side, 10 sqrt(2) m.

    Of a sphere 64 of a sixteenth of its box's diagonal.
    """
    scene, hit, _ = floor_of(tmp_path, 10.0)
    expected = (3 * 3 + 64 * 10 * np.sqrt(2)) * 2.0**-24
    assert Offsets(scene).at(hit())[0] == pytest.approx(expected, rel=1e-5)
    (floor,) = scene.shapes()
    assert extent(floor) == pytest.approx(10 * np.sqrt(2))
    assert extent(mi.load_dict({"type": "sphere", "radius": 2.0})) == pytest.approx(np.sqrt(3) / 4)


@pytest.mark.parametrize("side", [10.0, 1e4])
def test_start_of_a_ray(tmp_path, side):
    """It is off the surface by the offset, Mitsuba's at most, and as much nearer to the observer.

    A ray through the surface starts on the other side. Of a hit that is nearer than the offset, the
    ray starts half of the way back at most.
    """
    scene, hit, observer = floor_of(tmp_path, side)
    offset = min((9 + 64 * side * np.sqrt(2)) * 2.0**-24, (1 + 3) * 1500 * 2.0**-24)
    offsets, up, down = Offsets(scene), mi.Vector3f(0.6, 0, 0.8), mi.Vector3f(0.6, 0, -0.8)
    moved = lambda si, d: (offsets.leave(si, d) - si.p).numpy().ravel()
    normal, back, digits = np.array([0, 0, offset]), offset * observer, {"atol": 3e-7, "rtol": 1e-4}
    np.testing.assert_allclose(moved(hit(), up), normal + back, **digits)
    np.testing.assert_allclose(moved(hit(), down), -normal, **digits)
    near = hit()
    near.t = mi.Float(0.4 * offset)
    np.testing.assert_allclose(moved(near, up), normal + 0.2 * back, **digits)


@pytest.mark.parametrize("reflections", [0, 1, 6])
def test_rounding_of_a_radiance(reflections):
    """8 roundings at each end of a part of the path, each uniform up to 2^-24."""
    count = 8 * (reflections + 1)
    rounded = 2.0**-24 * np.random.default_rng(0).uniform(-1, 1, (20_000, count)).sum(axis=1)
    assert rounding_error(reflections) == pytest.approx(np.std(rounded), rel=0.015)


@pytest.mark.parametrize(
    "size, place, far",
    [
        (1e-3, 0.0, 1e3),
        (1e-3, 0.0, 1e6),
        (1e-2, 30.0, 1e3),
        (0.1, 30.0, 1e6),
        (1.0, 1e3, 1e6),
        (100.0, 1e5, 1e6),
    ],
)
def test_small_parts_reflect_as_large_ones(tmp_path, size, place, far):
    """An open cube anywhere has the intensity of one of 1 m at the origin, to 1e-3.

    Mitsuba's offset gives 0.81 for 0.845 at 1 mm and at 1 m in 1 km, and 0.5, the emission alone,
    at 1 m in 100 km.
    """
    expected = intensity(open_cube(tmp_path, 1.0, 0.0), 1.0)
    scene = open_cube(tmp_path, size, place, far)
    assert intensity(scene, size) == pytest.approx(expected, rel=1e-3)
    assert not any("small" in remark for remark in remarks_on_triangles(scene))


@pytest.mark.parametrize("size, place", [(1e-3, 30.0), (0.01, 1e3), (1.0, 1e5)])
def test_parts_that_are_too_small_are_remarked_with_their_error(tmp_path, size, place):
    """The stated error is that of the intensity within a factor of 3."""
    expected = intensity(open_cube(tmp_path, 1.0, 0.0), 1.0)
    scene = open_cube(tmp_path, size, place)
    error = abs(intensity(scene, size) / expected - 1)
    (remark,) = remarks_on_triangles(scene)
    assert "small for where they are" in remark
    stated = float(remark.partition("about ")[2].partition("%")[0]) / 100
    assert error < 3 * stated


@pytest.mark.parametrize("size, place", [(1.0, 1.0), (1.0, 30.0), (1.0, 1e3), (1.0, 1e5)])
def test_a_convex_body_does_not_light_itself(tmp_path, size, place):
    """No reflected ray of a turned cube hits it again; without an offset, 4 in 10,000 do."""
    rng = np.random.default_rng(int(place))
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    at = place * np.array([1.0, -0.6, 0.7])
    squares = (corners @ turn.T)[np.array(faces)] * size + at
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 1},
            "sensor": seen_from(at, turn @ np.array([0.5, 0.6, 0.62]), size),
            "cube": lit(
                mesh(tmp_path / "cube.ply", squares[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3))
            ),
        },
        optimize=False,
    )
    with scene.integrator().prepared(scene) as tracer:
        sums = tracer.trace(scene.sensors()[0], Launch(1, 1, 1, 8, 2**14), Channels())
    assert sums.channels["bounce.0"].sum() > 0
    assert sums.channels["bounce.1"].sum() == 0


def test_rectangles_in_one_plane_are_remarked():
    T = mi.ScalarTransform4f
    scene = mi.load_dict(
        {
            "type": "scene",
            "lower": {"type": "rectangle", "to_world": T().translate([1, 2, 3])},
            "upper": {"type": "rectangle", "to_world": T().translate([1.5, 2, 3])},
            "beside": {"type": "rectangle", "to_world": T().translate([1, 2, 4])},
        },
        optimize=False,
    )
    (remark,) = remarks_on_triangles(scene)
    assert "lie in one plane" in remark and "'lower'" in remark and "'upper'" in remark


def test_a_mesh_that_rounding_makes_a_point_is_remarked(tmp_path):
    (remark,) = remarks_on_triangles(open_cube(tmp_path, 1e-3, 1e5))
    assert "'cube' has no area: all of its 10 triangles" in remark


def test_the_rays_of_a_camera_follow_each_change():
    """What is kept of a camera is that of its place, its film and its clip distances now."""
    sensor = mi.load_dict(
        {"type": "orthographic", "film": {"type": "hdrfilm", "pixel_format": "luminance"}}
    )
    parameters = mi.traverse(sensor)

    def known():
        rays = ParallelRays.of(sensor)
        assert ParallelRays.of(sensor) is rays
        corner, right, up, _ = window(sensor)
        return [*corner, *right, *up, *np.ravel(rays.start), rays.length[0]]

    seen = [known()]
    for name, value in (
        ("to_world", mi.Transform4f().translate([1, 2, 3])),
        ("to_world", mi.Transform4f().translate([1, 2, 4])),
        ("film.size", [64, 8]),
        ("far_clip", 50.0),
        ("far_clip", 60.0),
    ):
        parameters[name] = value
        parameters.update()
        expected = ParallelRays.of.__wrapped__(sensor)
        assert np.array_equal(expected.start, ParallelRays.of(sensor).start)
        assert np.array_equal(window.__wrapped__(sensor), window(sensor))
        seen.append(known())
    assert len(set(map(str, seen))) == len(seen)
