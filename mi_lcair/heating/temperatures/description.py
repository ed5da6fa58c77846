"""What a heat.toml says: the scene, the weather, what lies behind its surfaces, uncertainties."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cache
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from mi_lcair import toml_table
from mi_lcair.declared import Bounds, Described, entry, excludes, listed, needs, rule, together
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.estimate import Stated, parsed, relative, sigmas
from mi_lcair.files import parse_toml, read_text
from mi_lcair.heating.temperatures.air import SurfaceAir, plate_convection, rough_convection
from mi_lcair.heating.temperatures.balance import DAY, DEEPEST, HeatWall
from mi_lcair.heating.temperatures.cells import CellWall, layout, middles
from mi_lcair.toml_table import check_tables, filled, table_of, tables_of

# Standard uncertainty of the model itself: the rms of what is left of two measured cases, rounded
# up (docs/validation/cases.md)
MODEL_K = 0.8
MODEL = Bounds(lower=0, upper=1000, unit="K")
# Uncertainties where none are stated: of weather, and of what is given in place of a material
OF_WEATHER = {
    "air_K": 0.5,
    "wind_m_s": "10 %",
    "relative_humidity": 5.0,
    "down_longwave_W_m2": 5.0,
    "sun_W_m2": "3 %",
    "diffuse_W_m2": "10 %",
}
CLOUDY_SKY, GIVEN_SKY = 15.0, "5 %"  # of the irradiance of skies that were not measured [W m^-2]
OF_ANY = {"h": "30 %", "absorptance": 0.05, "emissivity": 0.02}
OF_GIVEN = {
    "conductivity": "50 %",
    "heat_capacity": "10 %",
    "wetness": 0.2,
    "resistance_s_m": "60 %",
    "roughness_mm": "80 %",
    "heat_roughness_mm": "100 %",
    "contact_m2_K_W": "50 %",
}
# Numbers of walls that solids have, and the factor of a unit that is often meant instead
OF_SOLIDS = {
    "conductivity": (1e-3, 500.0, "W/(m K)", None, ""),
    "density": (10.0, 25_000.0, "kg/m^3", 1000, "g/cm^3"),
    "heat_capacity": (100.0, 6000.0, "J/(kg K)", 1000, "kJ/(kg K)"),
}
KELVIN = {"lower": 10, "upper": 6000, "unit": "K"}
# More than any surface takes up or gives off; numbers beyond are of another unit
FASTEST = 1e-10  # least time in which heat may diffuse through a wall, with errors of 3 mK [s]
FLUX, CONVECTION = {"lower": 0, "upper": 1e8}, {"lower": 0, "upper": 1e6}


# Grounds and walls by name, with the uncertainties of a sample that is not known any better
# -------------------------------------------------------------------------------------------

FILE = Path(__file__).with_name("materials.toml")
# What a given key of a group takes the place of
REPLACED = {
    "h_W_m2_K": ("roughness_mm", "heat_roughness_mm"),
    "plate": ("roughness_mm", "heat_roughness_mm"),
    "wetness": ("resistance_s_m",),
    "resistance_s_m": ("wetness",),
    "capacity_at_K": ("capacity_J_kg_K",),
}
OF_SURFACE = ("absorptance", "emissivity", "albedo")
NOT_OF_A_LAYER = ("layers", "temperature")  # a group with these keeps its surface only


@cache
def materials() -> dict[str, dict]:
    """The entries of the file by material."""
    return parse_toml(read_text(FILE, str(FILE)), str(FILE))


def values_of(name: str, given: dict, keys=None) -> dict:
    """What a material gives of a group or a layer, without what the given keys replace.

    keys: those that may be given; all of the material if None.
    """
    check_known("material", materials(), name)
    left_out = {"source", "h", *given, *(x for key in given for x in REPLACED.get(key, ()))}
    if "heat_capacity" in given or "layers" in given:
        left_out |= {"capacity_at_K", "capacity_J_kg_K"}
    is_surface = any(key in given for key in NOT_OF_A_LAYER)
    allowed = OF_SURFACE if is_surface else keys or materials()[name]
    values = {k: v for k, v in materials()[name].items() if k in allowed and k not in left_out}
    return {k: parsed(v)[0] if isinstance(v, str) else v for k, v in values.items()}


def sigmas_of(table: "GroupTable | LayerTable") -> dict[str, Stated]:
    """Standard uncertainties of what a group or a layer has, and of its surface.

    They are those of its material, also of a value that was given in place of the material's.
    """
    result = OF_ANY | {key: sigma for key, sigma in OF_GIVEN.items() if getattr(table, key, None)}
    for key, value in materials()[table.material].items() if table.material else ():
        stated = value if key == "h" else str(value).partition("+-")[2].strip()
        if stated and key != "thickness_mm" and (key in OF_ANY or getattr(table, key, None)):
            result[key] = stated if relative(stated) is not None else float(stated)
    return result


def doubts(table: "GroupTable | LayerTable", where: str) -> list[str]:
    """Remarks on numbers of a wall that no solid has, and on the unit that may be meant."""
    remarks = []
    for key, (lower, upper, unit, factor, other) in OF_SOLIDS.items():
        value = getattr(table, key, None)
        if value is not None and not lower <= value <= upper:
            meant = f"; {value:g} {other} would be {factor * value:g}" if factor else ""
            span = f"{lower:g} to {upper:g} of solids"
            remarks.append(f"{where}: {key} = {value:g} {unit} is outside {span}{meant}")
    layers = enumerate(getattr(table, "layers", ()))
    return remarks + [text for k, layer in layers for text in doubts(layer, f"{where} layers[{k}]")]


@dataclass(frozen=True, kw_only=True)
class TargetTable(Described, where="[target]"):
    """[target].

    Attributes
    ----------
    scene : str
        Bundled scene or Mitsuba XML file.
    parameters : dict
        Parameters for `mi_lcair.load`.
    """

    scene: str = entry(is_file=True)
    parameters: dict = entry(dict, is_file=True)


@dataclass(frozen=True, kw_only=True)
class WeatherTable(Described, where="[weather]"):
    """[weather]: a file of rows over a day, or numbers that hold all the time.

    Attributes
    ----------
    file : str or None
        EPW file, or CSV with the column `hour` and columns with the names of the numbers below.
    day : date or None
        The day of an EPW file, or of the sun by place: 2026-06-21.
    air_K : float or None
        Temperature of the air.
    h_W_m2_K, wind_m_s : float or None
        Coefficient of convection, or the wind speed from which it is computed (`convection`).
    wind_height_m, air_height_m : float
        Heights above the ground at which the wind (wind_height_m), and temperature and humidity
        (air_height_m) are given.
    relative_humidity, pressure_hPa : float or None
        Relative humidity of the air over water in percent, and pressure of the air (default
        1013.25).
    sky_K : float or None
        Temperature of a blackbody with the total radiance of the sky.
    down_longwave_W_m2 : float or None
        Measured irradiance of the sky on a horizontal plane, in place of sky_K.
    cloud : float or None
        Cloud cover, 0 to 1. With it the radiance of the sky is computed from temperature and
        humidity.
    ground_K : float or None
        Temperature of the ground below the horizon (default: that of the air).
    sun_W_m2, diffuse_W_m2 : float
        Irradiance of the sun's beam on a plane that faces the sun (sun_W_m2), and of the sky on a
        horizontal plane (diffuse_W_m2).
    sun_elevation_deg, sun_azimuth_deg : float or None
        Direction of the sun in the axes of the scene: azimuth 0 is +x, 90 is +y.
    albedo : float
        Share of sunlight that the ground reflects.
    latitude_deg, longitude_deg, utc_offset_h : float or None
        Latitude and longitude, in place of the sun's direction, and the time zone of the hours. An
        EPW file contains them.
    north_deg : float
        Azimuth of north, as for the emitter `sun`.
    day_h : float
        Length of a day in hours. The hours of the rows are 1/24 of it.
    """

    file: str | None = None
    day: date | None = None
    air_K: float | None = entry(None, **KELVIN)
    h_W_m2_K: float | None = entry(None, **CONVECTION)
    wind_m_s: float | None = entry(None, lower=0, upper=1000)
    wind_height_m: float = entry(10.0, lower=0.01, upper=1000)
    air_height_m: float = entry(2.0, lower=0.01, upper=1000)
    relative_humidity: float | None = entry(None, lower=0, upper=110)
    pressure_hPa: float | None = entry(None, lower=1, upper=1200)
    sky_K: float | None = entry(None, lower=0, upper=6000, unit="K")
    down_longwave_W_m2: float | None = entry(None, lower=0, upper=1e8)
    cloud: float | None = entry(None, lower=0, upper=1)
    ground_K: float | None = entry(None, lower=0, upper=6000, unit="K")
    sun_W_m2: float = entry(0.0, **FLUX)
    diffuse_W_m2: float = entry(0.0, **FLUX)
    sun_elevation_deg: float | None = entry(None, lower=-90, upper=90)
    sun_azimuth_deg: float | None = entry(None, lower=-3600, upper=3600)
    albedo: float = entry(0.2, lower=0, upper=1)
    latitude_deg: float | None = entry(None, lower=-90, upper=90)
    longitude_deg: float | None = entry(None, lower=-180, upper=180)
    utc_offset_h: float | None = entry(None, lower=-14, upper=14)
    north_deg: float = entry(90.0)
    day_h: float = entry(24.0, lower=0.1, upper=1e5)


WALL = ("thickness_mm", "conductivity", "density", "heat_capacity")
SURFACE = ("surface_conductivity", "surface_density", "scale_depth_mm")
HELD = "a group with a temperature cannot have a wall, a back or internal heat"
LAW = "one law gives the coefficient of convection"


@dataclass(frozen=True, kw_only=True)
class LayerTable(Described):
    """A layer of a wall, one of `layers` of [groups.NAME].

    Attributes
    ----------
    material : str or None
        Material of the list. It gives the keys that are left out.
    thickness_mm, conductivity, density, heat_capacity : float
        As for a wall of one material.
    contact_m2_K_W : float
        Resistance between this layer and the one above it, or the surface.
    """

    material: str | None = None
    thickness_mm: float = entry(lower=1e-5, upper=1e7)
    conductivity: float = entry(lower=1e-4, upper=1e4, unit="W/(m K)")
    density: float = entry(lower=0.01, upper=1e5, unit="kg/m^3")
    heat_capacity: float = entry(lower=1, upper=1e5, unit="J/(kg K)")
    contact_m2_K_W: float = entry(0.0, lower=0, upper=1e4)


BEHIND = (
    together(*WALL),
    excludes(
        "temperature", *WALL, "layers", "internal_W_m2", "internal_by_hour", "back_K", why=HELD
    ),
    excludes("internal_by_hour", "internal_W_m2"),
    excludes("layers", *WALL, *SURFACE),
    excludes("back", "back_K", why='give back = "insulated" or back_K'),
    needs("back_h", "back_K", why="the temperature of the air"),
    rule(
        lambda t: t.back_K is None or t.thickness_mm or t.layers,
        f"back_K needs {listed(WALL)}, or layers",
    ),
    together(*SURFACE),
    needs("scale_depth_mm", *WALL),
    together("capacity_at_K", "capacity_J_kg_K"),
    needs("capacity_at_K", *WALL),
    rule(
        lambda t: (
            len(t.capacity_at_K) == len(t.capacity_J_kg_K) != 1
            and (np.diff(t.capacity_at_K) > 0).all()
        ),
        "capacity_at_K must rise and have two or more numbers, as many as capacity_J_kg_K",
    ),
    rule(
        lambda t: t.thickness_mm or t.layers or not (t.radiative or t.contact_m2_K_W),
        f"radiative and contact_m2_K_W need {listed(WALL)}, or layers",
    ),
    rule(
        lambda t: not t.back_W_m2 or (t.thickness_mm or t.layers) and t.back_K is None,
        "back_W_m2 needs a wall without back_K",
    ),
    rule(
        lambda t: not (t.layers and t.contact_m2_K_W),
        "for a wall of layers, give contact_m2_K_W in its first layer",
    ),
    rule(
        lambda t: not t.albedo or min(t.albedos) >= -1e-9 and max(t.albedos) <= 1 + 1e-9,
        "albedo = {t.albedo}; the polynomial must lie in 0..1 for zenith angles of 0 to 90 degrees",
    ),
    rule(
        lambda t: np.real((t.heat_roughness_mm or 0) - (t.roughness_mm or np.inf)) <= 0,
        "heat_roughness_mm is more than roughness_mm",
    ),
    rule(  # the weather's coefficient, an array, is not used then
        lambda t: t.roughness_mm is t.plate is None or not isinstance(t.h_W_m2_K, float),
        f"h_W_m2_K cannot be combined with roughness_mm or plate; {LAW}",
    ),
    excludes("roughness_mm", "plate", why=LAW),
    together("plate", "length_m"),
    needs("heat_roughness_mm", "roughness_mm"),
    excludes("wetness", "resistance_s_m"),
    rule(
        lambda t: (
            t.is_of_cells or t.thickness_mm is None or np.real(t.wall(0.0).diffusion) >= FASTEST
        ),
        "heat crosses the wall faster than its storage can be computed; leave it out",
    ),
)


@dataclass(frozen=True, kw_only=True)
class GroupTable(Described, rules=BEHIND):
    """[groups.NAME]: what lies behind the surfaces of a group, and what air does to them.

    Attributes
    ----------
    material : str or None
        Material of the list. It gives the keys that are left out, and the uncertainties.
    temperature : float or None
        Fixed temperature of the group [K]. No other key may then be given.
    internal_W_m2 : float
        Heat flux that is released below the surface.
    internal_by_hour : tuple of float
        The same in equal parts of a day, such as 24 hours, in place of one number.
    h_W_m2_K : float or None
        Coefficient of convection, in place of that of the weather.
    h_factor : float
        Factor of the coefficient of convection, for any law.
    roughness_mm, heat_roughness_mm : float or None
        Roughness lengths of ground for wind and for heat. The convection is computed from them and
        from the stability of the air. The roughness for heat is a tenth of that for wind by
        default.
    plate : str or None
        "up", "down" or "upright": direction that a plate faces, for natural convection and wind
        along it.
    length_m : float or None
        Side of a square plate, or the height of an upright one.
    wetness, resistance_s_m : float or None
        Evaporation, dew and frost: give the wet share of the surface, 0 to 1, or its resistance.
    absorptance, emissivity : float or None
        Absorptance for sunlight, and hemispherical emissivity, in place of those of the scene.
    albedo : tuple of float
        Coefficients of a polynomial in the sun's zenith angle divided by 90 degrees. The surface
        absorbs 1 minus its value of the beam.
    thickness_mm, conductivity, density, heat_capacity : float or None
        Wall of one material: thickness in mm, conductivity in W/(m K), density in kg/m^3, heat
        capacity in J/(kg K).
    layers : tuple of LayerTable
        Layers in place of one material, the outermost first.
    contact_m2_K_W : float
        Resistance between the surface and the wall below, such as that of grass.
    radiative : float
        Conductivity grows with temperature by the factor 1 + radiative (T / 350 K)^3.
    capacity_at_K, capacity_J_kg_K : tuple of float
        Heat capacity at some temperatures, interpolated linearly between them.
    surface_conductivity, surface_density, scale_depth_mm : float or None
        Conductivity and density at the surface. They approach those of the wall exponentially over
        the depth scale_depth_mm.
    back : str
        "insulated", unless back_K is given.
    back_K, back_h : float or None
        Temperature of the back, or of the air behind it if back_h [W/(m^2 K)] is given.
    back_W_m2 : float
        Heat flux that enters through an insulated back of layers or of ground by depth.
    by_material : tuple of str
        Keys that the material gives. Do not write this key.
    """

    material: str | None = None
    temperature: float | None = entry(None, **KELVIN)
    internal_W_m2: float = entry(0.0, lower=-1e8, upper=1e8)
    internal_by_hour: tuple[float, ...] = entry((), lower=-1e8, upper=1e8)
    h_W_m2_K: float | None = entry(None, **CONVECTION)
    h_factor: float = entry(1.0, lower=0, upper=1000)
    roughness_mm: float | None = entry(None, lower=1e-4, upper=1e5)
    heat_roughness_mm: float | None = entry(None, lower=1e-9, upper=1e5)
    plate: Literal["up", "down", "upright"] | None = None
    length_m: float | None = entry(None, lower=1e-3, upper=1e4)
    wetness: float | None = entry(None, lower=0, upper=1)
    resistance_s_m: float | None = entry(None, lower=0, upper=1e6)
    absorptance: float | None = entry(None, lower=0, upper=1)
    emissivity: float | None = entry(None, lower=0, upper=1)
    albedo: tuple[float, ...] = entry((), lower=-10, upper=10)
    thickness_mm: float | None = entry(None, lower=1e-5, upper=1e7)
    conductivity: float | None = entry(None, lower=1e-4, upper=1e4, unit="W/(m K)")
    density: float | None = entry(None, lower=0.01, upper=1e5, unit="kg/m^3")
    heat_capacity: float | None = entry(None, lower=1, upper=1e5, unit="J/(kg K)")
    layers: tuple = ()
    contact_m2_K_W: float = entry(0.0, lower=0, upper=1e4)
    radiative: float = entry(0.0, lower=0, upper=1000)
    capacity_at_K: tuple[float, ...] = entry((), **KELVIN)
    capacity_J_kg_K: tuple[float, ...] = entry((), lower=1, upper=1e5)
    surface_conductivity: float | None = entry(None, lower=1e-4, upper=1e4)
    surface_density: float | None = entry(None, lower=0.01, upper=1e5)
    scale_depth_mm: float | None = entry(None, lower=1e-3, upper=1e6)
    back: Literal["insulated"] | None = None
    back_K: float | None = entry(None, **KELVIN)
    back_h: float | None = entry(None, lower=1e-6, upper=1e6)
    back_W_m2: float = entry(0.0, lower=-1e4, upper=1e4)
    by_material: tuple = ()

    def internal(self, share: np.ndarray) -> np.ndarray:
        """Heat that is released at times, shares of a day in 0..1 [W m^-2]."""
        values = np.array(self.internal_by_hour or [self.internal_W_m2])
        return values[np.minimum((share * len(values)).astype(int), len(values) - 1)]

    @property
    def has_law(self) -> bool:
        """Whether the coefficient of convection, or evaporation, depends on the temperature."""
        return bool(self.roughness_mm or self.plate) or self.has_water

    @property
    def has_water(self) -> bool:
        return self.wetness is not None or self.resistance_s_m is not None

    @property
    def is_of_cells(self) -> bool:
        """Whether the wall has layers, or properties by temperature or depth."""
        by_depth = self.scale_depth_mm is not None
        apart = self.thickness_mm is not None and self.contact_m2_K_W
        more = self.radiative or self.capacity_at_K or self.back_W_m2
        return bool(self.layers or more or by_depth or apart)

    @property
    def albedos(self) -> np.ndarray:
        """Values of the polynomial over the sun's zenith angles."""
        return np.polynomial.polynomial.polyval(np.linspace(0, 1, 91), self.albedo)

    def convection(self, kelvin, air: SurfaceAir, usual):
        """Coefficient of convection at some temperatures. usual: that without a law."""
        if self.roughness_mm is not None:
            roughness = self.roughness_mm / 1000
            given = self.heat_roughness_mm
            of_heat = roughness / 10 if given is None else given / 1000
            h = rough_convection(kelvin, air, roughness, of_heat)
        elif self.plate is not None:
            h = plate_convection(kelvin, air, self.length_m, self.plate)
        else:
            h = usual + 0 * kelvin
        return self.h_factor * h

    def wall(self, duration: float) -> HeatWall | CellWall | None:
        """The wall for weather of a duration [s], if there is one."""
        usual = 0.0 if self.back_K is None else np.inf
        back = usual if self.back_h is None else self.back_h
        if self.is_of_cells:
            return self.cells(duration, back)
        if self.thickness_mm is None:
            return None
        mm, *of_material = (getattr(self, name) for name in WALL)
        return HeatWall(mm / 1000, *of_material, back, self.back_K or 0.0, duration)

    def cells(self, duration: float, back: complex) -> CellWall:
        """The wall in cells, down to `DEEPEST` penetration depths."""
        layers, names = self.layers or (self,), WALL[1:]
        single = [
            HeatWall(layer.thickness_mm / 1000, *(getattr(layer, n) for n in names))
            for layer in layers
        ]
        sizes = [wall.thickness for wall in single]
        if not self.layers and not back and not self.back_W_m2:
            deepest = DEEPEST * single[0].penetration(max(duration, DAY))
            if np.real(sizes[0]) > np.real(deepest):
                sizes[0] = np.real(deepest)
        top = (getattr(self, f"surface_{n}", None) or getattr(layers[0], n) for n in names)
        of_depth = [HeatWall(1.0, *top), *single[1:]]
        waves = [float(np.real(wall.penetration(DAY))) for wall in of_depth]
        of_layer = layout(sizes, waves)
        owner = np.repeat(np.arange(len(layers)), [len(dz) for dz in of_layer])
        dz = np.concatenate(of_layer)
        contact = np.array([layer.contact_m2_K_W for layer in layers])
        is_top = np.diff(owner, prepend=-1) > 0
        values = {n: np.array([getattr(layer, n) for layer in layers])[owner] for n in names}
        if self.scale_depth_mm is not None:
            near = np.exp(-middles(dz) / (self.scale_depth_mm / 1000))
            for name in ("conductivity", "density"):
                deep = values[name]
                values[name] = deep - (deep - getattr(self, f"surface_{name}")) * near
        table = (self.capacity_at_K, self.capacity_J_kg_K) if self.capacity_at_K else None
        return CellWall(
            dz, **values, contact=np.where(is_top, contact[owner], 0.0), radiative=self.radiative,
            table=table, back=back, back_temperature=self.back_K or 0.0, flux=self.back_W_m2,
        )  # fmt: skip


