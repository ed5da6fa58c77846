"""Scenarios along slant paths: the band model's own paths, backgrounds, unusable input."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.api.scenarios import contrast
from mi_lcair.detection.contrast import unlit_sky
from mi_lcair.detection.detection_range import detection_range
from mi_lcair.detection.line_of_sight import (
    Sight,
    background_sun,
    from_sun,
    lower_height,
    sky_behind,
)
from mi_lcair.detection.scenario import Background, Observer
from mi_lcair.detection.setting import setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import SunDirection, clear_air
from mi_lcair.physics.air.levels import Weather, bands
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.sky import spectrum
from mi_lcair.physics.sun import clear_sky
from tests.detection.disc_scenario import AREA, disc, write_disc
from tests.physics.air.test_tape7 import block

LIMITS = {"MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0)}
AIR = clear_air("us_standard")
SLANT = {"atmosphere__table": "us_standard"}
SKY = {"background__sky": "us_standard_clear"}
GROUND = {"background__ground_temperature": 300}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("disc")
    write_disc(path)
    return path


def planck(x, T):
    """Planck's law, W m^-2 sr^-1 um^-1, with the published constants of CODATA 2018."""
    return 1.191042972e8 / x**5 / np.expm1(14387.76877 / (x * T))


def slant(elevation, range_km, lower_m=50.0):
    """Wavelengths, transmittance, and path radiance up and down of a path through the air."""
    up = AIR.ray(lower_m, elevation, 1000 * range_km)
    down = AIR.ray(1000 * up.heights_km[-1], -up.elevations_deg[-1], 1000 * range_km)
    radiances = (AIR.emitted(along).radiance for along in (up, down))
    return bands().wavelengths_um, bands().transmittance(up.amounts[-1]), *radiances


def sky_of(x, elevation, height_m=50.0):
    return np.interp(x, bands().wavelengths_um, AIR.sky(height_m, elevation).radiance)


def on(x, wavelengths, *columns):
    return [np.interp(x, wavelengths, column) for column in columns]


def grid(band):
    return np.linspace(*LIMITS[band], 100_001)


@pytest.mark.slow
@pytest.mark.parametrize("band, range_m", [("MWIR", 5000)])
def test_a_disc_before_the_sky(folder, band, range_m):
    """A disc of 400 K, 30 degrees up, seen from the ground, before the sky between two rows."""
    x = grid(band)
    T, up, _ = on(x, *slant(30, range_m / 1000))
    sky = sky_of(x, 30)
    result = contrast(
        disc(folder, observer__elevation_deg=-30, observer__range_m=range_m, sensor__band=band,
             **SLANT, **SKY)
    )  # fmt: skip
    row, per_area = result.rows[0], AREA * np.cos(np.radians(30)) / range_m**2
    assert row.target.value == pytest.approx(np.trapezoid(T * planck(x, 400), x) * per_area, 2e-3)
    assert row.path.value == pytest.approx(np.trapezoid(up, x) * per_area, 2e-3)
    assert row.background.value == pytest.approx(np.trapezoid(sky, x) * per_area, 2e-3)
    expected = np.trapezoid(T * planck(x, 400) + up - sky, x) * per_area
    assert row.total.value == pytest.approx(expected, 2e-3)
    assert (result.sight_elevation_deg, result.observer_height_m) == (30, 50)
    assert result.target_height_m == pytest.approx(10_070.5 if range_m == 20_000 else 2551, abs=2)


def behind_target(elevation, range_km, lower_m=50.0):
    """The ray from a sensor above a target on to the ground, with its elevation at the target."""
    up = AIR.ray(lower_m, elevation, 1000 * range_km)
    return AIR.ray(1000 * up.heights_km[-1], -up.elevations_deg[-1])


