"""What a heat.toml says: the scene, the weather, what lies behind its surfaces, uncertainties."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from mi_lcair import toml_table
from mi_lcair.declared import Described, entry, excludes, needs, rule, together
from mi_lcair.estimate import Stated, sigmas
from mi_lcair.heating.temperatures.balance import HeatWall
from mi_lcair.toml_table import check_tables, filled, table_of

KELVIN = {"lower": 10, "upper": 6000, "unit": "K"}
# More than any surface takes up or gives off; numbers beyond are of another unit
FASTEST = 1e-10  # least time in which heat may diffuse through a wall, with errors of 3 mK [s]
FLUX, CONVECTION = {"lower": 0, "upper": 1e8}, {"lower": 0, "upper": 1e6}


@dataclass(frozen=True, kw_only=True)
class TargetTable(Described, where="[target]"):
    """[target].

    Attributes
    ----------
    scene : str
        Bundled scene or Mitsuba XML file.
    parameters : dict
        Parameters as `mi_lcair.load` takes them.
    """

    scene: str = entry(is_file=True)
    parameters: dict = entry(dict, is_file=True)


@dataclass(frozen=True, kw_only=True)
class WeatherTable(Described, where="[weather]"):
    """[weather]: a file of rows over a day, or numbers that hold all the time.

    Attributes
    ----------
    file : str or None
        EPW file, or CSV with the column `hour` and columns called as the numbers below.
    day : date or None
        The day of an EPW file, or of the sun by place: 2026-06-21.
    air_K : float or None
        Temperature of the air.
    h_W_m2_K, wind_m_s : float or None
        Coefficient of convection, or the wind from which it follows (`convection`).
    sky_K : float or None
        Temperature of a blackbody with the total radiance of the sky.
    ground_K : float or None
        Temperature of the ground below the horizon; that of the air if it is left out.
    sun_W_m2, diffuse_W_m2 : float
        Irradiance of the beam on a plane that faces the sun, and of the sky on a horizontal plane.
    sun_elevation_deg, sun_azimuth_deg : float or None
        Direction of the sun in the axes of the scene: azimuth 0 is +x, 90 is +y.
    albedo : float
        Share of sunlight that the ground reflects.
    latitude_deg, longitude_deg, utc_offset_h : float or None
        Place in place of the sun's direction, and the clock of the hours. An EPW file has them.
    north_deg : float
        Azimuth of north, as the emitter `sun` has it.
    """

    file: str | None = None
    day: date | None = None
    air_K: float | None = entry(None, **KELVIN)
    h_W_m2_K: float | None = entry(None, **CONVECTION)
    wind_m_s: float | None = entry(None, lower=0, upper=1000)
    sky_K: float | None = entry(None, lower=0, upper=6000, unit="K")
    ground_K: float | None = entry(None, lower=0, upper=6000, unit="K")
    sun_W_m2: float = entry(0.0, **FLUX)
    diffuse_W_m2: float = entry(0.0, **FLUX)
    sun_elevation_deg: float | None = entry(None, lower=-90, upper=90)
    sun_azimuth_deg: float | None = entry(None)
    albedo: float = entry(0.2, lower=0, upper=1)
    latitude_deg: float | None = entry(None, lower=-90, upper=90)
    longitude_deg: float | None = entry(None, lower=-180, upper=180)
    utc_offset_h: float | None = entry(None, lower=-14, upper=14)
    north_deg: float = entry(90.0)


WALL = ("thickness_mm", "conductivity", "density", "heat_capacity")
HELD = "a group at a temperature has no wall, no back and no heat of its own"
BEHIND = (
    together(*WALL),
    excludes("temperature", *WALL, "internal_W_m2", "back_K", why=HELD),
    excludes("back", "back_K", why='give back = "insulated" or back_K'),
    needs("back_h", "back_K", why="the temperature of the air"),
    needs("back_K", *WALL),
    rule(
        lambda t: t.thickness_mm is None or np.real(t.wall(0.0).diffusion) >= FASTEST,
        "heat crosses the wall faster than its storage can be computed; leave it out",
    ),
)


@dataclass(frozen=True, kw_only=True)
class GroupTable(Described, rules=BEHIND):
    """[groups.NAME]: what lies behind the surfaces of a group.

    Attributes
    ----------
    temperature : float or None
        Temperature at which the group is held [K]; nothing else is then given.
    internal_W_m2 : float
        Heat that is released below the surface.
    h_W_m2_K : float or None
        Coefficient of convection, in place of that of the weather.
    thickness_mm, conductivity, density, heat_capacity : float or None
        Wall of one material, in mm, W/(m K), kg/m^3 and J/(kg K).
    back : str
        "insulated", unless back_K is given.
    back_K, back_h : float or None
        Temperature of the back, or of the air behind it if back_h [W/(m^2 K)] is given.
    """

    temperature: float | None = entry(None, **KELVIN)
    internal_W_m2: float = entry(0.0, lower=-1e8, upper=1e8)
    h_W_m2_K: float | None = entry(None, **CONVECTION)
    thickness_mm: float | None = entry(None, lower=1e-5, upper=1e7)
    conductivity: float | None = entry(None, lower=1e-4, upper=1e4)
    density: float | None = entry(None, lower=0.01, upper=1e5)
    heat_capacity: float | None = entry(None, lower=1, upper=1e5)
    back: Literal["insulated"] | None = None
    back_K: float | None = entry(None, **KELVIN)
    back_h: float | None = entry(None, lower=1e-6, upper=1e6)

    def wall(self, duration: float) -> HeatWall:
        """The wall for weather of a duration [s]; one of thickness 0 if there is none."""
        if self.thickness_mm is None:
            return HeatWall()
        mm, *of_material = (getattr(self, name) for name in WALL)
        usual = 0.0 if self.back_K is None else np.inf
        back = usual if self.back_h is None else self.back_h
        return HeatWall(mm / 1000, *of_material, back, self.back_K or 0.0, duration)


@dataclass(frozen=True, kw_only=True)
class RunTable(Described, where="[run]"):
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
        Temperature at which a series of rows begins; without it the day is repeated until it is
        periodic.
    """

    steps: int = entry(144, lower=4, upper=100_000)
    rays: int = entry(1024, lower=64, upper=2**20)
    seed: int = entry(0, lower=0, upper=2**32 - 1)
    start_K: float | None = entry(None, **KELVIN)


@dataclass(frozen=True, kw_only=True)
class SignatureTable(Described, where="[signature]"):
    """[signature]: intensity over the day, in the band and toward a sensor of the scene.

    Attributes
    ----------
    sensor : int
        Number of the sensor, from 0.
    spp : int
        Paths of each pixel.
    """

    sensor: int = entry(0, lower=0)
    spp: int = entry(64, lower=16, upper=2**20)


KINDS = {
    "weather": WeatherTable,
    "run": RunTable,
    "signature": SignatureTable,
}


@dataclass(frozen=True)
class HeatDescription:
    """The tables of a heat.toml.

    sigma: standard uncertainty of each input, in its unit or as a text such as "30 %". folder: that
    of the paths.
    """

    target: TargetTable
    weather: WeatherTable
    groups: dict[str, GroupTable] = field(default_factory=dict)
    sigma: dict[str, Stated] = field(default_factory=dict)
    run: RunTable = RunTable()
    signature: SignatureTable | None = None
    folder: Path = Path()

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
        group: filled(GroupTable, values, f"[groups.{group}]")
        for group, values in table_of(tree, "groups").items()
    }
    return HeatDescription(
        target=target,
        groups=groups,
        sigma=sigmas(tree),
        folder=folder,
        **tables,
    )
