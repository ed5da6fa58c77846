"""Paths that begin on facets bring what the model shows without a reflection, and no more."""

from dataclasses import replace

import meshio
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.triangles import ABSENT
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.rendering.facets import (
    FacetPolygons,
    FacetTable,
    in_view,
    meshes_of_model,
    mixed_choice,
    model_of,
    seen_shares,
    starts_on_facets,
)
from mi_lcair.rendering.measurands import IntensityInterval, Measurands
from mi_lcair.rendering.measure import aim_over_model, best_aim, measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.views import View
from mi_lcair.rendering.window import Windows
from mi_lcair.signatures.view_areas import windows_of
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import blackbody, camera

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
MEASURANDS = Measurands.of("target")


def square(half, z, x=0.0):
    return [[x + half * a, half * b, z] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def scene_of(shapes, sampling=False, max_bounces=2, height=2.0, origin=(0, 0, 3), **clips):
    integrator = {
        "type": "bounce_path",
        "max_bounces": max_bounces,
        "emitter_sampling": sampling,
    }
    sensor = {**camera(8, height, origin=origin), "sampler": {"type": "lattice"}, **clips}
    parts = {"type": "scene", "integrator": integrator, "sensor": sensor, **shapes}
    return load(mi.load_dict(parts, optimize=False))


def with_starts(scene, every=1):
    starts = starts_on_facets(scene, scene.sensor(0), blackbody(3000.0))
    return replace(Aim.anywhere(), direct=replace(starts, every=every))


def totals(scene, aim, paths=2**14, seed=0):
    windows = Windows.whole(scene.sensor(0))
    return measure(scene, windows, Sampling(paths=paths, seed=seed), MEASURANDS, aim=aim)


def room_of_plates(plate, sampling):
    """A floor that is not the model, a plume, a hot surface and one that reflects."""
    shapes = {
        "terrain": plate("terrain", square(0.9, -0.5), BLACK, 280.0, group="terrain"),
        "grey": plate("grey", square(0.5, 0.0), {"type": "diffuse"}, 300.0, group="grey"),
        "hot": plate("hot", square(0.2, 0.6, 0.5)[::-1], BLACK, 600.0, group="hot"),
        "gas": plate("gas", square(0.3, 1.0, 0.2), {"type": "plume", "transmittance": 0.6}, 400.0),
    }
    shapes["terrain"]["emitter"]["facet_type"] = "terrain"
    return scene_of(shapes, sampling)


@pytest.mark.parametrize("sampling, every", [(False, 8), (True, 1)])
def test_the_parts_add_up_to_the_whole(plate, sampling, every):
    """In every channel, also where fewer paths begin on facets."""
    scene = room_of_plates(plate, sampling)
    whole, split = totals(scene, None, 2**16), totals(scene, with_starts(scene, every), 2**16)
    assert split.sums.keys() == whole.sums.keys() and (split.paths == whole.paths).all()
    for name in (None, *whole.sums):
        error = np.hypot(whole.scatter_error(name), split.scatter_error(name))
        change = np.abs(split.mean(name) - whole.mean(name))
        assert change[0] <= 6 * error[0] + 1e-5 * whole.mean(name)[0], name


def test_what_is_seen(plate):
    """A cover hides half of the lower triangle of a plate, from above; a speck is below a cell."""
    shapes = {
        "a": plate("a", square(0.6, 0.0), BLACK, 300.0),
        "cover": plate("cover", np.array(square(0.3, 0.5)) + [0.3, -0.3, 0], BLACK, 300.0),
        "under": plate("under", square(0.2, -0.5), BLACK, 300.0),
        "back": plate("back", square(0.1, 0.6, -0.8)[::-1], BLACK, 300.0),
        "speck": plate("speck", square(1e-4, 0.6, -0.3), BLACK, 300.0),
    }
    scene = scene_of(shapes)
    _, area = in_view(meshes_of_model(scene), scene.sensor(0))
    halves = {"a": 0.6, "cover": 0.3, "under": 0.2, "back": 0.0, "speck": 1e-4}
    names = [mesh.id() for mesh in meshes_of_model(scene)]
    expected = [halves[name] ** 2 / 2 for name in names for _ in range(2)]
    np.testing.assert_allclose(area[0], expected, rtol=1e-3)
    share = dict(zip(names, seen_shares(scene, scene.sensor(0), area)[0].reshape(-1, 2)))
    np.testing.assert_allclose(share["a"], [0.5, 1], atol=0.01)
    assert (share["cover"] > 0.99).all() and (share["under"] == 0.1).all()
    np.testing.assert_allclose(share["speck"], 0.5 / 0.505, atol=0.003)


def test_views_have_starts_of_their_own(plate):
    """The parts of each view, where the aim of another view would miss the hot plate."""
    scene = room_of_plates(plate, False)
    views = [View(azimuth, elevation) for azimuth, elevation in ((0, 90), (20, 60), (200, 35))]
    windows, _ = windows_of(scene, views, 8)
    starts = replace(starts_on_facets(scene, windows.sensor, blackbody(600.0)), every=5)
    aims = None, replace(aim_over_model(scene, windows.sensor, True), direct=starts)
    sampling, measurands = Sampling(paths=2**15), Measurands.of("model")
    whole, split = (measure(scene, windows, sampling, measurands, aim=aim) for aim in aims)
    assert split.sums.keys() == whole.sums.keys()
    for name in whole.sums:
        error = np.hypot(whole.scatter_error(name), split.scatter_error(name))
        change = np.abs(split.mean(name) - whole.mean(name))
        assert (change <= 6 * error + 1e-5 * whole.mean(name)).all(), name


@pytest.mark.parametrize("distance, height", [(1.0, 600.0), (1000.0, 0.2), (1.0, 3e4)])
@pytest.mark.parametrize("angle_deg", [0.5, 5])
def test_slivers(plate, distance, height, angle_deg):
    """A plate of 10 cm nearly edge-on: in a window of up to 3e5 of its sides, or from 1 km."""
    angle = np.radians(angle_deg)
    origin = distance * np.array([np.cos(angle), 0, np.sin(angle)])
    hot = {"hot": plate("hot", square(0.05, 0.0), BLACK, 600.0)}
    scene = scene_of(hot, max_bounces=0, height=height, origin=origin)
    intensity = totals(scene, with_starts(scene)).mean("target")[0] * height**2
    assert intensity == pytest.approx(0.1**2 * np.sin(angle) * blackbody(600.0), rel=3e-5)


@pytest.mark.parametrize("distance, cover", [(100, 80.0), (2, 1.9)])
def test_what_hides_the_model_from_a_distant_sensor(plate, distance, cover):
    """A cover that is not the model, farther away than its size, hides half of a plate."""
    shapes = {
        "hot": plate("hot", square(0.5, 0.0), BLACK, 600.0),
        "cover": plate("cover", square(0.5, cover, 0.5), BLACK, 300.0, group="terrain"),
    }
    shapes["cover"]["emitter"]["facet_type"] = "terrain"
    scene = scene_of(shapes, max_bounces=0, origin=(0, 0, distance))
    total = totals(scene, starts_on_facets(scene, scene.sensor(0), blackbody(600.0)))
    assert total.mean("target")[0] == pytest.approx(blackbody(600.0) / 8, rel=2e-3)
    range_m = total.mean("target.range")[0] / total.mean("target.hit")[0]
    assert range_m == pytest.approx(distance - 0.01)  # from the plane at which rays start


@pytest.mark.parametrize("clips", [{"far_clip": 49.0}, {"near_clip": 51.0}])
def test_what_a_sensor_clips(plate, clips):
    hot = {"hot": plate("hot", square(0.5, 0.0), BLACK, 600.0)}
    scene = scene_of(hot, max_bounces=0, origin=(0, 0, 50), **clips)
    total = totals(scene, starts_on_facets(scene, scene.sensor(0), blackbody(600.0)))
    assert total.mean("target")[0] == 0


def test_too_many_triangles_have_no_starts(plate, monkeypatch):
    scene = scene_of({"a": plate("a", square(0.6, 0.0), BLACK, 300.0)})
    for most, expected in ((2, False), (1, True)):
        monkeypatch.setattr("mi_lcair.rendering.facets.MOST_STARTS", most)
        assert (starts_on_facets(scene, scene.sensor(0), blackbody(300.0)) is None) == expected


def test_starts_are_those_of_all_views(plate, monkeypatch):
    """Two triangles in three views are six starts."""
    scene = scene_of({"a": plate("a", square(0.6, 0.0), BLACK, 300.0)})
    windows, _ = windows_of(scene, [View(angle, 60) for angle in (0, 20, 40)], 8)
    for most, expected in ((6, False), (5, True)):
        monkeypatch.setattr("mi_lcair.rendering.facets.MOST_STARTS", most)
        assert (starts_on_facets(scene, windows.sensor, blackbody(300.0)) is None) == expected


@pytest.mark.parametrize("transmittance", [None, 0.6])
def test_starts_follow_what_facets_bring(plate, transmittance):
    """Every draw then brings the same: area times radiance of all, in parts of the window's area.

    A plume may also pass what is as bright as the brightest source.
    """
    hot = BLACK if transmittance is None else {"type": "plume", "transmittance": transmittance}
    shapes = {
        "cold": plate("cold", square(0.3, 0.0, -0.5), BLACK, 300.0),
        "hot": plate("hot", square(0.1, 0.0, 0.5), hot, 600.0),
    }
    scene, brightest = scene_of(shapes), blackbody(900.0)
    starts = starts_on_facets(scene, scene.sensor(0), brightest)
    of_hot = blackbody(600.0) + (0.0 if transmittance is None else brightest)
    total = 0.3**2 * blackbody(300.0) + 0.1**2 * of_hot
    assert starts.largest_direct == pytest.approx(total, rel=0.02)
    assert starts.largest_weight == pytest.approx(total / blackbody(300.0), rel=0.02)


def test_triangles_are_drawn_by_shares_of_parts():
    """Half of the paths follow 1 : 3, a quarter 1 : 1, and a part of zeros gets none."""
    parts = np.array([[1.0, 3.0], [0.0, 0.0], [2.0, 2.0]])
    found = mixed_choice((0.5, 0.25, 0.25), parts).probability
    np.testing.assert_allclose(found, [1 / 3, 2 / 3], rtol=1e-8)
    assert mixed_choice((0.5, 0.5), np.zeros((2, 4))).probability.tolist() == [0.25] * 4


@pytest.mark.parametrize("every", [1, 8])
def test_intervals_of_black_plates_hold(plate, every):
    """A speck of 3e-6 of the window makes two thirds of the intensity, and is never missed."""
    half = np.sqrt(3e-6)
    shapes = {
        "plate": plate("plate", square(0.6, 0.0), BLACK, 250.0),
        "speck": plate("speck", square(half, 0.5), BLACK, 3000.0),
    }
    scene = scene_of(shapes, max_bounces=0)
    cold, hot = blackbody(250.0), blackbody(3000.0)
    exact = 0.36 * cold + half**2 * (hot - cold)
    errors, widths = [], []
    for seed in range(20):
        total = totals(scene, with_starts(scene, every), 2**10 * every, seed)
        errors.append(total.mean("target")[0] / exact - 1)
        widths.append(total.half_width("target")[0] / exact)
    held = np.mean(np.abs(errors) <= widths)
    assert held >= 0.9 and np.abs(errors).max() < 0.03
    assert min(widths) > 0


def test_rays_to_facets_may_be_few(plate):
    """Rounds of 48, 16 and 2 points with a ray for every 8th, and at least one: 6, 2 and 1."""
    starts = with_starts(scene_of({"a": plate("a", square(0.6, 0.0), BLACK, 300.0)}), 8)
    first, points = zip(
        *(
            (direct.first_point, direct.points)
            for begin, more in ((0, 48), (48, 16), (64, 2))
            for direct in [Launch(1, 1, 3, 8, more, begin, aim=starts).split()[1]]
        )
    )
    assert first == (0, 6, 8) and points == (6, 2, 1)


def test_what_few_rays_to_facets_may_miss(plate):
    """A facet that 2.5 of a quarter of the rays meet adds four times as much as one of all."""
    scene = scene_of({"a": plate("a", square(0.6, 0.0), BLACK, 300.0)}, max_bounces=0)
    missed = [totals(scene, with_starts(scene, every), 2**10).missed("target") for every in (1, 4)]
    assert missed[0] > 0 and missed[1] == pytest.approx(4 * missed[0], rel=1e-3)


def test_paths_that_bring_both_parts_are_kept_where_they_have_no_noise(plate):
    """An isothermal closed box: emission and reflections add up to a constant."""
    box = {
        "type": "cube",
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}},
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
    }
    scene = scene_of({"box": {**box, "to_world": mi.ScalarTransform4f().scale([2, 2, 5])}})
    windows = replace(Windows.whole(scene.sensor(0)), may_follow_facets=True)
    with scene.prepared(binning=MEASURANDS.binning(0.01)) as tracer:
        plan = scene, tracer, windows, Sampling(tolerance=0.01), MEASURANDS
        assert best_aim(*plan, IntensityInterval(0.01)).direct is None


