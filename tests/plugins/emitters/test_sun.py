"""The sun's light on plates against closed forms: diffuse, in and off the glint, in shadow."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.physics import reflection
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun import SunPosition, sunlight
from mi_lcair.plugins.emitters import sun as sun_plugin
from tests.plugins.small_scenes import GREY, SQUARE, camera, runs, scene

E = sunlight().in_band_radiance(band("MWIR"))
RADIUS = np.radians(0.53 / 2)
BOTH = [{}, {"emitter_sampling": True}]
IDS = ["sun drawn", "emitter sampling"]


def sun(elevation, azimuth=0.0, **others):
    return {
        "type": "sun",
        "elevation_deg": float(elevation),
        "azimuth_deg": float(azimuth),
        "band": "MWIR",
        **others,
    }


def direction(elevation, azimuth=0.0):
    h, a = np.radians([elevation, azimuth])
    return np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])


def path(max_bounces=2, **others):
    return {"type": "bounce_path", "max_bounces": max_bounces, **others}


def looking_from(elevation, azimuth=0.0):
    """A camera that sees a small part of the plate z = 0 from far away."""
    return camera(2, 0.01, origin=10 * direction(elevation, azimuth))


def sky(temperature=1.0):
    """A closed box of sky around everything."""
    shape = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().scale(20),
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
    }
    emitter = {"type": "thermal", "temperature": temperature, "facet_type": "sky", "group": "sky"}
    return {**shape, "emitter": {**emitter, "band": "MWIR"}}


def incoming(elevation, azimuth, count=64):
    """Directions over the disc and their solid angles [sr], in Float64, (3, n) and (n,)."""
    x, w = np.polynomial.legendre.leggauss(count)
    theta = RADIUS * (x + 1) / 2
    phi = 2 * np.pi * (np.arange(count) + 0.5) / count
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    weights = np.outer(w * RADIUS / 2, np.full(count, 2 * np.pi / count)) * np.sin(theta)
    centre = direction(elevation, azimuth)
    right = np.cross([0, 0, 1], centre)
    right /= np.linalg.norm(right)
    up = np.cross(centre, right)
    place = [np.cos(theta), np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)]
    return np.einsum("kij,kd->dij", place, [centre, right, up]).reshape(3, -1), weights.ravel()


def reflected(parameters, elevation, azimuth, view):
    """Radiance of a Sandford-Robertson plate in sunlight, by quadrature over the disc."""
    model = reflection.model("sandford_robertson")
    Float64 = dr.float64_array_t(mi.Float)
    S = model.surface(*(Float64(value) for value in parameters), form="thesis")
    d, weights = incoming(elevation, azimuth)
    vector = dr.replace_type_t(mi.Vector3f, dr.VarType.Float64)
    i = vector(*(Float64(np.ascontiguousarray(c)) for c in d))
    r = vector(*(Float64(float(c)) for c in view))
    f = model.f(S, i, r).numpy()
    return E / (np.pi * np.sin(RADIUS) ** 2) * np.sum(f * d[2] * weights)


@pytest.mark.parametrize("settings", BOTH, ids=IDS)
@pytest.mark.parametrize("elevation", [90, 60, 30, 5])
def test_diffuse_plate(plate, elevation, settings):
    made = scene(
        path(**settings),
        camera(2),
        sun=sun(elevation, 40),
        floor=plate("floor", SQUARE, GREY, 1.0, band="MWIR"),
    )
    expected = 0.3 * E * np.sin(np.radians(elevation)) / np.pi
    assert runs(made, 1, 512).mean() == pytest.approx(expected, rel=2e-3)


GLOSSY = {"epsilon": 0.2, "rho_d": 0.05, "b": 0.5, "e": 0.02}  # a lobe about as wide as the disc
VIEWS = {"glint": (40.0, 180.0), "beside": (41.0, 180.0), "off": (70.0, 90.0)}


@pytest.mark.parametrize("settings", BOTH, ids=IDS)
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("e", [0.3, 0.02, 0.002])
def test_sandford_robertson_plate(plate, view, e, settings):
    """In the glint a lobe much narrower than the disc is found by reflected rays alone."""
    values = {**GLOSSY, "e": e}
    made = scene(
        path(**settings),
        looking_from(*VIEWS[view]),
        sun=sun(40),
        floor=plate("floor", SQUARE, {"type": "sandford_robertson", **values}),
    )
    expected = reflected(values.values(), 40, 0, direction(*VIEWS[view]))
    found = runs(made, 1, 2**14)
    assert found.mean() == pytest.approx(expected, rel=5e-3)


def test_glints_are_no_noisier_where_emitters_are_drawn(plate):
    """The sun has a drawn direction of its own: beside hot plates, and with twelve balls."""
    source = {"type": "thermal", "temperature": 500.0, "band": "MWIR"}
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    balls = {
        f"ball{k}": {
            "type": "sphere",
            "center": [float(k - 6), 4.0, 1.0],
            "radius": 0.3,
            "bsdf": black,
            "emitter": source,
        }
        for k in range(12)
    }
    values = {**GLOSSY, "e": 0.1}
    high = [[x, y, 3.0] for x, y, _ in SQUARE]
    shapes = {
        "floor": plate("floor", SQUARE, {"type": "sandford_robertson", **values}),
        "hot": plate("hot", [[x + 40, y, z] for x, y, z in high], black, 400.0, "MWIR"),
        **balls,
    }
    scatters, means = [], []
    for settings in BOTH:
        made = scene(path(1, **settings), looking_from(40, 180), sun=sun(40), **shapes)
        images = runs(made, 32, 64)
        scatters.append(images.reshape(32, -1).std(axis=0, ddof=1).mean())
        means.append(images.mean())
    assert means[0] == pytest.approx(means[1], rel=0.01)
    assert scatters[1] < 1.2 * scatters[0]


@pytest.mark.parametrize("with_sky", [False, True])
def test_a_mirror_shows_the_disc(plate, with_sky):
    bsdf = {"type": "sandford_robertson", **GLOSSY, "lobe": "mirror"}
    shapes = {"floor": plate("floor", SQUARE, bsdf)} | ({"sky": sky()} if with_sky else {})
    in_disc, beside = (
        scene(path(), looking_from(height, 180), sun=sun(40), **shapes) for height in (40.2, 40.3)
    )
    model = reflection.model("sandford_robertson")
    Float64 = dr.float64_array_t(mi.Float)
    S = model.surface(*map(Float64, GLOSSY.values()), form="thesis")
    HDR = model.HDR(S, Float64(np.radians(90 - 40.2))).numpy()[0]
    disc = E / (np.pi * np.sin(RADIUS) ** 2)
    assert runs(in_disc, 1, 16).mean() == pytest.approx(HDR * disc, rel=1e-3)
    assert runs(beside, 1, 16).max() < 1e-9


def test_the_camera_sees_the_disc():
    made = scene(
        path(),
        {
            **camera(1, 0.01),
            "to_world": mi.ScalarTransform4f().look_at(
                origin=[0, 0, 0], target=direction(30, 20), up=[0, 0, 1]
            ),
        },
        sun=sun(30, 20),
        box=sky(),
    )
    disc = E / (np.pi * np.sin(RADIUS) ** 2)
    assert runs(made, 1, 16).mean() == pytest.approx(disc, rel=1e-4)


@pytest.mark.parametrize("settings", BOTH, ids=IDS)
def test_sky_does_not_hide_the_sun_and_a_plate_does(plate, settings):
    """The edge of the shadow of a plate at a height h falls h / tan(elevation) beside it."""
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    h, elevation = 2.0, 50.0
    shift = h / np.tan(np.radians(elevation))  # toward -x, away from the sun
    screen = [[-1, -1, h], [-1, 1, h], [1, 1, h], [1, -1, h]]
    for x, is_lit in ((-shift - 0.97, False), (-shift - 1.03, True), (-shift + 1.03, True)):
        eye = camera(2, 0.01, target=(x, 0, 0), origin=(x, -3.0, 1.0))
        made = scene(
            path(**settings),
            eye,
            sun=sun(elevation),
            floor=plate("floor", SQUARE, GREY),
            screen=plate("screen", screen, black),
            sky=sky(),
        )
        expected = is_lit * 0.3 * E * np.sin(np.radians(elevation)) / np.pi
        assert runs(made, 1, 2048).mean() == pytest.approx(expected, rel=5e-3, abs=1e-6)


@pytest.mark.parametrize("settings", BOTH, ids=IDS)
def test_the_irradiance_is_differentiable(plate, settings):
    made = scene(
        path(**settings),
        looking_from(40, 180),
        sun=sun(40),
        floor=plate("floor", SQUARE, {"type": "sandford_robertson", **GLOSSY}, 300.0, band="MWIR"),
        sky=sky(250.0),
    )
    params = mi.traverse(made)
    key = "sun.irradiance"
    value = lambda: np.array(mi.render(made, spp=2**14, seed=3), dtype=float).mean()
    at_one = value()
    dr.enable_grad(params[key])
    params.update()
    image = mi.render(made, params, spp=2**14, seed=3)
    dr.backward(dr.mean(image.array))
    slope = float(dr.grad(params[key])[0])
    params[key] = mi.Float(2 * E)
    params.update()
    # Both values are noisy where half of the drawn directions point to the sky
    error = 0.01 if settings else 1e-3
    assert slope == pytest.approx((value() - at_one) / E, rel=error)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"band": "total"}, "does not cover band total"),
        ({"band": "SWIR", "air": "midlat_summer"}, "does not cover band SWIR"),
        ({"elevation_deg": -1.0, "air": "midlat_summer"}, "-1 degrees; must lie in 1..90"),
        ({"height_m": -5.0, "air": "midlat_summer"}, "height_m = -5; must lie in 0..100000"),
        ({"elevation_deg": 91.0}, "elevation_deg = 91; must lie in -90..90"),
        ({"air": "midlat"}, "air 'midlat'"),
        ({"air": "none.csv"}, "none.csv"),
        ({"diameter_deg": 0.0}, "diameter_deg = 0; must be positive"),
        ({"distance_au": -1.0}, "distance_au = -1; must be positive"),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({**sun(40), **changes})
    with pytest.raises(InputError, match=message):
        raise mitsuba_error(caught.value)


HERE = {"latitude_deg": 48.1, "longitude_deg": 11.6, "time": "2026-06-21T10:00:00Z"}


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"band": None}, "give its `band`"),
        ({"azimuth_deg": None}, "found elevation_deg"),
        ({"latitude_deg": 48.0}, "found azimuth_deg, elevation_deg, latitude_deg"),
        ({"azimuth_deg": None, "elevation_deg": None}, "found none"),
        ({"elevation_deg": None, **HERE, "north_deg": 90.0}, "found azimuth_deg, latitude_deg"),
    ],
)
def test_what_it_needs(changes, message):
    given = {key: value for key, value in {**sun(40), **changes}.items() if value is not None}
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict(given)


def test_place_and_time(monkeypatch):
    """North is at the azimuth 30, and the compass turns the other way."""
    asked = []
    height = {"2026-06-21T10:00:00Z": 60.0, "night": -7.0}
    monkeypatch.setattr(
        sun_plugin,
        "sun_position",
        lambda *place: asked.append(place) or SunPosition(200.0, height[place[2]], 1.01),
    )
    by_place = {"type": "sun", "band": "MWIR", "north_deg": 30.0, **HERE}
    loaded = mi.load_dict(by_place)
    assert asked == [tuple(HERE.values())]
    assert (loaded.azimuth_deg, loaded.elevation_deg) == (-170.0, 60.0)
    assert loaded.scale[0] == pytest.approx(E / 1.01**2, rel=1e-6)
    given = mi.load_dict({**by_place, "distance_au": 2.0})
    assert given.scale[0] == pytest.approx(E / 4, rel=1e-6)
    with pytest.raises(RuntimeError, match="7.00 degrees below the horizon"):
        mi.load_dict({**by_place, "time": "night"})
    with pytest.raises(RuntimeError, match="latitude_deg = 91; must lie in -90..90"):
        mi.load_dict({**by_place, "latitude_deg": 91.0})


def test_one_sun():
    two = scene(path(), camera(2), a=sun(40), b=sun(50))
    with pytest.raises(InputError, match="has 2 suns"), two.integrator().prepared(two):
        pass
