"""Propagation methods against closed forms and against each other.

Each method reproduces a closed form to a stated error. Methods without a common algorithm agree.

One scene is a black room with a floor of some material, all at 300 K. The floor emits less than a
blackbody and reflects the rest after one bounce. Its radiance is therefore the blackbody's, if a
method integrates the whole lobe.
"""

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from benchmarks.methods.propagation import METHODS, exact, path_tracing, problems, quadrature
from benchmarks.methods.propagation.hemisphere_grid import Hemisphere, Peak, Stratified
from benchmarks.methods.propagation.primary import (
    barycentric_middles,
    part_corners,
    part_index,
    visible_points,
)
from benchmarks.methods.propagation.problem import Problem
from benchmarks.methods.propagation.quadrature import plan
from benchmarks.methods.propagation.radiance_maps import radiance_maps
from benchmarks.methods.propagation.radiosity import parts_of, view_factors
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.scene import Scene
from tests.matrix import some_of
from tests.scenes import view_factors as exact_view_factors

BY_NAME = {method.name: method for method in METHODS}
BLACKBODY = {"type": "sandford_robertson", "material": "blackbody", "band": "MWIR"}


def plates(plate, **walls):
    """Shapes of the walls of a unit cube, which face inward.

    walls: "x0", "x1", "y0", ... -> (bsdf, temperature in K).
    """
    shapes = {}
    for name, (bsdf, temperature) in walls.items():
        axis, side = "xyz".index(name[0]), int(name[1])
        u, v = (axis + 1) % 3, (axis + 2) % 3
        corners = np.zeros((4, 3))
        corners[:, axis] = side
        corners[:, u], corners[:, v] = [0, 1, 1, 0], [0, 0, 1, 1]
        shapes[name] = plate(
            name, (corners[::-1] if side else corners).tolist(), bsdf, temperature, band="MWIR"
        )
    return shapes


@pytest.fixture
def plate(tmp_path):
    """plate(name, corners, bsdf, temperature, band) gives a one-sided rectangle as a dictionary."""

    def make(name, corners, bsdf, temperature, band):
        mesh = mi.Mesh(name, 4, 2)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.array(corners, dtype=np.float32).ravel()
        parameters["faces"] = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32)
        parameters.update()
        mesh.write_ply(str(tmp_path / f"{name}.ply"))
        return {
            "type": "ply",
            "filename": str(tmp_path / f"{name}.ply"),
            "face_normals": True,
            "bsdf": bsdf,
            "emitter": {"type": "thermal", "band": band, "temperature": float(temperature)},
        }

    return make


def problem(
    shapes, origin, target, half_width, answer=1.0, bounces=1, points=16, diffuse=True
) -> Problem:
    """A problem with these shapes and a square window."""
    T = mi.ScalarTransform4f
    film = {
        "type": "hdrfilm",
        "width": 1,
        "height": 1,
        "pixel_format": "luminance",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    look = T().look_at(origin=origin, target=target, up=[0.3, 1, 0.2]) @ T().scale(
        [half_width, half_width, 1]
    )
    loaded = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": bounces},
            "sensor": {"type": "orthographic", "to_world": look, "film": film},
            **shapes,
        },
        optimize=False,
    )
    scene = Scene(
        loaded, "test", band("MWIR"), ["self"], {}, [], loaded.sensors(), Path("test.xml")
    )
    return Problem("test", scene, None, bounces, points, diffuse, 300.0, answer, "closed form")


@pytest.fixture
def black_room(plate):
    """black_room(bsdf) gives a room with that floor and black walls, all at 300 K.

    The sensor looks at the floor at 30 degrees from its normal.
    """

    def make(bsdf, **options):
        walls = dict.fromkeys(("x0", "x1", "y0", "y1", "z1"), (BLACKBODY, 300.0))
        expected = float(in_band_radiance(band("MWIR"), 300)) * 0.1**2
        origin, target = [0.75, 0.5, 0.5 * 3**0.5 / 2 + 0.05], [0.5, 0.5, 0.05]
        return problem(
            plates(plate, z0=(bsdf, 300.0), **walls), origin, target, 0.05, expected, **options
        )

    return make


# ---- closed forms

