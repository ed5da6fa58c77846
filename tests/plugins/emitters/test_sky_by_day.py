"""The daytime sky without a mesh: seen, reflected, beside the sun, and in a recorded launch."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.bands import band
from tests.physics.test_sun import daytime_sky, in_band
from tests.plugins.emitters.test_sun import BOTH, IDS, E, direction, path, sun
from tests.plugins.small_scenes import GREY, SQUARE, camera, runs, scene

MWIR = band("MWIR")
SKY = daytime_sky("midlat_summer")
DOME = {"type": "sky", "band": "MWIR", "atmosphere": "midlat_summer"}
DOME |= {"sun_azimuth_deg": 70.0, "sun_elevation_deg": 45.0}


def on_ground():
    """Irradiance of the sky on the ground, by quadrature [W m^-2]."""
    x, w = np.polynomial.legendre.leggauss(200)
    sin2, azimuth = (x + 1) / 2, np.linspace(0, 180, 361)
    elevation = np.degrees(np.arcsin(np.sqrt(sin2)))
    values = in_band(SKY, MWIR, *np.meshgrid(elevation, azimuth, indexing="ij"))
    return np.pi * (w / 2) @ np.trapezoid(values, azimuth, axis=1) / 180


@pytest.mark.parametrize("elevation, azimuth", [(35, 160), (35, 250), (-20 + 35, 70), (-5, 70)])
def test_seen(elevation, azimuth):
    """At the rows of the table, and below the horizon."""
    look = mi.ScalarTransform4f().look_at(
        origin=[0, 0, 0], target=direction(elevation, azimuth), up=[0, 0, 1]
    )
    made = scene(path(), {**camera(1), "to_world": look}, sky=DOME)
    from_sun = azimuth - 70.0
    expected = in_band(SKY, MWIR, [elevation], [from_sun])[0] if elevation > 0 else 0
    assert runs(made, 1, 16).mean() == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("settings", BOTH, ids=IDS)
@pytest.mark.parametrize("with_sun", [False, True])
def test_on_a_plate(plate, settings, with_sun):
    lights = {"sky": DOME} | ({"sun": sun(45, 70)} if with_sun else {})
    floor = plate("floor", SQUARE, GREY, 1.0, band="MWIR")
    made = scene(path(**settings), camera(2), floor=floor, **lights)
    expected = on_ground() + with_sun * E * np.sin(np.radians(45))
    assert runs(made, 1, 2**15).mean() == pytest.approx(0.3 * expected / np.pi, rel=5e-3)


def test_scale(plate):
    floor = plate("floor", SQUARE, GREY, 1.0, band="MWIR")
    made = scene(path(), camera(2), floor=floor, sky=DOME)
    before = runs(made, 1, 256)
    params = mi.traverse(made)
    params["sky.scale"] = mi.Float(3.0)
    params.update()
    np.testing.assert_allclose(runs(made, 1, 256), 3 * before, rtol=1e-5)


@pytest.mark.parametrize("elevation, azimuth", [(45, 80), (30, 70)])
def test_a_sun_that_does_not_fit(elevation, azimuth):
    made = scene(path(), camera(2), sky=DOME, sun=sun(elevation, azimuth))
    with pytest.raises(InputError, match="does not fit the sky"):
        made.integrator().prepared(made).__enter__()


def test_bands():
    """LWIR is known too; there the sky by day is that of the night."""
    mi.load_dict({**DOME, "band": "LWIR"})
    for name in ("SWIR", "total"):
        with pytest.raises(RuntimeError, match=f"does not cover band {name}"):
            mi.load_dict({**DOME, "band": name})


def test_height_and_elevation_of_the_sun():
    """The dome of a higher place is darker, and one of a low sun has its own radiances."""
    for changes, sky in (
        ({}, SKY),
        ({"height_m": 3000.0}, daytime_sky("midlat_summer", height_m=3000.0)),
        ({"sun_elevation_deg": 20.0}, daytime_sky("midlat_summer", 20.0)),
    ):
        made = mi_lcair.load(scene(path(), camera(1), sky={**DOME, **changes}))
        (dome,) = made.mi.emitters()
        with made.prepared():
            value = dome.along(mi.Vector3f(*map(float, direction(30, 110))), mi.Bool(True))[0][0]
        assert value == pytest.approx(in_band(sky, MWIR, 30.0, 40.0), rel=3e-3)
        dome.in_air(0.0, Weather())
        assert dome.height_m == (0.0 if "height_m" not in changes else 3000.0)
