"""Derivatives by all vertices of a group against closed forms, identities and attached differences.

A convex blackbody of the band `total` emits L = sigma T^4 / pi, so that its intensity is L times
its projected area. A scene whose temperatures stay has the intensity s^2 I when it is scaled by s.
"""

from itertools import product
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import ConvexHull

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.coincident import weld
from mi_lcair.derivatives.attached import AttachedPaths
from mi_lcair.derivatives.edges import ModelEdges
from mi_lcair.derivatives.shape import Estimation, MovedMesh
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.triangles import triangle_vertices
from mi_lcair.rendering.motions.motion import turned
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling
from tests.derivatives.motions.test_differences import (
    CUBE,
    GAP,
    VIEW,
    WALL,
    L,
    box,
    convex_hull,
    light_of_plate,
    mesh,
    plates,
    scene_of,
    view_of_wall,
)

SKY = {"plate": "sky"}


def derivatives(scene, group: str, along=None, paths: int = 2**14, seed: int = 0):
    """Surface of a group, and the derivatives by its vertices."""
    surface = MovedMesh(scene, group)
    along = surface.outward if along is None else along(surface.positions)
    return surface, Estimation(surface, along, Sampling(paths=paths, seed=seed)).run()


@pytest.mark.parametrize(("yaw_deg", "tolerance"), [(0.0, 0.03), (30.0, 2e-3)])
def test_vertices_of_a_cube(yaw_deg, tolerance):
    """At yaw 0 two faces are edge-on. The derivative is then the mean of the one-sided ones."""
    scene = scene_of(convex_hull("cube", CUBE))
    with changed(scene, {"cube.yaw_deg": yaw_deg}):
        surface, result = derivatives(scene, "cube", paths=2**12)
        assert mi_lcair.parameters(scene)["cube.yaw_deg"].value == yaw_deg

    def intensity(positions):
        a, b, c = np.moveaxis(positions[surface.corners], 1, 0)
        return L * np.maximum(np.cross(b - a, c - a) @ VIEW, 0).sum() / 2

    h = 1e-5
    for k, normal in enumerate(surface.outward):
        step = h * np.outer(np.arange(8) == k, normal)
        ends = [intensity(surface.positions + side * step) for side in (1, -1)]
        assert result.mean[k] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=tolerance)
    assert (result.error >= 0).all() and (result.error < 5).all()  # 0 for a hidden corner


def test_a_single_facet():
    """A facet that grows from its first corner has the intensity (1 + t)^2 I: derivative 2 I."""
    corners = np.array([[0.0, -0.5, -0.4], [0.0, 0.5, -0.4], [0.0, -0.5, 0.6]])
    scene = scene_of(mesh("sheet", corners, [[0, 1, 2]]))
    _, result = derivatives(scene, "sheet", lambda positions: positions - corners[0], 2**10)
    sides = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    assert result.total[0] == pytest.approx(L * abs(sides @ VIEW), rel=1e-3)


def bodies(seed: int, reflectance: float):
    """Corners and triangles of two closed bodies with bumps, which hide and light each other."""
    rng, points, triangles = np.random.default_rng(seed), [], []
    for centre in ([0, 0, 0], [0.6, 0.2, 0.1]):
        sphere = rng.normal(size=(14, 3))
        sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
        hull = ConvexHull(sphere)
        corners = sphere[hull.simplices]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0
        turned = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
        triangles.append(turned + 14 * len(points))
        points.append(0.35 * np.exp(0.3 * rng.normal(size=(14, 1))) * sphere + centre)
    body = mesh("body", np.concatenate(points), np.concatenate(triangles), reflectance)
    return scene_of(body, window=3.0, max_bounces=3)


