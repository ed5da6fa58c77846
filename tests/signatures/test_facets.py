"""Tests of facet results: sums, geometry in closed form, and standard errors."""

import csv
import re
from math import pi, tan
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from docs.studies.claims.view_factors import to_polygon
from mi_lcair import models3d
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.scene import checked
from mi_lcair.scenes import build_meshes
from mi_lcair.show.pictures.hemispherical_view import places
from mi_lcair.signatures.facets import MAP_PHI, MAP_THETA, NOTHING, frame, hemispherical_view
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import camera

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
GREY = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}


@pytest.fixture
def roof(plate):
    """A floor of 4 m x 4 m, half of it under a sloping roof, above a terrain.

    The terrain fills the rest of the sensor's window of 8 m x 8 m.
    """
    floor = plate(
        "floor", [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], GREY, 300.0, group="floor"
    )
    slope = plate(
        "slope", [[0, -2, 1], [2, -2, 3], [2, 2, 3], [0, 2, 1]], GREY, [350.0, 400.0], group="roof"
    )
    wall = plate(
        "wall", [[-2, -2, 0], [-2, 2, 0], [-2, 2, 3], [-2, -2, 3]], GREY, 320.0, group="wall"
    )
    ground = plate(
        "ground", [[-9, -9, -1], [9, -9, -1], [9, 9, -1], [-9, 9, -1]], GREY, 290.0, group="terrain"
    )
    ground["emitter"]["facet_type"] = "terrain"
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 3},
            "sensor": camera(size=15, height=8.0),
            "floor": floor,
            "slope": slope,
            "wall": wall,
            "ground": ground,
        },
        optimize=False,
    )
    return checked(scene, Path("roof.xml"), {})


@pytest.fixture
def speck(plate):
    """Function (temperature [K], reflections, lights): a plate of 1 cm in a window of 8 m."""

    def scene(temperature, max_bounces, **lights):
        corners = [[0, 0, 0], [0.01, 0, 0], [0.01, 0.01, 0], [0, 0.01, 0]]
        tree = {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": max_bounces},
            "sensor": camera(size=15, height=8.0),
            "speck": plate("speck", corners, GREY, temperature),
            **lights,
        }
        return checked(mi.load_dict(tree), Path("speck.xml"), {})

    return scene


def test_a_facet_that_no_path_meets_has_an_error(speck):
    """A plate of 1 cm, at 400 K, in a window of 8 m: what it sends is not beyond its error.

    The error is that of its projected area at the largest radiance of the scene, not of a path's.
    """
    table = mi_lcair.signature(speck(400.0, 0), spp=1, facets=True).facets.table
    assert not table["samples"].any()
    blackbody = 0.5e-4 * float(in_band_radiance(band("LWIR"), 400.0))  # one of two facets
    assert np.all(1.96 * table["standard_error_W_sr"] >= 0.499 * blackbody)
    assert np.all(1.96 * table["standard_error_W_sr"] <= 1.001 * blackbody)


def test_a_cold_facet_in_the_sun_that_no_path_meets_has_an_error(speck):
    """It emits nothing, and reflects E rho / pi: also the target's interval holds it."""
    sun = {"type": "sun", "azimuth_deg": 0.0, "elevation_deg": 90.0, "band": "LWIR"}
    result = mi_lcair.signature(speck(20.0, 1, sun=sun), spp=1, facets=True)
    irradiance = 1.091  # in LWIR outside the air [W m^-2]
    reflected = 0.5e-4 * 0.5 * irradiance / np.pi  # by one of two facets
    assert not result.facets.table["samples"].any()
    assert np.all(1.96 * result.facets.table["standard_error_W_sr"] >= reflected)
    assert result.target.half_width >= 2 * reflected


