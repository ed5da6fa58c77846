"""Scenarios along slant paths: closed forms from the raw tables, backgrounds, unusable input."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.detection.contrast import contrast, unlit_sky
from mi_lcair.detection.detection_range import detection_range
from mi_lcair.detection.line_of_sight import Sight, lower_height, reflected
from mi_lcair.detection.scenario import Background, Observer
from mi_lcair.detection.setting import setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.spectrum import BUNDLED, spectrum
from mi_lcair.physics.sun.daytime_sky import daytime_sky
from tests.detection.disc_scenario import AREA, disc, write_disc
from tests.physics.test_tape7 import block

LIMITS = {"MWIR": (3.0, 5.0), "LWIR": (8.0, 12.0)}
SLANT = {"atmosphere__table": "slant_us_standard"}
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


def rows(name, *key):
    """The rows of a bundled file whose first columns are `key`: its other columns, in order."""
    lines = (BUNDLED / name).read_text().splitlines()
    table = np.loadtxt([line for line in lines if line[0].isdigit()], delimiter=",")
    return table[np.all(table[:, : len(key)] == key, axis=1)].T[len(key) :]


def on(x, wavelengths, *columns):
    return [np.interp(x, wavelengths, column) for column in columns]


def grid(band):
    return np.linspace(*LIMITS[band], 100_001)


@pytest.mark.slow
@pytest.mark.parametrize("band, range_m", [("MWIR", 5000)])
def test_a_disc_before_the_sky(folder, band, range_m):
    """A disc of 400 K, 30 degrees up, seen from the ground, before the sky between two rows."""
    x = grid(band)
    T, up, _ = on(x, *rows("slant_us_standard.csv", 30, range_m / 1000))
    sky = sum(on(x, *rows("sky_us_standard_clear.csv", e))[0] for e in (25, 35)) / 2
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


@pytest.mark.slow
@pytest.mark.parametrize("band", ["LWIR"])
def test_a_disc_on_the_ground(folder, band):
    """Ground that emits and reflects the sky, behind the target and through the same air."""
    x = grid(band)
    T, _, down = on(x, *rows("slant_us_standard.csv", 10, 5))
    sky_elevations = [0.5, 5, 15, 25, 35, 45, 55, 65, 75, 85, 90]
    skies = [on(x, *rows("sky_us_standard_clear.csv", e))[0] for e in sky_elevations]
    fine = np.linspace(0, 90, 9001)
    share = 2 * np.sin(np.radians(fine)) * np.cos(np.radians(fine)) * np.radians(0.01)
    weights = [
        share @ np.interp(fine, sky_elevations, np.eye(len(skies))[n]) for n in range(len(skies))
    ]
    assert sum(weights) == pytest.approx(1, rel=1e-4)
    sky = sum(weight * radiance for weight, radiance in zip(weights, skies))
    ground = T * (0.9 * planck(x, 300) + 0.1 * sky) + down
    result = contrast(
        disc(folder, observer__elevation_deg=10, observer__range_m=5000, sensor__band=band,
             background__ground_emissivity=0.9, **SLANT, **SKY, **GROUND)
    )  # fmt: skip
    row, per_area = result.rows[0], AREA * np.cos(np.radians(10)) / 5000**2
    assert row.background.value == pytest.approx(np.trapezoid(ground, x) * per_area, 2e-3)
    expected = np.trapezoid(T * planck(x, 400) + down - ground, x) * per_area
    assert row.total.value == pytest.approx(expected, 2e-3)
    assert result.target_height_m == 50


def test_the_ground_lies_behind_a_target_in_the_air(folder):
    """The ground's path is the whole line of sight, an entry of the table; the target's is not.

    The sensor is 5 km from the ground along 10 degrees, and the target 2 km from it. There the
    line is 0.015 degrees steeper, as the Earth is round.
    """
    scenario = disc(
        folder, observer__elevation_deg=10.0149, observer__range_m=3000, observer__height_m=919.8,
        sensor__band="LWIR", **SLANT, **GROUND,
    )  # fmt: skip
    sight = Sight.of(scenario)
    x, T, _, down = rows("slant_us_standard.csv", 10, 5)
    whole = sight.to_ground(3000)
    np.testing.assert_allclose(whole.transmittance, T, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(whole.radiance, down, rtol=1e-3)
    assert sight.target_m == pytest.approx(397.6, abs=1) and sight.observer_m == pytest.approx(
        919.8
    )
    path, (_, lower, _, below) = sight.air.path(3000), rows("slant_us_standard.csv", 10, 2)
    # A band of lines lets more through twice than the product of its parts.
    assert np.all(path.transmittance > T) and np.all(path.transmittance * lower <= T * 1.02 + 1e-6)
    # The nearer air hides the farther air, and is colder.
    assert np.all(path.radiance <= whole.radiance * 1.001)
    # What the air behind the target adds to the whole path is its own emission, where it shows.
    added = below / (1 - lower) * (path.transmittance - T)
    np.testing.assert_allclose(path.radiance, whole.radiance - added, rtol=0.02)
    behind = setting_of(scenario).backdrop
    np.testing.assert_allclose(behind.at_sensor(3000).at(x), T * planck(x, 300) + down, rtol=1e-3)
    farther = Sight.of(disc(folder, observer__elevation_deg=10, observer__range_m=3000, **SLANT))
    assert farther.target_m == 50 and farther.beyond_m == 0


def test_horizontal_scenarios_are_as_before(folder):
    """A table of horizontal paths is used as it is, at any elevation, bit by bit."""
    for table in ("midlat_summer", "vacuum"):
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
    sky = setting_of(disc(folder, observer__elevation_deg=-20, **SKY)).backdrop
    np.testing.assert_array_equal(
        sky.at_sensor(1000.0).at(x), spectrum("us_standard_clear", 20.0).at(x)
    )


def test_ground_behind_horizontal_air_and_vacuum(folder):
    """The path goes on to the ground in the same air. In vacuum the ground arrives as it is."""
    x = np.linspace(8.1, 11.9, 50)
    low = {"observer__elevation_deg": 30, "observer__range_m": 500, "observer__height_m": 1000.0}
    sight = Sight.of(disc(folder, atmosphere__table="us_standard", **low, **GROUND))
    assert sight.to_ground(500).range_m == pytest.approx(2000, rel=1e-3)
    behind = setting_of(disc(folder, sensor__band="LWIR", **low, **GROUND)).backdrop
    np.testing.assert_allclose(behind.at_sensor(500.0).at(x), planck(x, 300), rtol=1e-8)


def test_the_sunlit_sky_behind_the_target(folder):
    """Entries of the table: the sensor looks at azimuth 200, toward the sun and square to it."""
    x = np.linspace(3.1, 4.9, 50)
    looks_up = {"observer__elevation_deg": -35, "observer__azimuth_deg": 20, "sensor__band": "MWIR"}
    looks_up |= {"background__daytime_sky": "us_standard"} | SLANT
    for sun, relative in ((200, 0), (110, 90), (290.0, 90), (20, 180)):
        sky = setting_of(disc(folder, background__sun_azimuth_deg=sun, **looks_up)).backdrop
        expected = rows("skysun_us_standard_clear.csv", 35, relative)
        np.testing.assert_allclose(sky.at(x), on(x, *expected[:2])[0], rtol=2e-3)
    with pytest.raises(InputError, match="daytime.*does not cover|does not cover band LWIR"):
        setting_of(disc(folder, **(looks_up | {"sensor__band": "LWIR"})))
    low, high = (
        setting_of(disc(folder, observer__height_m=height, **looks_up)).backdrop.at(x)
        for height in (50.0, 2000.0)
    )
    assert np.all(high > 0) and np.all(high < 1.05 * low) and high.sum() < 0.8 * low.sum()


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
    given = {"background__daytime_sky": "us_standard", "background__sun_azimuth_deg": 60}
    scenario = disc(tmp_path, observer__elevation_deg=-30, **given)
    if fits:
        setting = setting_of(scenario)
        assert not unlit_sky(setting.view, scenario, setting.detector)
        night = disc(tmp_path, observer__elevation_deg=-30, **SKY)
        (remark,) = unlit_sky(setting.view, night, setting.detector)
        assert "no scattered sunlight; `daytime_sky` has it in MWIR" in remark
    else:
        with pytest.raises(InputError, match="does not fit the daytime_sky of .background., whose"):
            setting_of(scenario)


def test_sunlit_ground(folder):
    """Ground that only reflects has the sun's irradiance and that of the sky, over pi."""
    x, given = np.linspace(3.6, 4.0, 9), {"observer__elevation_deg": 10, "sensor__band": "3.5-4.1"}
    given |= {"background__daytime_sky": "us_standard", "background__ground_emissivity": 1e-9}
    ground = setting_of(disc(folder, **given, **SLANT, **GROUND)).backdrop
    of_table = rows("sun_us_standard_clear.csv", 45)
    (sun,) = on(x, of_table[0], of_table[2])
    of_sky = daytime_sky("us_standard").mean_spectrum().at(x)
    np.testing.assert_allclose(ground.at(x) - of_sky, sun * np.sin(np.pi / 4) / np.pi, rtol=1e-3)
    with pytest.raises(InputError, match="has sky and daytime_sky; give one of them"):
        Background(sky="us_standard_clear", daytime_sky="us_standard")


