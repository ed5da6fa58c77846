"""Derivatives of frames along motions, against areas of polygons on the film and closed forms.

A black body has the radiance L = sigma T^4 / pi everywhere. A pixel is then L times the part of it
that the body covers.
"""

import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial import ConvexHull

import mi_lcair
from mi_lcair.derivatives.frames import ALONG_FRAME, Frame, parts_in_pixels
from mi_lcair.derivatives.motions.differences import ON_FILM
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from mi_lcair.rendering.window import Windows, window_area
from tests.derivatives.motions import test_differences as closed
from tests.derivatives.motions.test_differences import CUBE, L, convex_hull, mesh

SIZE, FOV, AT = 12, 25.0, np.array([4.0, 0.7, 1.3])


def camera(at=AT, size: int = SIZE, **more) -> dict:
    to_world = mi.ScalarTransform4f().look_at(list(at), [0, 0, 0], [0, 0, 1])
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "luminance", "component_format": "float32"}
    lattice = {"type": "lattice"}
    sensor = {"type": "perspective", "to_world": to_world, "fov": FOV, "near_clip": 0.1}
    return {**sensor, "film": film, "sampler": lattice, **more}


def scene_of(*shapes, max_bounces: int = 0, **settings):
    integrator = {"type": "bounce_path", "max_bounces": max_bounces}
    scene = {"type": "scene", "integrator": integrator, "sensor": camera(**settings)}
    scene |= {f"shape{k}": shape for k, shape in enumerate(shapes)}
    return mi_lcair.load(mi.load_dict(scene, optimize=False))


def derivative(scene, *names: str, spp: int = 16, method: str = ALONG_FRAME):
    """Derivatives of the pixels, (K, rows, columns), and their errors."""
    found = mi_lcair.derivative_images(scene, names, spp=spp)
    assert found.method == (method,) * len(names)
    return found.derivative, found.derivative_error


def on_film(points, at=AT, size: int = SIZE) -> np.ndarray:
    """Positions of points (n, 3) on the film of a pinhole camera, (n, 2) [pixels]."""
    forward = -at / np.linalg.norm(at)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    x, y, z = ((points - at) @ np.stack([right, np.cross(forward, right), forward], axis=1)).T
    return size / 2 * (1 + np.stack([x, y], axis=1) / z[:, None] / np.tan(np.radians(FOV / 2)))


def cut(polygon, axis: int, border: float, side: int) -> np.ndarray:
    """The part of a convex polygon (n, 2) with side (coordinate - border) > 0."""
    kept = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
        p, q = (side * (end[axis] - border) for end in (a, b))
        kept += [a] if p > 0 else []
        kept += [a + p / (p - q) * (b - a)] if p * q < 0 else []
    return np.array(kept)


def covered(points: np.ndarray, size: int = SIZE) -> np.ndarray:
    """Parts of the pixels that the convex hull of points (n, 2) covers, (size, size)."""
    hull, areas = points[ConvexHull(points).vertices], np.zeros((size, size))
    for row, column in np.ndindex(areas.shape):
        corners = hull
        for axis, border in ((0, column), (1, row)):
            for side in (0, 1):
                corners = cut(corners, axis, border + side, 1 - 2 * side)
        x, y = corners.T if len(corners) else np.zeros((2, 1))
        areas[row, column] = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    return areas


def expected(points, moved, at=AT, size: int = SIZE, h: float = 1e-5) -> np.ndarray:
    """Derivative of the pixels of a convex blackbody. moved: its points for a value."""
    ends = [covered(on_film(moved(points, side * h), at, size), size) for side in (1, -1)]
    return L * (ends[0] - ends[1]) / (2 * h)


def close(found, to, tolerance: float = 1e-4) -> bool:
    return np.abs(found - to).max() < tolerance * np.abs(to).max()


TWO_SIDED = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": 0.0}}
SQUARE = np.array([[0, y, z] for y, z in ((-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4))])
TURNED = closed.turned(CUBE, 25.0, "yaw_deg", np.zeros(3))
MOTIONS = {
    "x_m": lambda points, x: points + [x, 0, 0],
    "y_m": lambda points, x: points + [0, x, 0],
    "size": lambda points, x: (1 + x) * points,
    "yaw_deg": lambda points, x: closed.turned(points, x, "yaw_deg", np.zeros(3)),
}