def test_a_facet_that_few_paths_meet_may_have_missed_a_source(plate):
    """A triangle of 2 m^2 in a window of 64 m^2 is lit by a small lamp. A black one reflects none.

    The seven or so paths that meet a triangle rarely go on to the lamp.
    """
    square, up = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([0, 0, 1])
    lamp = np.array([[3.0, -0.5, 0], [3.0, 0.5, 0], [3.0, 0.5, 1], [3.0, -0.5, 1]])
    shapes = {
        "grey": plate("grey", square, GREY, 100.0, group="grey"),
        "black": plate("black", square - [0, 2.5, 0], BLACK, 300.0, group="black"),
        "lamp": plate("lamp", lamp[::-1], BLACK, 1000.0),
    }
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 1},
            "sensor": camera(size=15, height=8.0),
            **shapes,
        },
        optimize=False,
    )
    share = to_polygon(square[:3].mean(axis=0)[None], up, lamp)[0]
    lamp_radiance = float(in_band_radiance(band("LWIR"), 1000.0))
    truth = 0.5 * share * 2 * lamp_radiance
    scene, covered = checked(scene, Path("lamp.xml"), {}), 0
    for seed in range(10):
        table = mi_lcair.signature(scene, spp=1, seed=seed, facets=True).facets.table
        errors = by_group(table, "standard_error_W_sr", "grey")
        covered += np.sum(abs(table["intensity_W_sr"][:2] - truth) < 2.4 * errors)
        of_black = by_group(table, "standard_error_W_sr", "black")
        assert np.all(of_black < 0.2 * 64 / 225 * lamp_radiance)  # of one path to the lamp
    assert covered >= 17


def by_group(columns, name, group):
    return columns[name][columns["group"] == group]


@pytest.mark.slow
def test_columns(roof):
    result = mi_lcair.signature(roof, spp=2048, facets=True)
    columns = result.facets.table
    # The table holds the model's facets, not those of the terrain.
    assert list(columns["group"]) == ["floor"] * 2 + ["roof"] * 2 + ["wall"] * 2
    assert columns["intensity_W_sr"].sum() == pytest.approx(result.target.intensity, rel=1e-6)
    np.testing.assert_allclose(by_group(columns, "area_m2", "roof"), 4 * np.sqrt(2), rtol=1e-6)
    np.testing.assert_allclose(by_group(columns, "mean_cosine", "roof"), np.sqrt(0.5), rtol=1e-6)
    # The roof hides one half of the floor. The triangle at (2, -2) keeps a quarter of its area, and
    # the one at (-2, 2) three quarters.
    np.testing.assert_allclose(
        by_group(columns, "visible_fraction", "floor"), [0.25, 0.75], atol=5e-3
    )
    np.testing.assert_allclose(by_group(columns, "visible_fraction", "roof"), 1, atol=5e-3)
    assert np.all(by_group(columns, "visible_fraction", "wall") == 0) and np.all(
        np.isnan(by_group(columns, "radiance_W_m2_sr", "wall"))
    )
    np.testing.assert_allclose(
        by_group(columns, "emitted_W_m2_sr", "roof"),
        0.5 * in_band_radiance(band("LWIR"), np.array([350.0, 400.0])),
        rtol=1e-5,
    )
    np.testing.assert_array_equal(by_group(columns, "temperature_K", "roof"), [350, 400])
    visible = columns["samples"] > 0
    parts = sum(
        values
        for name, values in columns.items()
        if name.startswith(("emitted", "bounce", "closure"))
    )
    np.testing.assert_allclose(parts[visible], columns["radiance_W_m2_sr"][visible], rtol=1e-5)
    np.testing.assert_allclose(
        columns["intensity_W_sr"][visible],
        (
            columns["radiance_W_m2_sr"]
            * columns["area_m2"]
            * columns["mean_cosine"]
            * columns["visible_fraction"]
        )[visible],
        rtol=1e-5,
    )


