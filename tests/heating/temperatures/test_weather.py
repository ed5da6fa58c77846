"""Weather from numbers, rows and EPW files, and what is refused."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.air import SurfaceAir
from mi_lcair.heating.temperatures.description import HeatDescription, WeatherTable
from mi_lcair.heating.temperatures.weather import convection, weather
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.physics.sun import sun_position

FOIL = {"thickness_mm": 1e-5, "conductivity": 200.0, "density": 2700.0, "heat_capacity": 900.0}
CONSTANT = {"air_K": 290.0, "h_W_m2_K": 8.0, "sky_K": 260.0}


def rows(path, cells=lambda hour: f"{290 + hour},260,8,0,-20,0", hours=range(25)):
    """A CSV of a day, and the table that names it."""
    head = "hour,air_K,sky_K,h_W_m2_K,sun_W_m2,sun_elevation_deg,sun_azimuth_deg\n"
    lines = "".join(f"{hour},{cells(hour)}\n" for hour in hours)
    (path / "day.csv").write_text(head + lines)
    return WeatherTable(file="day.csv")


def epw(path, change=None):
    """An EPW file of a day in Zurich whose numbers are simple functions of the hour."""
    head = ["LOCATION,Zurich,-,CHE,made,0,47.48,8.53,1.0,400"] + ["-"] * 7
    lines = []
    for hour in range(1, 25):
        row = [1999, 6, 21, hour, 0, "-"] + [0] * 29
        row[6], row[12], row[14], row[15], row[21] = (
            10 + hour,
            300 + hour,
            20 * hour * (5 < hour < 21),
            50,
            3,
        )
        for column, cell in (change or {}).items() if hour == 12 else ():
            row[column] = cell
        lines.append(",".join(map(str, row)))
    (path / "site.epw").write_text("\n".join(head + lines) + "\n")
    return WeatherTable(file="site.epw", day=date(2026, 6, 21))


def placed(path, place):
    """The same file with another place."""
    table, file = epw(path), path / "site.epw"
    file.write_text(file.read_text().replace("47.48,8.53,1.0", place))
    return table


def renamed(path):
    """A CSV with a column of another name."""
    table, file = rows(path), path / "day.csv"
    file.write_text(file.read_text().replace("sky_K", "sky_C"))
    return table


def night(path):
    """Sunshine around midnight at a place."""
    (path / "night.csv").write_text(
        "hour,sun_W_m2\n" + "".join(f"{hour},{600 * (hour < 5)}\n" for hour in range(24))
    )
    place = {"latitude_deg": 47.0, "longitude_deg": 8.0, "utc_offset_h": 1.0}
    place["day"] = date(2026, 6, 21)
    return WeatherTable(file="night.csv", **place, **CONSTANT)


def test_numbers_hold_all_the_time(tmp_path):
    table = WeatherTable(**CONSTANT, sun_W_m2=700, sun_elevation_deg=30, sun_azimuth_deg=90)
    constant = weather(table, tmp_path, 96, True)
    assert constant.seconds.shape == (1,)
    np.testing.assert_allclose(constant.toward_sun, [[0, np.sqrt(3) / 2, 0.5]], atol=1e-12)
    assert constant.height_of_sun == pytest.approx(0.5)
    assert replace(constant, sun_elevation_deg=np.array([-5.0])).height_of_sun == 0
    assert constant.shines and not replace(constant, sun_W_m2=np.zeros(1)).shines
    assert constant.ground_K == 290
    # The standard atmosphere's pressure, still and dry air, heights of a weather station
    assert constant.air(0) == SurfaceAir(290.0, 0.0, 0.0, 1013.25, 10.0, 2.0)
    assert "ground" in constant.remarks[0]


def test_a_measured_sky_and_a_day_of_another_length(tmp_path):
    table = rows(tmp_path)
    text = (tmp_path / "day.csv").read_text().replace("sky_K", "down_longwave_W_m2")
    (tmp_path / "day.csv").write_text(text)
    day = weather(replace(table, day_h=48.0), tmp_path, 48, True)
    np.testing.assert_allclose(day.seconds, 3600 * np.arange(1, 49))
    np.testing.assert_allclose(day.air_K[:46], 290 + 0.5 * np.arange(1, 47))
    np.testing.assert_allclose(STEFAN_BOLTZMANN * day.sky_K**4, 260)
    np.testing.assert_allclose(day.down_longwave_W_m2, 260)
    assert day.day_s == 48 * 3600


def test_air_in_celsius_is_doubted(tmp_path):
    """A vacuum has no air, so that its temperature does not count."""

    def remarks(**changes):
        table = WeatherTable(**CONSTANT | {"ground_K": 280.0} | changes)
        return weather(table, tmp_path, 96, True).remarks

    (remark,) = remarks(air_K=20.0)
    assert remark.startswith("air_K falls to 20, ")
    assert not remarks() and not remarks(air_K=20.0, h_W_m2_K=0.0)
    assert len(remarks(air_K=119.0, h_W_m2_K=0.5)) == 1 and not remarks(air_K=121.0)
    (remark,) = remarks(relative_humidity=0.5)
    assert "drier than any desert; as a share it would be 50 %" in remark
    (remark,) = remarks(pressure_hPa=90.0)
    assert "8.9% of sea level's; 90 kPa would be 900 hPa" in remark
    (remark,) = remarks(sun_W_m2=2722.0, sun_elevation_deg=30.0, sun_azimuth_deg=0.0)
    assert remark.startswith("sun_W_m2 rises to 2722, 2 times as much as the sun sends")
    assert not remarks(relative_humidity=1.02, pressure_hPa=301.0)
    assert len(remarks(relative_humidity=1.0, pressure_hPa=299.0)) == 2
    assert not remarks(relative_humidity=0.0)


def test_rows_are_interpolated(tmp_path):
    day = weather(rows(tmp_path), tmp_path, 48, True)
    np.testing.assert_allclose(day.seconds, 1800 * np.arange(1, 49))
    np.testing.assert_allclose(day.air_K[:46], 290 + 0.5 * np.arange(1, 47))
    # The last row is the first one of the next day, and gives way to that of this day
    np.testing.assert_allclose(day.air_K[46:], [(313 + 290) / 2, 290])
    assert np.all(day.sun_W_m2 == 0)
    series = weather(rows(tmp_path, hours=range(7)), tmp_path, 96, False)
    np.testing.assert_allclose(series.seconds, 900 * np.arange(1, 25))


@pytest.mark.parametrize(
    ("column", "given"), [(21, {"h_W_m2_K": 7.0}), (12, {"sky_K": 260.0})], ids=["h", "sky"]
)
def test_numbers_stand_in_for_what_an_epw_file_lacks(tmp_path, column, given):
    table = replace(epw(tmp_path, {column: 9999}), **given)
    ((name, value),) = given.items()
    assert np.all(getattr(weather(table, tmp_path, 24, True), name) == value)


def test_an_epw_file_with_blanks_is_the_same(tmp_path):
    table = epw(tmp_path)
    plain, file = weather(table, tmp_path, 24, True), tmp_path / "site.epw"
    file.write_text(file.read_text().replace(",", " , "))
    np.testing.assert_equal(vars(weather(table, tmp_path, 24, True)), vars(plain))


@pytest.mark.parametrize(("step", "most"), [(0.5, 0.7), (2.0, 2.9)])
def test_a_gap_is_one_and_a_half_of_the_usual_step(tmp_path, step, most):
    regular = np.arange(0, 12.1, step)
    for wide in (most, 1.6 * step):
        hours = [*regular, regular[-1] + wide]
        table = rows(tmp_path, lambda hour: "290,260,8,0,-20,0", hours)
        if wide < 1.5 * step:
            assert weather(table, tmp_path, 96, False).seconds[-1] == 3600 * hours[-1]
        else:
            with pytest.raises(InputError, match="there is a gap, where rows are"):
                weather(table, tmp_path, 96, False)


@pytest.mark.parametrize("share", [0.0148, 0.0155, 0.0495, 0.0505])
def test_sun_at_night(tmp_path, share):
    """Beyond 1.5 % of the day's energy it is left out with a remark, beyond 5 % refused."""

    def cells(hour):
        sun = {2: share, 12: 1 - share}.get(hour, 0)
        return f"290,260,8,{1000 * sun},{30 if hour == 12 else -20},0"

    table = rows(tmp_path, cells)
    if share > 0.05:
        with pytest.raises(InputError, match=r"5\.[01]% of sun_W_m2"):
            weather(table, tmp_path, 24, True)
        return
    day = weather(table, tmp_path, 24, True)
    assert day.sun_W_m2[1] == 0 and day.sun_W_m2[11] == pytest.approx(1000 * (1 - share))
    assert any("is the clock right?" in remark for remark in day.remarks) == (share > 0.015)


