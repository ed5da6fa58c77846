"""Temperatures of a loaded scene for a heat.toml."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mi_lcair.derivatives.images import FacetMatrix, facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.heating.conductors import standard_error
from mi_lcair.heating.exchange import exchange
from mi_lcair.heating.surfaces import SolarAreas, emitting_facets, solar_areas
from mi_lcair.heating.temperatures.balance import CELLS, CLOSED, DAY, SOLVED
from mi_lcair.heating.temperatures.description import HeatDescription, RunTable, SignatureTable
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

PERIODIC = 2e-3  # largest distance of a temperature from its periodic value [K]
MOST_DAYS = 60
DAILY = 1e-9  # residual of the balance of a step, as a fraction of the power
ROUGH = 1e-5  # residual of the changes by the columns, as a fraction of the power
BDF2, EULER = 1.5, 1.0  # coefficients of the new temperatures in a step
PARTS = 16  # implicit Euler steps in place of a first step of BDF2


def course(
    network: Network, columns: Sequence[Column] = (), start_K: float | None = None
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

    Raises
    ------
    InputError
        If the days do not become periodic, or a balance does not converge.
    """
    result = Course(network, columns, start_K)
    if len(result.kelvin) == 1:
        result.step(0, EULER, result.seconds)
    elif start_K is not None:
        result.series()
    else:
        while not result.days or result.drift >= PERIODIC:
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

    def __init__(self, network: Network, columns: Sequence[Column], start_K: float | None):
        self.network, self.columns = network, columns
        times = network.weather.seconds
        m, n = len(times), len(network.facets.area)
        self.seconds = float(times[1] - times[0]) if m > 1 else np.inf
        self.power, self.conductance = network.loads()
        self.changes = np.zeros((len(columns) + len(network.traced.replicates), m, n))
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
        g, r = self.of_walls(1 / self.rates, self.back)
        kelvin = np.full(n, network.weather.air_K[0] if start_K is None else start_K)
        if start_K is None:
            into = network.facets.area * g
            power, conductance = (load.mean(axis=0) for load in (self.power, self.conductance))
            kelvin, _ = network.balance.solve(power + into * r, conductance + into, kelvin)
        self.states = np.zeros((2, 1 + len(self.changes), CELLS + 1, n))
        self.states[:, 0] = (self.back + self.surface * g * (kelvin - r)) / self.rates
        self.kelvin = np.tile(kelvin, (m, 1))

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
        before = self.states[1]
        for _ in range(PARTS):
            self.step(0, EULER, self.seconds / PARTS)
        self.states[0] = before
        for k in range(1, len(self.kelvin)):
            self.step(k, BDF2, self.seconds)
        self.days = 1

    def repeat(self) -> None:
        """Take the steps of a day, go on to its periodic state, and say how far away that was.

        Each mode decays, so that no later temperature of a surface differs by more than the drift.
        """
        begin = self.states[1]
        for k in range(len(self.kelvin)):
            self.step(k, BDF2, self.seconds)
        change = self.states[1] - begin
        left = self.left(change)
        self.states = self.states + left
        self.drift = float(np.sum(abs(self.surface * (change + left)), axis=-2).max())
        self.days += 1

    def left(self, change: np.ndarray) -> np.ndarray:
        """How far amplitudes still are from periodic ones, from their change over a day.

        A wall below a surface that loses heat in proportion to its temperature changes by
        V = F V from day to day, so that (1 - F)^-1 F of a change is left to do.
        """
        network, result = self.network, np.zeros_like(change)
        slope = 4 * STEFAN_BOLTZMANN * self.kelvin.mean(axis=0) ** 3 * network.balance.diagonal
        loss = (self.conductance.mean(axis=0) + slope) / network.facets.area
        for _, wall, members in network.with_walls:
            rates, shapes = wall.modes
            matrix = np.diag(rates) + loss[members].mean() * np.outer(shapes[0], shapes[0])
            rates, modes = np.linalg.eigh(matrix)
            rest = modes * (np.exp(-rates * DAY) / -np.expm1(-rates * DAY)) @ modes.T
            result[..., members] = rest @ change[..., members]
        return result

    def step(self, k: int, scheme: float, seconds: float) -> None:
        """Take the step to a time, of the temperatures and then of their changes."""
        network, balance, area = self.network, self.network.balance, self.network.facets.area
        closed, solved = (DAILY, ROUGH) if np.isfinite(seconds) else (CLOSED, SOLVED)
        earlier, last = self.states
        history = last if scheme == EULER else 2 * last - 0.5 * earlier
        source, lag = history / seconds, 1 / (scheme / seconds + self.rates)
        source[0] += self.back
        g, r = self.of_walls(lag, source[0])

        power, conductance = self.power[k] + area * g * r, self.conductance[k] + area * g
        kelvin, residual = balance.solve(power, conductance, self.kelvin[k], closed)
        self.residual, self.kelvin[k] = max(self.residual, residual), kelvin
        source[0] += self.surface * g * (kelvin - r)

        amplitudes = lag * source[0]
        for c, members, b, K, M in self.varied:
            V = amplitudes[:, members]
            slope = (scheme * V - history[0][:, members]) / seconds
            source[1 + c][:, members] += b - K @ V - M @ slope
        _, r = self.of_walls(lag, source[1:])
        power = network.rates(self.columns, kelvin, k) + area * g * r
        self.changes[:, k] = balance.linear(kelvin, conductance, power.T, solved).T
        source[1:] += self.surface * (g * (self.changes[:, k] - r))[:, None]
        self.states = np.stack([last, lag * source])


