"""Derivatives with respect to motions against closed forms; blackbodies of the band `total`.

A convex blackbody emits L = sigma T^4 / pi from each facet, so that its intensity is L times its
projected area.
"""

from functools import partial
from itertools import product

import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial import ConvexHull

import mi_lcair
from mi_lcair.derivatives.common_numbers import CommonNumbers
from mi_lcair.derivatives.motions.differences import ATTACHED, DifferenceKind
from mi_lcair.derivatives.window import differences_of
from mi_lcair.rendering.motions.motion import TURNS, turned
from mi_lcair.rendering.motions.pose import declare
from mi_lcair.rendering.motions.table import motions_of
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling

L = 5.670374419e-8 * 300.0**4 / np.pi
VIEW = np.array([np.cos(np.radians(20)), 0, np.sin(np.radians(20))])  # to the observer


def mesh(
    name: str,
    corners,
    triangles,
    reflectance: float = 0.0,
    kelvin: float = 300.0,
    bsdf=None,
    more=(),
    facet_type: str = "model",
):
    """A mesh with one temperature. bsdf: in place of a diffuse one. more: other properties."""
    values = mi.Properties()
    for key, value in dict(more).items():
        values[key] = value
    values["bsdf"] = mi.load_dict(bsdf or {"type": "diffuse", "reflectance": reflectance})
    emitter = {"type": "thermal", "band": "total", "temperature": kelvin, "group": name}
    values["emitter"] = mi.load_dict(emitter | {"facet_type": facet_type})
    shape = mi.Mesh(name, len(corners), len(triangles), values)
    buffers = mi.traverse(shape)
    buffers["vertex_positions"] = np.ravel(corners).astype(np.float32)
    buffers["faces"] = np.ravel(triangles).astype(np.uint32)
    buffers.update()
    return shape


def convex_hull(name: str, points):
    """The mesh of a convex hull, its triangles turned outward."""
    hull, triangles = ConvexHull(points), []
    for simplex, equation in zip(hull.simplices, hull.equations):
        a, b, c = points[simplex]
        outward = np.cross(b - a, c - a) @ equation[:3] > 0
        triangles.append(simplex if outward else simplex[::-1])
    return mesh(name, points, triangles)


def scene_of(*shapes, window: float = 2.0, view=VIEW, max_bounces: int = 0, away: float = 10, at=0):
    to_world = mi.ScalarTransform4f().look_at(
        origin=list(away * np.array(view) + at), target=list(np.zeros(3) + at), up=[0, 0, 1]
    ) @ mi.ScalarTransform4f().scale([window, window, 1])
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    film |= {"pixel_format": "luminance", "component_format": "float32"}
    sensor = {"type": "orthographic", "to_world": to_world, "near_clip": 1.0, "film": film}
    sensor["sampler"] = {"type": "lattice"}
    parts = {f"shape{k}": shape for k, shape in enumerate(shapes)}
    integrator = {"type": "bounce_path", "max_bounces": max_bounces}
    scene = {"type": "scene", "integrator": integrator, "sensor": sensor, **parts}
    return mi_lcair.load(mi.load_dict(scene, optimize=False))


CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def cube_intensity(yaw_deg: float) -> float:
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    normals = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return L * np.abs(normals @ VIEW).sum()