# Facets are numbered as their models number them, described as the scene does, and recognised when
# ------------------------------------------------------------------------------------------------
# a ray meets them.

SCENE = """<scene version="3.0.0"> <integrator type="bounce_path"/> \
<sensor type="orthographic"/> {shapes} </scene>"""
PLY = """<shape type="ply" id="{id}"> <string name="filename" value="{file}"/> \
<boolean name="face_normals" value="true"/>
    {extra} <bsdf type="sandford_robertson"> <string name="material" value="{material}"/> \
<string name="band" value="LWIR"/> </bsdf>
    <emitter type="thermal"> \
<string name="band" value="LWIR"/> {temperature} <string name="group" value="{group}"/> </emitter>
</shape>"""
PER_FACE = (
    '<texture type="mesh_attribute" name="temperature"> '
    '<string name="name" value="face_temperature"/> </texture>'
)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


def write_mesh(path, vertices, faces, **attributes):
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(np.ravel(vertices).astype(np.float32))
    parameters["faces"] = mi.UInt32(np.ravel(faces).astype(np.uint32))
    parameters.update()
    for name, values in attributes.items():
        mesh.add_attribute(f"face_{name}", 1, np.asarray(values, dtype=np.float32))
    mesh.write_ply(str(path))
    return path


@pytest.fixture
def table(tmp_path):
    def load(*shapes):
        (tmp_path / "scene.xml").write_text(SCENE.format(shapes="".join(shapes)))
        scene = mi_lcair.load(tmp_path / "scene.xml")
        return scene, FacetTable(scene)

    return load


