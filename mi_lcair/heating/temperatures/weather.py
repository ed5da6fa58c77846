"""Weather at the steps of a day: from numbers, from the rows of a CSV, or from an EPW file."""

import csv
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.files import read_text
from mi_lcair.heating.temperatures.air import SurfaceAir, longwave_temperature, sky_temperature
from mi_lcair.heating.temperatures.balance import DAY
from mi_lcair.heating.temperatures.description import WeatherTable
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.physics.sun import sun_position
from mi_lcair.rendering.motions.motion import toward
from mi_lcair.table import LARGEST, TextTable, read_table

HOUR = 3600.0
# Columns of an EPW file [EnergyPlus, Auxiliary Programs, section 2.9] and its mark for a missing
# value. MEANS are those over the hour that ends at a row.
EPW = {
    "air_K": (6, 99.9),
    "infrared": (12, 9999),
    "sun_W_m2": (14, 9999),
    "diffuse_W_m2": (15, 9999),
    "wind_m_s": (21, 999),
    "relative_humidity": (8, 999),
    "pressure_hPa": (9, 999999),
}
OPTIONAL = ("relative_humidity", "pressure_hPa")  # columns of an EPW file that may be missing
MEANS = ("sky_K", "sun_W_m2", "diffuse_W_m2")
STANDS_IN = {"wind_m_s": "h_W_m2_K", "infrared": "sky_K"}  # what [weather] may give in its place
EPW_HEADER = 8  # lines above the rows
ZERO_CELSIUS = 273.15
DIRECTION = ("sun_elevation_deg", "sun_azimuth_deg")
AT_TIMES = ("air_K", "h_W_m2_K", "sky_K", "ground_K", "sun_W_m2", "diffuse_W_m2", *DIRECTION)
OF_AIR = ("wind_m_s", "relative_humidity", "pressure_hPa")
OF_SKY = ("sky_K", "down_longwave_W_m2", "cloud")
ROWS = (*OF_AIR, *OF_SKY[1:], *AT_TIMES)  # columns of a CSV beside the hour
PLACE = ("latitude_deg", "longitude_deg", "utc_offset_h", "day")
LIMITS = {
    entry.name: Bounds(lower=bounds.lower, upper=min(bounds.upper, LARGEST))
    for entry in fields(WeatherTable)
    if (bounds := entry.metadata.get("bounds"))
}
INFRARED = Bounds(lower=10, upper=9999)  # of an EPW file [W m^-2]: a row without it may have 0
SEA_LEVEL_HPA = 1013.25
SHARE, THIN_HPA = 1.0, 300.0  # humidity as a share [%], and less pressure than on any mountain
SUNLIGHT_W_M2 = 1361  # irradiance by the sun at the Earth's distance, above the air
COLD_AIR_K = 120.0  # less than any air of the atmosphere has
# Largest shares of the beam's energy below the horizon: from rows that are means of an hour without
# a remark, and with one, as of a clock that is an hour off
DUSK, NIGHT = 0.015, 0.05


@dataclass(frozen=True)
class WeatherSeries:
    """Weather at some times.

    seconds: times since the beginning of the rows, (m,); of one time without a file. The other
    arrays have the same shape, see `WeatherTable`. sky: key from which sky_K follows.
    """

    seconds: np.ndarray
    air_K: np.ndarray
    h_W_m2_K: np.ndarray
    sky_K: np.ndarray
    ground_K: np.ndarray
    sun_W_m2: np.ndarray
    diffuse_W_m2: np.ndarray
    sun_elevation_deg: np.ndarray
    sun_azimuth_deg: np.ndarray
    albedo: float
    remarks: tuple[str, ...] = ()
    wind_m_s: np.ndarray | None = None
    relative_humidity: np.ndarray | None = None
    pressure_hPa: np.ndarray | None = None
    wind_height_m: float = 10.0
    air_height_m: float = 2.0
    day_s: float = DAY
    sky: str = "sky_K"

    def air(self, k: int) -> SurfaceAir:
        """The air at a time."""
        of_air = (None if v is None else v[k] for v in (getattr(self, n) for n in OF_AIR))
        wind, humidity, pressure = of_air
        return SurfaceAir(
            self.air_K[k],
            0.0 if wind is None else wind,
            0.0 if humidity is None else humidity,
            SEA_LEVEL_HPA if pressure is None else pressure,
            self.wind_height_m,
            self.air_height_m,
        )

    @property
    def down_longwave_W_m2(self) -> np.ndarray:
        """Irradiance of the sky on a horizontal plane, (m,)."""
        return STEFAN_BOLTZMANN * self.sky_K**4

    @property
    def toward_sun(self) -> np.ndarray:
        """Unit vectors toward the sun in the axes of the scene, (m, 3)."""
        angles = zip(self.sun_azimuth_deg, self.sun_elevation_deg)
        return np.array([toward(*pair)[:, 0] for pair in angles])

    @property
    def shines(self) -> np.ndarray:
        """Whether the sun shines, (m,)."""
        return np.real(self.sun_W_m2) > 0

    @property
    def height_of_sun(self) -> np.ndarray:
        """Sine of the sun's elevation, 0 below the horizon, (m,)."""
        return np.maximum(np.sin(np.radians(self.sun_elevation_deg)), 0)