@pytest.mark.parametrize("column", [6, 12, 14, 15, 21])
def test_marks_of_missing_values(tmp_path, column):
    """The marks of the EPW format; what is just below them is a value, if in its limits."""
    mark = {6: 99.9, 21: 999}.get(column, 9999)
    with pytest.raises(InputError, match="line 20: .* is missing"):
        weather(epw(tmp_path, {column: mark}), tmp_path, 24, True)
    below = {6: 99.8, 12: 9998, 14: 9998, 15: 9998, 21: 99.0}[column]
    weather(epw(tmp_path, {column: below}), tmp_path, 24, True)


def test_humidity_and_pressure_of_an_epw_file(tmp_path):
    """Percent and Pa; a file that misses one of them in any row is read without it."""
    table, file = epw(tmp_path), tmp_path / "site.epw"
    head, lines = file.read_text().splitlines()[:8], file.read_text().splitlines()[8:]

    def written(last_humidity, last_pressure):
        filled = []
        for number, line in enumerate(lines):
            cells, is_last = line.split(","), number == len(lines) - 1
            cells[8] = str(last_humidity if is_last else 40 + number)
            cells[9] = str(last_pressure if is_last else 95_000 + number)
            filled.append(",".join(cells))
        file.write_text("\n".join(head + filled) + "\n")
        return weather(table, tmp_path, 24, True)

    day = written(63, 95_023)
    np.testing.assert_allclose(day.relative_humidity, 40 + np.arange(24))
    np.testing.assert_allclose(day.pressure_hPa, 950 + np.arange(24) / 100)
    assert day.air(3).pressure == pytest.approx(950.03) and day.air(3).humidity == 43
    assert day.air(3).wind == 3
    assert written(999, 95_023).relative_humidity is None
    assert written(0, 95_023).relative_humidity is None
    assert written(63, 999_999).pressure_hPa is None