def test_target_and_scene(roof):
    """The target leaves out the pixels that show terrain, but not the terrain's reflection."""
    result = mi_lcair.signature(roof, spp=256)
    target, scene = result.target, result.scene
    assert set(target.by_seen) == set(scene.by_seen) == {"floor", "roof", "wall", "terrain"}
    assert target.by_seen["terrain"] == 0 and target.by_seen["floor"] == scene.by_seen["floor"] > 0
    assert (
        scene.by_seen["terrain"] > 0 and scene.by_group["terrain"] > target.by_group["terrain"] >= 0
    )
    for part in (target, scene):
        assert sum(part.by_seen.values()) == pytest.approx(part.intensity, rel=1e-5)
        assert sum(part.by_group.values()) == pytest.approx(part.intensity, rel=1e-5)
        assert part.up_to_bounce[-1] == pytest.approx(part.intensity, rel=1e-5)
    assert target.intensity == pytest.approx(
        sum(scene.by_seen[name] for name in ("floor", "roof", "wall")), rel=1e-6
    )
    image = mi_lcair.render(roof, spp=256)
    in_image = image.channels["target.Y"].mean(dtype=float) * result.window_area
    # The image's paths begin elsewhere; its error over the window is at least twice the signature's
    assert in_image == pytest.approx(target.intensity, abs=12 * target.standard_error)


@pytest.mark.slow
def test_standard_errors_are_the_scatter_of_seeds(roof, monkeypatch):
    """Standard errors of facets and target match the scatter of 16 seeds, within 5 sigma.

    The passes cover runs of pixels that do not divide the image evenly.
    """
    monkeypatch.setattr("mi_lcair.rendering.window.PASS_SAMPLES", 600)
    runs = [mi_lcair.signature(roof, spp=16, seed=seed, facets=True) for seed in range(16)]
    values = np.array([run.facets.table["intensity_W_sr"] for run in runs])
    claimed = np.mean([run.facets.table["standard_error_W_sr"] ** 2 for run in runs], axis=0)
    visible = claimed > 0
    np.testing.assert_allclose(
        values.var(axis=0, ddof=1)[visible], claimed[visible], rtol=5 * np.sqrt(2 / 15 + 2 / 16 / 7)
    )
    target = np.array([run.target.intensity for run in runs])
    assert target.var(ddof=1) == pytest.approx(
        np.mean([run.target.standard_error**2 for run in runs]), rel=5 * np.sqrt(2 / 15)
    )


def test_csv(roof, tmp_path):
    result = mi_lcair.signature(roof, spp=16, facets=True)
    result.facets.save(tmp_path / "facets.csv")
    with open(tmp_path / "facets.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["group"] for row in rows] == list(result.facets.table["group"]) and rows[4][
        "radiance_W_m2_sr"
    ] == ""
    np.testing.assert_allclose(
        [float(row["intensity_W_sr"]) for row in rows],
        result.facets.table["intensity_W_sr"],
        rtol=1e-8,
    )


def test_shapes_that_are_no_meshes_and_backs(plate):
    """A sphere has an area; the visible fraction of a plate seen from behind is unknown."""
    grey = {"type": "twosided", "bsdf": GREY}
    emitter = {"type": "thermal", "band": "LWIR", "temperature": 300.0}
    ball = {"type": "sphere", "radius": 0.5, "center": [2, 2, 0], "bsdf": GREY, "emitter": emitter}
    only = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(8, 8.0),
            "ball": ball,
        },
        optimize=False,
    )
    assert mi_lcair.signature(checked(only, Path("x.xml"), {}), spp=4, facets=True).facets.table[
        "area_m2"
    ][0] == pytest.approx(np.pi, rel=1e-6)
    back = plate("back", [[-2, -2, 0], [-2, 2, 0], [2, 2, 0], [2, -2, 0]], grey, 300.0)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(8, 8.0),
            "ball": ball,
            "back": back,
        },
        optimize=False,
    )
    columns = mi_lcair.signature(
        checked(scene, Path("x.xml"), {}), spp=16, facets=True
    ).facets.table
    behind = columns["facet"] >= 0
    behind[[k for k, area in enumerate(columns["area_m2"]) if area < 7]] = False
    assert np.all(np.isnan(columns["visible_fraction"][behind])) and np.all(
        columns["radiance_W_m2_sr"][behind] > 0
    )