CLOSED_FORMS = [  # method, problem, effort, stated error
    ("quadrature, hemisphere", problems.two_plates, 4**10, 5e-3),
    ("quadrature, hemisphere", problems.open_box, 4**10, 5e-3),
    ("quadrature, stratified", problems.two_plates, 4**10, 1e-2),
    ("quadrature, stratified", problems.open_box, 4**10, 1e-2),
    ("radiosity", problems.two_plates, 4**10, 3e-3),
    ("radiosity", problems.open_box, 4**10, 3e-3),
    ("radiosity", problems.cavity, 4**9, 3e-3),
    ("radiosity, radiance maps", problems.two_plates, 4**9, 5e-3),
    ("radiosity, radiance maps", problems.open_box, 4**9, 5e-3),
    ("radiosity, radiance maps", problems.cavity, 4**9, 5e-3),
    ("radiosity, radiance maps", problems.furnace, 4**9, 5e-3),
    ("lattice points", problems.two_plates, 2**21, 6e-3),
    ("lattice points", problems.cavity, 2**16, 1e-3),
    ("lattice points", problems.furnace, 2**16, 2e-4),
    ("lattice points, emitter sampling", problems.two_plates, 2**21, 3e-3),
    ("lattice points, emitter sampling", problems.cavity, 2**16, 3e-3),
    ("independent points", problems.two_plates, 2**21, 6e-3),
    ("independent points", problems.cavity, 2**16, 1e-3),
    ("independent points, emitter sampling", problems.two_plates, 2**21, 3e-3),
    ("Mitsuba's path", problems.two_plates, 4**10, 6e-3),
    ("Mitsuba's path", problems.open_box, 4**10, 4e-3),
    ("Mitsuba's path", problems.cavity, 4**8, 1e-3),
    ("lattice points, N = 1 and ambient", problems.furnace, 2**16, 2e-4),
    ("lattice points, N = 2 and tail", problems.cavity, 2**17, 1e-3),
]


@pytest.mark.slow
@pytest.mark.parametrize("name, make, effort, error", some_of(CLOSED_FORMS, 2))
def test_closed_form(name, make, effort, error):
    case = make()
    value, rays = BY_NAME[name].run(case, effort, 5)
    assert value == pytest.approx(case.answer, rel=error)
    assert rays > effort / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, effort, error",
    [
        ("mirror, one bounce", 16, 2e-5),
        ("mirror, N bounces", 16, 2e-5),
        ("quadrature, stratified", 4**9, 1e-2),
        ("quadrature, peak only", 4**9, 1e-2),
    ],
)
def test_lobe_in_a_black_room(black_room, name, effort, error):
    """A lobe without a diffuse floor, all of which lies in the peak region.

    The normalized form has HDR = 1 - emissivity.
    """
    lobe = {
        "type": "sandford_robertson",
        "epsilon": 0.2,
        "rho_d": 0.0,
        "b": 0.3,
        "e": 0.005,
        "form": "normalized",
    }
    case = black_room(lobe, diffuse=False)
    assert BY_NAME[name].run(case, effort, 0)[0] == pytest.approx(case.answer, rel=error)


@pytest.mark.slow
def test_single_mirror_bounce_stops_there(plate):
    """Two mirrors face each other.

    With one bounce the radiance is the emission of the first, plus the emission of the second times
    the reflectance of the first (Eq 3.8).
    """
    mirror = {
        "type": "sandford_robertson",
        "epsilon": 0.3,
        "rho_d": 0.0,
        "b": 0.0,
        "e": 0.1,
        "lobe": "mirror",
    }
    case = problem(
        plates(plate, z0=(mirror, 300.0), z1=(mirror, 400.0)),
        [0.5, 0.501, 0.5],
        [0.5, 0.501, 0],
        0.05,
        bounces=3,
    )
    case.scene.mi.integrator().max_bounces = 3
    L_300, L_400 = (float(in_band_radiance(band("MWIR"), T)) for T in (300, 400))
    eps = 1 - float(case.scene.mi.shapes()[0].bsdf().eval_diffuse_reflectance(upward())[0][0])
    rho = 1 - eps
    once, rays = BY_NAME["mirror, one bounce"].run(case, 16, 0)
    assert once == pytest.approx(0.01 * eps * (L_300 + rho * L_400), rel=1e-4)
    thrice, _ = BY_NAME["mirror, N bounces"].run(case, 16, 0)
    assert thrice == pytest.approx(0.01 * eps * (L_300 + rho * L_400) * (1 + rho**2), rel=1e-4)


def upward():
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(0, 0, 1)
    return si