@pytest.mark.parametrize(("seed", "tolerance", "rounding"), [(1, 0.02, 1e-5), (3, 0.01, 1e-5)])
def test_size_and_shift(seed, tolerance, rounding):
    """The sum of derivative times position is 2 I, and that of equal shifts is 0.

    The third bodies pass through each other.
    """
    scene = bodies(seed, 0.5)
    intensity = mi_lcair.signature(scene, spp=2**8).target
    sum_, error = derivatives(scene, "body", lambda p: p, 2**13, seed)[1].total
    assert error < tolerance * intensity.intensity
    of_both = np.hypot(error, 2 * intensity.standard_error)
    assert abs(sum_ - 2 * intensity.intensity) < 3.5 * of_both
    shifted = derivatives(scene, "body", lambda p: 0 * p + [1.0, 2, 3], 2**13, seed)[1]
    assert abs(shifted.total[0]) < rounding * np.abs(shifted.mean).sum()


@pytest.mark.parametrize("thickness", [0.02, 0.1])
def test_corners_of_a_slab_move_by_a_part_of_its_thickness(thickness):
    """Its front and one side move outward, of which each hides nothing."""
    turn = np.linalg.qr([[1.0, 0.5, 0.3], [-0.2, 1.0, -0.4], [0.1, 0.4, 1.0]])[0]
    scene = scene_of(convex_hull("slab", (CUBE * [thickness, 1.0, 1.0]) @ turn))

    def outward(positions):
        front, side = (positions @ turn[:2].T > 0).T[..., None]
        return np.where(front, turn[0], 0) + np.where(side, turn[1], 0)

    surface, result = derivatives(scene, "slab", outward)
    sum_, error = result.total
    areas = np.abs(turn @ VIEW) * [1.0, thickness, thickness]
    exact = L * (areas[2] / thickness + areas[1] / thickness + areas[0] + areas[2])
    assert abs(sum_ - exact) < 2.5 * error
    assert (surface.reach() <= 3.01 * thickness).all()


def panel(name: str, middle, kelvin: float = 300.0, reflectance: float = 0.0):
    """A square of 0.5 m that faces +x, of two triangles."""
    corners = 0.25 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1.0]]) + middle
    return mesh(name, corners, [[0, 1, 2], [0, 2, 3]], reflectance, kelvin)


@pytest.mark.parametrize("kind", ["welded", "split", "mirrored", "two-sided", "background"])
def test_a_square_that_hides_another(kind):
    """It moves by 1 m: along its edge, of which a part is before the hot one, this is uncovered.

    If it belongs to the background, the hot one moves in its place.
    """
    parts = []
    for name, middle, kelvin in (("cold", [0.3, 0.2, 0], 3.0), ("hot", [0, 0, 0], 300.0)):
        corners = 0.25 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1.0]]) + middle
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
        if kind == "split":
            corners, triangles = corners[triangles.ravel()], np.arange(6).reshape(2, 3)
        turned = {"flip_normals": True} if kind == "mirrored" else {}
        bsdf = {"type": "diffuse", "reflectance": 0.0}
        bsdf = {"type": "twosided", "bsdf": bsdf} if kind == "two-sided" else bsdf
        triangles = triangles[:, :: -1 if turned else 1]
        facet_type = "terrain" if (kind, name) == ("background", "cold") else "model"
        parts.append(mesh(name, corners, triangles, 0.0, kelvin, bsdf, turned, facet_type))
    moves, way = ("hot", -1) if kind == "background" else ("cold", 1)
    _, result = derivatives(scene_of(*parts), moves, lambda p: 0 * p + [0, way, 0], 2**15)
    exact = L * (0.5 * VIEW[0] - 0.3 * VIEW[2])
    sum_, error = result.total
    assert abs(sum_ - exact) < 3.5 * error < 0.01 * exact


@pytest.mark.parametrize(("height", "meets"), [(-0.1, False), (0.0, True), (0.05, False)])
def test_parts_that_touch(height, meets):
    """A box in, on or over a plate: where they touch, what is hidden jumps if it moves."""
    plate = convex_hull("plate", box([-1, -1, -0.2], [1, 1, 0]))
    scene = scene_of(plate, convex_hull("box", box([-0.2, -0.3, height], [0.2, 0.25, 0.5])))
    surface = MovedMesh(scene, "box")
    estimation = Estimation(surface, surface.outward, Sampling(paths=2**8))
    with scene.prepared() as tracer:
        paths = AttachedPaths(surface, estimation.sensor, tracer, estimation.choice)
        assert paths.contacts.meets_itself() == meets


