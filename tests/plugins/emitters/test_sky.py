"""The emitter `sky`: seen, reflected by diffuse plates, its spectra by direction, and bad input."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.physics.air.clear_air import SunDirection, clear_air
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import set_values
from tests.matrix import some_of
from tests.physics.surroundings.test_sunlit_table import SUN, WAVELENGTHS, write
from tests.plugins.emitters.test_sun import direction, path, sun
from tests.plugins.small_scenes import GREY, camera, runs, scene

AIR = clear_air("us_standard")
NIGHT = {"type": "sky", "ground_temperature": 288.0}
DAY = {**NIGHT, "sun_elevation_deg": 40.0, "sun_azimuth_deg": 20.0}


def radiance(name, elevation, azimuth=None):
    """In-band radiance of the clear sky at 50 m, computed for the direction itself."""
    by_day = None if azimuth is None else SunDirection(40.0, azimuth - 20.0)
    return AIR.sky(50.0, elevation, by_day).in_band_radiance(band(name))


def reflected_by(name, tilt, ground, nodes=40):
    """Mean radiance over the hemisphere of a plate, weighted by its cosine, in Float64.

    tilt: angle of its normal from the zenith [degrees]. ground: radiance below the horizon.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    azimuth = (np.arange(2000) + 0.5) * np.pi / 1000
    total = 0.0
    for of_sky in (True, False):
        # Nodes over the square root of |z|, since the sky changes fast near the horizon
        z, weight = ((x + 1) / 2) ** 2, w / 2 * (x + 1)
        z = z if of_sky else -z
        across = np.sqrt(1 - z**2)[:, None] * np.cos(azimuth)
        cos = np.sin(np.radians(tilt)) * across + np.cos(np.radians(tilt)) * z[:, None]
        mean = np.maximum(cos, 0).mean(axis=1) * 2 * np.pi
        light = (
            [radiance(name, np.degrees(np.arcsin(s))) for s in z]
            if of_sky
            else np.full(nodes, ground)
        )
        total += (weight * mean) @ light
    return total / np.pi


def plate_at(tilt):
    """A dark grey plate whose normal is tilted from the zenith, and a camera that looks at it."""
    normal = direction(90 - tilt)
    T = mi.ScalarTransform4f
    up = [0, 1, 0] if tilt in (0, 180) else [0, 0, 1]
    look = T().look_at(origin=[0, 0, 0], target=list(normal), up=up)
    emitter = {"type": "thermal", "temperature": 1.0, "group": "plate"}
    shape = {"type": "rectangle", "to_world": look @ T().scale(5), "bsdf": GREY}
    sensor = camera(2, 1.0, origin=20 * normal)
    sensor["to_world"] = T().look_at(origin=list(20 * normal), target=[0, 0, 0], up=up)
    return shape, emitter, sensor


@pytest.mark.parametrize("name", some_of(["MWIR", "LWIR"], 2))
@pytest.mark.parametrize("tilt", [0, 60, 90, 180])
@pytest.mark.parametrize("sampling", [False, True])
def test_diffuse_plate(name, tilt, sampling):
    """Against a quadrature over sky and ground, within 0.2 %."""
    shape, emitter, sensor = plate_at(tilt)
    plate = {**shape, "emitter": {**emitter, "band": name}}
    integrator = path(1, emitter_sampling=sampling)
    made = scene(integrator, sensor, plate=plate, sky={**NIGHT, "band": name})
    expected = 0.3 * reflected_by(name, tilt, in_band_radiance(band(name), 288.0))
    assert runs(made, 4, 2**16).mean() == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("elevation, azimuth", [(0.7, 60), (9, 110), (47, 200), (-3, 0), (-80, 50)])
@pytest.mark.parametrize("settings", [NIGHT, DAY])
def test_seen(settings, elevation, azimuth):
    look = mi.ScalarTransform4f().look_at(
        origin=[0, 0, 0], target=list(direction(elevation, azimuth)), up=[0, 0, 1]
    )
    made = scene(path(), {**camera(1), "to_world": look}, sky={**settings, "band": "MWIR"})
    expected = in_band_radiance(band("MWIR"), 288.0)
    if elevation > 0:
        expected = radiance("MWIR", elevation, azimuth if settings is DAY else None)
    assert runs(made, 1, 16).mean() == pytest.approx(
        expected, rel=8e-3 if settings is DAY else 3e-3
    )