def test_backs_of_one_sided_facets_are_not_seen(plate):
    """Two sheets of which one shows its back: it sends nothing, as a facet that is hidden."""
    corners = [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]
    front = plate("front", [[x, y, -1] for x, y, _ in corners], GREY, 300.0)
    back = plate("back", [[x / 2, y / 2, 0] for x, y, _ in corners[::-1]], GREY, 310.0)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(16, 8.0),
            "front": front,
            "back": back,
        },
        optimize=False,
    )
    columns = mi_lcair.signature(
        checked(scene, Path("x.xml"), {}), spp=64, facets=True
    ).facets.table
    behind = columns["temperature_K"] == 310
    for name in ("samples", "visible_fraction", "intensity_W_sr", "mean_cosine"):
        assert np.all(columns[name][behind] == 0), name
        assert np.all(columns[name][~behind] > 0), name
    assert np.all(np.isnan(columns["radiance_W_m2_sr"][behind]))


BOX = """\
v -.5 -.5 0
v .5 -.5 0
v .5 .5 0
v -.5 .5 0
v -.5 -.5 1
v .5 -.5 1
v .5 .5 1
v -.5 .5 1
o f*bare_aluminum*310*sides
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
f 4 3 2 1
o f*gloss_black*330*lid
f 5 6 7 8
"""


@pytest.fixture(scope="module")
def box_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    (folder / "box.obj").write_text(BOX)
    models3d.export(models3d.read(folder / "box.obj"), folder / "box")
    return folder / "box"


def of_box(path, **changes):
    """The facet table of a scene with the box, and the mask of the facets that face away."""
    scene = mi_lcair.load(path, azimuth_deg=30, elevation_deg=30, resolution=64, **changes)
    columns = mi_lcair.signature(scene, spp=16, facets=True).facets.table
    away = columns["mean_cosine"] == 0
    assert away.tolist() == [True, False, False, True, True, False]
    return columns, away


def test_a_closed_box(box_folder):
    """Facets that face away have no samples, and no radiance."""
    columns, away = of_box(box_folder / "scene.xml")
    for name in ("samples", "visible_fraction", "intensity_W_sr", "standard_error_W_sr"):
        assert np.all(columns[name][away] == 0), name
    for name in columns:
        if name.endswith("_W_m2_sr"):
            assert np.all(np.isnan(columns[name][away])), name
            assert np.all(np.isfinite(columns[name][~away])), name


def test_a_closed_box_seen_at_its_edges(box_folder):
    """Rays that pass between the triangles of an outline are no samples of facets behind it.

    The gap is as wide as the rounding of coordinates, 1e-7 of the box. The window shows 0.0002 of
    one edge, so that some of its 65,536 rays pass through the gap.
    """
    text = (box_folder / "scene.xml").read_text()
    text = re.sub(r'<scale x="\S+" y="\S+"/>', '<scale x="1e-4" y="1e-4"/>', text)
    text = re.sub(r"<translate [^>]+/>", '<translate x="0.5" y="-0.5" z="0.5"/>', text)
    (box_folder / "edge.xml").write_text(text)
    columns, away = of_box(box_folder / "edge.xml")
    assert columns["samples"][1] > 30_000
    for name in ("samples", "intensity_W_sr", "standard_error_W_sr"):
        assert np.all(columns[name][away] == 0), name


def test_a_convex_body_with_a_closure(plate):  # noqa: F811
    """Without a second reflection the closure is 0, a constant for Dr.Jit."""
    square = plate("square", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], GREY, 300.0)
    integrator = {"type": "bounce_path", "max_bounces": 2, "closure": "tail"}
    shapes = {"sensor": camera(size=4, height=4.0), "square": square}
    scene = mi.load_dict({"type": "scene", "integrator": integrator, **shapes}, optimize=False)
    result = mi_lcair.signature(scene, spp=16, facets=True)
    assert sum(result.facets.table["intensity_W_sr"]) == pytest.approx(result.intensity, rel=1e-6)


# Tests of hemispherical views: exact view factors, solid angles by quadrature, and the map
# -----------------------------------------------------------------------------------------

