"""Paths that begin on facets bring what the model shows without a reflection, and no more."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.aiming import aim_over_model
from mi_lcair.rendering.facets.starts import (
    HIDDEN,
    in_view,
    meshes_of_model,
    seen_shares,
    starts_on_facets,
)
from mi_lcair.rendering.measurands import IntensityInterval, Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.pilots import best_aim
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.views import View
from mi_lcair.rendering.window import Windows
from mi_lcair.signatures.many_views import windows_of
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
    assert (share["cover"] > 0.99).all() and (share["under"] == HIDDEN).all()
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
        monkeypatch.setattr("mi_lcair.rendering.facets.starts.MOST_STARTS", most)
        assert (starts_on_facets(scene, scene.sensor(0), blackbody(300.0)) is None) == expected


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