def test_quadrature_by_bounces():
    """The quadrature's bounces are the terms of Eq 3.12.

    In the cavity the radiance after N bounces is 0.5 times the sum of (0.5 (1 - f))^k, k = 0..N.
    """
    case = problems.cavity(16)
    for bounces in (1, 2):
        value, _ = quadrature.intensity(case, Hemisphere(10), bounces, 4)
        limit = exact.cavity_emissivity(16, bounces) / exact.cavity_emissivity(16)
        assert value / case.answer == pytest.approx(limit, rel=1e-2)


# ---- radiosity and path tracing, which have no algorithm in common


@pytest.mark.slow
def test_radiosity_against_path_tracing(plate):
    """They agree within 0.3 % in a closed cube with different walls and on the diffuse scenes."""
    grey = lambda reflectance: {
        "type": "diffuse",
        "reflectance": {"type": "uniform", "value": reflectance},
    }
    walls = {
        "x0": (grey(0.8), 300.0),
        "x1": (grey(0.3), 400.0),
        "y0": (grey(0.6), 350.0),
        "y1": (grey(0.1), 280.0),
        "z0": (grey(0.5), 320.0),
        "z1": (grey(0.7), 300.0),
    }
    cube = problem(plates(plate, **walls), [0.5, 0.5, 0.9], [0.5, 0.5, 0], 0.4, bounces=40)
    cases = ((cube, 2**17), (problems.open_box(), 2**20), (problems.cavity(), 2**17))
    for case, count in cases:
        radiosity, _ = BY_NAME["radiosity"].run(case, 4**10, 1)
        paths, _ = path_tracing.intensity(case, count, 1, emitter_sampling=case.name == "open_box")
        assert radiosity == pytest.approx(paths, rel=3e-3), case.name


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["brdf", "mirror"])
def test_radiance_maps_of_bare_aluminium(lobe):
    """A cylinder whose lobe is narrower than a cell, and an isothermal room in all directions."""
    case = problems.in_range("cylinder", problems.loaded("cylinder_ir_range"), 1024, 2**10)
    for scene in (case.scene, case.independent):
        scene.set_lobe(lobe)
    case = problems.referred(case, 2**18)
    value, _ = BY_NAME["radiosity, radiance maps"].run(case, 4**9, 1)
    assert value == pytest.approx(case.answer, rel=0.01)
    furnace = problems.furnace()
    corners, divisions, _ = parts_of(furnace, 200)
    maps = radiance_maps(furnace, corners, divisions, 4, 1)
    L = in_band_radiance(furnace.scene.band, 300)
    assert np.mean(maps) == pytest.approx(L, rel=0.01)
    assert np.quantile(maps, 0.02) == pytest.approx(L, rel=0.02)


def test_view_factors(plate):
    """Between the walls of the unit cube they agree with Howell's catalogue, C-13 and C-15.

    Rows add up to 1.
    """
    walls = {f"{'xyz'[axis]}{side}": (BLACKBODY, 300.0) for axis, side in exact_view_factors.WALLS}
    case = problem(plates(plate, **walls), [0.5, 0.5, 0.9], [0.5, 0.5, 0], 0.4)
    order = list(walls)
    with case.prepared() as (scene, emitters):
        triangles = case.facets.triangles
        F = view_factors(
            scene, emitters, case.triangles, triangles, np.ones(12, int), 2**16, 0
        ).toarray()
    assert F.sum(axis=1) == pytest.approx(np.ones(12), abs=1e-4)
    centre = case.facets.centre.reshape(6, 2, 3).mean(axis=1)
    axes = np.argmax(abs(centre - 0.5), axis=1)
    wall_of = [f"{'xyz'[axis]}{round(c[axis])}" for axis, c in zip(axes, centre)]
    by_wall = F.reshape(6, 2, 6, 2).sum(axis=3).mean(axis=1)
    place = [wall_of.index(wall) for wall in order]
    assert by_wall[np.ix_(place, place)] == pytest.approx(exact_view_factors.cube(1), abs=2e-3)


# ---- closures


@pytest.mark.slow
@pytest.mark.parametrize("opening", list(exact.CAVITY_BLOCKS))
def test_closures_on_the_cavity(opening):
    """`tail` after two reflections is within 0.2 % of the limit.

    For openings below 0.03 of the sphere, `ambient` at the walls' temperature after one reflection
    is better than four reflections without it.
    """
    case = problems.cavity(opening)
    error = lambda bounces, closure: abs(
        path_tracing.intensity(case, 2**18, 2, bounces, closure=closure)[0] / case.answer - 1
    )
    assert error(2, "tail") < 2e-3
    if exact.cavity_opening_fraction(opening) < 0.03:
        assert error(1, "ambient") < error(4, "none")


