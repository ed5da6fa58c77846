"""The integrator: emitter sampling, bounce counts, closures and labels, against closed forms or
against itself without them.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels

WHITE = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 1.0}}
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
FLOOR = [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]


def small_source(size=0.01, height=0.5):
    """Corners of a square that looks down on the floor."""
    half = size / 2
    return [
        [-half, half, height],
        [half, half, height],
        [half, -half, height],
        [-half, -half, height],
    ]


def look_down(width=1.0):
    T = mi.ScalarTransform4f
    film = {
        "type": "hdrfilm",
        "width": 16,
        "height": 16,
        "component_format": "float32",
        "pixel_format": "luminance",
        "rfilter": {"type": "box"},
    }
    return {
        "type": "orthographic",
        "film": film,
        "to_world": T().look_at(origin=[0, 0, 0.4], target=[0, 0, 0], up=[0, 1, 0])
        @ T().scale([width / 2, width / 2, 1]),
    }


def observe(integrator, spp=1024, seed=0, sensor=None, **shapes):
    """(mean over the pixels, its standard error, per-sample variance) of the radiance."""
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", **integrator},
            "sensor": sensor or look_down(),
            **shapes,
        },
        optimize=False,
    )
    with scene.integrator().prepared(scene) as tracer:
        launch = Launch(16, 16, seed, min(32, spp), max(1, spp // 32), windows=256)
        means = tracer.trace(scene.sensors()[0], launch).radiance / launch.points
    variance = means.var(axis=1, ddof=1)
    error = np.sqrt(np.sum(variance / launch.randomisations)) / 256
    return means.mean(), error, variance.mean() * launch.points


def assert_same_mean(first, second):
    """Within 3 joint standard errors (0.27 %)."""
    assert abs(first[0] - second[0]) < 3 * np.hypot(first[1], second[1]), (
        f"{first[0]} +- {first[1]}, {second[0]} +- {second[1]}"
    )


@pytest.mark.slow
def test_small_source_over_a_plate(plate):
    """The same mean with emitter sampling on and off, and far less variance with it (a million
    times less here).
    """
    shapes = {
        "floor": plate("floor", FLOOR, WHITE),
        "source": plate("source", small_source(0.02), BLACK, 800.0),
    }
    on = observe({"max_bounces": 1, "emitter_sampling": True}, spp=256, **shapes)
    off = observe({"max_bounces": 1}, spp=16384, **shapes)
    assert_same_mean(on, off)
    assert off[2] / on[2] > 1e5


def test_overlapping_emitters(plate):
    """Two emitters in one place: only the one that a ray meets counts, however it was drawn."""
    overlap = [[x, y, z + 1e-9] for x, y, z in small_source(0.3)]
    shapes = {
        "floor": plate("floor", FLOOR, WHITE),
        "one": plate("one", small_source(0.3), BLACK, 800.0),
        "two": plate("two", overlap, BLACK, 300.0),
        "hidden": plate("hidden", small_source(0.2, 0.6), BLACK, 900.0),
    }
    on = observe({"max_bounces": 2, "emitter_sampling": True}, **shapes)
    preferred = observe({"max_bounces": 2, "emitter_sampling": "preferred"}, **shapes)
    off = observe({"max_bounces": 2}, spp=4096, **shapes)
    assert_same_mean(on, off)
    assert_same_mean(preferred, off)


@pytest.mark.slow
def test_every_kind_of_emitter_at_once(plate):
    """A mesh with a temperature per facet, a thermal sphere, a stock area light, a point and a
    constant sky.

    Without emitter sampling a point source is never met, so the reference is stock `path`, which
    draws them all.
    """
    shapes = {
        "floor": plate(
            "floor",
            FLOOR,
            {"type": "sandford_robertson", "epsilon": 0.2, "rho_d": 0.3, "b": 0.3, "e": 0.2},
            300.0,
        ),
        "facets": plate("facets", small_source(0.2), BLACK, [500.0, 700.0]),
        "ball": {
            "type": "sphere",
            "center": [0.35, 0.0, 0.25],
            "radius": 0.06,
            "bsdf": BLACK,
            "emitter": {"type": "thermal", "band": "LWIR", "temperature": 600.0},
        },
        "stock": {
            "type": "rectangle",
            "bsdf": BLACK,
            "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 200.0}},
            "to_world": mi.ScalarTransform4f().translate([-0.3, 0.2, 0.3])
            @ mi.ScalarTransform4f().rotate([1, 0, 0], 180)
            @ mi.ScalarTransform4f().scale(0.05),
        },
        "sky": {"type": "constant", "radiance": {"type": "uniform", "value": 5.0}},
        "lamp": {
            "type": "point",
            "position": [0.1, -0.3, 0.3],
            "intensity": {"type": "uniform", "value": 1.0},
        },
    }
    on = observe({"max_bounces": 2, "emitter_sampling": True}, spp=2048, **shapes)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 3, "rr_depth": 100},
            "sensor": look_down(),
            **shapes,
        },
        optimize=False,
    )
    images = np.array(
        [
            np.array(mi.render(scene, spp=256, seed=seed)).mean(dtype=np.float64)
            for seed in range(12)
        ]
    )
    assert_same_mean(on, (images.mean(), images.std(ddof=1) / np.sqrt(len(images))))


@pytest.mark.parametrize("emitter_sampling", [False, True])
def test_emission_only(plate, emitter_sampling):
    """max_bounces = 0: what the floor emits, and nothing that it reflects."""
    shapes = {
        "floor": plate(
            "floor",
            FLOOR,
            {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.4}},
            300.0,
        ),
        "source": plate("source", small_source(0.3), BLACK, 800.0),
    }
    mean, _, _ = observe({"max_bounces": 0, "emitter_sampling": emitter_sampling}, spp=16, **shapes)
    assert mean == pytest.approx(0.6 * float(in_band_radiance(band("LWIR"), 300.0)), rel=1e-5)


def cavity(opening, **integrator):
    """Radiance of the bundled cavity in units of the blackbody's, and the tail's own error."""
    scene = mi_lcair.load(
        "cavity", opening=opening, resolution=32, max_bounces=integrator.pop("max_bounces")
    )
    for name, value in integrator.items():
        setattr(scene.mi.integrator(), name, value)
    result = mi_lcair.render(scene, spp=1024, seed=1, parts=True)
    unit = float(in_band_radiance(scene.band, 800.0))
    return result.mean / unit, result


@pytest.mark.slow
@pytest.mark.parametrize("opening", [2, 24, 80])
def test_tail(opening):
    """Geometric continuation after N = 2: within 0.2 % of the limit, and no further off than it
    says beside the noise.
    """
    value, result = cavity(opening, max_bounces=2, closure="tail")
    assert value == pytest.approx(exact.cavity_emissivity(opening), rel=2e-3)
    assert result.channels["closure.Y"].mean() > 0.01 * result.mean
    assert 0 <= result.closure_error < 0.01 * result.mean


@pytest.mark.slow
def test_ambient():
    """Surfaces beyond the last reflection taken for blackbodies at the walls' temperature: N = 1
    beats N = 4 without.
    """
    closed, result = cavity(2, max_bounces=1, closure="ambient", ambient_temperature=800.0)
    cut, _ = cavity(2, max_bounces=4)
    limit = exact.cavity_emissivity(2)
    assert abs(closed - limit) < 0.1 * abs(cut - limit)
    assert result.header["closure"] == "ambient"
    # exact: what is kept after two reflections, times the black walls that it then meets
    kept = 0.5 * (1 - exact.cavity_opening_fraction(2))
    expected = exact.cavity_emissivity(2, 1) + kept**2
    assert closed == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    "integrator, message",
    [
        ({"closure": "ambient"}, "ambient_temperature need each other"),
        ({"ambient_temperature": 300.0}, "ambient_temperature need each other"),
        ({"closure": "ambient", "ambient_temperature": -1.0}, "must be positive"),
        ({"closure": "tail", "max_bounces": 1}, "must be >= 2"),
    ],
)
def test_unusable_closure(integrator, message):
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "bounce_path", **integrator})


def test_samples_of_small_facets_arrive(plate):
    """A facet of 2 mm, seen at 45 degrees from 0.14 m: a ray aimed from the surface but started
    Mitsuba's 0.1 mm off it would pass beside the facet for some of the samples, which then would
    not count.

    Irradiance from a small source: L A cos(theta_source) cos(theta_floor) / d^2, to 2e-4 for this
    size.
    """
    size, height, aside = 0.002, 0.1, 0.1
    shapes = {
        "floor": plate("floor", FLOOR, WHITE),
        "source": plate("source", small_source(size, height), BLACK, 800.0),
    }
    T = mi.ScalarTransform4f
    sensor = look_down()
    sensor["to_world"] = T().look_at(
        origin=[aside, 0, 0.09], target=[aside, 0, 0], up=[0, 1, 0]
    ) @ T().scale([1e-4, 1e-4, 1])
    mean, error, _ = observe(
        {"max_bounces": 1, "emitter_sampling": True}, spp=1024, sensor=sensor, **shapes
    )
    distance2 = height**2 + aside**2
    expected = (
        float(in_band_radiance(band("LWIR"), 800.0))
        * size**2
        * (height**2 / distance2)
        / distance2
        / np.pi
    )
    assert error < 2e-4 * expected
    assert mean == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("closure", ["none", "tail"])
@pytest.mark.parametrize("split", ["image", "target", None])
def test_a_pass_traces_its_paths_once(plate, closure, split):
    """One kernel holds the paths; what reduces their samples is far smaller."""
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    built = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 3, "closure": closure},
            "sensor": look_down(),
            "floor": plate("floor", FLOOR, grey, 300.0),
        },
        optimize=False,
    )
    integrator = built.integrator()
    with (
        integrator.prepared(built) as tracer,
        dr.scoped_set_flag(dr.JitFlag.KernelHistory, True),
    ):
        dr.kernel_history_clear()
        launch = Launch(16, 16, 0, randomisations=1, points=4, windows=256)
        tracer.trace(built.sensors()[0], launch, Channels(split))
        sizes = sorted(
            kernel["operation_count"]
            for kernel in dr.kernel_history()
            if kernel["type"] == dr.KernelType.JIT
        )
    assert sizes[-2] < sizes[-1] / 4, sizes
