"""Weather at the steps of a day: from numbers, from the rows of a CSV, or from an EPW file."""

import csv
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.files import read_text
from mi_lcair.heating.temperatures.description import WeatherTable
from mi_lcair.heating.temperatures.wall import DAY
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.physics.sun.position import sun_position
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
}
MEANS = ("sky_K", "sun_W_m2", "diffuse_W_m2")
EPW_HEADER = 8  # lines above the rows
ZERO_CELSIUS = 273.15
ROWS = ("air_K", "h_W_m2_K", "wind_m_s", "sky_K", "ground_K", "sun_W_m2", "diffuse_W_m2")
DIRECTION = ("sun_elevation_deg", "sun_azimuth_deg")
PLACE = ("latitude_deg", "longitude_deg", "utc_offset_h", "day")
LIMITS = {
    entry.name: (bounds.lower, min(bounds.upper, LARGEST))
    for entry in fields(WeatherTable)
    if (bounds := entry.metadata.get("bounds"))
}
DUSK = 0.05  # largest share of the beam's energy below the horizon, from rows that are means


@dataclass(frozen=True)
class Weather:
    """Weather at some times.

    seconds: times since the beginning of the rows, (m,); of one time without a file. The other
    arrays have the same shape, see `WeatherTable`.
    """

    seconds: np.ndarray
    air_K: np.ndarray
    h_W_m2_K: np.ndarray
    sky_K: np.ndarray
    ground_K: np.ndarray
    sun_W_m2: np.ndarray
    diffuse_W_m2: np.ndarray
    elevation_deg: np.ndarray
    azimuth_deg: np.ndarray
    albedo: float
    remarks: tuple[str, ...] = ()

    @property
    def toward_sun(self) -> np.ndarray:
        """Unit vectors toward the sun in the axes of the scene, (m, 3)."""
        elevation, azimuth = np.radians(self.elevation_deg), np.radians(self.azimuth_deg)
        cos = np.cos(elevation)
        return np.stack([cos * np.cos(azimuth), cos * np.sin(azimuth), np.sin(elevation)], axis=1)

    @property
    def height_of_sun(self) -> np.ndarray:
        """Sine of the sun's elevation, 0 below the horizon, (m,)."""
        return np.maximum(np.sin(np.radians(self.elevation_deg)), 0)


def convection(wind_m_s):
    """Coefficient of convection [W m^-2 K^-1] from the wind [m/s].

    McAdams' correlation of Juerges' flat plate, Heat Transmission, 3rd ed. (1954), p. 249.
    """
    wind = np.asarray(wind_m_s, float)
    return np.where(wind < 4.88, 5.7 + 3.8 * wind, 6.47 * wind**0.78)


def weather(table: WeatherTable, folder: Path, steps: int, is_periodic: bool) -> Weather:
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
    constants = {
        name: value
        for name in (*ROWS, *DIRECTION, *PLACE)
        if (value := getattr(table, name)) is not None
    }
    where, times, values = "[weather]", np.zeros(1), dict(constants)
    if table.file is not None:
        path = folder / table.file
        where, is_epw = f"weather {path}", path.suffix.lower() == ".epw"
        text, rows, place = (epw_rows if is_epw else csv_rows)(path, table.day)
        if is_epw and table.h_W_m2_K is not None:
            del rows["wind_m_s"]
        hours = rows.pop("hour")
        check_hours(where, hours, is_periodic)
        length = DAY if is_periodic else HOUR * (hours[-1] - hours[0])
        count = steps if is_periodic else max(2, round(length / DAY * steps))
        begin = 0.0 if is_periodic else hours[0] * HOUR
        times = begin + length / count * np.arange(1, count + 1)
        values |= place
        if twice := [name for name in (*rows, *place) if constants.get(name)]:
            raise InputError(f"{where}: has {twice[0]}; leave it out of [weather]")
        for name, numbers in rows.items():
            text.check_range(name, numbers, *LIMITS[name])
            centres = hours - 0.5 * (is_epw and name in MEANS)
            values[name] = interpolated(times, centres * HOUR, numbers, is_periodic)
    return completed(table, values, times, where)


def interpolated(times, centres, numbers, is_periodic: bool) -> np.ndarray:
    """Numbers of rows at other times, on straight lines.

    The rows of a day are repeated; a last row that is 24 hours after the first is left out.
    """
    if is_periodic and centres[-1] - centres[0] >= DAY:
        centres, numbers = centres[:-1], numbers[:-1]
    return np.interp(times, centres, numbers, period=DAY if is_periodic else None)


def check_hours(where: str, hours: np.ndarray, is_periodic: bool) -> None:
    """Raise InputError for rows with gaps, that go back, or that are no day."""
    if len(hours) < 2:
        raise InputError(f"{where}: has one row; give at least two")
    steps = np.diff(hours)
    usual = float(np.median(steps))
    if (bad := ~((steps > 0) & (steps < 1.5 * usual))).any():
        row = int(bad.argmax())
        raise InputError(
            f"{where}: from hour {hours[row]:g} to {hours[row + 1]:g} there is a gap, where rows "
            f"are {usual:g} h apart"
        )
    if is_periodic and not -1e-6 <= 24 - (hours[-1] - hours[0]) < 1.5 * usual:
        raise InputError(
            f"{where}: the rows last {hours[-1] - hours[0]:g} h, but a day that is repeated has "
            "24; give start_K of [run] for another series"
        )


