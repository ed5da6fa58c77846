"""Tests of plans: known best settings, the error bound, and that the scene is unchanged."""

from dataclasses import replace
from math import inf
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.benchmark.propagation import exact
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.reflection.interface import Rung
from mi_lcair.planning.lobes import rungs
from mi_lcair.planning.probe import Settings, pixels_launch
from mi_lcair.rendering.scene import checked
from mi_lcair.rendering.settings import changed
from tests.plugins.conftest import corner, plate  # noqa: F401, fixtures
from tests.plugins.small_scenes import SQUARE, camera
from tests.scenes.view_factors import WALLS


@pytest.mark.slow
def test_diffuse_plates_need_no_lobe_and_one_reflection():
    """`diffuse` is exact for a diffuse reflector and a blackbody.

    Emitter sampling is cheaper here, although the scene switches it off. Its cost is 0.3 to 0.57 of
    the other one by probes of five seeds, and must be below 0.53 to be adopted.
    """
    plan = mi_lcair.plan(
        mi_lcair.load("two_plates", resolution=32, max_bounces=4, emitter_sampling="false"),
        renders=inf,
        seed=1,
    )
    assert (
        set(plan.lobe.values()) == {"diffuse"} and plan.max_bounces == 1 and plan.closure == "none"
    )
    assert plan.emitter_sampling and plan.left_out == []


@pytest.mark.slow
def test_a_furnace_does_not_sample_its_emitters():
    scene = mi_lcair.load("furnace", resolution=16, emitter_sampling="true")
    plan = mi_lcair.plan(scene, renders=inf)
    assert not plan.emitter_sampling and plan.lobe["bare_aluminum"] == "mirror"


@pytest.mark.slow
def test_gloss_black_in_the_range_needs_a_mirror_and_two_reflections():
    scene = mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=64)
    plan = mi_lcair.plan(scene, renders=inf)
    assert (
        plan.lobe == {"gloss_black": "mirror", "ir_range_wall": "diffuse"} and plan.max_bounces <= 2
    )
    assert any("gloss_black, taken as mirror" in sentence for sentence in plan.left_out)


@pytest.mark.slow
def test_a_broad_lobe_is_kept(corner):
    """e = 0.15 beside a hot wall: a mirror would change each pixel and their mean."""
    scene = checked(
        corner(
            {"type": "bounce_path", "max_bounces": 4},
            {"epsilon": 0.1, "rho_d": 0.02, "b": 0.1, "e": 0.15},
            floor_temperature=300.0,
        ),
        Path("corner.xml"),
        {},
    )
    for each_pixel in (False, True):
        assert set(mi_lcair.plan(scene, 0.01, each_pixel, renders=inf).lobe.values()) == {"brdf"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameters, lobe",
    [
        ({"alpha": 1e-3, "gamma": 2.0, "n": 10.0, "k": 30.0, "rho_d": 0.0}, "mirror"),
        ({"alpha": 0.15, "gamma": 2.0, "n": 10.0, "k": 30.0, "rho_d": 0.0}, "brdf"),
        ({"alpha": 0.219, "gamma": 2.0, "n": 1.328, "k": 0.283, "rho_d": 0.015}, "brdf"),
        ({"alpha": 0.3, "gamma": 2.0, "n": 1.0, "k": 0.0, "rho_d": 0.5}, "diffuse"),
    ],
    ids=["narrow metal", "broad metal", "rough paint", "no facets"],
)
def test_microfacet_beside_hot_walls(corner, parameters, lobe):
    """A mirror stands for a narrow lobe alone; a surface without facets is diffuse."""
    floor = {"type": "microfacet", **parameters}
    scene = checked(
        corner({"type": "bounce_path", "max_bounces": 4}, floor, floor_temperature=200.0),
        Path("corner.xml"),
        {},
    )
    for each_pixel in (False, True):
        assert set(mi_lcair.plan(scene, 0.01, each_pixel, renders=inf).lobe.values()) == {lobe}