def test_a_box_that_rises_out_of_a_plate():
    """It is turned, and hot: as much of its sides appears as lies across the view."""
    turn = turned(box([-0.2, -0.2, -0.1], [0.2, 0.2, 0.5]), 25.0, "yaw_deg", np.zeros(3))
    plate = convex_hull("plate", box([-1, -1, -0.2], [1, 1, 0]))
    scene = scene_of(plate, convex_hull("box", turn), window=3.0)
    with changed(scene, {"plate.temperature": 3.0}):
        _, result = derivatives(scene, "box", lambda p: 0 * p + [0, 0, 1.0], 2**14)
    sum_, error = result.total
    wide = 0.4 * (np.cos(np.radians(25)) + np.sin(np.radians(25)))
    assert abs(sum_ - L * wide * VIEW[0]) < 3.5 * error < 0.05 * L


def cosines(points, polygon):
    """Integral of the z cosine over the directions of a polygon, at points, by Lambert (n,)."""
    d = np.array(polygon, float) - points[:, None]
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    after = np.roll(d, -1, axis=1)
    normal = np.cross(d, after)
    sine = np.linalg.norm(normal, axis=2)
    return abs((normal[..., 2] / sine * np.arctan2(sine, (d * after).sum(axis=2))).sum(axis=1)) / 2


@pytest.mark.slow
def test_light_of_a_box_that_comes_out_of_a_wall():
    """A floor reflects the light of its front, bottom and sides; nothing else of it is in view."""
    corners = 0.25 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    floor = mesh("floor", corners, [[0, 1, 2], [0, 2, 3]], 0.6, 3.0)
    wall = convex_hull("wall", box([-0.57, -0.22, 0.1], [-0.55, 0.2, 0.5]))
    corners = np.array([[-0.7, -0.3, 0.6], [-0.4, -0.3, 0.6], [-0.4, 0.3, 0.6], [-0.7, 0.3, 0.6]])
    roof = mesh("roof", corners, [[0, 1, 2], [0, 2, 3]], 0.0, 3.0)
    hot = convex_hull("hot", box([-0.65, -0.12, 0.2], [-0.45, 0.1, 0.4]))
    scene = scene_of(floor, wall, roof, hot, view=np.array([1e-3, 0, 1.0]), max_bounces=1)
    with changed(scene, {"wall.temperature": 3.0}):
        _, result = derivatives(scene, "hot", lambda p: 0 * p + [1.0, 0, 0], 2**16)

    def light(x):
        nodes, weights = np.polynomial.legendre.leggauss(40)
        points = np.stack([*np.meshgrid(nodes / 4, nodes / 4, indexing="ij")], axis=-1)
        points = np.pad(points.reshape(-1, 2), [(0, 0), (0, 1)])
        ends = [[a, b, c] for a in (-0.55, x) for b in (-0.12, 0.1) for c in (0.2, 0.4)]
        y, front = points[:, 1], [4, 6, 7, 5]
        bottom, left, right = [0, 2, 6, 4], [0, 1, 5, 4], [2, 3, 7, 6]
        front, bottom, left, right = (
            cosines(points, [ends[k] for k in of]) for of in (front, bottom, left, right)
        )
        seen = front + bottom + left * (y < -0.12) + right * (y > 0.1)
        return 0.6 / np.pi * L * (seen @ np.outer(weights, weights).ravel()) / 16

    exact = (light(-0.45 + 1e-4) - light(-0.45 - 1e-4)) / 2e-4
    sum_, error = result.total
    assert abs(sum_ - exact) < 3.5 * error < 0.25 * exact