# Rays toward the sun: least number from each side of a facet at each time, and number of all rays
# up to which there are as many as paths
SHADOW_RAYS, ALL_SHADOW_RAYS = 32, 2**24
BYTES = 1100  # memory for a facet and a position of the sun, measured with 4,000 and 8,000 facets
DOUBTFUL = 0.01  # share of an effect that may rest on an assumption without a remark


def temperatures(scene: Scene, description: HeatDescription) -> Heat:
    """The temperatures of a scene's facets; see `mi_lcair.heat`."""
    run, sigmas = description.run, description.sigma
    conditions = weather(
        description.weather, description.folder, run.steps, is_periodic=run.start_K is None
    )
    table, signature = FacetTable(scene), description.signature
    traced = None if signature is None else effective_areas(scene, table, signature, run.seed)
    radiation = exchange(scene, run.rays, run.seed)
    sun = sunlight(scene, len(radiation.facets.number), conditions, run)
    network = Network(radiation.facets, radiation.traced, sun, conditions, description.groups)
    columns = [network.column(name, sigma) for name, sigma in sigmas.items()]
    solved = course(network, columns, run.start_K)
    rows = [Contribution("exchange", standard_error(solved.scatter))]
    rows += [
        Contribution(name, change, sigma=sigma)
        for (name, sigma), change in zip(sigmas.items(), solved.changes)
    ]
    of_sigma = [
        f"[sigma] {row.quantity} changes no temperature"
        for row in rows[1:]
        if not row.contribution.any()
    ]
    of_sigma += remarks_on_emissivities(network, sigmas, solved.kelvin[0], traced is not None)
    of_sun = () if sun is None else sun.remarks
    result = Heat(
        name=scene.name,
        facets=radiation.facets,
        seconds=conditions.seconds,
        estimate=Estimate.of(solved.kelvin, "K", rows),
        residual_W=solved.residual,
        days=solved.days,
        drift_K=solved.drift,
        intensity=None,
        band="" if traced is None else traced[0].band.label,
        polygons=FacetPolygons.of(table.triangles, table.triangle_facet),
        scene_kelvin=table.temperature,
        remarks=tuple(dict.fromkeys((*radiation.remarks, *of_sun, *conditions.remarks, *of_sigma))),
    )
    return result if traced is None else replace(result, intensity=intensity(result, *traced))


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
            share = f"{onward / whole:.0%} of its effect assumes that surfaces reflect evenly"
            remarks.append(f"[sigma] {name}: {share}")
        if has_intensity:
            delta = network.relative(group, sigma, facets.emissivity)
            share = facets.emitting_area @ delta / facets.emitting_area.sum()
            remarks.append(
                f"[sigma] {name}: changes the intensity by temperatures only; the surfaces also "
                f"emit {share:.1%} more at the same temperatures, which a budget takes in"
            )
    return remarks


def sunlight(scene: Scene, n: int, conditions: WeatherSeries, run: RunTable) -> SolarAreas | None:
    """The sunlight that n facets absorb while the sun shines; None in the dark."""
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
    return solar_areas(scene, suns, run.rays, shadow_rays, run.seed)


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