PERIODIC = "harmonics need a periodic day"


@dataclass(frozen=True, kw_only=True)
class RunTable(Described, where="[run]", rules=(excludes("method", "start_K", why=PERIODIC),)):
    """[run]: numbers of the computation.

    Attributes
    ----------
    steps : int
        Steps of a day.
    rays : int
        Paths from each side of a facet, for conductors and sunlight.
    seed : int
        Seed of the random numbers.
    start_K : float or None
        Start temperature of a series of rows. By default the day is repeated until it is periodic.
    method : str
        "steps" from day to day, or "harmonics": the periodic day by its Fourier components, for
        walls of one material and convection that does not depend on the temperature.
    """

    steps: int = entry(144, lower=4, upper=100_000)
    rays: int = entry(1024, lower=64, upper=2**20)
    seed: int = entry(0, lower=0, upper=2**32 - 1)
    start_K: float | None = entry(None, **KELVIN)
    method: Literal["steps", "harmonics"] = "steps"


@dataclass(frozen=True, kw_only=True)
class SignatureTable(Described, where="[signature]"):
    """[signature]: intensity over the day, in the band and toward a sensor of the scene.

    Attributes
    ----------
    sensor : int
        Number of the sensor, from 0.
    spp : int
        Paths per pixel.
    """

    sensor: int = entry(0, lower=0)
    spp: int = entry(64, lower=16, upper=2**20)


