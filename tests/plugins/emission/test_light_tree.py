"""The tree that draws panels: probabilities against frequencies and against what panels send."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.emission.panels import ANYWHERE, ByPower, LightTree, Panels, chosen
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.emission.triangles import TriangleTable
from tests.plugins.small_scenes import GREY, INTEGRATORS, blackbody, camera, runs, scene


def mesh(vertices, faces):
    made = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    return made


def scattered(count, seed=0, both_sides=False):
    """Panels: `count` random triangles of very different radiances in a cube of 2 m."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1, 1, size=(count, 1, 3))
    vertices = (centres + rng.normal(scale=0.05, size=(count, 3, 3))).reshape(-1, 3)
    made = mesh(vertices, np.arange(3 * count).reshape(-1, 3))
    return Panels(TriangleTable([made]), rng.lognormal(0, 2, count), np.full(count, both_sides))


def receiver(p, n, width):
    p, n = mi.Point3f(*map(float, p)), mi.Normal3f(*map(float, n))
    return Receiver(dr.repeat(p, width), dr.repeat(n, width))


def probabilities(tree, count, p, n):
    at = receiver(p, n, count)
    _, probability = tree.probability(dr.arange(mi.UInt32, count), at, mi.Bool(True))
    return probability.numpy().astype(float)


@pytest.mark.parametrize("kind", [LightTree, ByPower])
@pytest.mark.parametrize("count", [1, 2, 3, 37, 200])
def test_frequencies_are_the_probabilities(count, kind):
    tree = kind(scattered(count))
    stated = probabilities(tree, count, (0.3, 0.1, -0.2), (0.6, 0, 0.8))
    assert stated.sum() == pytest.approx(1, abs=1e-5)
    assert np.all(stated >= tree.least * (1 - 1e-5))
    draws = 2**20
    number = (dr.arange(mi.Float64, draws) + 0.5) / draws
    at = receiver((0.3, 0.1, -0.2), (0.6, 0, 0.8), draws)
    panel, _, probability = tree.draw(number, at, mi.Bool(True))
    # Evenly spaced numbers: each panel gets its probability in two intervals
    panel = np.broadcast_to(panel.numpy(), draws)
    counts = np.bincount(panel, minlength=count)
    np.testing.assert_allclose(counts / draws, stated, atol=2 * count / draws)
    np.testing.assert_allclose(
        np.broadcast_to(probability.numpy(), draws), stated[panel], rtol=1e-5
    )


def test_panels_are_drawn_by_what_they_send():
    """Among 200 triangles: most draws go where most arrives, and few behind or to backs."""
    panels = scattered(200, seed=3)
    tree = LightTree(panels)
    p, n = np.array([0.0, 0.0, -1.2]), np.array([0.0, 0.0, 1.0])
    stated = probabilities(tree, 200, p, n)
    to = panels.corners[:, :3].mean(axis=1) - p
    distance = np.linalg.norm(to, axis=1)
    facing = np.maximum(-np.sum(panels.normal * to, axis=1) / distance, 0)
    sent = panels.radiance * panels.area * np.maximum(to @ n / distance, 0) * facing / distance**2
    ideal = sent / sent.sum()
    by_power = panels.radiance * panels.area / np.sum(panels.radiance * panels.area)
    # Variance of one draw's sent / probability, without and with the tree
    scatter = [np.sum(ideal**2 / q) - 1 for q in (by_power, stated)]
    assert scatter[1] < 0.3 * scatter[0]
    backs = sent == 0
    assert stated[backs].sum() < 2 * ANYWHERE * by_power[backs].sum() + 0.05