def convection(wind_m_s):
    """Coefficient of convection [W m^-2 K^-1] from the wind [m/s].

    McAdams' correlation of Juerges' flat plate, Heat Transmission, 3rd ed. (1954), p. 249. From
    4.88 m/s on it is 9 % less than 7.1 v^0.78, which others give for the same plate.
    """
    wind = np.asarray(wind_m_s, float)
    return np.where(wind < 4.88, 5.7 + 3.8 * wind, 6.47 * wind**0.78)


def weather(table: WeatherTable, folder: Path, steps: int, is_periodic: bool) -> WeatherSeries:
    """The weather of a [weather] table.

    Parameters
    ----------
    table : WeatherTable
    folder : Path
        Folder of the files that it names.
    steps : int
        Steps of a day, at whose ends the weather of a file is wanted.
    is_periodic : bool
        Whether the rows are those of a day that is repeated.

    Raises
    ------
    InputError
        If rows are missing or cannot be used, if something is missing or given twice, or if the sun
        shines from below the horizon.
    """
    given = ((name, getattr(table, name)) for name in (*ROWS, *PLACE))
    values = {name: value for name, value in given if value is not None}
    if table.file is None:
        if not is_periodic:
            raise InputError("[run]: start_K begins a series; give its rows as file of [weather]")
        return completed(table, values, np.zeros(1), "[weather]")
    path = folder / table.file
    where, is_epw = f"weather {path}", path.suffix.lower() == ".epw"
    text, rows, place = epw_rows(path, table) if is_epw else csv_rows(path)
    if twice := [name for name in (*rows, *place) if values.get(name)]:
        raise InputError(f"{where}: has {twice[0]}; leave it out of [weather]")
    hours, hour_s = rows.pop("hour"), HOUR * table.day_h / 24
    check_hours(where, hours, is_periodic)
    if is_periodic:
        times = 24 * hour_s / steps * np.arange(1, steps + 1)
    else:
        count = max(2, round((hours[-1] - hours[0]) / 24 * steps))
        times = hour_s * np.linspace(hours[0], hours[-1], count + 1)[1:]
    for name, numbers in rows.items():
        text.check_range(name, numbers, LIMITS[name])
        centres = hours - 0.5 * (is_epw and name in MEANS)
        values[name] = interpolated(times, centres * hour_s, numbers, is_periodic, 24 * hour_s)
    return completed(table, values | place, times, where)


def interpolated(times, centres, numbers, is_periodic: bool, day: float = DAY) -> np.ndarray:
    """Numbers of rows at other times, on straight lines.

    The rows of a day are repeated; a last row that is 24 hours after the first is left out.
    """
    if is_periodic and centres[-1] - centres[0] >= day:
        centres, numbers = centres[:-1], numbers[:-1]
    return np.interp(times, centres, numbers, period=day if is_periodic else None)


def check_hours(where: str, hours: np.ndarray, is_periodic: bool) -> None:
    """Raise InputError for rows with gaps, that go back, or that are no day."""
    if len(hours) < 2:
        raise InputError(f"{where}: has one row; give at least two")
    usual = float(np.median(np.diff(hours)))
    # A day that is repeated goes on with its first row, or has that row at its end too
    around = [hours[0] + 24] if is_periodic and hours[-1] != hours[0] + 24 else []
    steps = np.diff([*hours, *around])
    if (bad := ~((steps > 0) & (steps < 1.5 * usual))).any():
        row = int(bad.argmax())
        hint = "; give start_K of [run] for a series that is no day" if is_periodic else ""
        what = "there is a gap" if steps[row] > 0 else "time does not rise"
        raise InputError(
            f"{where}: from hour {hours[row]:g} to {hours[row] + steps[row]:g} {what}, "
            f"where rows are {abs(usual):g} h apart{hint}"
        )