@dataclass(frozen=True, kw_only=True)
class CorrelationTable(Described, where="[correlation]"):
    """[correlation]: how the errors of some inputs of [sigma] go together, as `invert` writes it.

    Attributes
    ----------
    inputs : tuple of str
        Names as in [sigma].
    matrix : tuple
        Rows of the correlation matrix.
    """

    inputs: tuple[str, ...] = ()
    matrix: tuple[tuple[float, ...], ...] = ()

    @property
    def root(self) -> np.ndarray:
        """The lower triangle L with L L^T = matrix; raises InputError for no such matrix."""
        count = len(self.inputs)
        if [len(row) for row in self.matrix] != [count] * count:
            raise InputError(f"matrix must have {count} rows of {count} numbers, as inputs")
        C = np.array(self.matrix).reshape(count, count)
        if abs(C - C.T).max(initial=0) > 1e-6 or abs(np.diag(C) - 1).max(initial=0) > 1e-6:
            raise InputError("matrix must be symmetric, with 1 on its diagonal")
        try:
            return np.linalg.cholesky((C + C.T) / 2 + ROUNDED * np.eye(count))
        except np.linalg.LinAlgError:
            raise InputError("matrix has a negative eigenvalue; no errors go together so") from None

    def complete(self) -> None:
        """Raise InputError for a matrix that is no correlation."""
        _ = self.root