def test_the_sky_is_darker_from_higher_up(folder):
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
    x, T, _, down = rows("slant_us_standard.csv", 30, 10)
    steep = setting_of(disc(folder, **(given | {"observer__elevation_deg": 30}))).backdrop
    at_10_km = steep.at_sensor(10_000).at(x)
    np.testing.assert_allclose(at_10_km, T * planck(x, 300) + down, rtol=1e-4)


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


def test_lower_end_of_the_line_of_sight():
    """The sensor's height if it looks up, else the target's; up to 0.5 m below ground is rounding.

    Downward by 30 degrees, the target at 1 km lies 500 m lower, and 0.05 m for the round Earth.
    """

    def lower(height_m, elevation_deg, range_m=1000.0, base_m=50.0):
        observer = Observer(range_m, 0.0, elevation_deg, height_m=height_m)
        return lower_height(observer, base_m)

    assert lower(None, 30) == 50 and lower(None, 30, base_m=0.0) is None
    assert lower(700.0, -30) == lower(700.0, 0) == 700
    assert lower(700.0, 30) == pytest.approx(199.95, abs=0.001)
    assert lower(500.0, 30) == lower(499.56, 30) == 0
    with pytest.raises(InputError, match="ends below the ground before range_m = 1000"):
        lower(499.54, 30)