def test_the_choice_between_two_is_by_their_projected_solid_angles():
    """Two squares above a floor, at 1 m and 2 m: shares by their view factors."""
    square = np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]]) * 0.1
    vertices = np.concatenate([square + [0, 0, 1], square + [1, 0, 2]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    made = mesh(vertices, np.concatenate([faces, faces + 4]))
    panels = Panels(TriangleTable([made]), np.ones(4), np.zeros(4, bool))
    assert panels.is_rectangle.tolist() == [True, True] and panels.counts == [2]
    stated = probabilities(LightTree(panels), 2, (0.05, 0.05, 0), (0, 0, 1))
    factor = np.array([1.0, 2.0**2 / (1**2 + 2**2) ** 2])
    expected = ANYWHERE / 2 + (1 - ANYWHERE) * factor / factor.sum()
    np.testing.assert_allclose(stated, expected, rtol=3e-3)


def room(turned=1):
    """Mesh of a cube of 2 m whose 6 squares have their fronts inside; turned = -1: outside."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    vertices, faces = [], []
    for axis in range(3):
        for side in (-1, 1):
            corners = np.roll(np.insert(square, 0, side, axis=1), axis, axis=1)
            faces += [[len(vertices) + k for k in (0, *pair)] for pair in ((1, 2), (2, 3))]
            vertices += corners[:: -side * turned].tolist()
    return mesh(vertices, faces)


def test_walls_that_surround_the_scene_are_drawn_by_power():
    """Not those of a body, those with one bright part, a few plates, or plates with two sides."""
    even, one_side = np.ones(12), np.zeros(12, bool)
    bright = np.append([10.0, 10.0], np.ones(10))
    for made, radiance, both_sides, kind in (
        (room(), even, one_side, ByPower),
        (room(-1), even, one_side, LightTree),
        (room(), bright, one_side, LightTree),
        (room(), even, ~one_side, LightTree),
    ):
        assert type(chosen(Panels(TriangleTable([made]), radiance, both_sides))) is kind
    assert type(chosen(scattered(12))) is LightTree
    assert type(chosen(scattered(1))) is ByPower


@pytest.mark.parametrize("sampling", [True, "preferred", False])
def test_a_room_that_is_drawn_by_power_has_its_closed_form(tmp_path, sampling):
    """Walls of one temperature and of emissivity 0.7: what 3 reflections leave out is 0.3^4."""
    file = str(tmp_path / "room.ply")
    room().write_ply(file)
    walls = {"type": "ply", "filename": file, "face_normals": True, "bsdf": GREY}
    walls["emitter"] = {"type": "thermal", "temperature": 300.0, "band": "LWIR"}
    integrator = {**INTEGRATORS["bounce_path"], "emitter_sampling": sampling}
    loaded = scene(integrator, camera(height=1.5, origin=(0, 0, 0.9)), walls=walls)
    with loaded.integrator().prepared(loaded) as tracer:
        assert sampling is False or isinstance(tracer.emitters.tables[0].panel_choice, ByPower)
    images = runs(loaded, 4, 2**12)
    error = images.mean(axis=(1, 2)).std() / 2 + 1e-5 * images.mean()
    assert images.mean() == pytest.approx(blackbody(300) * (1 - 0.3**4), abs=4 * error)
    assert error < 1e-3 * images.mean()


def test_a_panel_that_emits_backward_is_drawn_from_behind():
    for both_sides in (False, True):
        square = np.array(
            [[0, 0, 1], [1, 0, 1], [0, 1, 1], [5, 5, 1], [5, 5.001, 1], [5.001, 5, 1]]
        )
        made = mesh(square, [[0, 1, 2], [3, 4, 5]])
        panels = Panels(TriangleTable([made]), np.ones(2), np.array([both_sides, False]))
        stated = probabilities(LightTree(panels), 2, (0.2, 0.2, 0), (0, 0, 1))
        assert (stated[0] > 0.99) == both_sides


def test_rectangles_are_pairs_of_triangles():
    """In both orders of corners; not a parallelogram, not two radiances, not a folded pair."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float)
    slanted = corners + [[0, 0, 0], [0, 0, 0], [0.1, 0, 0], [0.1, 0, 0]]
    folded = corners + [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0.1]]
    for faces in ([[0, 1, 2], [0, 2, 3]], [[1, 2, 0], [3, 0, 2]], [[3, 0, 1], [3, 1, 2]]):
        for vertices, radiance, is_rectangle in (
            (corners, [1, 1], True),
            (corners, [1, 2], False),
            (slanted, [1, 1], False),
            (folded, [1, 1], False),
        ):
            table = TriangleTable([mesh(vertices, faces)])
            panels = Panels(table, np.array(radiance, float), np.zeros(2, bool))
            assert panels.is_rectangle.all() == is_rectangle
            assert panels.area.sum() == pytest.approx(table.area.sum(), rel=1e-6)
            assert panels.of_triangles.numpy().tolist() == [0, 0 if is_rectangle else 1]
            if is_rectangle:
                np.testing.assert_allclose(np.ptp(panels.corners[0], axis=0), [2, 1, 0])


def test_rectangles_and_triangles_in_one_table():
    """Of a square and a lone triangle, directions point where their panels are."""
    vertices = np.array(
        [[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1], [-2, 0, 1], [-2, 1, 1], [-1, 0, 1]]
    )
    made = mesh(vertices, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    panels = Panels(TriangleTable([made]), np.ones(3), np.zeros(3, bool))
    assert panels.is_rectangle.tolist() == [True, False]
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, 1000)
    at = receiver((0.1, 0.2, 0), (0, 0, 1), 1000)
    for panel, (low, high) in enumerate((((0, 0), (1, 1)), ((-2, 0), (-1, 1)))):
        seen = panels.seen(mi.UInt32(panel), at)
        d, distance, density = seen.draw(sampler.next_2d())
        place = np.array(at.p + distance * d)
        assert np.all(density.numpy() > 0) and np.allclose(place[2], 1)
        assert np.all((place[0] > low[0]) & (place[0] < high[0]))
        assert np.all((place[1] > low[1]) & (place[1] < high[1]))
