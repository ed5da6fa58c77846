"""The heat balance of a scene: what its facets take up, and what one input changes of it.

Derivatives with respect to the inputs are taken by complex steps: the imaginary part of a power for
an input that is larger by i times a tiny number is exact to rounding [Squire and Trapp 1998].
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from mi_lcair.errors import InputError, unknown
from mi_lcair.heating.conductors import Conductors, Facets, Traced, weighted
from mi_lcair.heating.temperatures.balance import Balance
from mi_lcair.heating.temperatures.description import GroupTable, Sigma
from mi_lcair.heating.temperatures.wall import Wall
from mi_lcair.heating.temperatures.weather import Weather
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

STEP = 1e-30  # of complex steps, in standard uncertainties
OF_WEATHER = ("h", "air_K", "sky_K", "ground_K", "sun_W_m2", "diffuse_W_m2", "albedo")
OF_WALL = ("thickness_mm", "conductivity", "density", "heat_capacity", "back_K", "back_h")
OF_SURFACE = ("h", "absorptance", "emissivity", "internal_W_m2", "temperature")
INPUTS = tuple(dict.fromkeys((*OF_WEATHER, *OF_SURFACE, *OF_WALL)))


@dataclass(frozen=True, eq=False)
class Sunlit:
    """Sunlight that the facets absorb, for each of R randomisations, in m^2.

    beam: (R, m, n), power by the irradiance of the beam at each time. sky: (R, n), by the
    irradiance of an even sky on a horizontal plane. ground: (R, n), by the irradiance that the
    ground reflects. absorptance: (n,), of the facets in the solar band. onward: (n, n), of the
    light that a facet (row) reflects, the share that each absorbs.
    """

    beam: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    absorptance: np.ndarray
    onward: sparse.csr_array

    def absorbed(self, sun, diffuse, from_ground) -> np.ndarray:
        """Power for irradiances (m, 1) of the beam, the sky and the ground, (R, m, n) [W]."""
        of_sky = self.sky[:, None] * diffuse
        return self.beam * sun + of_sky + self.ground[:, None] * from_ground


@dataclass(frozen=True)
class Change:
    """An input that differs by a number of standard uncertainties. Without a name nothing does."""

    name: str = ""
    sigma: Sigma = Sigma(0.0, False)
    count: complex = 0.0

    def of(self, name: str, value, group: str = ""):
        """The value of an input, of one group or of all."""
        if not self.name or self.name not in (name, f"{group}.{name}"):
            return value
        return (
            value * (1 + self.count * self.sigma.value)
            if self.sigma.is_relative
            else (value + self.count * self.sigma.value)
        )


@dataclass(frozen=True)
class Column:
    """Derivatives of the balance with respect to one input, for one standard uncertainty.

    power, conductance: derivatives of P and C, (m, free). walls: the complex step of an input of
    walls. radiative: derivative of the heat that the free facets gain by radiation at temperatures
    (free,) and a time, which P and C do not have [W]. held: that of the temperatures at which
    facets are held, (n,).
    """

    name: str
    power: np.ndarray | float = 0.0
    conductance: np.ndarray | float = 0.0
    walls: Change | None = None
    radiative: Callable[[np.ndarray, int], np.ndarray] | None = None
    held: np.ndarray | float = 0.0

    def gained(self, kelvin: np.ndarray, k: int) -> np.ndarray:
        """Power that it adds at temperatures (free,) and a time, apart from walls [W]."""
        power, conductance = (
            values[k] if np.ndim(values) else values for values in (self.power, self.conductance)
        )
        radiative = self.radiative(kelvin, k) if self.radiative else 0.0
        return power - conductance * kelvin + radiative


@dataclass(frozen=True, eq=False)
class Network:
    """The facets of a scene, what they exchange, and their weather.

    Attributes
    ----------
    facets : Facets
    traced : Traced
        Conductors in the total band.
    sunlit : Sunlit
    weather : Weather
        At m times.
    groups : dict of str to GroupTable
        What was stated of some groups.
    """

    facets: Facets
    traced: Traced
    sunlit: Sunlit
    weather: Weather
    groups: dict[str, GroupTable] = field(default_factory=dict)

    def __post_init__(self):
        for group in self.groups:
            if group not in self.facets.groups:
                raise unknown("group", group, self.facets.groups)
        self.check_paths()

    @cached_property
    def tables(self) -> dict[str, GroupTable]:
        """The table of each group, in the order of the facets' groups."""
        return {group: self.groups.get(group, GroupTable()) for group in self.facets.groups}

    @cached_property
    def members(self) -> list[np.ndarray]:
        """Indices of the facets of each group."""
        return [np.flatnonzero(self.facets.group == k) for k in range(len(self.facets.groups))]

    @cached_property
    def is_free(self) -> np.ndarray:
        """Whether the temperature of a facet is sought, (n,)."""
        return self.of_facets(lambda table, group: table.temperature is None)

    @property
    def conductors(self) -> Conductors:
        return self.traced.mean

    @cached_property
    def balance(self) -> Balance:
        """The balance of the facets whose temperatures are sought."""
        free = self.is_free
        between = self.conductors.between
        inner = between[free][:, free]
        outward = self.conductors.total[free] - inner.sum(axis=1)
        return Balance.of(inner, outward)

    def check_paths(self) -> None:
        """Raise InputError for a facet from which heat has no path, also through other facets."""
        C = self.conductors
        is_tied = self.of_facets(
            lambda table, group: (
                table.temperature is not None
                or table.back_K is not None
                or self.convection(table).any()
            )
        )
        count, part = connected_components(C.between, directed=False)
        outward = is_tied + C.to_sky.sum(axis=1) + C.to_ground
        if (closed := (np.bincount(part, outward, count) == 0)[part]).any():
            k = int(closed.argmax())
            raise InputError(
                f"group {self.facets.groups[self.facets.group[k]]}: facet {self.facets.number[k]} "
                "has no path for heat; it needs convection, a back at a temperature, or something "
                "that it sees"
            )

    def wall(self, group: str, change: Change = Change()) -> Wall:
        """The wall of a group; one of thickness 0 if it has none."""
        table = self.tables[group]
        if table.thickness_mm is None:
            return Wall()
        number = {
            name: change.of(name, value, group)
            for name in OF_WALL
            if (value := getattr(table, name)) is not None
        }
        back = np.inf if table.back_K is not None else 0.0
        return Wall(
            thickness=number["thickness_mm"] / 1000,
            conductivity=number["conductivity"],
            density=number["density"],
            heat_capacity=number["heat_capacity"],
            back=number.get("back_h", back),
            back_temperature=number.get("back_K", 0.0),
            duration=float(np.ptp(self.weather.seconds)),
        )

    def held(self, change: Change = Change()) -> np.ndarray:
        """Temperatures of the facets that are held at one [K], 0 for others, (n,)."""
        return self.of_facets(
            lambda table, group: (
                0.0
                if table.temperature is None
                else change.of("temperature", table.temperature, group)
            )
        )

    def of_facets(self, function: Callable) -> np.ndarray:
        """Values (n, ...) of the facets, from a function of their group's table and name."""
        return np.array([function(*pair[::-1]) for pair in self.tables.items()])[self.facets.group]

    def varied(self, change: Change, name: str, values: np.ndarray) -> np.ndarray:
        """Relative change of positive values of the facets, (n,)."""
        changed = values * (1 + 0 * change.count)
        for group, members in zip(self.tables, self.members):
            changed[members] = change.of(name, values[members], group)
        return changed / values - 1

    def convection(self, table: GroupTable) -> np.ndarray:
        """Coefficient of convection of a group at the times, (m,)."""
        weather = self.weather.h_W_m2_K
        return weather if table.h_W_m2_K is None else np.full(weather.shape, table.h_W_m2_K)

    def whole(self, kelvin: np.ndarray) -> np.ndarray:
        """Temperatures of all facets, from those that are sought, (n,)."""
        whole = self.held()
        whole[self.is_free] = kelvin
        return whole

    def spread(self, changes: np.ndarray, column: Column) -> np.ndarray:
        """Changes of the temperatures of all facets, from those that are sought, (n,)."""
        whole = np.zeros(len(self.facets.area)) + column.held
        whole[self.is_free] = changes
        return whole

    def loads(self, change: Change = Change()) -> tuple[np.ndarray, np.ndarray]:
        """P and C of all facets whose temperatures are sought, (m, free) [W, W/K]."""
        weather, C = self.weather, self.conductors
        air, sky, ground = (
            change.of(name, getattr(weather, name))[:, None]
            for name in ("air_K", "sky_K", "ground_K")
        )
        arriving = C.to_sky.sum(axis=1) * sky**4 + C.to_ground * ground**4
        arriving = arriving + C.between @ self.held(change) ** 4
        sunlight = self.sunlight(change).mean(axis=0)
        h = self.of_facets(lambda table, group: change.of("h", self.convection(table), group)).T
        internal = self.of_facets(
            lambda table, group: change.of("internal_W_m2", table.internal_W_m2, group)
        )
        more = self.varied(change, "absorptance", np.maximum(self.sunlit.absorptance, 1e-9))
        conductance = h * self.facets.radiating_area
        power = STEFAN_BOLTZMANN * arriving + sunlight + conductance * air
        power = power + internal * self.facets.area
        if more.any():
            # What is absorbed in addition is not reflected on others
            kept = sunlight * more
            power = power + kept - kept @ self.sunlit.onward
        power, conductance = power[:, self.is_free], conductance[:, self.is_free]
        return (power, conductance) if change.name else (power.real, conductance.real)

    def sunlight(self, change: Change = Change()) -> np.ndarray:
        """Sunlight that the facets absorb, for each randomisation, (R, m, n) [W]."""
        weather = self.weather
        sun = change.of("sun_W_m2", weather.sun_W_m2)[:, None]
        diffuse = change.of("diffuse_W_m2", weather.diffuse_W_m2)[:, None]
        light = sun * weather.height_of_sun[:, None] + diffuse
        return self.sunlit.absorbed(sun, diffuse, light * change.of("albedo", weather.albedo))

    def column(self, name: str, sigma: Sigma) -> Column:
        """The derivatives with respect to an input; raises InputError for an unknown one."""
        group, dot, bare = name.rpartition(".")
        if bare not in INPUTS:
            raise unknown("input", bare, INPUTS)
        if dot and group not in self.facets.groups:
            raise unknown("group", group, self.facets.groups)
        if dot and bare in OF_WEATHER and bare != "h":
            raise InputError(f"[sigma]: {name}: {bare} is of the weather, not of a group")
        if bare == "emissivity":
            return Column(name, radiative=self.of_emissivity(name, sigma))
        change = Change(name, sigma, 1j * STEP)
        power, conductance = (values.imag / STEP for values in self.loads(change))
        walls = change if bare in OF_WALL else None
        return Column(name, power, conductance, walls, held=self.held(change).imag / STEP)

    def of_emissivity(self, name: str, sigma: Sigma, is_whole: bool = True) -> Callable:
        """Derivative of the radiative gains with respect to emissivities, for diffuse surfaces.

        With the conductors GR of the surfaces and of the surroundings, including those to itself,
        d GR_ij / d eps_k = (d_ik + d_jk) GR_ij / eps_k - GR_ik GR_kj / (A_k eps_k^2).

        is_whole: False for the last term only, what surfaces reflect less on others.
        """
        facets, C, change = self.facets, self.conductors, Change(name, sigma, 1.0)
        area, eps = facets.radiating_area, np.maximum(facets.emissivity, 1e-9)
        delta = self.varied(change, "emissivity", eps)

        def changed(fourth, sky, ground):
            """The derivative of GR times T^4 of facets, sky and ground."""
            absorbed = C.absorbed(fourth, sky, ground)
            onward = C.absorbed(delta * (fourth - absorbed / (area * eps)), 0, 0)
            return delta * absorbed + onward if is_whole else onward

        def gained(kelvin, k):
            fourth, weather = self.whole(kelvin) ** 4, self.weather
            flow = changed(fourth, weather.sky_K[k] ** 4, weather.ground_K[k] ** 4)
            flow = flow - fourth * changed(np.ones_like(fourth), 1, 1)
            return STEFAN_BOLTZMANN * flow[self.is_free]

        return gained

    def noise(self) -> list[Column]:
        """A column for each randomisation of the paths: its difference from their mean.

        The temperatures of the columns scatter as those of the randomisations.
        """
        free, mean = self.is_free, self.conductors

        def of(replicate):
            change = weighted([replicate, mean], (1, -1))

            def gained(kelvin, k):
                sky, ground = self.weather.sky_K[k], self.weather.ground_K[k]
                gain = change.gained(self.whole(kelvin) ** 4, sky**4, ground**4)
                return STEFAN_BOLTZMANN * gain[free]

            return gained

        light = self.sunlight()[:, :, free]
        shape = (len(self.traced.replicates), *light.shape[1:])
        light = np.broadcast_to(light - light.mean(axis=0), shape)
        return [
            Column(f"randomisation {number}", power=power, radiative=of(replicate))
            for number, (power, replicate) in enumerate(zip(light, self.traced.replicates))
        ]