@pytest.mark.slow
@pytest.mark.parametrize("band", ["LWIR"])
def test_a_disc_near_the_ground(folder, band):
    """Ground that emits and reflects the sky, behind the target and through its own air.

    The light of the sky has crossed air before, so that the amounts of both paths add.
    """
    x = grid(band)
    along = behind_target(10, 5)
    fine = np.radians(np.arange(1, 90, 2.0))
    share = 2 * np.sin(fine) * np.cos(fine) * np.radians(2.0)
    skies = [AIR.sky(0.0, angle) for angle in np.degrees(fine)]
    amounts, wavelengths = along.amounts[-1], bands().wavelengths_um
    arriving = sum(weight * sky.through(amounts) for weight, sky in zip(share, skies))
    behind, sky, air = on(
        x, wavelengths, bands().transmittance(amounts), arriving, AIR.emitted(along).radiance
    )
    ground = behind * 0.9 * planck(x, 300) + 0.1 * sky + air
    result = contrast(
        disc(folder, observer__elevation_deg=10, observer__range_m=5000, sensor__band=band,
             background__ground_emissivity=0.9, **SLANT, **SKY, **GROUND)
    )  # fmt: skip
    row, per_area = result.rows[0], AREA * np.cos(np.radians(10)) / 5000**2
    assert row.background.value == pytest.approx(np.trapezoid(ground, x) * per_area, 2e-3)
    _, T, _, down = slant(10, 5)
    T, down = on(x, wavelengths, T, down)
    expected = np.trapezoid(T * planck(x, 400) + down - ground, x) * per_area
    assert row.total.value == pytest.approx(expected, 1e-2)
    assert result.target_height_m == 50