def csv_rows(path: Path) -> tuple[TextTable, dict, dict]:
    """The table of a CSV, its columns as {name: numbers}, and no place."""
    table = read_table(path, ("hour",), "weather")
    if odd := [name for name in table.columns if name not in ("hour", *ROWS)]:
        raise InputError(
            f"weather {path}: column {odd[0]} is unknown; known are hour, {', '.join(ROWS)}"
        )
    numbers = table.numbers(table.columns)
    if "sun_azimuth_deg" in numbers:
        numbers["sun_azimuth_deg"] = np.unwrap(numbers["sun_azimuth_deg"], period=360)
    return table, numbers, {}


def epw_rows(path: Path, given: WeatherTable) -> tuple[TextTable, dict, dict]:
    """Rows of a day of an EPW file, as `csv_rows`, and the place of its first line.

    The year of the day is ignored, because the months of a typical year come from several years.
    What is given in place of a column is not read; see `STANDS_IN`.
    """
    where, day = f"weather {path}", given.day
    columns = {
        name: place
        for name, place in EPW.items()
        if name not in STANDS_IN or getattr(given, STANDS_IN[name]) is None
    }
    reader = csv.reader(read_text(path, where).splitlines(), skipinitialspace=True)
    lines = [[cell.strip() for cell in row] for row in reader]
    if len(lines) <= EPW_HEADER or lines[0][:1] != ["LOCATION"]:
        raise InputError(f"{where}: is no EPW file, whose first line begins with LOCATION")
    if day is None:
        raise InputError(f"{where}: name the day, such as day = 2026-06-21")
    of_day = [
        (number, [row[3], *(row[k] for k, _ in columns.values())])
        for number, row in enumerate(lines[EPW_HEADER:], EPW_HEADER + 1)
        if len(row) > 21
        and [cell.lstrip("0") for cell in row[1:3]] == [str(day.month), str(day.day)]
    ]
    if len(of_day) != 24:
        raise InputError(f"{where}: has {len(of_day)} rows of {day}; expected 24")
    table = TextTable(where, ["hour", *columns], of_day)
    numbers = table.numbers(table.columns)
    for name in OPTIONAL:
        if not ((numbers[name] > 0) & (numbers[name] < columns[name][1])).all():
            del numbers[name], columns[name]
    if "pressure_hPa" in numbers:
        numbers["pressure_hPa"] = numbers["pressure_hPa"] / 100
    for name, (_, missing) in columns.items():
        if (absent := numbers[name] >= missing).any():
            raise InputError(f"{where}, line {of_day[int(absent.argmax())][0]}: {name} is missing")
    numbers["air_K"] += ZERO_CELSIUS
    if "infrared" in numbers:
        table.check_range("infrared", numbers["infrared"], INFRARED)
        numbers["sky_K"] = (numbers.pop("infrared") / STEFAN_BOLTZMANN) ** 0.25
    *names, _ = PLACE
    head = TextTable(where, names, [(1, lines[0][6:9])])
    place = head.numbers(names)
    for name, values in place.items():
        head.check_range(name, values, LIMITS[name])
    return table, numbers, {name: float(value[0]) for name, value in place.items()}