def csv_rows(path: Path, day) -> tuple[TextTable, dict, dict]:
    """The table of a CSV, its columns as {name: numbers}, and no place."""
    table = read_table(path, ("hour",), "weather")
    names = [name for name in table.columns if name in (*ROWS, *DIRECTION)]
    if odd := [name for name in table.columns if name not in (*names, "hour")]:
        raise InputError(
            f"weather {path}: column {odd[0]} is unknown; known are hour, "
            f"{', '.join((*ROWS, *DIRECTION))}"
        )
    numbers = table.numbers(["hour", *names])
    if {"sun_W_m2", "sun_elevation_deg"} <= numbers.keys():
        below = (numbers["sun_W_m2"] > 0) & (numbers["sun_elevation_deg"] <= 0)
        if below.any():
            raise InputError(
                f"weather {path}, line {table.rows[int(below.argmax())][0]}: sun_W_m2 > 0 with the "
                "sun below the horizon"
            )
    if "sun_azimuth_deg" in numbers:
        numbers["sun_azimuth_deg"] = np.unwrap(numbers["sun_azimuth_deg"], period=360)
    return table, numbers, {}


def epw_rows(path: Path, day: str | None) -> tuple[TextTable, dict, dict]:
    """Rows of a day of an EPW file, as `csv_rows`, and the place of its first line.

    The year of the day is ignored, because the months of a typical year come from several years.
    """
    where = f"weather {path}"
    lines = list(csv.reader(read_text(path, where).splitlines()))
    if len(lines) <= EPW_HEADER or not lines[0] or lines[0][0] != "LOCATION":
        raise InputError(f"{where}: is no EPW file, whose first line begins with LOCATION")
    if day is None:
        raise InputError(f"{where}: name the day, such as day = 2026-06-21")
    month, date = map(int, day.split("-")[1:])
    of_day = [
        (number, [cell.strip() for cell in (row[3], *(row[k] for k, _ in EPW.values()))])
        for number, row in enumerate(lines[EPW_HEADER:], EPW_HEADER + 1)
        if len(row) > 21 and row[1:3] == [str(month), str(date)]
    ]
    if len(of_day) != 24:
        raise InputError(f"{where}: has {len(of_day)} rows of {day}; expected 24")
    table = TextTable(where, ["hour", *EPW], of_day)
    numbers = table.numbers(table.columns)
    for name, (_, missing) in EPW.items():
        if (absent := numbers[name] >= missing).any():
            raise InputError(f"{where}, line {of_day[int(absent.argmax())][0]}: {name} is missing")
    numbers["air_K"] += ZERO_CELSIUS
    table.check_range("infrared", numbers["infrared"], 0, 9999)
    numbers["sky_K"] = (numbers.pop("infrared") / STEFAN_BOLTZMANN) ** 0.25
    names = ["latitude_deg", "longitude_deg", "utc_offset_h"]
    place = TextTable(where, names, [(1, lines[0][6:9])]).numbers(names)
    return table, numbers, {name: float(value[0]) for name, value in place.items()}


def completed(table: WeatherTable, values: dict, times: np.ndarray, where: str) -> Weather:
    """The Weather of the numbers of a table and its rows at some times."""
    if ("h_W_m2_K" in values) == ("wind_m_s" in values):
        raise InputError(f"{where}: give h_W_m2_K or wind_m_s, one of them")
    for name in ("air_K", "sky_K"):
        if name not in values:
            raise InputError(f"{where}: {name} is missing")
    remarks = []
    if "ground_K" not in values:
        remarks.append("the ground has the temperature of the air; give ground_K to change it")
        values["ground_K"] = values["air_K"]
    elevation, azimuth = directions(table, values, times, where)
    if "wind_m_s" in values:
        values["h_W_m2_K"] = convection(values["wind_m_s"])
    sun = np.broadcast_to(values["sun_W_m2"], times.shape)
    is_day = elevation > 0
    if (below := sun[~is_day].sum()) > DUSK * sun.sum():
        raise InputError(
            f"{where}: {below / sun.sum():.0%} of sun_W_m2 is there with the sun below the horizon"
        )
    arrays = {
        name: np.broadcast_to(np.asarray(values[name], float), times.shape)
        for name in ("air_K", "h_W_m2_K", "sky_K", "ground_K", "diffuse_W_m2")
    }
    return Weather(
        seconds=times,
        **arrays,
        sun_W_m2=np.where(is_day, sun, 0.0),
        elevation_deg=elevation,
        azimuth_deg=azimuth,
        albedo=table.albedo,
        remarks=tuple(remarks),
    )


def directions(table, values: dict, times: np.ndarray, where: str) -> tuple:
    """Elevation and azimuth of the sun at some times [degrees]; 0 without a sun."""
    if all(name in values for name in DIRECTION):
        return tuple(
            np.broadcast_to(np.asarray(values[name], float), times.shape) for name in DIRECTION
        )
    if not np.any(values["sun_W_m2"]):
        return np.zeros((2, *times.shape))
    missing = [name for name in PLACE if name not in values]
    if missing or table.file is None:
        raise InputError(
            f"{where}: sunlight needs {' and '.join(DIRECTION)}, or for a file its place: "
            f"{', '.join(PLACE)}"
        )
    midnight = np.datetime64(values["day"]) - np.timedelta64(
        round(3600 * values["utc_offset_h"]), "s"
    )
    suns = [
        sun_position(
            values["latitude_deg"],
            values["longitude_deg"],
            f"{midnight + np.timedelta64(round(second), 's')}+00:00",
        )
        for second in times
    ]
    azimuth = table.north_deg - np.array([sun.compass_deg for sun in suns])
    return np.array([sun.elevation_deg for sun in suns]), np.unwrap(azimuth, period=360)