def test_a_clock_of_half_hours(tmp_path):
    """The sun of a place at UTC+5:30 stands where it does at that moment."""
    place = {"latitude_deg": 20.0, "longitude_deg": 80.0, "utc_offset_h": 5.5, "north_deg": 90.0}
    (tmp_path / "noon.csv").write_text("hour,sun_W_m2\n8,500\n12,900\n16,500\n")
    table = WeatherTable(file="noon.csv", day=date(2026, 3, 1), **place, **CONSTANT)
    day = weather(table, tmp_path, 6, False)
    sun = sun_position(20.0, 80.0, "2026-03-01T12:00:00+05:30")
    assert day.seconds.tolist() == [12 * 3600, 16 * 3600]
    assert day.sun_elevation_deg[0] == pytest.approx(sun.elevation_deg, abs=1e-6)
    # +x of the scene points east, if north is at azimuth 90
    x, y, _ = day.toward_sun[0]
    assert np.degrees(np.arctan2(x, y)) % 360 == pytest.approx(sun.compass_deg, abs=1e-6)


@pytest.mark.parametrize(
    ("wind", "h"), [(0, 5.7), (1, 9.5), (4.8, 23.94), (5, 22.70), (10, 38.99), (20, 66.94)]
)
def test_mcadams_values(wind, h):
    """Values of his correlation; it steps down where the power law begins."""
    assert convection(wind) == pytest.approx(h, abs=0.01)