@pytest.mark.parametrize("name", ["LWIR", "MWIR"])
@pytest.mark.parametrize("settings", [{**NIGHT, "height_m": 2000.0}, DAY], ids=["high", "day"])
def test_spectrum_by_direction(name, settings):
    """What a mirror shows of a direction, after 5 km of air, within 0.6 %; near the sun 0.8 %."""
    made = mi_lcair.load(scene(path(), camera(1), sky={**settings, "band": name}))
    (sky,) = made.mi.emitters()
    more = AIR.ray(50.0, 0.0, 5000.0).amounts[-1]
    sources = sky.spectra()
    arriving = np.array(
        [
            band(name).integral(source.spectrum.wavelengths_um, source.spectrum.through(more))
            if source.spectrum is not None and source.in_band > 0
            else 0.0
            for source in sources
        ]
    )
    per_radiance = arriving / [max(source.in_band, 1e-30) for source in sources]
    around = sky.around()
    for elevation in (
        0.4,
        1.6,
        3.0,
        7.7,
        18.0,
        38.0,
        75.0,
        *([-3.0, -30.0] if settings is not DAY else []),
    ):
        for azimuth in (20.0, 22.0, 25.0, 35.0, 100.0, 190.0) if settings is DAY else (0.0,):
            with made.prepared():
                d = mi.Vector3f(*map(float, direction(elevation, azimuth)))
                parts = sky.parts_along(d, mi.Bool(True))
                total = sky.along(d, mi.Bool(True))[0][0]
                found = sum(share[0] * per_radiance[number[0]] for number, share in parts) * total
            assert sum(share[0] for _, share in parts) == pytest.approx(1, rel=1e-5)
            light = around.at(elevation, abs(azimuth - sky.sun_azimuth_deg))
            expected = band(name).integral(light.wavelengths_um, light.through(more))
            near = settings is DAY and elevation == 38 and azimuth < 40
            assert found == pytest.approx(expected, rel=8e-3 if near else 6e-3)


@pytest.mark.parametrize("sun", [20.0, 60.0, 85.0])
def test_near_the_sun(sun):
    """The aureole is met at any elevation of the sun, where a table over the azimuth is coarse."""
    settings = {"sun_elevation_deg": sun, "sun_azimuth_deg": 20.0, "band": "MWIR"}
    made = mi_lcair.load(scene(path(), camera(1), sky={**NIGHT, **settings}))
    (sky,) = made.mi.emitters()
    places = [(sun + e, 20.0 + a) for e in (-6, -2, 0, 2, 4) for a in (0, 2, 10, 30)]
    d = mi.Vector3f(np.array([direction(*place) for place in places], dtype=np.float32).T)
    with made.prepared():
        seen = sky.along(d, mi.Bool(True))[0].numpy()
    exact = [sky.around().at(e, a - 20).in_band_radiance(sky.band) for e, a in places]
    np.testing.assert_allclose(seen, exact, rtol=1e-2)


def test_table_by_azimuth(tmp_path):
    """A user's sky by day: its radiance by direction, and sources that add up to it."""
    file = write(tmp_path / "sky.csv", azimuths=(0, 20, 70, 180))
    settings = {"sky": file, "sun_elevation_deg": SUN, "sun_azimuth_deg": 20.0, "band": "MWIR"}
    made = mi_lcair.load(scene(path(), camera(1), sky={**NIGHT, **settings}))
    (sky,) = made.mi.emitters()
    sources, more = sky.spectra(), np.where(WAVELENGTHS < 4.2, 0.5, 0.0)
    for elevation, azimuth in ((2, 0), (9, 110), (25, 50), (33, 22), (40, -30), (70, 200)):
        d = mi.Vector3f(*map(float, direction(elevation, azimuth)))
        with made.prepared():
            total, parts = sky.along(d, mi.Bool(True))[0][0], sky.parts_along(d, mi.Bool(True))
        around = sky.around()
        expected = around.in_band_radiance(sky.band, elevation, azimuth - 20)
        assert total == pytest.approx(expected, rel=1e-2)
        shares = [(sources[number[0]], share[0]) for number, share in parts]
        assert sum(share for _, share in shares) == pytest.approx(1, rel=1e-5)
        light = around.at(elevation, azimuth - 20)
        left = sum(
            share
            * sky.band.integral(WAVELENGTHS, more * source.spectrum.at(WAVELENGTHS))
            / source.in_band
            for source, share in shares
            if source.in_band
        )
        expected = sky.band.integral(WAVELENGTHS, more * light.at(WAVELENGTHS))
        assert left * total == pytest.approx(expected, rel=1e-2, abs=5e-3 * total)


def test_even_table_by_azimuth(tmp_path):
    """Its second component is nothing, and adds nothing."""
    file = write(tmp_path / "sky.csv", (0, 90), (0, 180), lambda e, a: 2.0)
    settings = {"sky": file, "sun_elevation_deg": SUN, "band": "MWIR"}
    made = mi_lcair.load(scene(path(), camera(1), sky={**NIGHT, **settings}))
    (sky,) = made.mi.emitters()
    with made.prepared():
        assert sky.along(mi.Vector3f(0.6, 0, 0.8), mi.Bool(True))[0][0] == pytest.approx(
            4, rel=1e-5
        )
    of_sky = {round(source.in_band, 5) for source in sky.spectra() if source.group == "sky"}
    assert of_sky == {0.0, 4.0}