def test_the_ground_lies_behind_a_target_in_the_air(folder):
    """The sensor is at 919.8 m and the target 3 km from it; the ground is farther."""
    given = {"observer__elevation_deg": 10.0149, "observer__range_m": 3000, "sensor__band": "LWIR"}
    scenario = disc(folder, observer__height_m=919.8, **given, **SLANT, **GROUND)
    sight, whole = Sight.of(scenario), Sight.of(scenario).to_ground(3000)
    assert sight.target_m == pytest.approx(397.6, abs=1)
    assert sight.observer_m == pytest.approx(919.8)
    assert whole.range_m == pytest.approx(919.8 / np.sin(np.radians(10)), rel=0.01)
    path = sight.air.path(3000)
    x, T, _, down = slant(10.0149, 3, sight.target_m)
    np.testing.assert_allclose(path.transmittance, T, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(path.radiance, down, rtol=1e-3)
    assert np.all(path.transmittance >= whole.transmittance)
    assert np.all(path.radiance <= whole.radiance * 1.001)
    behind = setting_of(scenario).backdrop
    expected = whole.transmittance * planck(x, 300) + whole.radiance
    np.testing.assert_allclose(behind.at_sensor(3000).at(x), expected, rtol=1e-3)


def test_heights_of_target_and_sensor(folder):
    """Either height states both. LWIR transmittance of 1 km at 10 km height is near 1."""
    up = {"observer__elevation_deg": -30, "observer__range_m": 4000}
    of_target = Sight.of(disc(folder, target__height_m=5000.0, **up, **SLANT))
    assert of_target.target_m == pytest.approx(5000, abs=2)
    assert of_target.observer_m == pytest.approx(3000, abs=5)
    of_sensor = Sight.of(disc(folder, observer__height_m=of_target.observer_m, **up, **SLANT))
    np.testing.assert_allclose(
        of_sensor.air.path(4000).transmittance, of_target.air.path(4000).transmittance, rtol=1e-6
    )
    level = {"observer__elevation_deg": 0, "observer__range_m": 20_000.0}
    low, high = (
        Sight.of(disc(folder, observer__height_m=height, **level, **SLANT)).air
        for height in (50.0, 10_000.0)
    )
    for band in ("MWIR", "LWIR"):
        ratio = high.transmittance_mean(band_of(band), 20_000.0)
        assert ratio > 2 * low.transmittance_mean(band_of(band), 20_000.0)


def test_weather_of_a_scenario(folder):
    """Humid air transmits less. Weather of a table that has its own is refused."""
    given = {"observer__range_m": 5000, "observer__elevation_deg": 0} | SLANT
    dry, humid = (
        Sight.of(disc(folder, atmosphere__humidity=humidity, **given)).air.path(5000.0)
        for humidity in (0.1, 0.9)
    )
    assert humid.transmittance.mean() < 0.8 * dry.transmittance.mean()
    expected = clear_air("us_standard", Weather(humidity=0.9)).ray(50.0, 0.0, 5000.0)
    np.testing.assert_allclose(
        humid.transmittance, bands().transmittance(expected.amounts[-1]), rtol=1e-9
    )
    sky = {"observer__elevation_deg": -20, "sensor__band": "LWIR"} | SKY | SLANT
    warm, cold = (
        setting_of(disc(folder, atmosphere__temperature=kelvin, **sky)).backdrop.at(10.0)
        for kelvin in (305.0, 265.0)
    )
    assert warm > 1.3 * cold


def test_horizontal_tables_are_used_at_any_elevation(folder):
    """A user's table of horizontal paths and vacuum are used as they are, bit by bit."""
    file = folder / "air.csv"
    fine = [f"{R},{x},{np.exp(-R / 5)},{0.3 * R}" for R in (1, 2) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    file.write_text("\n".join([header, *fine]))
    for table in (str(file), "vacuum"):
        for elevation in (-20, 0, 5):
            given = {"atmosphere__table": table, "observer__elevation_deg": elevation}
            setting = setting_of(disc(folder, observer__range_m=1234.5, **given))
            expected = atmosphere(table).path(1234.5)
            for name in ("range_m", "wavelengths_um", "transmittance", "radiance"):
                np.testing.assert_array_equal(getattr(setting.path, name), getattr(expected, name))
            x = np.linspace(3, 5, 99)
            assert setting.backdrop.path_at is None
            np.testing.assert_array_equal(
                setting.backdrop.at_sensor(1234.5).at(x), setting.backdrop.at(x)
            )
    for elevation in (0.5, 20.0):
        sky = setting_of(disc(folder, observer__elevation_deg=-elevation, **SKY)).backdrop
        np.testing.assert_array_equal(
            sky.at_sensor(1000.0).at(x), spectrum("us_standard_clear", elevation).at(x)
        )


def test_ground_behind_vacuum(folder):
    """In vacuum the ground arrives as it is."""
    x = np.linspace(8.1, 11.9, 50)
    low = {"observer__elevation_deg": 30, "observer__range_m": 500, "observer__height_m": 1000.0}
    sight = Sight.of(disc(folder, atmosphere__table="vacuum", **low, **GROUND))
    radius, up = 1.19 * 6371e3, complex(np.cos(np.pi / 6), np.sin(np.pi / 6))
    target = sight.target_m  # 500 m from the sensor; the line leaves it upward by 30 degrees
    assert abs(1j * (radius + target) + 500 * up) == pytest.approx(radius + 1000, abs=1e-3)
    length = sight.to_ground(500).range_m - 500
    assert abs(1j * (radius + target) - length * up) == pytest.approx(radius, abs=1e-3)
    behind = setting_of(disc(folder, sensor__band="LWIR", **low, **GROUND)).backdrop
    np.testing.assert_allclose(behind.at_sensor(500.0).at(x), planck(x, 300), rtol=1e-8)
    assert not behind.rows_um.size  # no table: its spectrum is smooth


def test_the_sunlit_sky_behind_the_target(folder):
    """The sensor looks at azimuth 200, toward the sun and square to it; also in LWIR."""
    looks_up = {"observer__elevation_deg": -35, "observer__azimuth_deg": 20}
    looks_up |= {"background__daytime_sky": "us_standard"} | SLANT
    for band, sun, relative in (
        ("MWIR", 200, 0),
        ("MWIR", 110, 90),
        ("LWIR", 290.0, 90),
        ("MWIR", 20, 180),
    ):
        given = {"background__sun_azimuth_deg": sun, "sensor__band": band} | looks_up
        sky = setting_of(disc(folder, **given)).backdrop
        expected = AIR.sky(50.0, 35, SunDirection(45.0, relative)).radiance
        x = np.linspace(*LIMITS[band], 50)
        np.testing.assert_allclose(sky.at(x), on(x, bands().wavelengths_um, expected)[0], rtol=2e-3)
    summer = {"background__sun_azimuth_deg": 200, "background__daytime_sky": "midlat_summer"}
    sky = setting_of(disc(folder, sensor__band="MWIR", **(looks_up | summer))).backdrop
    expected = clear_air("midlat_summer").sky(50.0, 35, SunDirection(45.0, 0)).radiance
    x = np.linspace(*LIMITS["MWIR"], 50)
    np.testing.assert_allclose(sky.at(x), on(x, bands().wavelengths_um, expected)[0], rtol=2e-3)
    low, high = (
        setting_of(
            disc(folder, observer__height_m=height, sensor__band="MWIR", **looks_up)
        ).backdrop.at(np.linspace(3.1, 4.9, 50))
        for height in (50.0, 2000.0)
    )
    assert np.all(high > 0) and np.all(high < 1.05 * low) and high.sum() < 0.8 * low.sum()


def test_the_path_scatters_sunlight(folder):
    """10 % of the path radiance at 5 km, 10 degrees, 10 degrees from the sun (LOWTRAN7)."""
    given = {"observer__elevation_deg": -10, "observer__range_m": 5000, "sensor__band": "MWIR"}
    given |= SLANT | {"observer__azimuth_deg": 180, "background__sun_azimuth_deg": 10}
    shares = []
    for sky in ({"background__daytime_sky": "us_standard"}, SKY):
        setting = setting_of(disc(folder, **given, **sky))
        shares.append(band_of("MWIR").integral(bands().wavelengths_um, setting.path.radiance))
    assert shares[0] / shares[1] - 1 == pytest.approx(0.10, abs=0.01)


@pytest.mark.parametrize(
    "azimuth, elevation, fits", [(60, 45, True), (0, 45, False), (60, 20, False)]
)
def test_the_sun_of_scene_and_background_is_one(tmp_path, azimuth, elevation, fits):
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text()
    sun = f'''<emitter type="sun"> <string name="band" value="MWIR"/>
        <float name="azimuth_deg" value="{azimuth}"/>
        <float name="elevation_deg" value="{elevation}"/> </emitter></scene>'''
    (tmp_path / "disc.xml").write_text(text.replace("</scene>", sun))
    given = {"background__daytime_sky": "us_standard", "observer__elevation_deg": -30}
    unstated = setting_of(disc(tmp_path, **given))
    assert unstated.sun == (azimuth, elevation)
    sun = {"background__sun_azimuth_deg": azimuth, "background__sun_elevation_deg": elevation}
    x = np.linspace(8.5, 11.5, 5)
    stated = setting_of(disc(tmp_path, **given, **sun))
    np.testing.assert_array_equal(unstated.backdrop.at(x), stated.backdrop.at(x))
    scenario = disc(
        tmp_path,
        **given,
        background__sun_azimuth_deg=60,
        background__sun_elevation_deg=45,
    )
    if fits:
        setting = setting_of(scenario)
        assert not unlit_sky(setting.view, scenario, setting.detector)
        night = disc(tmp_path, observer__elevation_deg=-30, **SKY)
        (remark,) = unlit_sky(setting.view, night, setting.detector)
        assert "no scattered sunlight; `daytime_sky` has it in MWIR" in remark
    else:
        with pytest.raises(InputError, match="does not fit the sky of .background., whose"):
            setting_of(scenario)


def test_sunlit_ground(folder):
    """Ground that only reflects has the sun's irradiance and that of the sky, over pi."""
    x, given = np.linspace(3.6, 4.0, 9), {"observer__elevation_deg": 10, "sensor__band": "3.5-4.1"}
    given |= {"background__daytime_sky": "us_standard", "background__ground_emissivity": 1e-9}
    ground = setting_of(disc(folder, **given, **SLANT, **GROUND)).backdrop
    (sun,) = on(x, bands().wavelengths_um, AIR.sun(0.0, 45.0).radiance)
    of_sky = clear_sky("us_standard", 45.0, 0.0).mean_spectrum().at(x)
    np.testing.assert_allclose(ground.at(x) - of_sky, sun * np.sin(np.pi / 4) / np.pi, rtol=1e-3)
    lights = sum(share * light.at(x) for share, light in ground.reflected)
    np.testing.assert_allclose(ground.at(x), lights, rtol=1e-6)
    # What arrives is the sum of the lights through both of their ways in the air
    setting = setting_of(disc(folder, **(given | {"sensor__band": "4.2-4.6"}), **SLANT, **GROUND))
    x = np.linspace(4.2, 4.6, 9)
    along, ground = behind_target(10, 1), setting.backdrop
    lights = sum(light.through(along.amounts[-1]) for _, light in ground.reflected)
    of_air = AIR.emitted(along, setting.sight.sun).radiance
    (expected,) = on(x, bands().wavelengths_um, lights + of_air)
    np.testing.assert_allclose(ground.at_sensor(1000.0).at(x), expected, rtol=2e-3)
    with pytest.raises(InputError, match="has sky and daytime_sky; give one of"):
        Background(sky="us_standard_clear", daytime_sky="us_standard")


def test_a_sun_that_is_not_stated(folder):
    assert background_sun(disc(folder, background__daytime_sky="us_standard")) == (0.0, 45.0)
    assert background_sun(disc(folder)) is None


def test_the_sky_is_darker_from_higher_up(folder):
    x = np.array([8.5, 10.5, 11.5])
    up = {"observer__elevation_deg": -0.5, "observer__range_m": 50_000, "sensor__band": "LWIR"}
    sky = setting_of(disc(folder, observer__height_m=2000.0, **up, **SLANT, **SKY)).backdrop
    np.testing.assert_allclose(sky.at(x), sky_of(x, 0.5, 2000.0), rtol=1e-6)
    looks_up = {"observer__elevation_deg": -30, "sensor__band": "LWIR"} | SLANT | SKY
    low, high = (
        setting_of(disc(folder, observer__height_m=height, **looks_up)).backdrop.at(
            np.array([8.5, 10.5, 11.5])
        )
        for height in (50.0, 3000.0)
    )
    assert np.all(high < 0.5 * low) and np.all(high > 0)


@pytest.mark.slow
def test_detection_range_along_the_line_of_sight(folder):
    """At a level of the signal at 8 km the range is 8 km.

    The sensor moves away, and the ground behind the target with it.
    """
    given = {"observer__elevation_deg": 20, "observer__range_m": 8000} | SLANT | GROUND
    result = contrast(disc(folder, **given))
    row = result.rows[0]
    detector = replace(result.detector, nei=abs(row.total.value) / 10, snr=10)
    found = detection_range(row.irradiance, detector, result.air, 2.0)
    assert not found.at_least and found.largest_m == pytest.approx(8000, rel=1e-6)
    steep = setting_of(disc(folder, **(given | {"observer__elevation_deg": 30}))).backdrop
    x, along = bands().wavelengths_um, behind_target(30, 10)
    expected = bands().transmittance(along.amounts[-1]) * planck(x, 300)
    expected = expected + AIR.emitted(along).radiance
    np.testing.assert_allclose(steep.at_sensor(10_000).at(x), expected, rtol=1e-3)


def test_a_tape7_of_slant_paths(folder):
    """The block at the line of sight's elevation; the ground is at the end of a longer path."""
    x, elevations = np.arange(830, 1255, 5.0), {-30: (0.8, 0.6), -60: (0.9, 0.7)}
    (folder / "tape7").write_text(
        "".join(
            block(x, tau, range_km=length, itype=2, heights_and_angle=(1, 0, 90 - elevation))
            for elevation, taus in elevations.items()
            for length, tau in zip((1, 2), taus)
        )
    )
    setting = setting_of(
        disc(
            folder,
            atmosphere__table=str(folder / "tape7"),
            observer__elevation_deg=30,
            observer__range_m=1000,
            observer__height_m=1000.0,
            sensor__band="LWIR",
            **GROUND,
        )
    )
    np.testing.assert_allclose(setting.path.transmittance, 0.8, rtol=1e-6)
    behind = setting.backdrop.at_sensor(1000.0).at(np.array([10.0]))
    assert behind == pytest.approx(0.6 * planck(10.0, 300) + 0.4 * planck(10.0, 280), rel=1e-3)


def test_azimuth_from_the_sun():
    """The angle, 0..180 degrees, between the sun and where the sensor looks: away from itself."""
    rng = np.random.default_rng(3)
    for azimuth, of_sun in rng.uniform(-400, 400, (40, 2)):
        turn = np.radians(azimuth + 180 - of_sun)
        direction = from_sun(azimuth, of_sun, 20.0)
        assert direction.azimuth_deg == pytest.approx(np.degrees(np.arccos(np.cos(turn))), abs=1e-5)
        assert direction.elevation_deg == 20


@pytest.mark.parametrize("elevation", [0.5, 0.0, -0.5])
def test_a_line_that_is_nearly_level(folder, elevation):
    """Ground is behind the target where the line goes down at all, and sky where it does not."""
    given = {"observer__elevation_deg": elevation, "observer__height_m": 50.0}
    given |= {"observer__range_m": 1000.0, "atmosphere__table": "vacuum", "sensor__band": "LWIR"}
    behind = {"sky": SKY, "ground": GROUND}
    fits, fails = ("ground", "sky") if elevation > 0 else ("sky", "ground")
    setting_of(disc(folder, **given, **behind[fits]))
    with pytest.raises(InputError, match="looks down, by 0.5" if elevation > 0 else "looks up"):
        setting_of(disc(folder, **given, **behind[fails]))


@pytest.mark.parametrize("day", [False, True])
@pytest.mark.parametrize("height_m, depression", [(3000, 0.5), (2000, 1.3), (5000, 0.3)])
def test_a_line_just_above_the_horizon(folder, height_m, depression, day):
    """A line that looks down and misses the ground ends in the sky that the sensor sees there.

    The sky at the target and the air before it are the sky at the sensor, in its own direction.
    """
    range_m, x = 5000.0, np.array([8.5, 10.0, 11.5])
    given = {"observer__elevation_deg": depression, "target__height_m": float(height_m)}
    given |= {"observer__range_m": range_m, "sensor__band": "LWIR", **SLANT}
    sky = SKY
    if day:
        words = {"daytime_sky": "us_standard", "sun_elevation_deg": 40.0, "sun_azimuth_deg": 200.0}
        sky = {f"background__{name}": word for name, word in words.items()}
    for behind in (sky, sky | GROUND):
        setting = setting_of(disc(folder, **given, **behind))
        sight, backdrop = setting.sight, setting.backdrop
        assert not sight.meets_ground and backdrop.name.startswith("sky")
        sun = SunDirection(40.0, 20.0) if day else None
        seen = AIR.sky(sight.observer_m, sight.elevation_at_sensor(range_m), sun)
        at_sensor = backdrop.at_sensor(range_m).at(x)
        np.testing.assert_allclose(at_sensor, seen.at(x), rtol=3e-4 if day else 1e-4)
        # Twice the sky is not twice the air before the target
        path = sight.air.path(range_m).at(x)[1]
        twice = backdrop.scaled(2.0).at_sensor(range_m).at(x)
        np.testing.assert_allclose(twice, 2 * at_sensor - path, rtol=1e-9)
    lower = {"observer__elevation_deg": 1.0 - AIR.horizon_deg(height_m)}
    assert setting_of(disc(folder, **given | lower, **GROUND)).sight.meets_ground
    with pytest.raises(InputError, match="past the ground; .* give .background. a sky"):
        setting_of(disc(folder, **given, **GROUND))


def test_lower_end_of_the_line_of_sight():
    """The sensor's height if it looks up, else the target's; up to 0.5 m below ground is rounding.

    Downward by 30 degrees, the target at 1 km lies 500 m lower, and 0.05 m for the round Earth.
    """

    def lower(height_m, elevation_deg, range_m=1000.0, base_m=50.0):
        observer = Observer(range_m, 0.0, elevation_deg, height_m=height_m)
        scenario = SimpleNamespace(observer=observer, target=SimpleNamespace(height_m=None))
        return lower_height(scenario, base_m)

    assert lower(None, 30) == 50 and lower(None, 30, base_m=None) is None
    assert lower(700.0, -30) == lower(700.0, 0) == 700
    assert lower(700.0, 30) == pytest.approx(199.95, abs=0.001)
    assert lower(700.0, 0.5) == pytest.approx(700 - 8.727 - 0.066, abs=0.001)
    assert lower(500.0, 30) == lower(499.56, 30) == 0
    with pytest.raises(InputError, match="ends below the ground before range_m = 1000"):
        lower(499.54, 30)


def test_a_path_that_misses_the_end_of_a_table_by_rounding(folder):
    """The table ends at 20 km. A path to the ground that is 0.4 m longer ends there, too."""
    rows = [f"{R},{x},{0.9**R},0.1" for R in (5, 10, 20) for x in np.linspace(3, 5, 99)]
    header = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um"
    (folder / "long.csv").write_text("\n".join([header, *rows]))
    table = str(folder / "long.csv")
    sight = Sight.of(disc(folder, observer__elevation_deg=30, atmosphere__table=table))
    assert sight.beyond_m == 0
    for length in (19_999.6, 20_000.4):
        assert sight.to_ground(length).range_m == 20_000
    assert sight.to_ground(19_999.4).range_m == pytest.approx(19_999.4)
    with pytest.raises(InputError, match="range 20000.6 m is beyond its last one"):
        sight.to_ground(20_000.6)


def test_ground_reflects_the_mean_of_the_sky():
    """The mean of a sky with elevations, over their squared sine; a sky without is its own mean."""
    air = SimpleNamespace(table="vacuum")
    light = sky_behind(
        SimpleNamespace(background=Background(sky="us_standard_clear"), atmosphere=air),
        0.0,
        None,
    ).on_ground
    assert sum(factor for factor, _ in light) == pytest.approx(1, rel=1e-12)
    square = (np.arange(400) + 0.5) / 400
    elevations = np.degrees(np.arcsin(np.sqrt(square)))
    for x in (3.8, 10.5):
        mean = np.mean([spectrum("us_standard_clear", e, 0.0).at(x) for e in elevations])
        assert sum(factor * table.at(x) for factor, table in light) == pytest.approx(mean, rel=5e-3)


def test_grey_ground_below_a_sky_without_elevations(folder, tmp_path):
    x = np.array([8.5, 10.0, 11.5])
    sky = tmp_path / "sky.csv"
    rows = "".join(f"{8 + k / 20},{1 + k / 80}\n" for k in range(81))
    sky.write_text(f"wavelength_um,radiance_W_m2_sr_um\n{rows}")
    given = {"background__sky": str(sky), "sensor__band": "LWIR"}
    down = given | GROUND | {"observer__elevation_deg": 30, "background__ground_emissivity": 0.7}
    behind = setting_of(disc(folder, **down)).backdrop
    expected = 0.7 * planck(x, 300) + 0.3 * (1 + (x - 8) / 4)
    np.testing.assert_allclose(behind.at(x), expected, rtol=1e-8)
    assert np.array_equal(behind.rows_um, np.unique(spectrum(sky).wavelengths_um))
    # It is the sky in all directions, also to a sensor that looks down where there is no ground
    for elevation in (-30, 30):
        shown = setting_of(disc(folder, observer__elevation_deg=elevation, **given)).backdrop
        np.testing.assert_allclose(shown.at(x), 1 + (x - 8) / 4, rtol=1e-9)


def test_a_cloudy_sky_knows_no_height(folder):
    """A clear sky is that at the sensor's height, a table is shown as it is."""
    given = {"observer__elevation_deg": -30, "observer__height_m": 1000.0, "sensor__band": "LWIR"}
    x = np.array([8.5, 10.5])
    for name, expected in (
        ("us_standard_clear", spectrum("us_standard_clear", 30.0, 1000.0)),
        ("us_standard_stratus", spectrum("us_standard_stratus", 30.0)),
    ):
        shown = setting_of(disc(folder, background__sky=name, **given, **SLANT)).backdrop
        np.testing.assert_array_equal(shown.at(x), expected.at(x))


@pytest.mark.parametrize(
    "changes, message",
    [
        (
            {"observer__elevation_deg": -30, "observer__range_m": 200_001} | SKY,
            "upper end of the line of sight is .* m above the ground; must be at most 100000 m",
        ),
        (
            {"observer__elevation_deg": 0, "observer__range_m": 200_001} | SKY,
            "range 200001 m is beyond its last one, 200000 m",
        ),
        (
            {"target__height_m": 400.0, "observer__height_m": 300.0} | SKY,
            "height_m of .target. and of .observer.; give one of them",
        ),
        ({"target__height_m": -5.0} | SKY, r".target.: height_m = -5; must lie in 0\.\.100000"),
        (
            {"target__height_m": 400.0, "observer__elevation_deg": -30} | SKY,
            ".target.: from height_m = 400 the line of sight, 30 degrees downward, ends below",
        ),
        ({"atmosphere__humidity": 45} | SKY, "humidity = 45; must lie in 0..0.98"),
        (
            {"atmosphere__table": "vacuum", "atmosphere__co2": 425} | SKY,
            "co2 is weather of a clear air, but table = 'vacuum' has its own",
        ),
        ({"observer__elevation_deg": 30, "sensor__band": "5-8"} | GROUND, "does not cover band"),
        (
            {"observer__elevation_deg": -30} | GROUND,
            "looks up, by 30 degrees, where no ground is behind",
        ),
        ({"observer__elevation_deg": 30} | SKY, "looks down, by 30 degrees, .* ground_temperature"),
        (
            {"observer__elevation_deg": 30, "observer__height_m": 400.0} | GROUND,
            "from height_m = 400 the line of sight, 30 degrees downward, ends below the ground",
        ),
        (
            {"observer__elevation_deg": 30, "atmosphere__ranges_m": [5.0]} | GROUND,
            "ranges_m is for",
        ),
        ({"atmosphere__table": "midlat"}, "unknown atmosphere 'midlat'"),
        ({"background__ground_temperature": -1}, "ground_temperature = -1 K; must be positive"),
        ({"background__ground_emissivity": 0.5}, "sky and temperature are missing; give one"),
        ({"background__ground_emissivity": 1.5} | GROUND, "emissivity = 1.5; must be positive"),
        ({"observer__height_m": -1}, "height_m = -1; must lie in 0..100000"),
    ],
)
def test_unusable(folder, changes, message):
    with pytest.raises(InputError, match=message):
        setting_of(disc(folder, **(SLANT | changes)))