def test_independent_points_are_other_numbers():
    """The same scene and seed with another sampler, whose error is larger."""
    case = problems.open_box()
    lattice, independent = (
        [
            path_tracing.intensity(case, 2**14, seed, emitter_sampling=True, sampler=sampler)[0]
            for seed in range(8)
        ]
        for sampler in ("lattice", "independent")
    )
    assert np.std(independent) > 2 * np.std(lattice)


def test_settings_are_put_back():
    case = problems.cavity()
    path_tracing.intensity(case, 4096, 0, 1, emitter_sampling=True, closure="ambient")
    integrator = case.scene.mi.integrator()
    assert (
        integrator.max_bounces,
        integrator.emitter_sampling,
        integrator.closure,
        integrator.ambient_temperature,
    ) == (24, "auto", "none", None)


# ---- points and directions of the deterministic methods


@pytest.mark.parametrize(
    "make, area, error",
    [
        (problems.two_plates, 0.02, 1e-6),
        (problems.open_box, 0.02 * 0.5**0.5, 1e-6),
        (problems.cavity, 0.06**2, 1e-6),
        (problems.furnace, 1.0, 3e-3),
    ],
)
def test_visible_area(make, area, error):
    """The areas add up to the visible area, exactly where no facet is hidden.

    In the furnace bodies hide each other and the room, and together they fill the window.
    """
    case = make()
    points = visible_points(case, 512)
    assert np.sum(points.area.numpy().astype(float)) == pytest.approx(area, rel=error)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_parts_of_a_triangle(n):
    """The parts are equal, and each middle is the mean of its corners.

    `part_index` finds each middle in its own part.
    """
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 3, 0.5]]])
    parts = part_corners(corners, n)
    middles = barycentric_middles(n)
    assert np.allclose(parts.mean(axis=1), middles @ corners[0])
    normals = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
    assert np.allclose(normals, np.cross(corners[0, 1], corners[0, 2]) / n**2)
    assert part_index(mi.Point2f(middles[:, 1:].T), mi.UInt32(n)).numpy().tolist() == list(
        range(n * n)
    )


@pytest.mark.parametrize("theta_deg", [0, 7, 30, 55, 85])
@pytest.mark.parametrize("grid", [Hemisphere(24), Stratified(30, 24)])
def test_grids_cover_the_hemisphere(grid, theta_deg):
    """The weights add up to 2 pi sr, and times the cosine to pi, within 0.3 %."""
    wo, weight = directions(grid, theta_deg)
    assert weight.sum() == pytest.approx(2 * np.pi, rel=3e-3)
    assert (weight * wo[2]).sum() == pytest.approx(np.pi, rel=3e-3)


def test_grids_on_bare_aluminium():
    """At 30 degrees the whole grid gives the plugin's own HDR.

    Outside the peak region the reflectance is 0.02, as in the thesis (Figure 3.20).
    """
    bsdf = mi.load_dict({"type": "sandford_robertson", "material": "bare_aluminum", "band": "MWIR"})
    si = mi.SurfaceInteraction3f()
    si.wi = observer(30)
    HDR = float(bsdf.eval_diffuse_reflectance(si)[0][0])

    def integral(grid):
        wo, weight = directions(grid, 30)
        return np.sum(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo))[0].numpy() * weight)

    assert integral(Stratified(161, 60)) == pytest.approx(HDR, rel=3e-3)
    assert HDR - integral(Peak(161)) == pytest.approx(0.02, abs=0.005)


def observer(theta_deg):
    theta = np.radians(theta_deg)
    return mi.Vector3f(
        *map(float, (np.sin(theta) * np.cos(0.4), np.sin(theta) * np.sin(0.4), np.cos(theta)))
    )


def directions(grid, theta_deg):
    wo, weight = grid.direction(dr.arange(mi.UInt32, grid.cells), observer(theta_deg))
    return wo.numpy().astype(float), np.broadcast_to(weight.numpy().astype(float), grid.cells)


def test_plan_keeps_to_its_budget():
    """The plan has at least the cells asked for and no more rays than the budget.

    One more bounce would not fit into the budget.
    """
    case = problems.cavity()
    for budget in (4**6, 4**8, 4**11):
        bounces, points, cells = plan(case, budget, 32)
        assert cells >= 31 and points * cells**bounces <= 1.1 * budget
        assert case.points * 32 ** (bounces + 1) > budget