def completed(table: WeatherTable, values: dict, times: np.ndarray, where: str) -> WeatherSeries:
    """Weather of the numbers of a table and its rows at some times."""
    if ("h_W_m2_K" in values) == ("wind_m_s" in values):
        raise InputError(f"{where}: give h_W_m2_K or wind_m_s, one of them")
    if "air_K" not in values:
        raise InputError(f"{where}: air_K is missing")
    sky, remarks = sky_of(values, where)
    if "ground_K" not in values:
        remarks += ("the ground has the temperature of the air; give ground_K to change it",)
        values["ground_K"] = values["air_K"]
    if "wind_m_s" in values:
        values["h_W_m2_K"] = convection(values["wind_m_s"])
    if not all(name in values for name in DIRECTION):
        values |= zip(DIRECTION, directions(table, values, times, where))
    arrays = {name: np.broadcast_to(values[name], times.shape).astype(float) for name in AT_TIMES}
    remarks = (*remarks, *doubts(values))
    coldest = np.where(arrays["h_W_m2_K"] > 0, arrays["air_K"], np.inf).min()
    if coldest < COLD_AIR_K:
        cold = f"air_K falls to {coldest:g}, colder than air ever is; is it in kelvin?"
        remarks = (*remarks, cold)
    sun, is_day = arrays["sun_W_m2"], arrays["sun_elevation_deg"] > 0
    share = sun[~is_day].sum() / max(sun.sum(), 1e-300)
    at_night = f"{share:.1%} of sun_W_m2 is at times when the sun is below the horizon"
    if share > NIGHT:
        raise InputError(f"{where}: {at_night}")
    if share > DUSK:
        remarks = (*remarks, f"{at_night} and is ignored; is the clock right?")
    sun[~is_day] = 0
    arrays |= {
        name: np.broadcast_to(values[name], times.shape).astype(float)
        for name in OF_AIR
        if name in values
    }
    return WeatherSeries(
        seconds=times, albedo=table.albedo, remarks=remarks, wind_height_m=table.wind_height_m,
        air_height_m=table.air_height_m, day_s=HOUR * table.day_h, sky=sky, **arrays,
    )  # fmt: skip


def doubts(values: dict) -> list[str]:
    """Remarks on humidity, pressure and sunlight that may be in another unit."""
    humidity = np.max(values.get("relative_humidity", 100.0))
    pressure = np.max(values.get("pressure_hPa", SEA_LEVEL_HPA))
    remarks = []
    if 0 < humidity <= SHARE:
        most = f"relative_humidity is {humidity:g} % at most, drier than any desert"
        remarks.append(f"{most}; as a share it would be {100 * humidity:g} %")
    if pressure < THIN_HPA:
        thin = (
            f"pressure_hPa is {pressure:g} at most, {pressure / SEA_LEVEL_HPA:.1%} of sea level's"
        )
        remarks.append(f"{thin}; {pressure:g} kPa would be {10 * pressure:g} hPa")
    for name in ("sun_W_m2", "diffuse_W_m2"):
        if (most := np.max(values.get(name, 0.0))) > SUNLIGHT_W_M2:
            times = f"{most / SUNLIGHT_W_M2:.3g} times as much as the sun sends to the Earth"
            remarks.append(f"{name} rises to {most:g}, {times}; is it in W/m^2?")
    return remarks


def sky_of(values: dict, where: str) -> tuple[str, tuple[str, ...]]:
    """Set sky_K from what is given of the sky, and return that key and remarks on it."""
    given = [name for name in OF_SKY if name in values]
    if len(given) > 1:
        raise InputError(f"{where}: give {given[0]} or {given[1]}, one of them")
    if not given:
        raise InputError(f"{where}: sky_K is missing; give one of {', '.join(OF_SKY)}")
    (sky,) = given
    if sky == "down_longwave_W_m2":
        values["sky_K"] = longwave_temperature(values[sky])
    if sky != "cloud":
        return sky, ()
    if "relative_humidity" not in values:
        raise InputError(f"{where}: cloud needs relative_humidity, from which the sky follows")
    names = ("air_K", "relative_humidity", "cloud")
    values["sky_K"] = sky_temperature(*(values[name] for name in names))
    return sky, ("the sky is estimated from humidity and cloud, with an error of about 15 W/m^2",)


def directions(table, values: dict, times: np.ndarray, where: str) -> np.ndarray:
    """Elevation and azimuth of the sun by place, at some times [degrees]; 0 without a sun."""
    if not np.any(values["sun_W_m2"]):
        return np.zeros((2, *times.shape))
    if table.file is None or not all(name in values for name in PLACE):
        raise InputError(
            f"{where}: sunlight needs {' and '.join(DIRECTION)}, or for a file its place: "
            f"{', '.join(PLACE)}"
        )
    offset = np.timedelta64(round(3600 * values["utc_offset_h"]), "s")
    moments = np.datetime64(values["day"]) - offset + np.round(times).astype("timedelta64[s]")
    place = values["latitude_deg"], values["longitude_deg"]
    suns = [sun_position(*place, f"{moment}+00:00") for moment in moments]
    azimuth = table.north_deg - np.array([sun.compass_deg for sun in suns])
    return np.array([[sun.elevation_deg for sun in suns], np.unwrap(azimuth, period=360)])