def ply(
    file,
    id="",
    material="blackbody",
    temperature='<float name="temperature" value="300"/>',
    group="self",
    extra="",
):
    return PLY.format(
        id=id, file=file, material=material, temperature=temperature, group=group, extra=extra
    )


@pytest.fixture
def model(tmp_path):
    """A model of two parts whose facets interleave: 0 and 3 (two triangles) in one, 1 in the other;
    no facet 2.
    """
    write_mesh(
        tmp_path / "a.ply",
        np.concatenate([SQUARE, SQUARE + [2, 0, 0]]),
        [[0, 1, 2], [0, 2, 3], [4, 5, 6]],
        facet=[3, 3, 0],
        temperature=[310, 310, 290],
    )
    write_mesh(tmp_path / "b.ply", SQUARE + [0, 0, 5], [[0, 2, 1]], facet=[1], temperature=[400])
    return [
        ply("a.ply", "plane.f_gloss_black", "gloss_black", PER_FACE),
        ply("b.ply", "plane.f_blackbody_4.5deg", "blackbody", PER_FACE, group="hot"),
    ]


def test_parts_of_a_model_share_its_numbers(table, model):
    """Also with another shape between them; what follows starts after the model's last number."""
    between = '<shape type="sphere"> <point name="center" x="20" y="0" z="0"/> </shape>'
    _, facets = table(model[0], between, model[1])
    assert facets.count == 5
    assert facets.shape_index.tolist() == [0, 2, -1, 0, 1]
    assert facets.material.tolist() == [
        "gloss_black",
        "blackbody",
        "",
        "gloss_black",
        "SmoothDiffuse",
    ]
    assert facets.group.tolist() == ["self", "hot", "other", "self", "other"]
    assert facets.type.tolist() == ["model"] * 5
    np.testing.assert_array_equal(facets.temperature, [290, 400, np.nan, 310, np.nan])
    np.testing.assert_allclose(facets.area, [0.5, 0.5, 0, 1, 4 * np.pi], rtol=1e-6)
    np.testing.assert_allclose(facets.normal[[0, 1, 3]], [[0, 0, 1], [0, 0, -1], [0, 0, 1]])
    np.testing.assert_allclose(
        facets.centre[[0, 1, 3]],
        [[2 + 2 / 3, 1 / 3, 0], [2 / 3, 1 / 3, 5], [0.5, 0.5, 0]],
        rtol=1e-6,
    )
    assert np.isnan(facets.normal[[2, 4]]).all() and np.isnan(facets.centre[[2, 4]]).all()
    assert facets.triangles.shape == (4, 3, 3) and facets.triangle_facet.tolist() == [3, 3, 0, 1]
    np.testing.assert_allclose(facets.triangles[3], [[0, 0, 5], [1, 1, 5], [1, 0, 5]])