# View factors between the walls of a cube (Howell C-11, C-14).
OPPOSITE, ADJACENT = 0.19982489569838746, 0.20004377607540316
CUBE = """<scene version="3.0.0"> <integrator type="bounce_path"/>
    <sensor type="orthographic">
        <film type="hdrfilm"> <string name="pixel_format" value="luminance"/> </film>
    </sensor>
    <shape type="ply"> <string name="filename" value="cube.ply"/>
        <boolean name="face_normals" value="true"/> <bsdf type="diffuse"/>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
        </emitter>
    </shape> {more}
</scene>"""


@pytest.fixture
def cube(tmp_path):
    """A closed room of 2 m; its facets 0 to 5 lie at x = -1, 1, y = -1, 1, z = -1, 1."""

    def load(more=""):
        (tmp_path / "cube.ply").write_bytes(
            build_meshes.ply(*build_meshes.box((2, 2, 2), inward=True))
        )
        (tmp_path / "cube.xml").write_text(CUBE.format(more=more))
        return mi_lcair.load(tmp_path / "cube.xml")

    return load


def factors(view):
    return dict(zip(view.neighbour.tolist(), view.view_factor.tolist()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, facet, other, expected",
    [
        ("two_plates", 0, 1, exact.perpendicular_view_factor(0.1, 0.2, 0.2)),
        ("two_plates", 1, 0, exact.perpendicular_view_factor(0.1, 0.2, 0.2)),
        ("open_box", 0, 1, exact.perpendicular_view_factor(0.2, 0.1, 0.1)),
    ],
)
def test_plates(name, facet, other, expected):
    """View factors of two plates are within 0.5 % (measured: 0.05 %); other rays hit nothing."""
    view = hemispherical_view(mi_lcair.load(name), facet)
    assert view.neighbour.tolist() == [other, NOTHING]
    assert view.view_factor == pytest.approx([expected, 1 - expected], rel=5e-3)
    assert view.view_factor.sum() == pytest.approx(1, abs=1e-3)
    assert view.solid_angle.sum() == pytest.approx(2 * pi, abs=1e-3)


@pytest.mark.slow
def test_closed_cube(cube):
    """View factors and solid angles of a cube's walls are within 0.5 %.

    The exact solid angle is the integral of the cosine at the other wall over the squared distance.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    x, y, u, v = np.meshgrid(*[nodes] * 4, indexing="ij")
    w = np.multiply.outer(np.multiply.outer(weights, weights), np.multiply.outer(weights, weights))
    opposite = np.sum(w * 2 / ((x - u) ** 2 + (y - v) ** 2 + 4) ** 1.5) / 4
    expected = {1: opposite, **dict.fromkeys((2, 3, 4, 5), (2 * pi - opposite) / 4)}

    view = hemispherical_view(cube(), 0)
    assert sorted(view.neighbour[:-1]) == [1, 2, 3, 4, 5] and view.neighbour[-1] == NOTHING
    for number, share in factors(view).items():
        assert share == pytest.approx({1: OPPOSITE, NOTHING: 0}.get(number, ADJACENT), rel=5e-3)
    for number, angle in zip(view.neighbour[:-1].tolist(), view.solid_angle):
        assert angle == pytest.approx(expected[number], rel=5e-3)
    assert view.view_factor.sum() == pytest.approx(
        1, abs=1e-3
    ) and view.solid_angle.sum() == pytest.approx(2 * pi, abs=1e-3)


def test_the_back_of_a_surface_hides_what_is_behind_it(cube):
    """A wall sees little but the back of a plate in front of it."""
    plate = """<shape type="rectangle">
        <transform name="to_world"> <scale value="0.99"/> <translate z="-0.99"/> </transform>
    </shape>"""
    view = hemispherical_view(cube(plate), 4, rays=2**14)
    assert view.facets.count == 7 and view.neighbour[0] == 6 and view.view_factor[0] > 0.97


def test_map_follows_the_thesis_azimuth():
    """The map of two_plates' reflector has the azimuth of the thesis.

    The reflector has its centre at (0.1, 0) and its second vertex at (0.2, -0.05). The middle of
    the emitter, toward -x, therefore lies at the azimuth 180 + atan(1/2) degrees. The emitter's top
    lies there at tan(theta) = 0.1 / 0.2.
    """
    view = hemispherical_view(mi_lcair.load("two_plates"), 0, rays=2**10)
    reference, positive, normal = frame(view.facets, 0)
    np.testing.assert_allclose(reference, np.array([2, -1, 0]) / 5**0.5, atol=1e-6)
    np.testing.assert_allclose(np.cross(reference, positive), normal, atol=1e-12)
    on_emitter = view.map == 1
    columns = np.flatnonzero(on_emitter.any(axis=0))
    phi = (columns + 0.5) / MAP_PHI * 360 - 180
    assert (phi.min(), phi.max()) == (
        pytest.approx(-180, abs=0.3),
        pytest.approx(-180 + 26.565 * 2, abs=0.3),
    )
    top = np.argmax(on_emitter[:, columns[np.argmin(abs(phi + 153.435))]]) / MAP_THETA * pi / 2
    assert tan(top) == pytest.approx(0.5, abs=0.01)
    assert set(np.unique(view.map)) == {NOTHING, 1}


@pytest.mark.slow
def test_map_agrees_with_the_table(cube, tmp_path):
    """The solid angles of the map's pixels add up to those of the table.

    The facet is a tiny tilted plate inside the room.
    """
    plate = build_meshes.rectangle((-5e-4, -5e-4, 0), (1e-3, 0, 0), (0, 1e-3, 0))
    (tmp_path / "plate.ply").write_bytes(build_meshes.ply(*plate))
    view = hemispherical_view(
        cube("""<shape type="ply"> <string name="filename" value="plate.ply"/>
        <boolean name="face_normals" value="true"/> <transform name="to_world">
        <rotate x="0.6" y="0.8" angle="50"/> <translate x="0.3" y="-0.2" z="0.1"/>
        </transform> </shape>"""),
        6,
    )
    edges = np.cos(np.linspace(0, pi / 2, MAP_THETA + 1))
    pixel = np.broadcast_to((edges[:-1] - edges[1:])[:, None] * 2 * pi / MAP_PHI, view.map.shape)
    for number, angle in zip(view.neighbour[:-1].tolist(), view.solid_angle):
        assert pixel[view.map == number].sum() == pytest.approx(angle, abs=2e-3)


@pytest.mark.slow
def test_seed_and_rays(cube):
    scene = cube()
    few = [hemispherical_view(scene, 0, rays=1000, seed=seed) for seed in (1, 1, 2)]
    assert few[0].rays == 1024
    assert factors(few[0]) == factors(few[1]) != factors(few[2])


@pytest.mark.parametrize(
    "facet, reason",
    [
        (6, "facet 6 .* has no normal"),
        (7, "facet 7 .* from 0 to 6"),
        (-1, "facet -1 .* from 0 to 6"),
    ],
)
def test_what_has_no_view(cube, facet, reason):
    scene = cube('<shape type="sphere"> <float name="radius" value="0.1"/> </shape>')
    with pytest.raises(InputError, match=reason):
        hemispherical_view(scene, facet)


@pytest.mark.slow
def test_picture(tmp_path):
    """The number of each facet lies inside its region of the picture."""
    view = hemispherical_view(mi_lcair.load("furnace"), 2, rays=2**12)
    labels = {number: (column, row) for number, column, row in places(view.map)}
    assert {0, 1, 3, 4, 5} <= set(labels)
    for number, (column, row) in labels.items():
        assert view.map[int(row), int(column)] == number
    view.plot(tmp_path / "view.png")
    assert (tmp_path / "view.png").read_bytes().startswith(b"\x89PNG")


def test_json_has_a_row_for_what_escapes():
    table = hemispherical_view(mi_lcair.load("two_plates"), 0, rays=2**10).as_dict()
    assert list(zip(table["columns"]["facet"], table["columns"]["material"])) == [
        (1, "blackbody"),
        (-1, "nothing"),
    ]
    assert table["area_m2"] == pytest.approx(0.02) and table["view_factor"] == 1