def test_a_path_that_misses_the_end_of_the_table_by_rounding(folder):
    """The table ends at 20 km. A path to the ground that is 0.4 m longer ends there, too."""
    sight = Sight.of(disc(folder, observer__elevation_deg=30, **SLANT))
    assert sight.beyond_m == 0
    for length in (19_999.6, 20_000.4):
        assert sight.to_ground(length).range_m == 20_000
    assert sight.to_ground(19_999.4).range_m == pytest.approx(19_999.4)
    with pytest.raises(InputError, match="range 20000.6 m is beyond its last one"):
        sight.to_ground(20_000.6)


def test_ground_reflects_the_mean_of_the_sky():
    """The mean of a sky with elevations, over their squared sine; a sky without is its own mean."""
    light = reflected(Background(sky="us_standard_clear"))
    assert len(light) == 8 and sum(factor for factor, _ in light) == pytest.approx(1, rel=1e-12)
    square = (np.arange(400) + 0.5) / 400
    elevations = np.degrees(np.arcsin(np.sqrt(square)))
    for x in (3.8, 10.5):
        mean = np.mean([spectrum("us_standard_clear", e).at(x) for e in elevations])
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


def test_horizontal_air_does_not_lift_the_sky(folder):
    """Only a table of slant paths says what is above a sensor; another one shows the sky as is."""
    given = {"observer__elevation_deg": -30, "observer__height_m": 1000.0, "sensor__band": "LWIR"}
    x = np.array([8.5, 10.5])
    shown = setting_of(disc(folder, atmosphere__table="us_standard", **given, **SKY)).backdrop
    np.testing.assert_array_equal(shown.at(x), spectrum("us_standard_clear", 30.0).at(x))


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"observer__elevation_deg": -0.5} | SKY, "elevation of 0.5 degrees at 50 m is outside"),
        (
            {"observer__elevation_deg": 0} | SKY,
            "elevation of 0 degrees at 50 m is outside its 1-90",
        ),
        (
            {"observer__elevation_deg": -30, "observer__range_m": 20_001} | SKY,
            "range 20001 m is beyond its last one, 20000 m",
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
            {"observer__elevation_deg": -2, "observer__height_m": 9000.0} | SKY,
            "of 2 degrees at 9000 m, does not reach down to 50 m",
        ),
        (
            {"observer__elevation_deg": 60, "observer__height_m": 18_500.0} | GROUND,
            "begins 20312.1 m along the line of sight from 50 m, where its last range is 20000 m",
        ),
        (
            {"observer__elevation_deg": 30, "atmosphere__ranges_m": [5.0]} | GROUND,
            "ranges_m are for",
        ),
        ({"atmosphere__table": "slant_midlat"}, "unknown atmosphere 'slant_midlat'"),
        ({"background__ground_temperature": -1}, "ground_temperature = -1 K; must be positive"),
        ({"background__ground_emissivity": 0.5}, "ground_emissivity = 0.5 without sky"),
        ({"background__ground_emissivity": 1.5} | GROUND, "emissivity = 1.5; must be positive"),
        ({"observer__height_m": -1}, "height_m = -1; must lie in 0..100000"),
    ],
)
def test_unusable(folder, changes, message):
    with pytest.raises(InputError, match=message):
        setting_of(disc(folder, **(SLANT | changes)))