def test_facets_as_a_model(table, model):
    """Facets 0, 1 and 3 with one, one and two triangles, whose labels come in their order."""
    scene, facets = table(*model)
    found = model_of(scene)
    assert found.first.tolist() == [0, 3, 6, 12] and found.triangle_facet.tolist() == [2, 2, 0, 1]
    assert found.temperature.tolist() == [290, 400, 310] and found.label.tolist() == [0, 1, 0]
    kinds = [(label.type, label.material, label.group) for label in found.labels]
    assert kinds == [("f", "gloss_black", "self"), ("f", "blackbody", "hot")]
    np.testing.assert_array_equal(found.vertices[found.triangles], facets.triangles)
    corners = found.vertices[found.corners].reshape(-1, 3, 3)
    np.testing.assert_array_equal(corners, facets.triangles[[2, 3, 0, 1]])
    assert found.off_plane.tolist() == [0, 0, 0]


def test_a_ray_meets_the_facet_that_lies_there(table, model):
    scene, facets = table(
        *model,
        '<shape type="rectangle"> <transform name="to_world"> '
        '<translate x="-5"/> </transform> </shape>',
    )
    x = [0.2, 0.8, 2.8, 0.8, -5.5, -4.5, 9]
    y = [0.8, 0.2, 0.2, 0.2, 0.5, -0.5, 0]
    z = [1, 1, 1, 9, 1, 1, 1]
    si = scene.mi.ray_intersect(mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(0, 0, -1)))
    assert facets.number(si.shape, si.prim_index).numpy().tolist() == [3, 3, 0, 1, 4, 4, ABSENT]
    masked = facets.number(
        si.shape, si.prim_index, mi.Bool([False, True, True, True, True, True, True])
    )
    assert masked.numpy().tolist() == [ABSENT, 3, 0, 1, 4, 4, ABSENT]