def square(name: str = "square", **settings):
    return mesh(name, SQUARE, [[0, 1, 2], [0, 2, 3]], **settings)


def test_square_before_a_pinhole():
    """Seen along its normal, all of it moves toward the camera: dA / dx = 2 A / distance."""
    at, distance = np.array([4.0, 0, 0]), 4.0
    scene = scene_of(square(), at=at)
    pixel = 2 * distance * np.tan(np.radians(FOV / 2)) / SIZE
    found, error = derivative(scene, "square.x_m", "square.size", "square.y_m")
    exact = L * 0.8 / pixel**2
    sums = found.sum(axis=(1, 2))
    assert sums == pytest.approx([2 / distance * exact, 2 * exact, 0], rel=1e-6, abs=1e-3)
    assert error.max() == 0
    # The right edge moves to the right, through pixels that it crosses from top to bottom
    column = int(SIZE / 2 + 0.5 / pixel)
    assert found[2][SIZE // 2, column] == pytest.approx(L / pixel, rel=1e-6)


def seen_from(name: str, value: float) -> np.ndarray:
    """Place of the camera, which looks at the origin, after a motion of its own [m]."""
    if name == "range_m":
        return AT * (1 + value / np.linalg.norm(AT))
    if name == "azimuth_deg":
        return closed.turned(AT, value, "yaw_deg", np.zeros(3))
    azimuth = np.degrees(np.arctan2(AT[1], AT[0]))
    ahead = closed.turned(AT, -azimuth, "yaw_deg", np.zeros(3))
    raised = closed.turned(ahead, value, "pitch_deg", np.zeros(3))
    return closed.turned(raised, azimuth, "yaw_deg", np.zeros(3))


def test_motions_of_the_camera():
    names, h = ("azimuth_deg", "elevation_deg", "range_m"), 1e-5
    scene = scene_of(convex_hull("cube", TURNED))
    found, _ = derivative(scene, *map("observer.{}".format, names))
    for of, name in zip(found, names):
        ends = [covered(on_film(TURNED, seen_from(name, side * h))) for side in (1, -1)]
        assert close(of, L * (ends[0] - ends[1]) / (2 * h))
    derivative(scene, "observer.x_px", method=ON_FILM)


def split(shape):
    """A mesh whose triangles share no vertex."""
    triangles = triangle_vertices(shape)
    corners = vertex_positions(shape)[triangles].reshape(-1, 3)
    return mesh("cube", corners, np.arange(len(corners)))


@pytest.mark.parametrize("is_split", [False, True])
def test_turned_cube(is_split):
    shape = convex_hull("cube", TURNED)
    found, _ = derivative(
        scene_of(split(shape) if is_split else shape), *map("cube.{}".format, MOTIONS)
    )
    for of, moved in zip(found, MOTIONS.values()):
        assert close(of, expected(TURNED, moved))


@pytest.mark.parametrize("hidden", [False, True])
def test_far_camera_over_a_large_ground(monkeypatch, hidden):
    """Rays of 900 m are rounded; a square of the background may hide what moves from 450 m away."""
    at = AT * 900 / np.linalg.norm(AT)
    monkeypatch.setattr(f"{__name__}.FOV", FOV / 900 * np.linalg.norm(AT))
    ground = 500 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) - [0, 0, 43]
    parts = {"ground": ground} | ({"wall": at / 2 + 4 * SQUARE} if hidden else {})
    squares = [
        mesh(name, points, [[0, 1, 2], [0, 2, 3]], 0.0, 3.0, facet_type="terrain")
        for name, points in parts.items()
    ]
    scene = scene_of(convex_hull("cube", TURNED), *squares, at=at)
    found, _ = derivative(scene, "cube.y_m", spp=64)
    exact = expected(TURNED, MOTIONS["y_m"], at=at)
    if hidden:
        assert np.abs(found).max() < 1e-6 * np.abs(exact).max()
    else:
        assert close(found[0], exact, 1e-3)


def test_paths_begin_where_a_body_is():
    """In the pixels of which it covers a part, and in no others."""
    faces = triangle_vertices(convex_hull("cube", TURNED))
    scene = scene_of(mesh("cube", TURNED, faces, 0.5), max_bounces=1)
    with scene.prepared() as tracer:
        frame = Frame.of(scene, Windows.of_image(scene.sensor(0), 4), tracer)
        assert frame.shown.tolist() == np.flatnonzero(covered(on_film(TURNED)) > 0).tolist()