def test_silhouettes_at_each_reflection(monkeypatch):
    """A path looks for them at one of its reflections, with a weight for those left out."""
    shares, found, scene = [1 / 2, 1 / 4, 1 / 4], [], bodies(1, 0.5)

    def visited(paths, visit, sampler):
        of_visit = visit.bounces, visit.throughput
        left, weight = (np.broadcast_to(of.numpy(), 2**9) for of in of_visit)
        found.extend((left == 2 - k).mean() for k in range(3))
        found.append(weight[left == 2].mean())
        return mi.Float(0)

    monkeypatch.setattr(AttachedPaths, "beside_edges", visited)
    surface = MovedMesh(scene, "body")
    estimation = Estimation(surface, surface.outward, Sampling(paths=2**10))
    with scene.prepared() as tracer:
        paths = AttachedPaths(surface, estimation.sensor, tracer, estimation.choice)
        paths.run(0, 2**6)
    assert found == pytest.approx([*shares, 2], abs=0.02)


LOBE = {"type": "sandford_robertson", "epsilon": 0.1, "rho_d": 0.02, "b": 0.05, "e": 0.02}


@pytest.mark.parametrize("moves", ["floor", "hot"])
def test_mirror_image_of_a_panel(moves):
    """A narrow lobe shows the edge of a hot panel. The floor is tilted, or the panel is shifted."""
    view, triangles = np.array([1.0, 0, 1]) / np.sqrt(2), [[0, 1, 2], [0, 2, 3]]
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    below = mesh("floor", 0.1 * square, triangles, kelvin=3.0, bsdf=LOBE)
    above = [0.15, 0.3, 1] * square[::-1] + [-0.88, 0, 1.0]
    scene = scene_of(below, mesh("hot", above, triangles), view=view, max_bounces=1)
    along = {"floor": lambda p: p[:, :1] * [0, 0, 1], "hot": lambda p: 0 * p + [1.0, 0, 0]}[moves]
    _, result = derivatives(scene, moves, along, 2**14)

    def light(x):
        nodes, weights = np.polynomial.legendre.leggauss(48)
        grid = np.stack(np.meshgrid(nodes, nodes, 0.0, indexing="ij"), axis=-1).reshape(-1, 3)
        tilt, shift = (x, 0) if moves == "floor" else (0, x)
        axes = np.array([[1, 0, tilt], [0, 1, 0], [-tilt, 0, 1]]) / np.hypot(
            1, [[tilt], [0], [tilt]]
        )
        total, bsdf = 0, mi.load_dict(LOBE)
        panel = grid * [0.15, 0.3, 1] + [-0.88 + shift, 0, 1]
        few, of_few = np.polynomial.legendre.leggauss(6)
        for (u, v), w in zip(product(0.1 * few, repeat=2), np.outer(of_few, of_few).ravel()):
            to = panel - [u, v, u * tilt]
            far = np.linalg.norm(to, axis=1)
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(axes @ view)
            wo = (to / far[:, None]) @ axes.T
            f = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo.T))[0].numpy().astype(float)
            of_panel = f * to[:, 2] / far**3 * np.outer(weights, weights).ravel() * 0.15 * 0.3
            total += w * 0.01 * np.hypot(1, tilt) * (axes @ view)[2] * of_panel.sum()
        return L * total

    exact = (light(2e-3) - light(-2e-3)) / 4e-3
    sum_, error = result.total
    assert abs(sum_ - exact) < 3.5 * error < 0.15 * abs(exact)


def test_narrow_lobe_in_an_even_room():
    """The room belongs to the background. A tilted plate shows it times its reflectance."""
    view, triangles = np.array([1.0, 0, 1]) / np.sqrt(2), [[0, 1, 2], [0, 2, 3]]
    square = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    inward = triangle_vertices(convex_hull("walls", CUBE))[:, ::-1]
    walls = mesh("walls", 2 * CUBE, inward, facet_type="sky")
    plate = mesh("plate", square, triangles, kelvin=3.0, bsdf=LOBE)
    scene = scene_of(plate, walls, view=view, max_bounces=1, away=1.2)
    _, result = derivatives(scene, "plate", lambda p: p[:, :1] * [0, 0, 1], 2**12)
    bsdf = mi.load_dict(LOBE)

    def light(tilt):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(float(np.sin(np.pi / 4 + tilt)), 0, float(np.cos(np.pi / 4 + tilt)))
        share = bsdf.eval_diffuse_reflectance(si)[0].numpy()[0]
        return 0.04 * np.hypot(1, np.tan(tilt)) * np.cos(np.pi / 4 + tilt) * share * L

    exact = (light(0.01) - light(-0.01)) / 0.02
    sum_, error = result.total
    assert sum_ == pytest.approx(exact, rel=1e-3) and error < 1e-3 * abs(exact)