@pytest.mark.slow
@pytest.mark.parametrize("opening", [8, 80])
def test_reflections_of_a_cavity(opening):
    """Each reflection halves the radiance (emissivity 0.5), and a geometric tail adds the rest.

    Behind a narrow opening a blackbody of nearly the cavity's 800 K may stand for it as well.
    """
    plan = mi_lcair.plan(mi_lcair.load("cavity", opening=opening, resolution=16), renders=inf)
    assert plan.max_bounces <= 4 and 0 < plan.bias <= 0.002
    if opening == 8 and plan.closure == "ambient":
        assert plan.ambient_temperature == pytest.approx(800, rel=0.01)
    else:
        assert plan.closure == "tail"
    assert plan.noise_tolerance == pytest.approx(0.01 - plan.bias)


@pytest.mark.slow
def test_the_error_holds():
    """At most 2 of 12 plans for 0.5 % miss the tolerance.

    Each plan is rendered with another seed. Plans that hold with 95 % confidence fail this test
    with a probability of 2 %.
    """
    missed = 0
    intensity = exact.open_box_intensity(
        *(float(in_band_radiance(band("total"), T)) for T in (800, 300))
    )
    scene = mi_lcair.load("open_box", resolution=32, emitter_sampling="false")
    for seed in range(12):
        plan = mi_lcair.plan(scene, 0.005, seed=seed)
        with plan.applied(scene):
            result = mi_lcair.signature(scene, tolerance=plan.noise_tolerance, seed=1000 + seed)
        assert result.reached
        missed += abs(result.target.intensity / intensity - 1) > 0.005
    assert missed <= 2


@pytest.mark.slow
def test_each_pixel():
    """The bias of a plan for an image is the rms difference from full fidelity, bounded.

    Both images use the same paths, so that the noise of their difference is small.
    """
    scene = mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=64)
    plan = mi_lcair.plan(scene, 0.02, each_pixel=True, renders=inf)
    assert plan.each_pixel and "mirror" in plan.lobe.values()
    assert plan.noise_tolerance == pytest.approx(np.sqrt(0.02**2 - plan.bias**2))
    with plan.applied(scene):
        image = mi_lcair.render(scene, tolerance=plan.noise_tolerance)
        simple = mi_lcair.render(scene, spp=64).channels["Y"]
    assert image.reached and image.header["lobes"].count("mirror") == 1
    with changed(scene, max_bounces=32):
        full = mi_lcair.render(scene, spp=64).channels["Y"]
    assert np.sqrt(np.mean((simple - full) ** 2)) / full.mean() < 0.02


@pytest.mark.slow
def test_what_cannot_win_is_not_tried():
    """A small scene is rendered sooner than a simpler lobe is probed; ten thousand are not."""
    scene = mi_lcair.load("furnace", resolution=16)
    once, often = (mi_lcair.plan(scene, renders=renders) for renders in (1, 10_000))
    assert once.lobe["bare_aluminum"] == "brdf" and once.max_bounces == 32
    assert once.bias < 1e-6 and len(once.untried) == 2
    assert any("bare_aluminum" in sentence for sentence in once.untried)
    assert often.lobe["bare_aluminum"] == "mirror" and often.untried == []
    with pytest.raises(InputError, match="renders = 0 must be positive"):
        mi_lcair.plan(scene, renders=0)


@pytest.mark.slow
@pytest.mark.parametrize("each_pixel", [False, True])
def test_surroundings_of_one_temperature_are_ambient(each_pixel):
    """In the furnace one ray after the first hit sees a blackbody at 300 K."""
    scene = mi_lcair.load("furnace", resolution=16)
    plan = mi_lcair.plan(scene, each_pixel=each_pixel, renders=inf)
    assert plan.closure == "ambient" and plan.max_bounces == 0 and plan.bias < 2e-3
    assert plan.ambient_temperature == pytest.approx(300, abs=0.05)
    with plan.applied(scene):
        image = mi_lcair.render(scene, tolerance=plan.noise_tolerance)
    exact_radiance = float(in_band_radiance(scene.band, 300.0))
    assert np.sqrt(np.mean((image.channels["Y"] / exact_radiance - 1) ** 2)) < 0.01


