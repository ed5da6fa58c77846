"""The heat balance of a scene: what its facets take up, and what one input changes of it.

Derivatives with respect to the inputs are taken by complex steps: the imaginary part of a power for
an input that is larger by i times a tiny number is exact to rounding [Squire and Trapp 1998].
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import hadamard
from scipy.sparse.csgraph import connected_components

from mi_lcair.errors import InputError, check_known
from mi_lcair.estimate import Stated, deviation, relative
from mi_lcair.heating.conductors import Facets, Traced, standard_error
from mi_lcair.heating.surfaces import SolarAreas
from mi_lcair.heating.temperatures.air import evaporation, longwave_temperature
from mi_lcair.heating.temperatures.balance import Balance, HeatWall
from mi_lcair.heating.temperatures.cells import CellWall
from mi_lcair.heating.temperatures.description import SURFACE, WALL, GroupTable
from mi_lcair.heating.temperatures.weather import WeatherSeries
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

STEP = 1e-30  # of complex steps, in standard uncertainties
LAYER = re.compile(r"(.*?)(?:\[(\d+)\])?")  # conductivity[1] is that of the second layer
OF_WEATHER = (
    "air_K", "sky_K", "down_longwave_W_m2", "ground_K", "sun_W_m2", "diffuse_W_m2", "albedo",
    "wind_m_s", "relative_humidity", "pressure_hPa",
)  # fmt: skip
OF_WALL = (
    *WALL,
    *SURFACE,
    "inertia",
    "radiative",
    "back_K",
    "back_h",
    "back_W_m2",
    "contact_m2_K_W",
)
OF_LAYER = (*WALL, "contact_m2_K_W")
OF_LAW = ("roughness_mm", "heat_roughness_mm", "length_m", "wetness", "resistance_s_m")
OF_SURFACE = (
    "h", "absorptance", "emissivity", "internal_W_m2", "internal_by_hour", "temperature",
)  # fmt: skip
OF_INERTIA = ("conductivity", "density")  # "inertia" is a common factor of both
OF_GROUP = (*OF_SURFACE, *OF_LAW, *OF_WALL)


@dataclass(frozen=True)
class Column:
    """Derivatives of the balance with respect to one input, for one standard uncertainty.

    gained: derivative of the power that facets gain, at temperatures (n,) and a time, apart from
    walls [W]; for a facet that is held, of its temperature [K]. walls: the walls of the groups with
    a complex step of the input, if it is one of walls.
    """

    name: str
    gained: Callable[[np.ndarray, int], np.ndarray]
    walls: list[HeatWall | CellWall | None] | None = None


@dataclass(frozen=True, eq=False)
class Network:
    """The facets of a scene, what they exchange, and their weather.

    Attributes
    ----------
    facets : Facets
    traced : Traced
        Conductors in the total band.
    sun : SolarAreas or None
        Of the times at which the sun shines; None in the dark.
    weather : Weather
        At m times.
    groups : dict of str to GroupTable
        What was stated of some groups.
    """

    facets: Facets
    traced: Traced
    sun: SolarAreas | None
    weather: WeatherSeries
    groups: dict[str, GroupTable] = field(default_factory=dict)

    @cached_property
    def tables(self) -> dict[str, GroupTable]:
        """The table of each group, in the order of the facets' groups, with its convection."""
        check_known("group", self.facets.groups, *self.groups)
        tables = {group: self.groups.get(group, GroupTable()) for group in self.facets.groups}
        usual = self.weather.h_W_m2_K
        return {
            group: replace(table, h_W_m2_K=usual if table.h_W_m2_K is None else table.h_W_m2_K)
            for group, table in tables.items()
        }

    def of_facets(self, function: Callable[[GroupTable], object]) -> np.ndarray:
        """Values (n, ...) of the facets, from a function of their group's table."""
        return np.array([function(table) for table in self.tables.values()])[self.facets.group]

    @cached_property
    def is_free(self) -> np.ndarray:
        """Whether the temperature of a facet is sought, (n,)."""
        return self.of_facets(lambda table: table.temperature is None)

    @cached_property
    def held(self) -> np.ndarray:
        """Temperatures of the facets that are held at one [K], 0 for others, (n,)."""
        return self.of_facets(lambda table: table.temperature or 0.0)

    @cached_property
    def convection(self) -> np.ndarray:
        """Coefficients of convection, (m, n) [W m^-2 K^-1]."""
        times = self.weather.seconds.shape

        def of(table):
            h = 0.0 if table.has_law else table.h_factor * table.h_W_m2_K
            return np.broadcast_to(h, times)

        return self.of_facets(of).T

    @cached_property
    def with_laws(self) -> list[tuple[GroupTable, np.ndarray]]:
        """Table and indices of facets of each group whose convection depends on temperature.

        Raises InputError for weather that lacks what the law needs.
        """
        group, weather = self.facets.group, self.weather
        pairs = [(name, t) for name, t in self.tables.items() if t.has_law]
        for name, table in pairs:
            where = f"[groups.{name}]"
            if (table.roughness_mm or table.plate) and weather.wind_m_s is None:
                raise InputError(f"{where}: convection by its law needs wind_m_s of the weather")
            if table.has_water and weather.relative_humidity is None:
                raise InputError(f"{where}: evaporation needs relative_humidity of the weather")
            heights = min(np.real([weather.wind_height_m, weather.air_height_m]))
            if (mm := np.real(table.roughness_mm or 0)) / 1000 >= heights:
                raise InputError(
                    f"{where}: roughness_mm = {mm:g} reaches up to the height of the wind or the "
                    f"air, {heights:g} m"
                )
        return [(t, np.flatnonzero(group == self.facets.groups.index(name))) for name, t in pairs]

    def leaving(self, kelvin: np.ndarray, k: int) -> np.ndarray:
        """Power that air takes from groups with a law at a time, (n,) [W]; complex."""
        power, air = np.zeros(len(kelvin), complex), self.weather.air(k)
        for table, members in self.with_laws:
            surface, usual = kelvin[members], table.h_W_m2_K
            h = table.convection(surface, air, usual if np.ndim(usual) == 0 else usual[k])
            flux = h * (surface - air.kelvin)
            if table.has_water:
                flux = flux + evaporation(surface, h, air, table.wetness, table.resistance_s_m)
            power[members] = flux * self.facets.radiating_area[members]
        return self.is_free * power

    @cached_property
    def walls(self) -> list[HeatWall | CellWall | None]:
        """The wall of each group, if it has one."""
        duration = float(np.ptp(self.weather.seconds))
        return [table.wall(duration) for table in self.tables.values()]

    @property
    def with_walls(self) -> list[tuple[int, HeatWall, np.ndarray]]:
        """Number, wall and indices of facets of each group that has a wall."""
        group = self.facets.group
        walls = enumerate(self.walls)
        members = ((g, wall, np.flatnonzero(group == g)) for g, wall in walls)
        return [row for row in members if isinstance(row[1], HeatWall)]

    @property
    def with_cells(self) -> list[tuple[int, CellWall, np.ndarray]]:
        """The same of each group whose wall is of cells."""
        walls = ((g, w) for g, w in enumerate(self.walls) if isinstance(w, CellWall))
        return [(g, wall, np.flatnonzero(self.facets.group == g)) for g, wall in walls]

    @cached_property
    def balance(self) -> Balance:
        """The balance of the facets whose temperatures are sought.

        Raises InputError for a facet from which heat has no path, also through other facets.
        """
        C, free = self.traced.mean, self.is_free
        is_tied = self.of_facets(lambda table: table.back_K is not None) | ~free
        count, part = connected_components(C.between, directed=False)
        is_tied = is_tied | self.of_facets(lambda table: bool(table.has_law))
        outward = is_tied + self.convection.sum(axis=0) + C.to_sky.sum(axis=1) + C.to_ground
        if (closed := (np.bincount(part, outward, count) == 0)[part]).any():
            k = int(closed.argmax())
            raise InputError(
                f"group {self.facets.groups[self.facets.group[k]]}: facet {self.facets.number[k]} "
                "has no path for heat; it needs convection, a back at a temperature, or something "
                "that it sees"
            )
        of_free = sparse.diags_array(free.astype(float))
        laplacian = of_free @ (sparse.diags_array(C.total) - C.between) @ of_free
        return Balance(sparse.csr_array(laplacian))

    def loads(self) -> tuple[np.ndarray, np.ndarray]:
        """P and C of all facets, (m, n) [W, W/K]; those of a held facet balance its temperature."""
        weather, C = self.weather, self.traced.mean
        air, sky, ground = (T[:, None] for T in (weather.air_K, weather.sky_K, weather.ground_K))
        arriving = C.to_sky.sum(axis=1) * sky**4 + C.to_ground * ground**4
        arriving = arriving + C.between @ self.held**4
        conductance = self.convection * self.facets.radiating_area
        step = weather.seconds[1] - weather.seconds[0] if len(weather.seconds) > 1 else 0.0
        day = (weather.seconds - step / 2) / weather.day_s % 1
        internal = self.of_facets(lambda table: table.internal(day)).T * self.facets.area
        power = STEFAN_BOLTZMANN * arriving + self.light.mean(axis=0) + conductance * air + internal
        held = np.broadcast_to(self.held, power.shape)
        return np.where(self.is_free, power, held), np.where(self.is_free, conductance, 1.0)

    @cached_property
    def light(self) -> np.ndarray:
        """Sunlight that the facets absorb, for each randomisation, (R, m, n) [W]."""
        weather, sun = self.weather, self.sun
        if sun is None:
            return np.zeros((1, len(weather.seconds), len(self.facets.area)))
        level = weather.sun_W_m2 * weather.height_of_sun + weather.diffuse_W_m2
        light = sun.sky[:, None] * weather.diffuse_W_m2[:, None]
        light = light + sun.ground[:, None] * (weather.albedo * level)[:, None]
        beam = weather.sun_W_m2[weather.shines, None]
        zenith = 1 - np.real(weather.sun_elevation_deg[weather.shines]) / 90
        direct = sun.direct.copy()
        for table, members in zip(self.tables.values(), self.facets.membership.toarray() > 0):
            if table.albedo:
                absorbed = 1 - np.polynomial.polynomial.polyval(zenith, table.albedo)
                direct[..., members] = absorbed[:, None] * sun.lit[..., members]
        light[:, weather.shines] += (direct + sun.reflected) * beam
        return light

    def column(self, name: str, sigma: Stated) -> Column:
        """The derivatives with respect to an input; raises InputError for an unknown one."""
        group, dot, key = name.rpartition(".")
        bare, of_layer = LAYER.fullmatch(key).groups()
        check_known("input of [sigma]", (*OF_WEATHER, *OF_GROUP), bare)
        if dot:
            check_known("group", self.facets.groups, group)
        layers = self.tables[group].layers if dot and bare in OF_LAYER else ()
        if dot and bare == "internal_by_hour":
            layers = self.tables[group].internal_by_hour
        if of_layer and int(of_layer) >= len(layers):
            raise InputError(f"[sigma]: {name}: there is no such layer or part of a day")
        if dot and bare in OF_WEATHER:
            raise InputError(f"[sigma]: {name}: {bare} is of the weather, not of a group")
        if bare == "emissivity":
            return Column(name, self.of_emissivity(group, sigma))
        if bare == "absorptance":
            more = self.of_absorptance(group, sigma)
            return Column(name, lambda kelvin, k: more[k])
        changed = self.changed(name, sigma)
        power, conductance = (values.imag / STEP for values in changed.loads())
        walls = changed.walls if bare in OF_WALL else None
        if walls and any(type(wall) is not type(own) for wall, own in zip(walls, self.walls)):
            raise InputError(f"[sigma]: {name}: the wall has none; give it in [groups.{group}]")

        def gained(kelvin, k):
            taken = changed.leaving(kelvin, k).imag / STEP if self.with_laws else 0.0
            return power[k] - conductance[k] * kelvin - taken

        return Column(name, gained, walls)

    def changed(self, name: str, sigma: Stated) -> "Network":
        """The network with an input that is larger by a complex step of a standard uncertainty."""
        group, _, key = name.rpartition(".")
        bare, of_layer = LAYER.fullmatch(key).groups()

        def larger(table, entry=bare):
            if (layers := getattr(table, "layers", ())) and entry in OF_LAYER:
                chosen = range(len(layers)) if of_layer is None else [int(of_layer)]
                changed = (larger(x) if k in chosen else x for k, x in enumerate(layers))
                return replace(table, layers=tuple(changed))
            if entry == "inertia":
                for key in OF_INERTIA:
                    table = larger(table, key)
                return table
            if entry == "internal_by_hour":
                values = [
                    value + 1j * STEP * size(sigma, value) if of_layer in (None, str(k)) else value
                    for k, value in enumerate(table.internal_by_hour)
                ]
                return replace(table, internal_by_hour=tuple(values))
            if entry == "h":
                by_law = table.roughness_mm is not None or table.plate is not None
                if by_law and not isinstance(sigma, str):
                    raise InputError(
                        f'[sigma]: {name}: a law gives h; give a relative one, such as "30 %"'
                    )
                return larger(table, "h_factor" if by_law else "h_W_m2_K")
            if entry == "down_longwave_W_m2":
                value = table.down_longwave_W_m2
                value = value + 1j * STEP * size(sigma, value)
                return replace(table, sky_K=longwave_temperature(value))
            if (value := getattr(table, entry, None)) is None:
                return table
            return replace(table, **{entry: value + 1j * STEP * size(sigma, value)})

        if bare in OF_WEATHER:
            return replace(self, weather=larger(self.weather))
        tables = self.tables.items()
        groups = {key: larger(table) if group in ("", key) else table for key, table in tables}
        return replace(self, groups=groups)

    def relative(self, group: str, sigma: Stated, values: np.ndarray) -> np.ndarray:
        """A standard uncertainty in parts of the facets' values, of one group or of all, (n,)."""
        values = np.maximum(values, 1e-9)
        is_changed = np.array([group in ("", name) for name in self.facets.groups])
        return is_changed[self.facets.group] * size(sigma, values) / values

    def of_absorptance(self, group: str, sigma: Stated) -> np.ndarray:
        """Derivative of the absorbed sunlight with respect to absorptances, (m, n) [W]."""
        light = self.light.mean(axis=0)
        if self.sun is None:
            return light
        more = light * self.relative(group, sigma, self.sun.absorptance)
        # What is absorbed in addition is not reflected on others
        return self.is_free * (more - more @ self.sun.onward)

    def of_emissivity(self, group: str, sigma: Stated, is_whole: bool = True) -> Callable:
        """Derivative of the radiative gains with respect to emissivities, for diffuse surfaces.

        With the conductors GR of the surfaces and of the surroundings, including those to itself,
        d GR_ij / d eps_k = (d_ik + d_jk) GR_ij / eps_k - GR_ik GR_kj / (A_k eps_k^2).

        is_whole: False for the last term only, what surfaces reflect less on others.
        """
        facets, C, weather = self.facets, self.traced.mean, self.weather
        delta = self.relative(group, sigma, facets.emissivity)

        def changed(fourth, sky, ground):
            """The derivative of GR times T^4 of facets, sky and ground."""
            absorbed = C.absorbed(fourth, sky, ground)
            onward = C.absorbed(delta * (fourth - absorbed / facets.emitting_area), 0, 0)
            return delta * absorbed + onward if is_whole else onward

        def gained(kelvin, k):
            fourth = kelvin**4
            flow = changed(fourth, weather.sky_K[k] ** 4, weather.ground_K[k] ** 4)
            flow = flow - fourth * changed(np.ones_like(fourth), 1, 1)
            return STEFAN_BOLTZMANN * self.is_free * flow

        return gained

    def rates(
        self, columns: Sequence[Column], kelvin: np.ndarray, k: int, has_scatter: bool = True
    ) -> np.ndarray:
        """`Column.gained` of columns, and then of each randomisation of the paths, (c + R, n).

        The temperatures that belong to the latter scatter as those of the randomisations.
        """
        gained = [column.gained(kelvin, k) for column in columns]
        if not has_scatter:
            return np.array(gained).reshape(-1, len(kelvin))
        fourth, weather = kelvin**4, self.weather
        around = weather.sky_K[k] ** 4, weather.ground_K[k] ** 4
        runs = np.array([run.gained(fourth, *around) for run in self.traced.replicates])
        runs = STEFAN_BOLTZMANN * runs + self.light[:, k]
        least = STEFAN_BOLTZMANN * self.traced.least_error(fourth, *around)
        if least.any():  # the errors of neighbouring facets differ
            missing = np.sqrt(np.maximum(least**2 - standard_error(runs) ** 2, 0))
            signs = hadamard(len(runs))[:, 1 + np.arange(len(missing)) % (len(runs) - 1)]
            runs = runs + np.sqrt(len(runs) - 1) * missing * signs
        scatter = self.is_free * (runs - runs.mean(axis=0))
        return np.array([*gained, *scatter])


def size(sigma: Stated, value: float | np.ndarray) -> float | np.ndarray:
    """A standard uncertainty of a value in its unit, from what [sigma] states."""
    if isinstance(sigma, Mapping):
        return np.vectorize(lambda one: deviation("[sigma]", sigma, one))(value)
    return relative(sigma) * value if isinstance(sigma, str) else sigma + 0 * value