def test_equal_to_attached_differences():
    """A cold square before a hot one, which it hides and lights, moves across the view."""
    cold = panel("cold", [0.3, 0.2, 0], 250.0, 0.5)
    scene = scene_of(cold, panel("hot", [0, 0, 0], 500.0, 0.5), max_bounces=2)
    _, result = derivatives(scene, "cold", lambda p: 0 * p + [0, 1.0, 0], 2**13)
    sum_, error = result.total
    expected = mi_lcair.sensitivities(scene, ["cold.y_m"], paths=2**14).differences["cold.y_m"]
    assert expected.derivative > 100
    assert error < 0.005 * expected.derivative
    assert abs(sum_ - expected.derivative) < 3.5 * np.hypot(error, expected.error)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["parallel plates", "below a sky", "wall on a floor"])
def test_light_of_a_near_emitter(case):
    """A hot plate moves away from a grey one, or a hot wall that stands on a floor grows.

    If the hot plate belongs to the background, the grey one moves.
    """
    if case != "wall on a floor":
        moves, way, more = ("plate", 1, {}) if case == "parallel plates" else ("floor", -1, SKY)
        scene, group, along = plates(**more), moves, lambda p: 0 * p + [0, 0, way]
        of = lambda x: light_of_plate(GAP + x)  # noqa: E731
    else:
        scene, group, along = mi_lcair.load("open_box"), "wall", lambda p: p * [0, 0, 1.0]
        factor = np.cos(np.pi / 4) * 0.5 * WALL
        of = lambda x: factor * view_of_wall(0.1, 0.2, 0.1 * (1 + x))  # noqa: E731
    exact = (of(1e-4) - of(-1e-4)) / 2e-4
    sum_, error = derivatives(scene, group, along, 2**13)[1].total
    assert abs(sum_ - exact) < 3.5 * error < 0.005 * abs(exact)


@pytest.mark.slow
def test_shade_of_the_sun(tmp_path):
    """A black panel moves its shade over a sunlit one: along an edge of it this is uncovered."""
    parts = [{"type": "sun", "azimuth_deg": 0.0, "elevation_deg": 70.0, "band": "MWIR"}]
    for name, middle, reflectance in [("lit", [0, 0, 0], 0.9), ("shade", [0.3, 0.1, 0.8], 0.0)]:
        panel(name, middle).write_ply(str(tmp_path / f"{name}.ply"))
        emitter = {"type": "thermal", "band": "MWIR", "temperature": 100.0, "group": name}
        bsdf = {"type": "diffuse", "reflectance": reflectance}
        file = {"type": "ply", "filename": str(tmp_path / f"{name}.ply"), "face_normals": True}
        parts.append(file | {"bsdf": bsdf, "emitter": emitter})
    scene = scene_of(*parts, max_bounces=1)
    _, result = derivatives(scene, "shade", lambda p: 0 * p + [0, 1.0, 0], 2**12)
    sum_, error = result.total
    with changed(scene, {"shade.y_m": 5.0}):
        lit = mi_lcair.signature(scene, spp=2**10).target.intensity / 0.5**2  # of 1 m^2
    # The shade falls from z = 0.8 by 0.3 tan(70 deg); its other edge is beyond the sunlit panel
    edge = 0.25 + (0.8 + 0.25 - 0.3 * np.tan(np.radians(70)))
    assert sum_ > 5 * error
    assert abs(sum_ - lit * edge) < 3.5 * error + 2e-3 * sum_