def test_a_shape_that_is_no_mesh_is_one_facet(table, tmp_path):
    """Also a curve, whose hits tell its segments apart."""
    (tmp_path / "curve.txt").write_text("".join(f"{x} 0 0 0.1\n" for x in range(6)))
    write_mesh(tmp_path / "a.ply", SQUARE + [9, 0, 0], [[0, 1, 2], [0, 2, 3]])
    curve = '<shape type="bsplinecurve"> <string name="filename" value="curve.txt"/> </shape>'
    scene, facets = table(curve, ply("a.ply"))
    si = scene.mi.ray_intersect(
        mi.Ray3f(mi.Point3f([1.5, 3.5, 9.2], [0, 0, 0.8], 1), mi.Vector3f(0, 0, -1))
    )
    assert si.prim_index.numpy()[1] > 0
    assert facets.number(si.shape, si.prim_index).numpy().tolist() == [0, 0, 2]
    np.testing.assert_array_equal(facets.area, [np.nan, 0.5, 0.5])


def test_numbering_and_rays_agree_everywhere(table):
    """From each facet's centre a ray starts along its normal and comes back: it meets that facet.
    (Furnace's slabs share one mesh, turned by the scene.)
    """
    scene = mi_lcair.load("furnace")
    facets = FacetTable(scene)
    assert facets.count == 6 + 400 + 6 + 6
    start = mi.Point3f((facets.centre + 1e-3 * facets.normal).T)
    si = scene.mi.ray_intersect(mi.Ray3f(start, mi.Vector3f(-facets.normal.T)))
    assert np.array_equal(facets.number(si.shape, si.prim_index).numpy(), np.arange(facets.count))
    np.testing.assert_allclose(si.n.numpy().T, facets.normal, atol=1e-5)


