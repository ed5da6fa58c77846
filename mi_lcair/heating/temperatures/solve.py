"""Temperatures of a loaded scene for a heat.toml."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mi_lcair.derivatives.images import FacetMatrix, facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.heating.conductors import standard_error
from mi_lcair.heating.exchange import exchange
from mi_lcair.heating.surfaces import SolarAreas, emitting_facets, solar_areas
from mi_lcair.heating.temperatures.balance import CELLS, CLOSED, SLOWEST
from mi_lcair.heating.temperatures.cells import Cells
from mi_lcair.heating.temperatures.description import (
    GroupTable,
    HeatDescription,
    RunTable,
    SignatureTable,
    default_sigmas,
    doubts,
)
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.heating.temperatures.network import STEP, Column, Network
from mi_lcair.heating.temperatures.weather import WeatherSeries, weather
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN, radiance_and_slope
from mi_lcair.rendering.facets import FacetPolygons, FacetTable
from mi_lcair.rendering.measurands import check_free
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area

# Temperatures over the times of a weather, and their derivatives with respect to inputs
# --------------------------------------------------------------------------------------
# Time steps are those of BDF2. The nodes U of a wall are followed by the amplitudes V of its modes,
# U = Phi V, see `balance.Wall`. With those that earlier steps give, H, and the flux q into the
# surface,
#
#     (3/2 / dt + rates) V = H / dt + Phi^T b + Phi_0 q,
#
# so that the surface has the temperature Phi_0 V = r + q / g with known r and g. What remains is
# one equation for each facet, see `balance.Balance`. A steady state is a step without an end. A
# change of V that is due to an input of the wall follows the same equation, with
# Phi^T (db - dK U - dM dU/dt) in it.

# Share of the first day in which temperatures are followed without their changes, if walls have
# forgotten by the factor exp(-FORGOTTEN) in the rest of that day that these began with 0
ALONE, FORGOTTEN = 0.75, 10.0
PERIODIC = 2e-3  # largest distance of a temperature from its periodic value [K]
MOST_DAYS = 60
DAILY = 1e-9  # residual of the balance of a step, as a fraction of the power
ROUGH = 1e-5  # residual of the changes by the columns, as a fraction of the power
BDF2, EULER = 1.5, 1.0  # coefficients of the new temperatures in a step
USUAL_H = 10.0  # coefficient of convection of a first guess [W m^-2 K^-1]
MOST_FALLING = 0.9  # share of the radiation's slope that a falling convection may take away
PARTS = 16  # implicit Euler steps in place of a first step of BDF2


def course(
    network: Network,
    columns: Sequence[Column] = (),
    start_K: float | None = None,
    method: str = "steps",
    begin: "Course | None" = None,
    has_scatter: bool = True,
    drift_K: float | None = None,
) -> "Course":
    """The temperatures at the times of a weather; a steady state if it has one time.

    Parameters
    ----------
    network : Network
    columns : sequence of Column
        What the temperatures are differentiated by.
    start_K : float or None
        Temperature of all surfaces one step before the first time. None: the times are those of a
        day, which is repeated until it is periodic.
    method : str
        "steps" or "harmonics" for a periodic day; see `RunTable`.
    begin : Course or None
        Periodic day of a similar network with the same columns, from whose end the days go on.
    has_scatter : bool
        Whether the changes by the randomisations are wanted.
    drift_K : float or None
        Distance from the periodic day at which no further day is taken; `PERIODIC` if left out.

    Raises
    ------
    InputError
        If the days do not become periodic, or a balance does not converge.
    """
    result = Course(network, columns, start_K, has_scatter)
    if begin is not None and start_K is None:
        result.go_on_from(begin)
    if len(result.kelvin) == 1:
        result.step(0, EULER, result.seconds)
    elif start_K is not None:
        result.series()
    elif method == "harmonics":
        result.harmonics()
    else:
        near = PERIODIC if drift_K is None else drift_K
        while not result.days or result.drift >= near:
            if result.days == MOST_DAYS:
                raise InputError(
                    f"the temperatures still change by {result.drift:.2g} K after {MOST_DAYS} days"
                )
            result.repeat()
    return result


class Course:
    """Temperatures of the facets over the times of a weather.

    Attributes
    ----------
    kelvin : (m, n)
    changes : (columns + R, m, n)
        Their changes by the columns, and then by each randomisation of the paths [K].
    residual : float
        Largest power that is left over [W].
    days : int
        Number of days that were calculated.
    drift : float
        Largest distance of a temperature from its periodic value, as the last day shows it [K].
    states : (2, 1 + columns + R, modes, n)
        Amplitudes of the modes of all walls, and then their changes, at the last two times.
    rates, surface, back : (modes, n)
        Rates of the modes [1/s], Phi_0, and Phi^T b.
    """

    def __init__(
        self,
        network: Network,
        columns: Sequence[Column],
        start_K: float | None,
        has_scatter: bool = True,
    ):
        self.network, self.columns, self.has_scatter = network, columns, has_scatter
        times = network.weather.seconds
        m, n = len(times), len(network.facets.area)
        self.seconds = float(times[1] - times[0]) if m > 1 else np.inf
        self.power, self.conductance = network.loads()
        runs = len(network.traced.replicates) if has_scatter else 0
        self.changes = np.zeros((len(columns) + runs, m, n))
        self.residual, self.days, self.drift = 0.0, 0, 0.0
        self.rates, (self.surface, self.back) = np.ones((CELLS + 1, n)), np.zeros((2, CELLS + 1, n))
        self.varied = []  # effect of each column on the walls of a group
        for group, wall, members in network.with_walls:
            rates, shapes = wall.modes
            self.rates[:, members] = rates[:, None]
            self.surface[:, members] = shapes[0][:, None]
            self.back[:, members] = (shapes.T @ wall.conduction[1])[:, None]
            for c, column in enumerate(columns):
                if column.walls:
                    changed = column.walls[group]
                    parts = *changed.conduction, np.diag(changed.mass)
                    K, b, M = (part.imag / STEP for part in parts)
                    b, K, M = shapes.T @ b[:, None], shapes.T @ K @ shapes, shapes.T @ M @ shapes
                    self.varied.append((c, members, b, K, M))
        self.cells = [
            Cells(wall, members, {c: x.walls[group] for c, x in enumerate(columns) if x.walls})
            for group, wall, members in network.with_cells
        ]
        self.slope = np.zeros((m, n))  # of what air takes by its laws [W/K]
        g, r = self.of_walls(1 / self.rates, self.back)
        kelvin = np.full(n, network.weather.air_K[0] if start_K is None else start_K)
        if start_K is None:
            into = network.facets.area * g
            power, conductance = (load.mean(axis=0) for load in (self.power, self.conductance))
            for _, members in network.with_laws:  # a guess
                more = USUAL_H * network.is_free[members] * network.facets.radiating_area[members]
                conductance[members] += more
                power[members] += more * network.weather.air_K.mean()
            kelvin, _ = network.balance.solve(power + into * r, conductance + into, kelvin)
        self.states = np.zeros((2, 1 + len(self.changes), CELLS + 1, n))
        self.states[:, 0] = (self.back + self.surface * g * (kelvin - r)) / self.rates
        self.kelvin = np.tile(kelvin, (m, 1))
        for cells in self.cells:
            cells.begin(kelvin[cells.members], len(self.changes))

    def go_on_from(self, other: "Course") -> None:
        """Begin with the last state of another periodic day, at the same share of each depth."""
        if other.states.shape == self.states.shape:
            self.states, self.kelvin = other.states.copy(), other.kelvin.copy()
            pairs = zip(self.network.with_walls, other.network.with_walls)
            for (_, wall, members), (_, before, _) in pairs:
                to_new = np.linalg.pinv(wall.modes[1]) @ before.modes[1]
                self.states[..., members] = to_new @ self.states[..., members]
            for cells, before in zip(self.cells, other.cells):
                cells.go_on_from(before)

    @property
    def scatter(self) -> np.ndarray:
        """The changes by the randomisations of the paths, (R, m, n) [K]."""
        return self.changes[len(self.columns) :]

    def of_walls(self, lag: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """g [W m^-2 K^-1], (n,), and r [K], (..., n), of walls with V = lag (source + Phi_0 q)."""
        response = np.sum(self.surface**2 * lag, axis=0)
        g = np.divide(1, response, out=np.zeros_like(response), where=response > 0)
        return g, np.sum(self.surface * lag * source, axis=-2)

    def series(self) -> None:
        """Take the steps to all times. The first, of which no earlier one is known, has parts."""
        for c, members, b, K, _ in self.varied:  # of walls that conduct to a back at the beginning
            rates, top = self.rates[:, members], self.surface[:, members]
            if rates.min() > SLOWEST:
                source = b - K @ self.states[1, 0][:, members]
                flux = np.sum(top * source / rates, axis=0) / np.sum(top**2 / rates, axis=0)
                self.states[:, 1 + c][..., members] = (source - top * flux) / rates
        before, of_cells = self.states[1], [cells.states[1] for cells in self.cells]
        for _ in range(PARTS):
            self.step(0, EULER, self.seconds / PARTS)
        self.states[0] = before
        for cells, state in zip(self.cells, of_cells):
            cells.states[0] = state
        for k in range(1, len(self.kelvin)):
            self.step(k, BDF2, self.seconds)
        self.days = 1

    def harmonics(self) -> None:
        """Find the periodic day by its Fourier components."""
        network = self.network
        if network.with_laws or self.cells:
            raise InputError(
                '[run]: method = "harmonics" is for walls of one material and convection that does '
                "not depend on the temperature"
            )
        components = Harmonics(network, self.rates, self.surface, self.back)
        self.kelvin = components.temperatures(self.kelvin[0])
        self.changes = components.changes(self.kelvin, self.columns, self.varied)
        self.residual, self.days = components.residual, 1

    def repeat(self) -> None:
        """Take the steps of a day, go on to its periodic state, and say how far away that was.

        Each mode decays, so that no later temperature of a surface differs by more than the drift.
        """
        begin, of_cells = self.states[1], [cells.states[1] for cells in self.cells]
        m, rest = len(self.kelvin), (1 - ALONE) * self.seconds * len(self.kelvin)
        slowest = min((rates[0] for _, rates, _ in self.decays), default=0.0)
        is_first = not self.days and not self.cells and slowest * rest > FORGOTTEN
        for k in range(m):
            self.step(k, BDF2, self.seconds, has_changes=not is_first or k >= ALONE * m)
        change = self.states[1] - begin
        left = self.left(change)
        self.states = self.states + left
        self.drift = float(np.sum(abs(self.surface * (change + left)), axis=-2).max())
        day = self.seconds * len(self.kelvin)
        for cells, state in zip(self.cells, of_cells):
            drift = cells.periodic(state, self.loss[cells.members], day)
            self.drift = max(self.drift, drift)
        self.drift = np.inf if is_first else self.drift
        self.days += 1

    @property
    def loss(self) -> np.ndarray:
        """Heat that surfaces lose in proportion to their temperature, (n,) [W m^-2 K^-1]."""
        network = self.network
        slope = 4 * STEFAN_BOLTZMANN * (self.kelvin**3).mean(axis=0) * network.balance.diagonal
        slope += (self.conductance + self.slope).mean(axis=0)
        return slope / network.facets.area

    @property
    def decays(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Facets of each wall, and rates [1/s] and modes of its amplitudes below a surface that
        loses heat in proportion to its temperature; the slowest first."""
        loss = self.loss
        for _, wall, members in self.network.with_walls:
            rates, shapes = wall.modes
            matrix = np.diag(rates) + loss[members].mean() * np.outer(shapes[0], shapes[0])
            yield members, *np.linalg.eigh(matrix)

    def left(self, change: np.ndarray) -> np.ndarray:
        """How far amplitudes still are from periodic ones, from their change over a day.

        They change by V = F V from day to day, so that (1 - F)^-1 F of a change is left to do.
        """
        result, day = np.zeros_like(change), self.seconds * len(self.kelvin)
        for members, rates, modes in self.decays:
            rest = modes * (np.exp(-rates * day) / -np.expm1(-rates * day)) @ modes.T
            result[..., members] = rest @ change[..., members]
        return result

    def step(self, k: int, scheme: float, seconds: float, has_changes: bool = True) -> None:
        """Take the step to a time, of the temperatures and then of their changes, if wanted."""
        network, balance, area = self.network, self.network.balance, self.network.facets.area
        closed, solved = (DAILY, ROUGH) if np.isfinite(seconds) else (CLOSED, CLOSED)
        earlier, last = self.states
        history = last if scheme == EULER else 2 * last - 0.5 * earlier
        source, lag = history / seconds, 1 / (scheme / seconds + self.rates)
        source[0] += self.back
        g, r = self.of_walls(lag, source[0])

        power, conductance = self.power[k] + area * g * r, self.conductance[k] + area * g
        for cells in self.cells:
            cells.start_step(scheme, seconds)
        leaving = partial(self.leaving, k) if network.with_laws or self.cells else None
        kelvin, residual = balance.solve(power, conductance, self.kelvin[k], closed, leaving)
        if leaving:
            conductance = conductance + self.leaving(k, kelvin)[1]
            # What air takes in stable layers may fall as a surface warms
            least = -4 * MOST_FALLING * STEFAN_BOLTZMANN * kelvin**3 * balance.diagonal
            conductance = np.maximum(conductance, least)
        self.residual, self.kelvin[k] = max(self.residual, residual), kelvin
        source[0] += self.surface * g * (kelvin - r)

        amplitudes = lag * source[0]
        if not has_changes:
            self.states = np.stack([last, np.zeros_like(last)])
            self.states[1, 0] = amplitudes
            return
        for c, members, b, K, M in self.varied:
            V = amplitudes[:, members]
            slope = (scheme * V - history[0][:, members]) / seconds
            source[1 + c][:, members] += b - K @ V - M @ slope
        _, r = self.of_walls(lag, source[1:])
        power = network.rates(self.columns, kelvin, k, self.has_scatter) + area * g * r
        for cells in self.cells:
            known = area[cells.members] * cells.known(kelvin[cells.members])
            power[:, cells.members] -= network.is_free[cells.members] * known
        self.changes[:, k] = balance.linear(kelvin, conductance, power.T, solved).T
        source[1:] += self.surface * (g * (self.changes[:, k] - r))[:, None]
        self.states = np.stack([last, lag * source])
        for cells in self.cells:
            cells.end_step(self.changes[:, k][:, cells.members])

    def leaving(self, k: int, kelvin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Power that air and walls of cells take at a time, and its derivative, (n,)."""
        network = self.network
        taken = network.leaving(kelvin + 1j * STEP, k)
        power, slope = taken.real, taken.imag / STEP
        self.slope[k] = slope
        for cells in self.cells:
            area = (network.is_free * network.facets.area)[cells.members]
            flux, of_flux = cells.solve(kelvin[cells.members])
            power[cells.members] += area * flux
            slope[cells.members] += area * of_flux
        return power, slope


# A periodic day by the Fourier components of walls, exchange and weather
# -----------------------------------------------------------------------
# Each component of a wall's flux is its admittance times that of the surface's temperature. The
# admittances are those of BDF2 with the steps of the day, so that the result is what the steps
# approach from day to day. T^4 and coefficients that change over the day make the components depend
# on each other. The residual over time is taken as a power, to which the mean linear balance
# answers component by component, until nothing is left.

MOST_ROUNDS, LEFT_K = 200, 1e-4  # rounds, and the change of a temperature at which they end [K]
IN_ROUND = 1e-3  # residual of each linear system in a round, relative


class Harmonics:
    """The components of a network over its m times.

    rates, surface, back: (modes, n), of the walls, as those of `Course`. symbol: (K,), of the time
    derivative [1/s]. admittance: (K, n) [W m^-2 K^-1]. residual: largest power left over [W].
    """

    def __init__(self, network: Network, rates, surface, back):
        self.network, self.surface, self.back = network, surface, back
        times = network.weather.seconds
        self.count = len(times)
        z = np.exp(-2j * np.pi * np.arange(self.count // 2 + 1) / self.count)
        self.symbol = (1.5 - 2 * z + 0.5 * z**2) / (times[1] - times[0])
        self.lag = 1 / (self.symbol[:, None, None] + rates)
        response = np.sum(surface**2 * self.lag, axis=1)
        self.admittance = np.divide(1, response, out=np.zeros_like(response), where=response != 0)
        self.rest = np.real(self.admittance[0] * np.sum(surface * self.lag[0] * back, axis=0))
        self.power, self.conductance = network.loads()
        self.residual = 0.0

    def flux(self, values: np.ndarray) -> np.ndarray:
        """Fluxes into the walls below temperatures (..., m, n), without the part of the backs."""
        return np.fft.irfft(self.admittance * np.fft.rfft(values, axis=-2), self.count, axis=-2)

    def answered(self, residual: Callable, values: np.ndarray, cubes: np.ndarray) -> np.ndarray:
        """The values (c, m, n) for which the residual [W] vanishes, from others.

        cubes: mean of T^3, (n,), for the slope of the mean balance.
        """
        network, (c, m, n) = self.network, values.shape
        mean = self.conductance.mean(axis=0) + network.facets.area * self.admittance
        conductance = np.tile(mean, (c, 1)).T
        level = np.cbrt(cubes)
        for _ in range(MOST_ROUNDS):
            power = np.fft.rfft(residual(values), axis=1).reshape(-1, n).T
            parts = network.balance.linear(level, conductance, power, IN_ROUND)
            change = np.fft.irfft(parts.T.reshape(c, -1, n), m, axis=1)
            values = values + change
            if abs(change).max() < LEFT_K * max(1.0, abs(values).max() / 1000):
                return values
        raise InputError('the components do not converge; use method = "steps" of [run]')

    def temperatures(self, start: np.ndarray) -> np.ndarray:
        """Temperatures over the day, (m, n), from those of a mean day, (n,)."""
        area, L = self.network.facets.area, self.network.balance.laplacian

        def residual(values):
            (kelvin,) = values
            emitted = STEFAN_BOLTZMANN * (L @ kelvin.T**4).T
            into = area * (self.flux(kelvin) - self.rest)
            return (self.power - self.conductance * kelvin - emitted - into)[None]

        values = self.answered(residual, np.tile(start, (1, self.count, 1)), start**3)
        self.residual = float(abs(residual(values)).max())
        return values[0]

    def changes(self, kelvin: np.ndarray, columns: Sequence[Column], varied) -> np.ndarray:
        """Changes by the columns and by each randomisation, (c + R, m, n); see `Course`."""
        network, area = self.network, self.network.facets.area
        power = np.array([network.rates(columns, T, k) for k, T in enumerate(kelvin)])
        power = np.swapaxes(power, 0, 1)
        flux = self.admittance * np.fft.rfft(kelvin, axis=0)
        flux[0] -= self.count * self.rest
        for c, members, b, K, M in varied:
            surface, lag = self.surface[:, members], self.lag[:, :, members]
            source = surface * flux[:, None, members]
            source[0] += self.count * self.back[:, members]
            V = lag * source
            term = -(K @ V) - M @ (self.symbol[:, None, None] * V)
            term[0] += self.count * b
            r = self.admittance[:, members] * np.sum(surface * lag * term, axis=1)
            power[c][:, members] += area[members] * np.fft.irfft(r, self.count, axis=0)
        slope, L = 4 * STEFAN_BOLTZMANN * kelvin**3, network.balance.laplacian
        n = len(area)

        def residual(values):
            emitted = (L @ (slope * values).reshape(-1, n).T).T.reshape(values.shape)
            return power - self.conductance * values - emitted - area * self.flux(values)

        return self.answered(residual, np.zeros_like(power), (kelvin**3).mean(axis=0))


TOGETHER = " and others"  # of an input whose error goes together with those of others
WITHOUT_MODEL = "without model error: model_K of [sigma] is 0"
# Column of the weather, keys of a material that need it, and what they describe
FED = (
    ("wind_m_s", ("heat_roughness_mm", "roughness_mm"), "the law of wind over rough ground"),
    ("relative_humidity", ("wetness", "resistance_s_m"), "evaporation and dew"),
)
# Rays toward the sun: least number from each side of a facet at each time, and number of all rays
# up to which there are as many as paths
SHADOW_RAYS, ALL_SHADOW_RAYS = 32, 2**24
BYTES = 1100  # memory for a facet and a position of the sun, measured with 4,000 and 8,000 facets
DOUBTFUL = 0.01  # share of an effect that may rest on an assumption without a remark


def network_of(scene: Scene, description: HeatDescription) -> tuple[Network, tuple[str, ...]]:
    """The facets of a scene with what they exchange and their weather, and remarks."""
    run = description.run
    conditions = weather(
        description.weather, description.folder, run.steps, is_periodic=run.start_K is None
    )
    emissivities, absorptances = map(description.stated, ("emissivity", "absorptance"))
    radiation = exchange(scene, run.rays, run.seed, emissivities=emissivities)
    sun = sunlight(scene, len(radiation.facets.number), conditions, run, absorptances)
    groups, of_groups = usable(description.groups, conditions)
    of_sun = () if sun is None else sun.remarks
    of_walls = [text for name, t in groups.items() for text in doubts(t, f"[groups.{name}]")]
    remarks = *radiation.remarks, *of_sun, *conditions.remarks, *of_groups, *of_walls
    return Network(radiation.facets, radiation.traced, sun, conditions, groups), remarks


def temperatures(scene: Scene, description: HeatDescription) -> Heat:
    """The temperatures of a scene's facets; see `mi_lcair.heat`."""
    run = description.run
    table, signature = FacetTable(scene), description.signature
    traced = None if signature is None else effective_areas(scene, table, signature, run.seed)
    network, of_network = network_of(scene, description)
    sigmas, of_defaults = description.sigma, description.has_defaults
    if of_defaults:
        sigmas = default_sigmas(network.weather.sky, network.tables)
    columns = [network.column(name, sigma) for name, sigma in sigmas.items()]
    solved = course(network, columns, run.start_K, run.method)
    rows = [Contribution("exchange", standard_error(solved.scatter))]
    changes = dict(zip(sigmas, solved.changes))
    names, together = description.correlation.inputs, {}
    for k, part in enumerate(description.correlation.root.T):  # errors that do not depend on others
        of = sum(share * changes[name] for name, share in zip(names, part))
        together[names[k]] = of
    rows += [
        Contribution(
            f"{name}{TOGETHER * (name in names)}",
            together.get(name, change),
            sigma=f"{sigmas[name]} (default)" if of_defaults else sigmas[name],
        )
        for name, change in changes.items()
        if change.any() or not of_defaults
    ]
    of_sigma = [
        f"[sigma] {row.quantity} changes no temperature"
        for row in rows[1:]
        if not row.contribution.any()
    ]
    rows += model_errors(network, description.model_K)
    of_sigma += [WITHOUT_MODEL] if description.model_K == 0 else []
    of_sigma += remarks_on_emissivities(network, sigmas, solved.kelvin[0], traced is not None)
    of_intensity = [f"intensity: {text}" for text in scene.of_nothing if traced]
    result = Heat(
        name=scene.name,
        facets=network.facets,
        seconds=network.weather.seconds,
        estimate=Estimate.of(solved.kelvin, "K", rows),
        residual_W=solved.residual,
        days=solved.days,
        drift_K=solved.drift,
        intensity=None,
        band="" if traced is None else traced[0].band.label,
        polygons=FacetPolygons.of(table.triangles, table.triangle_facet),
        scene_kelvin=table.temperature,
        remarks=tuple(dict.fromkeys((*of_network, *of_sigma, *of_intensity))),
    )
    return result if traced is None else replace(result, intensity=intensity(result, *traced))


def model_errors(network: Network, kelvin: float) -> list[Contribution]:
    """The error of the model itself for each group: common to its facets and to all times.

    What air and ground do and the terms do not have is alike over a group, and lasts for hours.
    Groups err by themselves.
    """
    facets, times = network.facets, len(network.weather.seconds)
    rows = []
    for name, members in zip(facets.groups, facets.membership.toarray() > 0):
        change = np.tile(kelvin * (members & network.is_free), (times, 1))
        if change.any():
            rows.append(Contribution(f"{name}.model_K", change, sigma=kelvin))
    return rows


def usable(
    groups: dict[str, GroupTable], conditions: WeatherSeries
) -> tuple[dict[str, GroupTable], list[str]]:
    """Groups without those laws of their materials that the weather cannot feed, and remarks."""
    result, remarks = dict(groups), []
    for column, keys, effect in FED:
        for name, table in groups.items():
            gone = [key for key in keys if key in table.by_material]
            if gone and getattr(conditions, column) is None:
                result[name] = replace(result[name], **dict.fromkeys(gone))
                remarks.append(f"group {name}: without {effect}, which needs {column}")
    return result, remarks


def remarks_on_emissivities(
    network: Network, sigmas: dict, kelvin: np.ndarray, has_intensity: bool
) -> list[str]:
    """Remarks on neglected effects of emissivities. kelvin: (n,), at the first time."""
    facets, remarks = network.facets, []
    for name, sigma in sigmas.items():
        group, _, bare = name.rpartition(".")
        if bare != "emissivity":
            continue
        effects = (network.of_emissivity(group, sigma, whole)(kelvin, 0) for whole in (False, True))
        onward, whole = (abs(effect).max() for effect in effects)
        if onward > DOUBTFUL * whole:
            share = f"{onward / whole:.0%} of its effect assumes that surfaces reflect diffusely"
            remarks.append(f"[sigma] {name}: {share}")
        if has_intensity:
            delta = network.relative(group, sigma, facets.emissivity)
            share = facets.emitting_area @ delta / facets.emitting_area.sum()
            remarks.append(
                f"[sigma] {name}: changes the intensity by temperatures only; the surfaces also "
                f"emit {share:.1%} more at the same temperatures; `budget` includes that"
            )
    return remarks


def sunlight(
    scene: Scene, n: int, conditions: WeatherSeries, run: RunTable, absorptances: dict[str, float]
) -> SolarAreas | None:
    """The sunlight that n facets absorb while the sun shines; None in the dark.

    absorptances: of groups, in place of their materials.
    """
    suns = conditions.toward_sun[conditions.shines]
    if not len(suns):
        if not conditions.diffuse_W_m2.any():
            return None
        suns = np.array([[0.0, 0, 1]])  # for the sides of a sheet
    check_free(
        BYTES * n * len(suns),
        f"sunlight on {n} facets at {len(suns)} times",
        "lower steps of [run], or give the model larger facets",
    )
    shadow_rays = max(SHADOW_RAYS, min(run.rays, ALL_SHADOW_RAYS // (n * len(suns))))
    return solar_areas(scene, suns, run.rays, shadow_rays, run.seed, absorptances)


def effective_areas(
    scene: Scene, table: FacetTable, signature: SignatureTable, seed: int
) -> tuple[FacetMatrix, float]:
    """Radiance of the model by facet from one render, and the area of a pixel [m^2].

    Raises InputError for a sensor without a window, for what `facet_matrix` refuses, and for an
    emitter whose temperatures cannot be replaced.
    """
    area = window_area(scene.sensor(signature.sensor), scene.name)
    number = emitting_facets(table, shapes := list(scene.mi.shapes()), scene.name)
    for facet in number[np.isnan(table.temperature[number])]:
        raise InputError(
            f"{scene.name}: shape '{shapes[table.shape_index[facet]].id()}' has no temperature for "
            "each facet, in whose place [signature] could put the balance's; give it a number"
        )
    options = {"sensor": signature.sensor, "spp": signature.spp, "seed": seed}
    traced = facet_matrix(scene, **options, model_only=True)
    return traced, area / np.prod(traced.size)


def intensity(heat: Heat, traced: FacetMatrix, pixel: float) -> Estimate:
    """The intensity of the model at all times; see `effective_areas`."""
    weights = pixel * np.array([np.asarray(m.sum(axis=0)).ravel() for m in traced.matrices])
    rest = pixel * traced.rest.sum(axis=1)

    whole = heat.of_scene(heat.kelvin, heat.scene_kelvin)[:, traced.facets]
    radiance, slope = radiance_and_slope(traced.band, whole)
    values = (radiance @ weights.T + rest).T
    mean = slope * weights.mean(axis=0)

    def through(change):
        return np.sum(mean * heat.of_scene(change)[:, traced.facets], axis=1)

    first, *inputs = (row.through(through) for row in heat.estimate.contributions)
    rows = Contribution("noise of the rendering", standard_error(values)), *inputs, first
    return Estimate.of(values.mean(axis=0), "W/sr", rows)
