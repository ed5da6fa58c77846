"""Control points of a surface: how it follows them, against areas of hulls and known shapes."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import mi_lcair
from mi_lcair import InputError
from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.motions.pose import declare, known_motions, moved
from mi_lcair.rendering.motions.table import Declared
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.window import window_area
from tests.derivatives.motions.test_differences import CUBE, VIEW, L, mesh, scene_of

COUNT = 6
NAMES = [f"ball.shape.{k}" for k in range(COUNT)]
TABLE = {"ball.shape": Declared(("ball",), control_points=COUNT)}


def ball(count: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Points on a sphere of radius .5 (Fibonacci), and outward triangles."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - z**2)
    points = 0.5 * np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    hull = ConvexHull(points)
    a, b, c = points[hull.simplices].swapaxes(0, 1)
    outward = np.einsum("tk,tk->t", np.cross(b - a, c - a), hull.equations[:, :3]) > 0
    return points, np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1])


def with_points(*shapes, table=None, **more):
    scene = scene_of(*shapes, **more)
    declare(scene, TABLE if table is None else table)
    return scene


def test_equal_values_are_an_offset_of_the_surface():
    """Also where each facet has vertices of its own: no crack opens."""
    points, triangles = ball()
    split = mesh("ball", points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    for shape in (mesh("ball", points, triangles), split):
        scene = with_points(shape)
        before = vertex_positions(scene.mi.shapes()[0])
        with changed(scene, dict.fromkeys(NAMES, 0.07)):
            after = vertex_positions(scene.mi.shapes()[0])
        assert np.linalg.norm(after - before, axis=1) == pytest.approx(0.07, rel=1e-4)
        assert np.linalg.norm(after, axis=1) == pytest.approx(0.57, rel=1e-3)
        joints = np.unique(before.round(5), axis=0), np.unique(after.round(5), axis=0)
        assert len(joints[0]) == len(joints[1]) == len(points)


def test_a_control_point_has_its_value_and_the_others_stay():
    scene = with_points(mesh("ball", *ball()))
    motions, before = known_motions(scene), vertex_positions(scene.mi.shapes()[0]).copy()
    of_points = [
        int(np.argmin(np.linalg.norm(before - motions[name].place, axis=1))) for name in NAMES
    ]
    with moved(scene, {NAMES[2]: 0.1}):
        change = np.linalg.norm(vertex_positions(scene.mi.shapes()[0]) - before, axis=1)
    assert change[of_points] == pytest.approx(np.where(np.arange(COUNT) == 2, 0.1, 0), abs=1e-6)
    apart = np.linalg.norm(np.diff(before[of_points], axis=0), axis=1)
    assert apart.min() > 0.5  # six points on a sphere are up to .707 apart
    assert known_motions(scene)[NAMES[0]].upper == pytest.approx(0.5, rel=0.02)


def test_derivatives_are_those_of_the_hull_on_the_film():
    """The pixels of a black body together change by L times its projected area."""
    scene = with_points(mesh("ball", *ball()), window=0.8)
    right = np.array([0, 1.0, 0])
    plane = np.stack([right, np.cross(VIEW, right)], axis=1)

    def area(value: float, name: str) -> float:
        with moved(scene, {name: value}):
            return ConvexHull(vertex_positions(scene.mi.shapes()[0]).astype(float) @ plane).volume

    images = mi_lcair.derivative_images(scene, NAMES, spp=64)
    size = window_area(scene.sensors[0], "ball")
    found = images.derivative.mean(axis=(1, 2)) * size
    exact = [L * (area(1e-3, name) - area(-1e-3, name)) / 2e-3 for name in NAMES]
    assert found == pytest.approx(exact, rel=0.01, abs=0.01 * L)
    assert sum(exact) == pytest.approx(L * np.pi, rel=0.05)  # d(pi r^2)/dr of a sphere, less facets


def test_a_surface_that_would_turn_over():
    many = {"ball.shape": Declared(("ball",), control_points=60)}
    scene = with_points(mesh("ball", *ball()), table=many)
    before = vertex_positions(scene.mi.shapes()[0]).copy()
    values = {name: -0.4 * (k % 2) for k, name in enumerate(f"ball.shape.{k}" for k in range(60))}
    with pytest.raises(InputError, match=r"turn \d+ triangles of the surface over"):
        moved(scene, values).__enter__()
    assert np.array_equal(vertex_positions(scene.mi.shapes()[0]), before)


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (7, "control_points = 7; must be at most the number of vertices, 4"),
        (4, "vertices have no outward normal"),
    ],
)
def test_surfaces_without_room_or_normals(count, text):
    twice = mesh("plate", np.tile(CUBE[:4], (2, 1)), [[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]])
    with pytest.raises(InputError, match=text):
        with_points(twice, table={"plate.shape": Declared(("plate",), control_points=count)})