def test_mirrored_mesh(tmp_path):
    """Its triangles show their backs, which emit as well."""
    shape = convex_hull("cube", TURNED)
    shape.write_ply(str(tmp_path / "cube.ply"))
    emitter = {"type": "thermal", "band": "total", "temperature": 300.0, "group": "cube"}
    mirror = mi.ScalarTransform4f().scale([1, -1, 1])
    ply = {"type": "ply", "filename": str(tmp_path / "cube.ply"), "to_world": mirror}
    ply |= {"bsdf": TWO_SIDED, "emitter": emitter, "face_normals": True}
    found, _ = derivative(scene_of(mi.load_dict(ply)), "cube.y_m")
    assert close(found[0], expected(TURNED * [1, -1, 1], MOTIONS["y_m"]))


def test_nearer_body_hides_a_farther_one():
    """The square behind a small cube: where they overlap, only the cube's edges count.

    A square of the background hides as much. It moves against the camera.
    """
    small, at = 0.2 * TURNED + [1.0, 0, 0], np.array([4.0, 0.1, 0.2])
    scene = scene_of(square(kelvin=400.0), convex_hull("cube", small), at=at)
    found, _ = derivative(scene, "cube.y_m", "square.y_m", spp=64)
    cube, large = (expected(points, MOTIONS["y_m"], at=at) for points in (small, SQUARE))
    ratio = (400 / 300) ** 4
    inside = (covered(on_film(small, at)) > 0) | (cube != 0)
    assert close(found[0], (1 - ratio) * cube, 5e-4)
    assert close(found[1], ratio * large * ~inside)
    names = "cube.y_m", "observer.range_m"
    of_model = derivative(scene, *names, spp=64)[0]
    ground = square(kelvin=400.0, facet_type="terrain")
    before = derivative(scene_of(ground, convex_hull("cube", small), at=at), *names, spp=64)[0]
    assert all(close(of, to, 2e-3) for of, to in zip(before, of_model))


def test_neighbours_in_one_plane():
    """The border between two temperatures moves, though it is no silhouette."""
    right = SQUARE + [0, 1.0, 0]
    parts = square("left", kelvin=400.0), mesh("right", right, [[0, 1, 2], [0, 2, 3]])
    found, _ = derivative(scene_of(*parts), "model.yaw_deg")
    ratio = (400 / 300) ** 4
    of = [expected(points, MOTIONS["yaw_deg"]) for points in (SQUARE, right)]
    assert close(found[0], ratio * of[0] + of[1])


@pytest.mark.parametrize("of_floor", ["model", "terrain"])
def test_plates_light_each_other(of_floor):
    """The mean over the pixels times the window's area is an intensity of known derivative."""
    scene, h = closed.plates(floor=of_floor), 1e-4
    found = mi_lcair.derivative_images(scene, ["plate.z_m"], spp=256)
    assert found.method == (ALONG_FRAME,)
    means = found.derivatives.mean(axis=(1, 2, 3)) * window_area(scene.sensor(0), "plates")
    ends = [closed.light_of_plate(closed.GAP + side * h) for side in (1, -1)]
    error = means.std(ddof=1) / np.sqrt(len(means))
    assert means.mean() == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=5 * error)
    assert error < 0.3 * means.mean()