ROUNDED = 1e-5  # of correlations in a file, which keeps their matrix positive
KINDS = {
    "weather": WeatherTable,
    "run": RunTable,
    "correlation": CorrelationTable,
    "signature": SignatureTable,
}


@dataclass(frozen=True)
class HeatDescription:
    """The tables of a heat.toml.

    sigma: standard uncertainty of each input, in its unit or as a text such as "30 %". model_K:
    that of the model itself. has_defaults: whether [sigma] is left out, so that `default_sigmas`
    take its place. folder: that of the paths. tree: the tables as they were given, with the files
    of target and weather relative to the working folder.
    """

    target: TargetTable
    weather: WeatherTable
    groups: dict[str, GroupTable] = field(default_factory=dict)
    sigma: dict[str, Stated] = field(default_factory=dict)
    model_K: float = MODEL_K
    has_defaults: bool = False
    run: RunTable = RunTable()
    correlation: CorrelationTable = CorrelationTable()
    signature: SignatureTable | None = None
    folder: Path = Path()
    tree: Mapping = field(default_factory=dict)

    def stated(self, key: str) -> dict[str, float]:
        """What groups state in place of what the scene has, such as their emissivity."""
        pairs = ((group, getattr(table, key)) for group, table in self.groups.items())
        return {group: value for group, value in pairs if value is not None}

    @staticmethod
    def read(source: str | PathLike[str] | Mapping) -> "HeatDescription":
        """The description of a TOML file, or of a dictionary of its tables.

        Raises InputError if anything cannot be used.
        """
        return toml_table.read(source, described, "heat")