def test_vertices_at_one_position_move_together():
    """The halves of a cube, of two groups, share the vertices of the cut."""
    left, right = CUBE - [0.5, 0, 0], CUBE + [0.5, 0, 0]
    scene = scene_of(convex_hull("left", left), convex_hull("right", right))
    surface = MovedMesh(scene, "left")
    moved = surface.displaced(0 * surface.positions + [0, 0, 1.0]) - surface.vertices
    at_cut = surface.vertices[:, 0] == 0
    assert len(surface.positions) == 8 and at_cut.sum() == 8
    assert (moved[at_cut, 2] == 1).all() and moved[:, 2].sum() == 12


def test_colours_differ_in_each_triangle():
    scene = bodies(5, 0.0)
    surface = MovedMesh(scene, "body")
    colours = surface.colours()[surface.corners]
    assert (np.diff(np.sort(colours, axis=1), axis=1) > 0).all()
    assert colours.max() < 8


def test_result(tmp_path):
    """The integral of the facets' derivatives is the growth; a cube grows by its projected area."""
    shape = mi_lcair.shape_derivatives(scene_of(convex_hull("cube", CUBE)), "cube", paths=2**12)
    table = shape.table
    assert np.sum(table["area_m2"] * table["derivative_W_sr_m3"]) == pytest.approx(shape.growth)
    assert shape.growth == pytest.approx(np.sum(shape.derivative))
    # Corners move by 1 along the diagonal, and faces by 1 / sqrt(3)
    exact = 4 / np.sqrt(3) * L * (VIEW[0] + VIEW[2])
    assert shape.growth == pytest.approx(exact, rel=1e-3)
    assert 0 < shape.growth_error < 0.02 * exact
    assert (table["standard_error_W_sr_m3"] >= 0).all()
    np.testing.assert_allclose(shape.axes @ shape.axes.T, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(shape.axes[2], VIEW, atol=1e-6)
    assert shape.axes[1, 2] > 0.9
    for suffix in (".csv", ".vtp", ".png", ".json", ".html"):
        shape.save(tmp_path / f"shape{suffix}")
        assert (tmp_path / f"shape{suffix}").stat().st_size > 300


def test_inputs_that_cannot_be_used():
    scene = scene_of(convex_hull("cube", CUBE))
    with pytest.raises(InputError, match="unknown group of meshes of .* 'cub'; known: cube"):
        mi_lcair.shape_derivatives(scene, "cub")
    flat = mesh("sheet", np.eye(3), [[0, 1, 2], [0, 0, 1]])
    with pytest.raises(InputError, match="triangle 1 of shape '.*' has no area; remove it"):
        mi_lcair.shape_derivatives(scene_of(flat), "sheet")
    scene.mi.integrator().closure = "tail"
    with pytest.raises(InputError, match="closure = tail has no derivatives by vertex"):
        mi_lcair.shape_derivatives(scene, "cube", paths=64)


def test_command(tmp_path):
    output = tmp_path / "shape.csv"
    result = CliRunner().invoke(
        main,
        ["shape-derivatives", "two_plates", "--group", "plate", "--spp", "1", "-o", str(output)],
    )
    assert result.exit_code == 0, result.output
    assert "moved outward by 1 mm" in result.output
    assert output.read_text().startswith("facet,area_m2,derivative_W_sr_m3,standard_error_W_sr_m3")


def test_triangles_without_area_have_no_edges():
    """A tip of a cone may be many vertices at one place, with triangles between them."""
    angle = np.arange(8) * np.pi / 4
    rim, k = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), np.arange(8)
    vertices = np.concatenate([rim, np.tile([[0.0, 0, 1]], (8, 1))])
    sides, next_one = np.stack([k, (k + 1) % 8, k + 8], axis=1), (k + 1) % 8 + 8
    tip = np.stack([(k + 1) % 8, next_one, k + 8], axis=1)
    for triangles in (sides, np.append(tip, sides, axis=0)):
        surface = SimpleNamespace(vertices=vertices, triangles=triangles)
        surface.welded, surface.of_model = weld(vertices), len(vertices)
        of = ModelEdges(surface)
        assert of.opposite.shape == (16, 2)
        bare = (of.opposite < 0).any(axis=1)
        assert np.allclose(vertices[of.ends[bare]][..., 2], 0) and bare.sum() == 8