@pytest.mark.slow
def test_the_scene_is_left_as_it_was():
    scene = mi_lcair.load("furnace", resolution=16)
    before = Settings.of(scene)
    plan = mi_lcair.plan(scene, renders=inf)
    assert Settings.of(scene) == before != plan.settings
    with pytest.raises(KeyError), plan.applied(scene):
        assert Settings.of(scene) == plan.settings
        raise KeyError
    assert Settings.of(scene) == before


@pytest.mark.parametrize("tolerance", [0, 1, -0.1])
def test_unusable_tolerance(tolerance):
    with pytest.raises(InputError, match="between 0 and 1"):
        mi_lcair.plan(mi_lcair.load("open_box", resolution=16), tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("resolution", [40, 46, 64])
def test_every_resolution_has_its_pixels(resolution):
    """The pixels of a probe are spread over the image, whatever its width."""
    launch = pixels_launch(resolution, resolution, 0, 1)
    pixels = launch.stride * np.arange(launch.windows)
    assert pixels[-1] < resolution**2 and launch.windows >= resolution**2 // 20
    columns, rows = pixels % resolution, pixels // resolution
    assert len(set(columns)) > resolution / 3 and len(set(rows)) > 0.9 * resolution
    scene = mi_lcair.load("two_plates", resolution=resolution, emitter_sampling="false")
    plan = mi_lcair.plan(scene, 0.02, renders=inf)
    with plan.applied(scene):
        result = mi_lcair.signature(scene, tolerance=plan.noise_tolerance, seed=1)
    L = float(in_band_radiance(band("total"), 800))
    assert result.target.intensity == pytest.approx(exact.two_plates_intensity(L), rel=0.02)


@pytest.fixture
def speck(plate):
    """speck(emitter_sampling): a grey plate at 300 K that a small source illuminates.

    The source is 5 mm wide, has 3000 K, and lies behind the camera.
    """

    def make(emitter_sampling):
        source = [
            [-0.0025, 0.0025, 1],
            [0.0025, 0.0025, 1],
            [0.0025, -0.0025, 1],
            [-0.0025, -0.0025, 1],
        ]
        black, grey = (
            {"type": "diffuse", "reflectance": {"type": "uniform", "value": value}}
            for value in (0.0, 0.5)
        )
        square = [[x / 10, y / 10, z] for x, y, z in SQUARE]
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "bounce_path", "emitter_sampling": emitter_sampling},
                "sensor": camera(size=32, height=0.5, origin=(0, 0, 0.5)),
                "floor": plate("floor", square, grey, 300.0, "MWIR"),
                "source": plate("source", source, black, 3000.0, "MWIR"),
            },
            optimize=False,
        )
        return checked(scene, Path("speck.xml"), {})

    return make


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", [False, True])
@pytest.mark.parametrize("each_pixel", [False, True])
def test_a_source_that_paths_miss_is_drawn(speck, emitter_sampling, each_pixel):
    """A plan samples a source that no path hits.

    Probes without emitter sampling miss the source and see no noise. The plan must detect this.
    """
    scene = speck(emitter_sampling)
    plan = mi_lcair.plan(scene, 0.02, each_pixel)
    assert plan.emitter_sampling and plan.max_bounces >= 1
    with plan.applied(scene):
        planned = mi_lcair.signature(scene, tolerance=plan.noise_tolerance, seed=3).target.intensity
    exact = mi_lcair.signature(speck(True), spp=256).target.intensity
    assert planned == pytest.approx(exact, rel=0.02)