def described(tree: Mapping, folder: Path, _name: str) -> HeatDescription:
    """The description of the tables of a file in a folder."""
    check_tables(["target", *KINDS, "groups", "sigma"], tree)
    target = filled(TargetTable, tree.get("target", {}), "[target]", folder)
    tables = {
        key: filled(kind, tree.get(key, {}), f"[{key}]")
        for key, kind in KINDS.items()
        if key in tree or key != "signature"
    }
    groups = {
        group: group_of(values, f"[groups.{group}]")
        for group, values in table_of(tree, "groups").items()
    }
    file = tables["weather"].file
    if tables["run"].method == "harmonics" and file is None:
        raise InputError(f'[run]: method = "harmonics" needs a file of [weather]; {PERIODIC}')
    of_file = {} if file is None else {"file": str(folder / file)}
    of_sigma = dict(table_of(tree, "sigma"))
    model = of_sigma.pop("model_K", MODEL_K)
    stated = sigmas({"sigma": of_sigma})
    check_known("input of [sigma] for [correlation]", stated, *tables["correlation"].inputs)
    with errors_of("[sigma]"):
        if isinstance(model, bool) or not isinstance(model, (int, float)):
            raise InputError(f"model_K = {str(model)[:40]}; must be a number of K, such as 0.8")
        MODEL.check(model, "model_K")
    return HeatDescription(
        target=target,
        groups=groups,
        sigma=stated,
        model_K=float(model),
        has_defaults="sigma" not in tree or not of_sigma and "model_K" in tree["sigma"],
        folder=folder,
        tree=tree
        | {
            "target": {"scene": target.scene, "parameters": target.parameters},
            "weather": dict(tree.get("weather", {})) | of_file,
        },
        **tables,
    )