def test_density():
    """Drawn directions have the density that the emitter states, and it is one over the sphere."""
    made = mi_lcair.load(
        scene(path(), camera(1), sky={**NIGHT, "band": "LWIR", "height_m": 3000.0})
    )
    (sky,) = made.mi.emitters()
    with made.prepared():
        u = mi.Point2f(np.random.default_rng(1).random((2, 2**18)))
        d = sky.drawn(u)
        density = sky.density(d).numpy()
        assert np.mean(1 / density) == pytest.approx(4 * np.pi, rel=5e-3)
        for z in (-0.5, -0.04, 0.0, 0.3):
            inside = d.z.numpy() > z
            expected = 2 * np.pi * (1 - z)
            assert np.mean(inside / density) == pytest.approx(expected, rel=2e-2)
        assert dr.all(dr.abs(dr.norm(d) - 1) < 1e-5)


def test_groups_and_what_is_seen():
    """A camera that looks at the horizon sees sky above and ground below."""
    look = mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[1, 0, 0], up=[0, 0, 1])
    sensor = {**camera(8), "type": "perspective", "fov": 30.0, "to_world": look}
    image = mi_lcair.render(
        mi_lcair.load(scene(path(), sensor, sky={**NIGHT, "band": "LWIR"})), spp=64, parts=True
    )
    sky, ground = (image.channels[f"group.{name}.Y"] for name in ("sky", "ground"))
    np.testing.assert_allclose(ground[4:], in_band_radiance(band("LWIR"), 288.0), rtol=1e-4)
    assert sky[:4].min() > 0 and sky[4:].max() == 0 == ground[:4].max()
    for name, values in (("sky", sky), ("ground", ground)):
        np.testing.assert_allclose(image.channels[f"seen.{name}.Y"], values, rtol=1e-5)


def test_new_values():
    """New temperatures and a new emissivity act as if the scene had been given them."""
    first = {"type": "sky", "sky": "250", "ground_temperature": 280.0, "ground_emissivity": 0.9}
    then = {"type": "sky", "sky": "270", "ground_temperature": 300.0, "ground_emissivity": 0.6}
    shape, emitter, sensor = plate_at(90)
    make = lambda sky: mi_lcair.load(
        scene(
            path(1),
            sensor,
            sky={**sky, "band": "MWIR"},
            plate={**shape, "emitter": {**emitter, "band": "MWIR"}},
        )
    )
    changed, given = make(first), make(then)
    set_values(
        changed, {"sky.temperature": 270.0, "ground.temperature": 300.0, "ground.emissivity": 0.6}
    )
    for name in ("Y", "group.sky.Y", "group.ground.Y"):
        a, b = (
            mi_lcair.render(made, spp=256, parts=True).channels[name] for made in (changed, given)
        )
        np.testing.assert_allclose(a, b, rtol=1e-4)


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"sky": "none"}, "sky = none needs ground_temperature"),
        ({"ground_emissivity": 0.9}, "ground_emissivity needs ground_temperature"),
        (
            {**NIGHT, "ground_emissivity": 0.9, "ground_material": "gloss_black"},
            "cannot be combined",
        ),
        ({"sky": "sunny"}, "sky table 'sunny'"),
        ({"sky": "overcast", "sun_elevation_deg": 30.0}, "hides the sun"),
        ({"height_m": -5.0}, "height_m"),
        ({"band": "SWIR"}, "does not cover band"),
        ({"ground_temperature": -4.0}, "ground_temperature"),
    ],
)
def test_bad_input(settings, message):
    with pytest.raises(RuntimeError) as error:
        mi.load_dict({"type": "sky", "band": "LWIR", **settings})
    assert message in str(mitsuba_error(error.value))


def test_a_sun_that_does_not_fit():
    made = scene(path(), camera(2), sky={**DAY, "band": "MWIR"}, sun=sun(40, 80))
    with pytest.raises(InputError, match="does not fit the sky"):
        made.integrator().prepared(made).__enter__()


def test_ground_of_a_material():
    """Gloss black has a hemispherical emissivity between those at normal and grazing angles."""
    sky = mi.load_dict({**NIGHT, "band": "MWIR", "ground_material": "gloss_black"})
    assert 0.7 < float(sky.ground_emissivity[0]) < 1


@pytest.mark.parametrize("integrator", ["bounce_path", "path"])
def test_a_sky_that_is_never_rendered(integrator):
    """A second scene that is only loaded changes nothing in the first one."""
    thermal = {"type": "thermal", "temperature": 290.0, "band": "LWIR"}
    plate = {"type": "rectangle", "bsdf": GREY, "emitter": thermal}
    made, other = (
        scene({"type": "bounce_path"}, camera(4), plate=plate, sky={**NIGHT, "band": "LWIR"})
        for _ in range(2)
    )
    mi.render(made, spp=4)  # sets the tables
    kept = mi.load_dict({"type": integrator})
    first = np.array(mi.render(made, integrator=kept, spp=4))
    assert first.mean() > 1 and np.array_equal(first, mi.render(made, integrator=kept, spp=4))
    del other