@pytest.mark.slow
def test_a_tail_for_a_model_beside_other_surroundings(plate):
    """The tail of the model does not depend on the surroundings beside it.

    The model is a grey room of reflectance 0.5, the background another one of reflectance 0.8. The
    same sensor sees both, and each has its own ratio of successive bounces.
    """

    def room(name, x, reflectance, temperature, facet_type):
        shapes = {}
        for k, corners in enumerate(box(x)):
            grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}}
            shapes[f"{name}{k}"] = plate(f"{name}{k}", corners, grey, temperature, "MWIR", name)
            shapes[f"{name}{k}"]["emitter"]["facet_type"] = facet_type
        return shapes

    def box(x):
        corners = {0: [(0, 0), (1, 0), (1, 1), (0, 1)], 1: [(0, 0), (0, 1), (1, 1), (1, 0)]}
        for axis, side in WALLS:
            wall = np.full((4, 3), float(side))
            wall[:, [(axis + 1) % 3, (axis + 2) % 3]] = corners[side]
            yield (wall + [x, -0.5, -0.5]).tolist()

    sensor = camera(size=16, height=1.8, origin=(0, -0.4, 0), target=(0, 0, 0))
    sensor["to_world"] = mi.ScalarTransform4f().look_at(
        origin=[0, -0.4, 0], target=[0, 0, 0], up=[0, 0, 1]
    ) @ mi.ScalarTransform4f().scale([0.9, 0.4, 1])
    scene = checked(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "bounce_path"},
                "sensor": sensor,
                **room("a", -1.05, 0.5, 300.0, "model"),
                **room("b", 0.05, 0.8, 350.0, "terrain"),
            },
            optimize=False,
        ),
        Path("rooms.xml"),
        {},
    )
    plan = mi_lcair.plan(scene, 0.01, renders=inf)
    assert plan.closure == "tail"
    with plan.applied(scene):
        result = mi_lcair.signature(scene, tolerance=plan.noise_tolerance)
    assert result.target.intensity == pytest.approx(
        0.85 * 0.8 * float(in_band_radiance(band("MWIR"), 300.0)), rel=0.01
    )


@pytest.mark.slow
def test_surfaces_of_one_name_are_planned_together(plate):
    """Two surfaces without a name, one diffuse and one glossy, share one entry of the plan.

    `diffuse` is exact for one and an estimate for the other. Each gets its own lobe back.
    """
    glossy = {"type": "sandford_robertson", "epsilon": 0.1, "rho_d": 0.05, "b": 0.2, "e": 0.3}
    matt = {"type": "sandford_robertson", "epsilon": 0.5, "rho_d": 0.5, "b": 0.0, "e": 1.0}
    lid = [[-5, -5, 5], [-5, 5, 5], [5, 5, 5], [5, -5, 5]]
    scene = checked(
        mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "bounce_path"},
                "sensor": camera(size=8, origin=(0, 0, 4)),
                "floor": plate("floor", SQUARE, glossy, 300.0),
                "lid": plate("lid", lid, matt, 300.0),
            },
            optimize=False,
        ),
        Path("x.xml"),
        {},
    )
    scene.surfaces()[0].set_lobe("mirror")
    assert list(rungs(scene).values()) == [Rung("diffuse", exact=False)]
    plan = mi_lcair.plan(scene)
    assert [surface.lobe for surface in scene.surfaces()] == ["mirror", "brdf"] and len(
        plan.lobe
    ) == 1


@pytest.mark.slow
def test_any_seed():
    plan = mi_lcair.plan(mi_lcair.load("open_box", resolution=8), 0.05, seed=2**32 - 1)
    assert plan.max_bounces == 1 and plan.noise_tolerance == 0.05


def test_what_cannot_be_planned():
    with pytest.raises(
        InputError, match=r"needs an orthographic sensor.*each_pixel \(--each-pixel\)"
    ):
        scene = mi_lcair.load("two_plates", resolution=8)
        replaced = replace(
            scene,
            sensors=[
                mi.load_dict(
                    {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}
                )
            ],
        )
        mi_lcair.plan(replaced)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["open_box", "furnace"])
def test_no_clock_decides(monkeypatch, name):
    """The plan does not change if every second interval takes a thousand times longer."""

    def choices():
        scene = mi_lcair.load(name, resolution=16)
        plan = mi_lcair.plan(scene, seed=3, renders=inf).as_dict()
        return {key: value for key, value in plan.items() if not key.endswith("time_s")}

    usual = choices()
    for slow in (0, 1):
        calls = iter(range(10**6))
        ticks = np.cumsum([1000.0 if k % 2 == slow else 1.0 for k in range(10**4)])
        monkeypatch.setattr("time.perf_counter", lambda: ticks[next(calls)])
        assert choices() == usual