def group_of(values: Mapping, where: str) -> GroupTable:
    """The table of a group, with its layers, completed by its material."""
    if not isinstance(values, Mapping):
        return filled(GroupTable, values, where)
    of_group = completed(values, where)
    if "layers" in values:
        places = (f"{where} layers[{k}]" for k in count())
        of_group["layers"] = tuple(
            filled(LayerTable, completed(layer, place, WALL), place)
            for layer, place in zip(tables_of(values, "layers"), places)
        )
    more = tuple(key for key in of_group if key not in values)
    return replace(filled(GroupTable, of_group, where), by_material=more)


def completed(values: Mapping, where: str, keys=None) -> dict:
    """The values of a table with those that its material gives; keys: see `values_of`."""
    with errors_of(where):
        if "by_material" in values:
            raise InputError("unknown key 'by_material'; give material")
        name = values.get("material")
        return {**(values_of(str(name), dict(values), keys) if name is not None else {}), **values}


def default_sigmas(sky: str, groups: dict[str, GroupTable]) -> dict[str, Stated]:
    """The uncertainties of weather and materials.

    sky: key from which the sky follows. groups: all of the scene, by name.
    """
    of_sky = {"cloud": CLOUDY_SKY, "sky_K": GIVEN_SKY}
    measured = OF_WEATHER["down_longwave_W_m2"]
    result: dict[str, Stated] = OF_WEATHER | {"down_longwave_W_m2": of_sky.get(sky, measured)}
    for group, table in groups.items():
        if table.temperature is not None:
            continue
        of = sigmas_of(table)
        for k, layer in enumerate(table.layers):
            of |= {f"{key}[{k}]": x for key, x in sigmas_of(layer).items() if key not in OF_ANY}
        result |= {f"{group}.{key}": sigma for key, sigma in of.items()}
    return result