def facets_intensity(points, turn: str, degrees: float) -> float:
    """Intensity of a convex hull that is turned about the middle of its bounding box [W/sr]."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    corners = turned(points, degrees, turn, middle)[ConvexHull(points).simplices]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return L * np.abs(sides @ VIEW).sum() / 4  # front and back project on the same area


def derivative(scene, name: str, paths: int = 2**14, seed: int = 0):
    result = mi_lcair.sensitivities(scene, [name], paths=paths, seed=seed)
    return result.differences[name]


def test_cube_turns():
    scene = scene_of(convex_hull("cube", CUBE))
    with changed(scene, {"cube.yaw_deg": 30.0}):
        found = derivative(scene, "cube.yaw_deg", 2**16)
    h = 1e-4
    exact = (cube_intensity(30 + h) - cube_intensity(30 - h)) / (2 * h)
    assert exact == pytest.approx(0.87765, rel=1e-4)
    assert found.derivative == pytest.approx(exact, rel=1e-3)
    assert 0 < found.error < 2e-3 * exact
    assert abs(found.derivative - exact) < 3 * found.error
    assert (found.method, found.verdict) == ("attached difference", "smooth")


def test_kink_of_a_cube():
    """At yaw 0 a side face begins to show, on either side."""
    found = derivative(scene_of(convex_hull("cube", CUBE)), "cube.yaw_deg")
    slope = L * np.cos(np.radians(20)) * np.pi / 180
    assert slope == pytest.approx(2.3978, rel=1e-4)
    assert found.verdict == "kink"
    assert found.one_sided == pytest.approx((-slope, slope), rel=0.01)


def test_an_edge_that_hardly_moves():
    """A cover comes nearer, and its lower edge hides more by the sine of a degree.

    No path of this seed is hidden in one of the poses only.
    """
    hot = convex_hull("hot", box([-0.1, -0.5, -0.5], [0, 0.5, 0.5]))
    cover = convex_hull("cover", box([0.1, -0.9, 0.3], [0.11, 0.9, 0.7]))
    sine = np.sin(np.radians(1))
    scene = scene_of(hot, cover, view=np.array([np.sqrt(1 - sine**2), 0, sine]), window=0.6)
    with changed(scene, {"cover.temperature": 3.0}):
        result = derivative(scene, "cover.x_m", 2**12, seed=3)
    assert result.method == "attached paths"
    assert abs(result.derivative + L * sine) < 2 * result.error < 4 * L * sine


@pytest.mark.parametrize("seed", range(2))
def test_a_cover_that_slides(seed):
    """All that changes is what the cover hides: paths begin beside its edge."""
    hot = convex_hull("hot", box([-0.1, -0.5, -0.5], [0, 0.5, 0.5]))
    cover = convex_hull("cover", box([0.1, -0.9, -0.7], [0.11, 0.13, 0.7]))
    cold = {"cover.temperature": 3.0}
    scene = scene_of(hot, cover, view=np.array([1.0, 0, 0]))
    with changed(scene, cold):
        result = derivative(scene, "cover.y_m", 2**12, seed)
    assert result.method == "attached paths"
    assert abs(result.derivative + L) < 4 * result.error < 0.04 * L


def box(low, high):
    """Corners of a box, (8, 3)."""
    return np.array([[x, y, z] for x, y, z in product(*zip(low, high))])


@pytest.mark.parametrize(("overlap", "expected"), [(0.0025, True), (0.2, False)])
def test_a_part_that_is_soon_uncovered(overlap, expected):
    """A cover moves up: behind its top is another part, which sticks out by that much or not."""
    cover = convex_hull("cover", box([0, -0.5, -0.5], [0.001, 0.5, 0.5]))
    behind = convex_hull("behind", box([-0.001, -0.5, 0.1], [0, 0.5, 0.5 + overlap]))
    numbers = CommonNumbers(scene_of(cover, behind), Sampling(paths=2**14))
    differences = differences_of(numbers, "cover.z_m")
    step, rate = 0.01, L * np.cos(np.radians(20)) / 16  # of the mean over the window [1/m]
    assert differences.differs_nearby(rate, step, DifferenceKind(ATTACHED, False)) == expected


def test_a_panel_edge_on():
    """It has no area in view, and shows its front as soon as it turns to one side."""
    corners = 0.5 * np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1.0]])
    scene = scene_of(mesh("panel", corners, [[0, 1, 2], [0, 2, 3]]), view=np.array([1.0, 0, 0]))
    shift, yaw = (derivative(scene, f"panel.{name}", 2**10) for name in ("y_m", "yaw_deg"))
    assert (shift.derivative, shift.error, shift.verdict) == (0, 0, "smooth")
    assert yaw.verdict == "kink" and 0 < yaw.error < 0.01
    assert np.sort(np.abs(yaw.one_sided)) == pytest.approx([0, L * np.pi / 180], rel=1e-3, abs=1e-6)


def test_size_is_an_area():
    """Everything scaled: the intensity goes as the square of the size."""
    found = derivative(scene_of(convex_hull("cube", CUBE)), "cube.size")
    assert found.derivative == pytest.approx(2 * cube_intensity(0), rel=1e-3)


def test_at_the_end_of_a_range():
    """From the zenith, a motion goes on beyond it; sizes and turns go beyond their bounds."""
    points = CUBE @ np.linalg.qr([[1.0, 0.5, 0.3], [-0.2, 1.0, -0.4], [0.1, 0.4, 1.0]])[0]
    scene = scene_of(convex_hull("cube", 1e-3 * points))
    values = {"observer.elevation_deg": 90.0, "cube.size": 1e3, "cube.yaw_deg": 360.0}
    normals = ConvexHull(points).equations[:, :3]  # two for each side, of area 1

    def intensity(elevation: float) -> float:
        angle = np.radians(elevation)
        return L * np.abs(normals @ [np.cos(angle), 0, np.sin(angle)]).sum() / 4

    with changed(scene, values):
        result = mi_lcair.sensitivities(scene, list(values), paths=2**12).differences
    exact = [(intensity(90.01) - intensity(89.99)) / 0.02, 2e-3 * intensity(90), 0]
    for name, slope in zip(values, exact):
        assert abs(result[name].derivative - slope) < 4 * result[name].error


def test_a_distant_sensor():
    """Rounded sides of its window are not quite perpendicular to its rays."""
    points = CUBE @ np.linalg.qr([[1.0, 0.5, 0.3], [-0.2, 1.0, -0.4], [0.1, 0.4, 1.0]])[0]
    results = []
    for away in (10, 1000):
        scene = scene_of(convex_hull("cube", points), away=away)
        assert any("its rays begin" in remark for remark in scene.remarks) == (away == 1000)
        results.append(derivative(scene, "cube.size", 2**12).derivative)
    assert results[1] == pytest.approx(results[0], rel=2e-3)


def test_a_turn_about_a_distant_point():
    """It also shifts the cube, which must not leave the window within the step."""
    place = np.array([0, 50.0, 0])
    results = {}
    for name, at in (("cube.yaw_deg", 0 * place), ("model.yaw_deg", place)):
        scene = scene_of(convex_hull("cube", CUBE + at), at=at)
        with changed(scene, {"cube.yaw_deg": 30.0}):
            results[name] = derivative(scene, name)
    exact, turned_far = results.values()
    error = np.hypot(exact.error, turned_far.error)
    assert abs(turned_far.derivative - exact.derivative) < 4 * error < 0.2 * exact.derivative


@pytest.mark.parametrize("points", [CUBE, 0.5 * np.random.default_rng(4).normal(size=(12, 3))])
def test_a_shift_is_no_change(points):
    """What changes is rounding, which depends on the step."""
    scene = scene_of(convex_hull("body", points), window=4)
    for name in ("body.y_m", "body.z_m"):
        found = derivative(scene, name, 2**12, seed=4)
        assert abs(found.derivative) <= 3 * found.error and found.error > 0
        assert found.verdict == "smooth"


@pytest.mark.parametrize("seed", range(4))
def test_random_hulls(seed):
    """Any turn of any convex body, against its projected area in Float64."""
    rng = np.random.default_rng(seed)
    points = 0.5 * rng.normal(size=(12, 3))
    scene = scene_of(convex_hull("body", points), window=4)
    turn = list(TURNS)[seed % 3]
    intensity = partial(facets_intensity, points, turn)
    found = derivative(scene, f"body.{turn}")
    exact = (intensity(0.01) - intensity(-0.01)) / 0.02
    step = found.step or 0.01
    of_step = (intensity(step) - intensity(-step)) / (2 * step)
    assert abs(found.derivative - of_step) < 4 * found.error + 1e-4 * abs(exact)
    assert 0 < found.error < 0.02 * abs(exact) + 1e-3 * intensity(0)


@pytest.mark.parametrize("seed", [0, 7])
def test_cone_whose_facets_turn_away(seed):
    """A facet of this cone turns edge-on 0.7 degrees away, which the step must not reach."""
    angle = np.arange(48) * 2 * np.pi / 48
    rim = np.stack([0 * angle - 0.3, 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    points = np.concatenate([rim, [[0.7, 0, 0]]])
    intensity = partial(facets_intensity, points, "pitch_deg")
    scene = scene_of(convex_hull("cone", points))
    with changed(scene, {"cone.pitch_deg": 40.3}):
        found = derivative(scene, "cone.pitch_deg", 2**16, seed)
    exact = (intensity(40.31) - intensity(40.29)) / 0.02
    assert found.derivative == pytest.approx(exact, rel=0.01)
    assert abs(found.derivative - exact) < 4 * found.error


def view_of_wall(depth: float, width: float, height: float, gap: float = 0.0) -> float:
    """Area times view factor from a floor to a wall that stands upright behind a gap [m^2].

    The factor of a point at (x, y) is known in closed form. Gauss points integrate it over the
    floor, dense near the wall.
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    t, wt = (nodes + 1) / 2, weights / 2
    x, y = np.meshgrid(gap + depth * t**2, width * t, indexing="ij")
    far = np.hypot(x, height)
    sides = [np.arctan(s / x) - x / far * np.arctan(s / far) for s in (y, width - y)]
    return depth * width * (wt * 2 * t) @ (sum(sides) / (2 * np.pi)) @ wt


