"""The clear air by height: temperature, refraction and densities of absorbers, for any weather."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Described, entry
from mi_lcair.errors import check_known
from mi_lcair.table import read_table, rows_at

# Heights and lengths along a straight line of sight over a round Earth
# ---------------------------------------------------------------------
# The Earth has an effective radius, so that a straight line over it is as high as a refracted ray
# over the Earth: 1.19 times the true radius gives the target heights of LOWTRAN7's slant paths
# within 0.8 m.

EFFECTIVE_RADIUS_M = 1.19 * 6.371e6


def height_along(lower_m, elevation_deg, length_m):
    """Height [m] at `length_m` [m] along a line that starts at the height `lower_m` [m].

    `elevation_deg` is the line's elevation at its start [degrees].
    """
    radius = EFFECTIVE_RADIUS_M + lower_m
    # The difference of two large numbers would lose digits: (b^2 - a^2) / (b + a) is b - a.
    gained = length_m * (length_m + 2 * radius * np.sin(np.radians(elevation_deg)))
    return lower_m + gained / (np.sqrt(radius**2 + gained) + radius)


def lower_end(upper_m: float, elevation_deg: float, length_m: float) -> float:
    """Height [m] of the lower end of a line whose upper end is at the height `upper_m` [m].

    `elevation_deg` is the line's elevation at its lower end [degrees].
    """
    sine, cosine = np.sin(np.radians(elevation_deg)), np.cos(np.radians(elevation_deg))
    upper = EFFECTIVE_RADIUS_M + upper_m
    return float(np.sqrt(upper**2 - (length_m * cosine) ** 2) - length_m * sine) - (
        EFFECTIVE_RADIUS_M
    )


def length_between(start_m: float, end_m: float, elevation_deg: float) -> float:
    """Length [m] of a line from one height [m] to the other, where it first reaches that height.

    `elevation_deg` is its elevation at the start [degrees]; 0 is returned if it misses the end's
    height.
    """
    start, end = EFFECTIVE_RADIUS_M + start_m, EFFECTIVE_RADIUS_M + end_m
    along = start * np.sin(np.radians(elevation_deg))
    square = along**2 + (end_m - start_m) * (start + end)
    if square < 0:
        return 0.0
    return float(-along + np.copysign(np.sqrt(square), elevation_deg))


# Spectral coefficients of LOWTRAN7's band model: from amounts of absorbers to optical depths
# -------------------------------------------------------------------------------------------
# The optical depth is the sum of (coefficient * amount)^exponent over the absorbers, with the
# amounts of the whole path. The exponent is below 1 where unresolved lines saturate.

TABLES = Path(__file__).with_name("tables")
WAVELENGTH = "wavelength_um"
# Phase function of molecules, of the square of the cosine of the angle, as LOWTRAN7 has it [1/sr].
RAYLEIGH = 0.06050402, 0.0572197
ROWS = 16  # of a product of matrices that OpenBLAS calculates in one thread


@dataclass(frozen=True, eq=False)
class Bands:
    """Coefficients of the absorbers at each wavelength.

    Attributes
    ----------
    columns
        Names of the absorbers, (c,).
    wavelengths_um
        Rising wavelengths [um], (k,).
    exponents
        Exponents of the amounts, (c,).
    coefficients
        Coefficients raised to the exponents, (c, k); 0 where an absorber has no band.
    scattering
        Scattered part of the optical depth per amount, (c, k); 0 for gases that absorb.
    sun
        Irradiance of the sun outside the air at 1 astronomical unit [W m^-2 um^-1], (k,).
    """

    columns: tuple[str, ...]
    wavelengths_um: np.ndarray
    exponents: np.ndarray
    coefficients: np.ndarray
    scattering: np.ndarray
    sun: np.ndarray

    def depth(self, amounts: np.ndarray) -> np.ndarray:
        """Optical depth, (..., k), of amounts of absorbers (..., c) along whole paths.

        Amounts are densities of the table of levels times km.
        """
        powers = (np.maximum(amounts, 0) ** self.exponents).reshape(-1, len(self.exponents))
        depth = np.empty((len(powers), len(self.wavelengths_um)))
        # Threads of a BLAS wait for each other on a busy machine; for few rows it uses none.
        for first in range(0, len(powers), ROWS):
            rows = slice(first, first + ROWS)
            np.matmul(powers[rows], self.coefficients, out=depth[rows])
        return depth.reshape(*np.shape(amounts)[:-1], -1)

    def transmittance(self, amounts: np.ndarray) -> np.ndarray:
        """Transmittance 0..1, (..., k), of amounts of absorbers (..., c) along whole paths."""
        return np.exp(-self.depth(amounts))

    def phase(self, column: int, angle_deg: np.ndarray) -> np.ndarray:
        """Phase function of an absorber that scatters, (..., k) [1/sr].

        column: its number. angle_deg: angles between the directions before and after, (...).
        """
        name = self.columns[column]
        if name == "rayleigh":
            floor, slope = RAYLEIGH
            square = np.cos(np.radians(angle_deg)) ** 2
            return (floor + slope * square)[..., None] * np.ones(len(self.wavelengths_um))
        return np.exp(rows_at(angle_deg, *self._phases[name]))

    @cached_property
    def _phases(self) -> dict:
        """Angles [degrees] and logarithms of the phase functions (angles, k), by column."""
        names = "column", WAVELENGTH, "angle_deg", "phase_sr"
        file = read_table(TABLES / "band_phase.csv", names, "phase functions")
        of_column = np.array([cells[file.columns.index("column")] for _, cells in file.rows])
        table = file.numbers(names[1:])
        phases = {}
        for name in np.unique(of_column):
            wavelengths, angles, values = (table[key][of_column == name] for key in names[1:])
            wavelengths, angles = np.unique(wavelengths), np.unique(angles)
            # The rows are ordered by wavelength and angle
            logarithms = np.log(values).reshape(len(wavelengths), len(angles))
            phases[str(name)] = angles, rows_at(self.wavelengths_um, wavelengths, logarithms).T
        return phases


@lru_cache(maxsize=1)
def bands() -> Bands:
    """The coefficients of the bundled tables."""
    names = WAVELENGTH, "coefficient", "exponent", "scattered_share"
    file = read_table(TABLES / "band_terms.csv", ("column", *names), "band model")
    place = file.columns.index("column")
    of_row = [cells[place] for _, cells in file.rows]
    columns = tuple(dict.fromkeys(of_row))
    table = file.numbers(names)
    sun = read_table(TABLES / "band_sun.csv", (WAVELENGTH, "irradiance_W_m2_um"), "sun")
    wavelengths, irradiance = sun.numbers((WAVELENGTH, "irradiance_W_m2_um")).values()
    rows = [columns.index(name) for name in of_row]
    at = np.searchsorted(wavelengths, table[WAVELENGTH])
    exponents = np.zeros(len(columns))
    exponents[rows] = table["exponent"]  # every absorber has one exponent at all wavelengths
    coefficients, scattering = np.zeros((2, len(columns), len(wavelengths)))
    coefficients[rows, at] = table["coefficient"] ** table["exponent"]
    scattering[rows, at] = table["coefficient"] * table["scattered_share"]
    return Bands(columns, wavelengths, exponents, coefficients, scattering, irradiance)


EARTH_KM = 6371.23  # radius of the Earth in LOWTRAN7
TOP_M = 100_000.0  # height of the air's end
HEIGHT_M = 50.0  # height above the ground of a scene or path that states none
HEIGHT, PRESSURE, TEMPERATURE = "height_km", "pressure_hPa", "temperature_K"
HUMIDITY, VAPOUR, REFRACTIVITY = "relative_humidity", "water_vapour_g_m3", "refractivity"
STATE = HEIGHT, PRESSURE, TEMPERATURE, HUMIDITY, VAPOUR, REFRACTIVITY
STANDARD_VISIBILITY_KM, STANDARD_CO2_PPMV = 23.0, 330.0  # of the tables
MOST_HUMID = 0.98  # largest relative humidity in changed weather; LOWTRAN7's aerosols end at 99 %
VAPOUR_SHARE = 1.2442e-3  # share of the air's molecules at 273.15 K and 1013.25 hPa in 1 g m^-3
RURAL = "aerosol_rural_"  # beginning of the columns of the rural aerosol, by relative humidity in %
HAZE_KM = 0.0, 1.0, 2.0  # heights of the rural aerosol in the table of haze


@dataclass(frozen=True)
class Weather(Described, where="[atmosphere]"):
    """Weather other than that of a model atmosphere; None for what stays.

    Attributes
    ----------
    temperature : float, optional
        Temperature of the air at the ground [K]. It shifts the whole profile, and the relative
        humidity at the ground does not change.
    humidity : float, optional
        Relative humidity at the ground, 0..0.98. The water vapour at all heights is multiplied by
        the same factor, up to a relative humidity of 0.98.
    pressure : float, optional
        Pressure at the ground [hPa]. It scales the pressure at all heights.
    visibility : float, optional
        Visibility [km], 2..50, of the haze below 5 km; 23 in the model atmospheres.
    co2 : float, optional
        Carbon dioxide [ppmv]; 330 in the model atmospheres, about 425 in 2025.
    """

    temperature: float | None = entry(None, lower=230, upper=320, unit="K")
    humidity: float | None = entry(None, lower=0, upper=MOST_HUMID)
    pressure: float | None = entry(None, lower=850, upper=1090, unit="hPa")
    visibility: float | None = entry(None, lower=2, upper=50, unit="km")
    co2: float | None = entry(None, lower=0, upper=2000, unit="ppmv")


@dataclass(frozen=True, eq=False)
class Levels:
    """The air at some heights.

    Attributes
    ----------
    heights_km
        Rising heights above the ground [km], (n,), from 0 to 100.
    pressure, temperature, humidity, vapour, refractivity
        Pressure [hPa], temperature [K], relative humidity 0..1, water vapour [g m^-3] and
        refractive index less 1, (n,) each.
    densities
        Densities of the absorbers of `Bands.columns`, (n, c), in the units of the tables.
    """

    heights_km: np.ndarray
    pressure: np.ndarray
    temperature: np.ndarray
    humidity: np.ndarray
    vapour: np.ndarray
    refractivity: np.ndarray
    densities: np.ndarray

    def __post_init__(self):
        columns = np.column_stack([self.densities, self.refractivity, self.pressure])
        below, above = columns[:-1], columns[1:]
        exponential = (below > 0) & (above > 0)
        ratio = np.ones_like(below)
        np.divide(above, below, out=ratio, where=exponential)
        object.__setattr__(self, "_columns", columns)
        object.__setattr__(self, "_rates", np.log(ratio))
        object.__setattr__(self, "_slopes", np.where(exponential, 0, above - below))

    def at(self, heights_km: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Densities (..., c), temperature [K] and pressure [hPa] (...) at heights [km], (...).

        Between the levels temperature is linear, the others are exponential, or linear where one
        of two neighbours is 0.
        """
        below, share = self._place(heights_km)
        share = share[..., None]
        values = self._columns[below] * np.exp(share * self._rates[below])
        values = values + share * self._slopes[below]
        temperature = np.interp(heights_km, self.heights_km, self.temperature)
        return values[..., :-2], temperature, values[..., -1]

    def refraction(self, heights_km: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Refractivity and its derivative with respect to height [1/km] at heights [km]."""
        below, share = self._place(heights_km)
        column = len(self.densities[0])
        rate = self._rates[below, column]
        value = self._columns[below, column] * np.exp(share * rate)
        return value, value * rate / np.diff(self.heights_km)[below]

    def _place(self, heights_km):
        """Index of the level below each height, and the share of the level above."""
        below = np.searchsorted(self.heights_km, heights_km, side="right") - 1
        below = np.clip(below, 0, len(self.heights_km) - 2)
        low, high = self.heights_km[below], self.heights_km[below + 1]
        return below, np.clip((heights_km - low) / (high - low), 0, 1)

    def in_weather(self, weather: Weather) -> "Levels":
        """The air in other weather; see `Weather`."""
        temperature, vapour = self.temperature, self.vapour
        if weather.temperature is not None:
            temperature = temperature + (weather.temperature - temperature[0])
        if weather.temperature is not None or weather.humidity is not None:
            humidity = self.humidity[0] if weather.humidity is None else weather.humidity
            factor = humidity * saturation(temperature[0]) / vapour[0]
            vapour = np.minimum(vapour * factor, MOST_HUMID * saturation(temperature))
        factor = 1.0 if weather.pressure is None else weather.pressure / self.pressure[0]
        levels = self
        if (weather.temperature, weather.humidity, weather.pressure) != (None, None, None):
            levels = self.with_profile(temperature, self.pressure * factor, vapour)
        densities = levels.densities.copy()
        for k, name in enumerate(bands().columns):
            if weather.co2 is not None and name.startswith("co2_"):
                densities[:, k] *= weather.co2 / STANDARD_CO2_PPMV
            if weather.visibility is not None:
                densities[:, k] *= haze_factor(name, self.heights_km, weather.visibility)
        return replace(levels, densities=densities)

    def with_profile(
        self,
        temperature: ArrayLike | None = None,
        pressure: ArrayLike | None = None,
        vapour: ArrayLike | None = None,
    ) -> "Levels":
        """The air with other profiles, scaled as LOWTRAN7's subroutine STDMDL does.

        Parameters
        ----------
        temperature, pressure, vapour
            Temperature [K], pressure [hPa] and water vapour [g m^-3] at `heights_km`, (n,); None
            for what stays. Mixing ratios of the other gases and the extinction of the aerosols
            at .55 um stay. The classes of humidity of the rural aerosol change.
        """
        T = self.temperature if temperature is None else np.asarray(temperature, dtype=float)
        p = self.pressure if pressure is None else np.asarray(pressure, dtype=float)
        v = self.vapour if vapour is None else np.asarray(vapour, dtype=float)
        colder, denser = self.temperature / T, p / self.pressure
        moister = v / self.vapour
        d, d0 = (p * 273.15 / (1013.25 * T) for p, T in ((p, T), (self.pressure, self.temperature)))
        foreign = (d - VAPOUR_SHARE * v) / (d0 - VAPOUR_SHARE * self.vapour)
        ratios = {
            "rayleigh": denser * colder,
            "n2_continuum": denser**2 * colder**1.5,
            "h2o_self": moister**2,
            "h2o_foreign": moister * foreign,
        }
        for name, (gas, of_pressure, of_temperature) in scaling().items():
            amount = moister if gas == "h2o" else denser * colder
            ratios[name] = amount * denser**of_pressure * colder**of_temperature
        columns = bands().columns
        densities = np.column_stack(
            [self.densities[:, k] * ratios.get(name, 1.0) for k, name in enumerate(columns)]
        )
        humidity = v / saturation(T)
        rural = [k for k, name in enumerate(columns) if name.startswith(RURAL)]
        classes = [float(columns[k].removeprefix(RURAL)) / 100 for k in rural]
        extinction = densities[:, rural].sum(axis=1, keepdims=True)
        densities[:, rural] = extinction * class_shares(humidity, np.array(classes))
        cold = columns.index("h2o_self_cold")
        densities[:, cold] = densities[:, columns.index("h2o_self")] * np.clip((296 - T) / 36, 0, 1)
        return Levels(
            self.heights_km, p, T, humidity, v, self.refractivity * denser * colder, densities
        )


def saturation(temperature) -> np.ndarray:
    """Density of saturated water vapour over water at a temperature [K] in LOWTRAN7 [g m^-3]."""
    share = 273.15 / np.asarray(temperature, dtype=float)
    return share * np.exp(18.9766 - 14.9595 * share - 2.43882 * share**2)


def class_shares(humidity: np.ndarray, classes: np.ndarray) -> np.ndarray:
    """Shares of classes of an aerosol, (n, classes), at relative humidities 0..1, (n,).

    They are linear in ln(1 - humidity) between rising classes, and those of the nearest one beyond.
    """
    places = -np.log1p(-classes)
    at = -np.log1p(-np.minimum(humidity, classes[-1]))
    return rows_at(at, places, np.eye(len(classes)))


def haze_factor(column: str, heights_km: np.ndarray, visibility: float) -> np.ndarray:
    """Ratio of an aerosol's density at a visibility [km] to that at 23 km, (n,); 1 for others."""
    file = read_table(TABLES / "band_haze.csv", ("visibility_km", HEIGHT, "extinction_km"), "haze")
    table = file.numbers(file.columns)
    known = np.unique(table["visibility_km"])
    order = np.lexsort((table[HEIGHT], table["visibility_km"]))
    rows = table["extinction_km"][order].reshape(len(known), -1)
    extinction = [
        np.interp(1 / visibility, 1 / known[::-1], row[::-1]) for row in np.transpose(rows)
    ]
    logarithms = np.log(extinction / rows[list(known).index(STANDARD_VISIBILITY_KM)])
    if column.startswith(RURAL):
        return np.exp(np.interp(heights_km, HAZE_KM, logarithms[:3]))
    if column == "aerosol_fading":  # the rural aerosol of 2 km, which ends at 3 km
        return np.full(len(heights_km), np.exp(logarithms[2]))
    if column == "aerosol_tropospheric":
        return np.exp(np.interp(heights_km, (3.0, 4.0, 5.0), (*logarithms[3:], 0)))
    return np.ones(len(heights_km))


@lru_cache(maxsize=1)
def scaling() -> dict[str, tuple[str, float, float]]:
    """Gas of each column, and the exponents of its pressure and temperature."""
    names = "column", "gas", "pressure_exponent", "temperature_exponent"
    file = read_table(TABLES / "band_scaling.csv", names, "scaling")
    return {name: (gas, float(p), float(T)) for _, (name, gas, p, T) in file.rows}


def model_names() -> list[str]:
    """Names of the model atmospheres."""
    return sorted(file.stem.removeprefix("band_levels_") for file in TABLES.glob("band_levels_*"))


@lru_cache(maxsize=16)
def levels(name: str, weather: Weather = Weather()) -> Levels:
    """The air of a model atmosphere, in some weather; raises InputError for an unknown name."""
    check_known("air", model_names(), name)
    file = read_table(TABLES / f"band_levels_{name}.csv", STATE, "air")
    table = file.numbers(file.columns)
    heights, pressure, temperature, humidity, vapour, refractivity = (table[key] for key in STATE)
    densities = np.column_stack([table[column] for column in bands().columns])
    standard = Levels(
        heights, pressure, temperature, humidity / 100, vapour, refractivity, densities
    )
    return standard if weather == Weather() else standard.in_weather(weather)