def test_a_mesh_without_facets_has_one_per_triangle(table, tmp_path):
    """And each such mesh numbers for itself, whatever its name; `facet_type` need not be given."""
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], temperature=[300, 310])
    _, facets = table(ply("a.ply", "plane.left", temperature=PER_FACE), ply("a.ply", "plane.right"))
    assert facets.temperature.tolist() == [300, 310, 300, 300]
    assert facets.shape_index.tolist() == [0, 0, 1, 1]


def test_flipped_normals(table, tmp_path):
    """The normal is that of the reflecting side; the triangles run anticlockwise about it."""
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2]])
    _, facets = table(ply("a.ply", extra='<boolean name="flip_normals" value="true"/>'))
    np.testing.assert_allclose(facets.normal, [[0, 0, -1]])


def test_a_source_that_is_no_blackbody_has_no_temperature(table, tmp_path):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2]])
    _, facets = table(ply("a.ply"), ply("a.ply", temperature='<float name="radiance" value="3"/>'))
    np.testing.assert_array_equal(facets.temperature, [300, np.nan])


@pytest.mark.parametrize(
    "attributes, reason",
    [
        ({"facet": [0, 0], "temperature": [300, 310]}, "different temperatures, 300 to 310 K"),
        ({"facet": [0, 0.5], "temperature": [300, 300]}, "face_facet = 0.5"),
        ({"facet": [-1, 0], "temperature": [300, 300]}, "face_facet = -1"),
    ],
)
def test_unsound_facets_are_refused(table, tmp_path, attributes, reason):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], **attributes)
    with pytest.raises(InputError, match=reason):
        table(ply("a.ply", "plane.f", temperature=PER_FACE))


def test_a_facet_in_two_parts_is_refused(table, tmp_path):
    write_mesh(tmp_path / "a.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], facet=[0, 7])
    write_mesh(tmp_path / "b.ply", SQUARE, [[0, 1, 2], [0, 2, 3]], facet=[7, 1])
    with pytest.raises(InputError, match="'plane.a' and 'plane.b' both have facet 7"):
        table(ply("a.ply", "plane.a"), ply("b.ply", "plane.b"))


PATHS = {"type": "bounce_path"}


def test_a_scene_of_a_sky_alone():
    """It has no facets, and an intensity, toward whose error no paths can be aimed."""
    film = {"type": "hdrfilm", "pixel_format": "luminance"}
    sensor, sky = {"type": "orthographic", "film": film}, {"type": "sky", "band": "LWIR"}
    scene = mi.load_dict({"type": "scene", "path": PATHS, "sensor": sensor, "sky": sky})
    with pytest.raises(InputError, match="has no shapes, and therefore no facets"):
        mi_lcair.exchange(scene)
    result = mi_lcair.signature(scene, tolerance=1e-5, max_spp=1)
    assert result.intensity > 0
    assert not result.reached


def test_a_curve_whose_area_is_unknown_has_parameters(tmp_path):
    (tmp_path / "curve.txt").write_text("0 0 0 0.1\n0 0 1 0.1\n")
    emitter = {"type": "thermal", "band": "LWIR", "temperature": 320.0}
    curve = {"type": "linearcurve", "filename": str(tmp_path / "curve.txt"), "emitter": emitter}
    sensor = {"type": "orthographic"}
    scene = mi.load_dict({"type": "scene", "path": PATHS, "sensor": sensor, "curve": curve})
    assert mi_lcair.parameters(scene)["self.temperature"].value == 320


# Outlines of facets: areas by independent formulas, and what has no single outline
# ---------------------------------------------------------------------------------


def newell(points) -> float:
    """Area of a planar polygon, by Newell's formula."""
    points = points - points[0]
    return np.linalg.norm(sum(np.cross(a, b) for a, b in zip(points, np.roll(points, -1, 0)))) / 2


def triangles_of(*polygons):
    """Triangles of fans, and the number of the polygon of each."""
    found = [
        (k, [polygon[0], polygon[i], polygon[i + 1]])
        for k, polygon in enumerate(polygons)
        for i in range(1, len(polygon) - 1)
    ]
    return np.array([t for _, t in found], float), np.array([k for k, _ in found])


def test_polygons_come_back():
    square = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    arrow = [[0, 0, 1], [3, -2, 1], [1, 0, 1], [3, 2, 1]]  # concave; the fan about its first corner
    single = [[5, 0, 0], [6, 0, 0], [5, 0, 1]]
    found = FacetPolygons.of(*triangles_of(square, arrow, single))
    assert found.facet.tolist() == [0, 1, 2] and [len(face) for face in found.faces] == [4, 4, 3]
    for polygon, face in zip((square, arrow, single), found.faces):
        points = found.vertices[face]
        assert newell(points) == pytest.approx(newell(np.array(polygon, float)), rel=1e-12)
        start = points.tolist().index(polygon[0])  # the same corners in the same order
        assert np.roll(points, -start, axis=0).tolist() == polygon


def test_a_warped_quadrilateral_keeps_its_triangles_as_a_fan():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0]], float)
    triangles = points[[[1, 2, 3], [1, 3, 0]]]  # a fan about corner 1
    found = FacetPolygons.of(triangles, np.zeros(2, int))
    assert len(found.faces) == 1 and found.vertices[found.faces[0][0]].tolist() in (
        points[[1, 3]].tolist()
    )