WALL = 5.670374419e-8 * 800.0**4 / np.pi


def tall_wall(folder):
    """The open box, with a motion that makes its wall taller by that part of its height."""
    wall = mi_lcair.load("open_box").mi.shapes()[1]
    buffers = mi.traverse(wall)
    tall = buffers["vertex_positions"].numpy().reshape(-1, 3) * [1, 1, 2]
    buffers["vertex_positions"] = mi.Float(tall.ravel().astype(np.float32))
    buffers.update()
    wall.write_ply(str(folder / "tall.ply"))
    file = folder / "motions.toml"
    file.write_text(
        f'[motions]\n"wall.height" = {{groups = ["wall"], displaced = "{folder}/tall.ply"}}\n'
    )
    return mi_lcair.load("open_box", motions=file)


@pytest.mark.slow
def test_gap_of_two_plates():
    """The plate moves away from the reflector; nothing that the sensor sees moves."""
    scene = mi_lcair.load("two_plates", **{"plate.x_m": -0.02})
    h = 1e-5
    low, high = (view_of_wall(0.2, 0.1, 0.2, 0.02 + s * h) for s in (-1, 1))
    exact = WALL * (high - low) / (2 * h)
    found = derivative(scene, "plate.x_m", 2**16)
    assert abs(found.derivative + exact) < 4 * found.error < 0.008 * abs(exact)


