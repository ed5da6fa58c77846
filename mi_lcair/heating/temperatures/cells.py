"""Conduction through walls of layers, and through ground whose properties depend on temperature
and depth, in cells over the depth.

Cell i stores rho c(T) dz dT/dt, and heat flows between the middles of neighbouring cells. Each step
solves for the temperatures U below a surface of temperature T_s by Newton's iteration. Its Jacobian
has three diagonals, which complex steps of every third cell give exactly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from mi_lcair.errors import InputError

STEP = 1e-30  # of complex steps
FINEST, GROWTH = 1 / 40, 0.07  # first cell over the penetration depth, and growth with depth
MOST_STEPS, CLOSED = 40, 1e-11  # Newton steps, and the change at which they end, relative
ROUNDING = 1e-7  # largest change by rounding, relative
LEAST_CELLS = 10  # of a layer
WARM_K = 350.0  # temperature at which radiation between grains adds `radiative` times k


@dataclass(frozen=True)
class CellWall:
    """A wall of cells; the numbers may be complex.

    dz, conductivity, density, heat_capacity, contact: of each cell, (N,); contact is the resistance
    above it [m^2 K/W]. radiative: k is larger by the factor 1 + radiative (T / 350 K)^3. table:
    temperatures and heat capacities at them, in place of heat_capacity. back, back_temperature: as
    those of `HeatWall`. flux: heat that comes in through the back [W m^-2].
    """

    dz: np.ndarray
    conductivity: np.ndarray
    density: np.ndarray
    heat_capacity: np.ndarray
    contact: np.ndarray
    radiative: complex = 0.0
    table: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    back: complex = 0.0
    back_temperature: complex = 0.0
    flux: complex = 0.0

    def warmed(self, kelvin):
        """Factor of the conductivity at some temperatures."""
        return 1 + self.radiative * (kelvin / WARM_K) ** 3

    def capacity(self, kelvin):
        """Heat capacity at some temperatures [J kg^-1 K^-1]; on straight lines, kept beyond."""
        if self.table is None:
            return self.heat_capacity
        at, c = map(np.array, self.table)
        k = np.clip(np.searchsorted(at, np.real(kelvin)) - 1, 0, len(at) - 2)
        part = (kelvin - at[k]) / (at[k + 1] - at[k])
        part = np.where(np.real(part) < 0, 0, np.where(np.real(part) > 1, 1, part))
        return c[k] + part * (c[k + 1] - c[k])

    def flows(self, U, surface):
        """Heat down through the top of each cell and through the back, (f, N + 1) [W m^-2]."""
        half = self.dz / 2 / (self.conductivity * self.warmed(U))
        top = self.dz[0] / 2 / (self.conductivity[0] * self.warmed((U[:, 0] + surface) / 2))
        first = (surface - U[:, 0]) / (top + self.contact[0])
        inner = (U[:, :-1] - U[:, 1:]) / (half[:, :-1] + half[:, 1:] + self.contact[1:])
        last = -self.flux + 0 * first
        if self.back:
            resistance = 0.0 if np.isinf(self.back) else 1 / self.back
            last = last + (U[:, -1] - self.back_temperature) / (half[:, -1] + resistance)
        return np.column_stack([first, inner, last])

    def residual(self, U, surface, history, scheme: float, seconds: float):
        """Heat that cells store in a step less what they gain, (f, N) [W m^-2]."""
        stored = self.density * self.capacity(U) * self.dz * (scheme * U - history) / seconds
        return stored + np.diff(self.flows(U, surface), axis=1)


def layout(thicknesses: Sequence[complex], penetrations: Sequence[float]) -> list[np.ndarray]:
    """Thicknesses of the cells of each layer, which grow with depth."""
    result, depth = [], 0.0
    for thickness, penetration in zip(thicknesses, penetrations):
        sizes = []
        while sum(sizes) < np.real(thickness):
            sizes.append(FINEST * penetration + GROWTH * (depth + sum(sizes)))
        while len(sizes) < LEAST_CELLS:
            sizes = [size / 2 for size in sizes for _ in range(2)]
        result.append(np.array(sizes) / sum(sizes) * thickness)
        depth += float(np.real(thickness))
    return result


def middles(dz):
    """Depths of the middles of cells with these thicknesses, (N,)."""
    return np.cumsum(dz) - dz / 2


class Cells:
    """The cells of the facets of one group over the steps of a day.

    members: (f,), indices of the facets. U: (f, N), temperatures [K]. states: temperatures and
    their changes (columns, f, N) at the last two times.
    """

    def __init__(self, wall: CellWall, members: np.ndarray, varied: dict[int, CellWall]):
        self.wall, self.members, self.varied = wall, members, varied
        self.states, self.step = [], (1.0, np.inf)

    def begin(self, kelvin: np.ndarray, columns: int) -> None:
        """Set temperatures (f,) at all depths, and no changes."""
        U = np.repeat(kelvin[:, None], len(self.wall.dz), axis=1)
        changes = np.zeros((columns, *U.shape))
        self.U, self.states = U, [(U, changes), (U, changes)]

    def go_on_from(self, other: "Cells") -> None:
        """Begin with the last state of other cells, at the same share of the depth."""
        depths = [middles(cells.wall.dz) for cells in (self, other)]
        share, of_other = (np.real(depth) / np.real(depth[-1]) for depth in depths)
        to_new = np.array([np.interp(share, of_other, one) for one in np.eye(len(of_other))])
        self.states = [tuple(values @ to_new for values in state) for state in other.states]
        self.U = other.U @ to_new

    def start_step(self, scheme: float, seconds: float) -> None:
        """Begin a step of BDF2 or, with the scheme 1, of Euler."""
        (first, changes), (last, of_last) = self.states
        weights = (0.0, 1.0) if scheme == 1 else (-0.5, 2.0)
        self.history = weights[0] * first + weights[1] * last
        self.of_history = weights[0] * changes + weights[1] * of_last
        self.step = scheme, seconds

    def residual(self, U, surface, wall: CellWall | None = None):
        return (wall or self.wall).residual(U, surface, self.history, *self.step)

    def inverse(self, U, surface) -> Callable[[np.ndarray], np.ndarray]:
        """Function that applies the inverse of the Jacobian to (c, f, N)."""
        f, N = U.shape
        bands = np.zeros((3, f, N))
        for colour in range(3):
            at = np.arange(colour, N, 3)
            changed = U.astype(complex)
            changed[:, at] += 1j * STEP
            slope = self.residual(changed, surface).imag / STEP
            bands[1][:, at] = slope[:, at]
            bands[0][:, at[at > 0]] = slope[:, at[at > 0] - 1]
            bands[2][:, at[at < N - 1]] = slope[:, at[at < N - 1] + 1]

        def apply(values):
            rows = values.reshape(-1, f * N).T
            return solve_banded((1, 1), bands.reshape(3, -1), rows).T.reshape(-1, f, N)

        return apply

    def solve(self, surface: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Flux into the wall below a surface and its derivative, (f,) [W m^-2, W m^-2 K^-1]."""
        before = np.inf
        for _ in range(MOST_STEPS):
            apply = self.inverse(self.U, surface)
            change = apply(self.residual(self.U, surface)[None])[0]
            self.U = np.maximum(self.U - change, self.U / 2)
            largest = float(np.max(abs(change) / self.U, initial=0))
            # Steps that no longer fall are the rounding of thin layers that conduct well
            if largest < CLOSED or before / 2 < largest < ROUNDING:
                break
            before = largest
        else:
            raise InputError("conduction in a wall does not converge; raise steps of [run]")
        self.apply = self.inverse(self.U, surface)
        warmer = self.residual(self.U, surface + 1j * STEP).imag / STEP
        self.of_surface = -self.apply(warmer[None])[0]
        flux = self.wall.flows(self.U, surface)[:, 0]
        self.slope = self.flux_change(surface, self.of_surface, 1.0)
        return flux, self.slope

    def flux_change(self, surface, change_U, change_surface, wall: CellWall | None = None):
        """Change of the flux for small changes (..., f, N) and (..., f)."""
        U = self.U + 1j * STEP * change_U
        warmer = surface + 1j * STEP * change_surface
        flow = (wall or self.wall).flows(
            U.reshape(-1, U.shape[-1]), np.ravel(warmer + 0 * U[..., 0])
        )
        return flow[:, 0].imag.reshape(U.shape[:-1]) / STEP

    def known(self, surface: np.ndarray) -> np.ndarray:
        """Changes of the flux by the columns, (columns, f), if the surface did not change."""
        scheme, seconds = self.step
        wall, U = self.wall, self.U
        stored = wall.density * wall.capacity(U) * wall.dz / seconds
        source = stored * self.of_history
        for c, changed in self.varied.items():
            source[c] -= self.residual(U, surface, changed).imag / STEP
        self.changes = self.apply(source)
        result = self.flux_change(surface, self.changes, 0.0)
        for c, changed in self.varied.items():
            result[c] += changed.flows(U, surface)[:, 0].imag / STEP
        return result

    def end_step(self, changes: np.ndarray) -> None:
        """End the step with the surface's changes by the columns, (columns, f)."""
        state = self.U, self.changes + changes[..., None] * self.of_surface
        self.states = [self.states[1], state]

    def periodic(self, begin, loss: np.ndarray, seconds: float) -> float:
        """Go on to the periodic state, and return how far away it was [K].

        begin: the state a day of some seconds ago. loss: of the surface, (f,) [W m^-2 K^-1]. As in
        `Course.left`, (1 - F)^-1 F of the change over a day is left to do.
        """
        wall, U = self.wall, self.U.mean(axis=0, keepdims=True)
        mass = np.broadcast_to(np.real(wall.density * wall.capacity(U)), U.shape)[0] * wall.dz
        N = len(mass)
        history, step = self.history, self.step
        self.history, self.step = U, (0.0, np.inf)
        K = np.zeros((N, N))
        for j in range(N):
            changed = U + 1j * STEP * (np.arange(N) == j)
            K[:, j] = self.residual(changed, U[:, 0]).imag[0] / STEP
        self.history, self.step = history, step
        g = self.wall.flows(U, U[:, 0] + 1j * STEP)[0, 0].imag / STEP
        K[0, 0] += g * loss.mean() / (g + loss.mean()) - g
        root = np.sqrt(mass)
        rates, modes = np.linalg.eigh((K + K.T) / 2 / np.outer(root, root))
        days = np.maximum(rates, 1e-30) * seconds
        rest = modes * (np.exp(-days) / -np.expm1(-days)) @ modes.T
        left = []
        for before, now in zip(begin, self.states[1]):
            left.append((now - before) * root @ rest / root)
        self.states = [tuple(x + y for x, y in zip(state, left)) for state in self.states]
        self.U = self.states[1][0]
        return float(abs(self.U - begin[0])[:, 0].max(initial=0))