def test_mcadams_is_near_juerges():
    """Within 4 % of his law for smooth plates, as IDEAS has it, and 9 % less in faster wind."""
    slow, fast = np.linspace(0, 4.87, 40), np.linspace(5, 20, 40)
    np.testing.assert_allclose(convection(slow), 5.6 + 4.0 * slow, rtol=0.04)
    np.testing.assert_allclose(convection(fast), 0.91 * 7.1 * fast**0.78, rtol=0.002)


def test_a_short_series_is_no_steady_state(tmp_path):
    assert len(weather(rows(tmp_path, hours=(0, 1)), tmp_path, 4, False).seconds) == 2


def test_epw_file(tmp_path):
    """Air and wind at the hour, sun and infrared in the middle of the hour that ends there."""
    day = weather(epw(tmp_path), tmp_path, 48, True)
    at_noon, half_past = 23, 24
    assert day.air_K[at_noon] == pytest.approx(273.15 + 22)
    assert day.h_W_m2_K[at_noon] == pytest.approx(convection(3.0)) == pytest.approx(5.7 + 11.4)
    assert STEFAN_BOLTZMANN * day.sky_K[half_past] ** 4 == pytest.approx(313, rel=1e-3)
    assert day.sun_W_m2[half_past] == pytest.approx(260)
    assert day.diffuse_W_m2[half_past] == pytest.approx(50)
    sun = sun_position(47.48, 8.53, "2026-06-21T12:00:00+01:00")
    assert day.sun_elevation_deg[at_noon] == pytest.approx(sun.elevation_deg, abs=1e-6)
    x, y, _ = day.toward_sun[at_noon]
    assert np.degrees(np.arctan2(x, y)) % 360 == pytest.approx(sun.compass_deg, abs=1e-6)
    assert day.sun_W_m2[0] == 0  # the sun is below the horizon


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: rows(p, hours=[*range(5), *range(7, 25)]), "from hour 4 to 7 there is a gap"),
        (lambda p: rows(p, hours=range(12)), "from hour 11 to 24 there is a gap.* give start_K"),
        (lambda p: rows(p, hours=[0, 0, 1, 2]), "from hour 0 to 0 time does not rise"),
        (lambda p: placed(p, "99,8,1"), "line 1: latitude_deg = 99; must lie in -90..90"),
        (lambda p: placed(p, "47,190,1"), "line 1: longitude_deg = 190; must lie in"),
        (lambda p: placed(p, "47,8,15"), "line 1: utc_offset_h = 15; must lie in -14..14"),
        (lambda p: rows(p, lambda hour: "290,,8,0,-20,0"), "line 2: '' in column 'sky_K'"),
        (lambda p: rows(p, lambda hour: "290,260,8,5,-20,0"), "sun is below the horizon"),
        (lambda p: rows(p, hours=[3]), "one row"),
        (lambda p: renamed(p), "column sky_C is unknown"),
        (lambda p: epw(p, {2: 22}), "has 23 rows of 2026-06-21; expected 24"),
        (lambda p: epw(p, {12: 9}), "line 20: infrared = 9; must lie in 10..9999"),
        (lambda p: epw(p, {6: 9999}), "line 20: air_K is missing"),
        (lambda p: WeatherTable(file="site.epw"), "day = 2026-06-21"),
        (lambda p: epw(p, {6: "warm"}), "line 20: 'warm' in column 'air_K'"),
        (lambda p: epw(p, {6: -400}), "line 20: air_K = -126.85; must lie in 10..6000"),
        (lambda p: epw(p, {12: -5}), "line 20: infrared = -5; must"),
        (lambda p: epw(p, {12: 0}), "line 20: infrared = 0; must lie in 10..9999"),
        (lambda p: epw(p, {14: -5}), "line 20: sun_W_m2 = -5; must"),
        (lambda p: rows(p, lambda hour: "0,260,8,0,-20,0"), "line 2: air_K = 0; must lie in 10"),
        (lambda p: replace(rows(p), air_K=280.0), "has air_K; leave it out of"),
        (lambda p: replace(epw(p), north_deg=0, latitude_deg=5.0), "has latitude_deg; leave"),
        (lambda p: night(p), "% of sun_W_m2 is at times when the sun is below the horizon"),
        (lambda p: WeatherTable(**CONSTANT, wind_m_s=3.0), "one of them"),
        (lambda p: WeatherTable(air_K=290.0, h_W_m2_K=8.0), "sky_K is missing"),
        (lambda p: WeatherTable(air_K=290.0, h_W_m2_K=8.0, cloud=0.5), "needs relative_humidity"),
        (lambda p: WeatherTable(**CONSTANT, cloud=0.5), "give sky_K or cloud, one of them"),
        (lambda p: WeatherTable(**CONSTANT, sun_W_m2=900.0), "sunlight needs"),
        (
            lambda p: WeatherTable(
                **CONSTANT, sun_W_m2=900.0, sun_elevation_deg=-1, sun_azimuth_deg=0
            ),
            "sun is below the horizon",
        ),
    ],
)
def test_refused(tmp_path, make, message):
    epw(tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        weather(make(tmp_path), tmp_path, 96, True)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"weather": {"sky": "clear"}}, "sky_K"),
        ({"weather": {"day": "20260621"}}, "must be a date without quotes, such as 2026-06-21"),
        ({"groups": {"self": {"conductivity": -1.0}}}, r"groups.self.: conductivity = -1"),
        ({"groups": {"self": {"thickness_mm": 2.0}}}, "conductivity is missing; give thickness_mm"),
        (
            {"groups": {"self": {"temperature": 300.0, "internal_W_m2": 5.0}}},
            "a group with a temperature",
        ),
        ({"groups": {"self": {"back_h": 5.0}}}, "back_h needs back_K"),
        ({"groups": {"self": {"back_K": 300.0}}}, "back_K needs thickness_mm, conductivity"),
        ({"groups": {"self": FOIL}}, "groups.self.: heat crosses the wall faster than"),
        (
            {"groups": {"self": FOIL | {"density": 0.0}}},
            r"density = 0 kg/m.3; must lie in 0.01..100000",
        ),
        ({"sigma": {"sky_K": {}}}, "'sky_K' = {}: must have one of uniform"),
        ({"sigma": {"sky_K": 1e30}}, r"'sky_K' = 1e\+30; must be positive and at most"),
        ({"sigma": {"h": "nine"}}, "'h' = 'nine'"),
        ({"sigma": {"h": "-5 %"}}, "sigma.: 'h' = -0.05; must be positive"),
        ({"sigma": {"h": -1.0}}, "'h' = -1"),
        ({"sun": {}}, "table 'sun'"),
        ({"sigma": 3}, r"\[sigma\] must be a table"),
        ({"groups": 3}, r"\[groups\] must be a table"),
        ({"run": 3}, r"\[run\] must be a table"),
        ({"target": {}}, "scene is missing"),
    ],
)
def test_descriptions_that_are_refused(tables, message):
    with pytest.raises(InputError, match=message):
        HeatDescription.read({"target": {"scene": "box"}, "weather": CONSTANT} | tables)