@pytest.mark.slow
def test_height_of_a_wall(tmp_path):
    """A declared motion: the wall of the open box stays on the floor and grows."""
    found = derivative(tall_wall(tmp_path), "wall.height", 2**16)
    h, factor = 1e-5, np.cos(np.pi / 4) * 0.5 * WALL
    low, high = (view_of_wall(0.1, 0.2, 0.1 * (1 + s * h)) for s in (-1, 1))
    exact = factor * (high - low) / (2 * h)
    assert abs(found.derivative - exact) < 4 * found.error < 0.008 * exact


RHO, GAP = 0.6, 0.1  # reflectance of the lower one of two parallel plates, and their distance [m]
HOT = 1000.0  # temperature of the upper one [K]


def plates(**of_type):
    """A grey plate, and a hot black one above its side that the sensor does not see into.

    of_type: facet types of `floor` and `plate`.
    """
    triangles = [[0, 1, 2], [0, 2, 3]]
    corners = np.array([[0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    below, above = (of_type.get(name, "model") for name in ("floor", "plate"))
    floor = mesh("floor", corners, triangles, RHO, 3.0, facet_type=below)
    corners = corners[::-1] + [-0.6, 0, GAP]
    above = mesh("plate", corners, triangles, 0.0, HOT, facet_type=above)
    return scene_of(floor, above, max_bounces=1)


def light_of_plate(gap: float) -> float:
    """Intensity that the floor reflects to the sensor [W/sr], by Gauss points on both plates."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x, w = (nodes + 1) / 4, weights / 4
    along = x[:, None] - (x[None, :] - 0.6)
    across = x[:, None] - x[None, :]
    squares = along[:, :, None, None] ** 2 + across**2 + gap**2
    area_factor = np.einsum("ijkl,i,j,k,l->", gap**2 / (np.pi * squares**2), w, w, w, w)
    return RHO * L * (HOT / 300) ** 4 * np.sin(np.radians(20)) * area_factor


@pytest.mark.parametrize("draws", ["auto", False])
def test_plates_that_face_each_other(draws):
    """No reflected ray may flip within the step: then the scatter is 0, and the error is not."""
    scene = plates()
    scene.mi.integrator().emitter_sampling = draws
    found, h = derivative(scene, "plate.z_m", 2**12), 1e-4
    exact = (light_of_plate(GAP + h) - light_of_plate(GAP - h)) / (2 * h)
    assert abs(found.derivative - exact) < 4 * found.error
    assert draws is False or found.error < 0.01 * exact


def test_budget_of_pose():
    """Pose and size in a budget, against draws of the closed form; two renders for each."""
    sigma = {"cube.yaw_deg": 3.0, "cube.size": 0.01}
    scene = scene_of(convex_hull("cube", CUBE))
    with changed(scene, {"cube.yaw_deg": 30.0}):
        budget = mi_lcair.budget(scene, {"sigma": sigma}, spp=256)
    draws = np.random.default_rng(0).normal(size=(10_000, 2))
    values = [cube_intensity(30 + 3 * yaw) * (1 + 0.01 * size) ** 2 for yaw, size in draws]
    assert budget.sigma == pytest.approx(np.std(values), rel=0.03)
    assert budget.renders <= 1 + 2 * len(sigma)
    assert all(check.holds for check in budget.checks)


def test_control_points_of_a_thin_body():
    """The step of a difference is shorter than the body is thick, so that nothing turns over."""
    scene = mi_lcair.load("cylinder_ir_range", resolution=8)
    declare(scene, motions_of({"b.s": {"groups": ["self"], "control_points": 40}}))
    found = derivative(scene, "b.s.0", 2**8)
    assert 0 < found.step < 0.05 and np.isfinite(found.derivative)