@pytest.mark.parametrize("scale", [1, 1e-4])
@pytest.mark.parametrize("case", ["hole", "apart", "strip"])
def test_what_has_no_single_outline_stays_triangles(case, scale):
    if case == "hole":
        outer = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0]], float)
        inner = outer / 3 + [1, 1, 0]
        triangles = np.array(
            [
                t
                for k in range(4)
                for t in (
                    [outer[k], outer[(k + 1) % 4], inner[k]],
                    [outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]],
                )
            ]
        )
    elif case == "apart":
        one = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
        triangles = np.stack([one, one + 5])
    else:  # three squares of a channel, which no fan covers
        points = np.array([[x, y, z] for x, z in ((0, 0), (1, 0), (1, 1), (0, 1)) for y in (0, 1)])
        corners = [c for k in (0, 2, 4) for c in ([k, k + 2, k + 1], [k + 2, k + 3, k + 1])]
        triangles = points[corners].astype(float)
    triangles = scale * triangles
    found = FacetPolygons.of(triangles, np.zeros(len(triangles), int))
    assert len(found.faces) == len(triangles)
    areas = sum(newell(found.vertices[face]) for face in found.faces)
    assert areas == pytest.approx(sum(map(newell, triangles)), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a340_landing", "cylinder_ir_range", "cavity"])
def test_areas_of_bundled_scenes(name):
    table = FacetTable(mi_lcair.load(name))
    found = FacetPolygons.of(table.triangles, table.triangle_facet)
    areas = np.zeros(table.count)
    for face, facet in zip(found.faces, found.facet):
        fan = found.vertices[face]
        areas[facet] += sum(newell(fan[[0, k, k + 1]]) for k in range(1, len(fan) - 1))
    np.testing.assert_allclose(areas, table.area, rtol=1e-6)
    assert len(found.faces) < 1.01 * table.count


def test_nothing(tmp_path):
    found = FacetPolygons.of(np.zeros((0, 3, 3)), np.zeros(0, int))
    assert not found.faces
    found.write(tmp_path / "a.vtu", {"facet": np.zeros(0, int)})
    assert 'NumberOfCells="0"' in (tmp_path / "a.vtu").read_text()


def test_facets_of_a_table_are_written(tmp_path):
    """The rows in any order; facet 7 has no row, and facet 9 no polygon."""
    triangles = np.arange(4)[:, None, None] + SQUARE[:3]
    found = FacetPolygons.of(triangles, np.array([5, 7, 0, 5]))
    columns = {"facet": np.array([9, 5, 0]), "range_m": np.array([9.5, 5.5, 0.5])}
    found.write(tmp_path / "a.vtu", columns)
    mesh = meshio.read(tmp_path / "a.vtu")
    assert mesh.cell_data["facet"][0].tolist() == [0, 5, 5]
    assert mesh.cell_data["range_m"][0].tolist() == [0.5, 5.5, 5.5]
    corners = mesh.points[mesh.cells[0].data]
    np.testing.assert_array_equal(corners, triangles[[2, 0, 3]])