def test_light_comes_back_from_a_plate():
    """A hot floor lights a plate, and this the floor: radiosity at Gauss points of both."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    x, y = (of.ravel() for of in np.meshgrid((nodes + 1) / 4, (nodes + 1) / 4))
    area = np.outer(weights, weights).ravel() / 16

    def light(gap: float) -> float:
        squares = np.subtract.outer(x, x - 0.6) ** 2 + np.subtract.outer(y, y) ** 2 + gap**2
        factors = gap**2 / (np.pi * squares**2)
        seen = (
            L * (1000 / 300) ** 4 * 0.5 * 0.5 * 0.9 * (area @ factors @ (area * (factors.T @ area)))
        )
        return np.sin(np.radians(20)) * seen

    corners = np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    faces = [[0, 1, 2], [0, 2, 3]]
    floor = mesh("floor", corners, faces, 0.5, 1000.0)
    plate = mesh("plate", corners[::-1] + [-0.6, 0, closed.GAP], faces, 0.9, 3.0)
    scene, h = closed.scene_of(floor, plate, max_bounces=2), 1e-4
    found = mi_lcair.derivative_images(scene, ["plate.z_m"], spp=2**15)
    means = found.derivatives.mean(axis=(1, 2, 3)) * window_area(scene.sensor(0), "plates")
    exact = (light(closed.GAP + h) - light(closed.GAP - h)) / (2 * h)
    error = means.std(ddof=1) / np.sqrt(len(means))
    assert found.method == (ALONG_FRAME,)
    assert means.mean() == pytest.approx(exact, abs=5 * error)
    assert error < 0.1 * exact


def strip(begin: float):
    """A strip at the camera's right, from some distance behind its eye or before it [m]."""
    x, z = [begin - 4, 20, 20, begin - 4], [-0.3, -0.3, 0.3, 0.3]
    corners = np.stack([-np.array(x), np.full(4, 0.5), z], axis=1)
    return mesh("strip", corners, [[0, 1, 2], [0, 2, 3]], bsdf=TWO_SIDED)


def test_an_edge_that_begins_behind_the_camera():
    """It looks as one that begins outside of the view."""
    at = np.array([4.0, 0, 0])
    behind, before = (derivative(scene_of(strip(x), at=at), "strip.z_m")[0] for x in (-5, 0.5))
    assert np.abs(before).max() > 100
    assert close(behind, before)


@pytest.mark.parametrize(
    "other",
    [SQUARE + [0, 1.0, 0], SQUARE[:, [1, 0, 2]] + [0.2, 0, 0], 1.2 * SQUARE + [0, 1.1, 0]],
    ids=["comes apart", "passes through", "corner on an edge"],
)
def test_differences_where_no_edge_ends_a_surface(other):
    """Or where two edges of bodies that move apart are the same."""
    scene = scene_of(square(), mesh("other", other, [[0, 1, 2], [0, 2, 3]], bsdf=TWO_SIDED))
    derivative(scene, "square.y_m", method=ON_FILM)


def test_parts_in_pixels():
    """Lines through random places: parts add up, and their middles are in their pixels."""
    random = np.random.default_rng(0)
    start, end = random.uniform(-4, 12, (2, 200, 2))
    line, first, last, pixel = parts_in_pixels(start, end - start, (8, 6))
    s = random.random(4000)
    points = start[:, None] + s[:, None] * (end - start)[:, None]
    inside = ((points > 0) & (points < [8, 6])).all(axis=-1).mean(axis=1)
    lengths = np.bincount(line, last - first, 200)
    assert lengths == pytest.approx(inside, abs=0.04)
    middle = start[line] + ((first + last) / 2)[:, None] * (end - start)[line]
    assert pixel.tolist() == (np.floor(middle) @ [1, 8]).astype(int).tolist()
    assert (np.abs(end - start)[line] * (last - first)[:, None]).max() < 1 + 1e-9


def test_other_emission_is_differentiated_by_differences():
    """The place on a surface that a pixel shows moves over a texture. So it may over a lamp."""
    image = {"type": "bitmap", "data": mi.TensorXf(np.ones((2, 2, 1)) / 2), "raw": True}
    shape = square(bsdf={"type": "diffuse", "reflectance": image})
    derivative(scene_of(shape), "square.y_m", method=ON_FILM)
    lamp = mi.Mesh("lamp", 4, 2, properties(bsdf={"type": "diffuse"}, emitter={"type": "area"}))
    buffers = mi.traverse(lamp)
    buffers["vertex_positions"] = np.ravel(SQUARE + [0.5, 0, 0]).astype(np.float32)
    buffers["faces"] = np.uint32([0, 1, 2, 0, 2, 3])
    buffers.update()
    scene = scene_of(square(), lamp)
    derivative(scene, "model.yaw_deg", method=ON_FILM)
    derivative(scene, "square.y_m")


def properties(**plugins) -> mi.Properties:
    values = mi.Properties()
    for name, plugin in plugins.items():
        values[name] = mi.load_dict(plugin)
    return values
