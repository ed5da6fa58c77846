"""The path of a flight: where target and observer are by time, and how the target is turned."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.declared import Bounds, Described, entry
from mi_lcair.errors import InputError, unknown
from mi_lcair.table import read_table

POSITION, ATTITUDE = ("x_m", "y_m", "z_m"), ("yaw_deg", "pitch_deg", "roll_deg")
OBSERVER = tuple(f"observer_{name}" for name in POSITION)
NEEDED = ("time_s", *POSITION, *ATTITUDE)
HISTORIES = Bounds(lower=60, upper=1e5, unit="K")  # a smaller number is probably in Celsius
HISTORY = "temperature."  # beginning of the columns that are temperatures of groups
MOST_MOMENTS = 1_000_000


@dataclass(frozen=True)
class FlightTable(Described, where="[flight]"):
    """Table [flight] of a scenario.

    Attributes
    ----------
    path : str
        CSV with the columns time_s, x_m, y_m, z_m (middle of the target in the scene's axes, z up),
        yaw_deg, pitch_deg, roll_deg (the scene's parameters of these names) and, optionally,
        observer_x_m, observer_y_m, observer_z_m and temperature.GROUP, K.
    observer_m : tuple of float
        Position of an observer that does not move, m.
    ground_m : float
        z of the ground, m.
    rate_hz : float, optional
        Times per second, interpolated between the rows of the file. By default the times are those
        of the rows.
    tolerance : float
        Allowed difference between an interpolated and a traced contrast, as a fraction of it, in
        addition to the error of the rendering.
    pixels : float
        If a point of the target shifts by more than this number of pixels, a camera's frame is
        rendered again.
    spp : int
        Paths per pixel of a camera's frame.
    """

    path: str = entry(is_file=True)
    observer_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ground_m: float = 0.0
    rate_hz: float | None = entry(None, is_positive=True)
    tolerance: float = entry(0.01, is_positive=True, upper=1)
    pixels: float = entry(0.5, lower=0)
    spp: int = entry(16, lower=2, upper=2**31)

    def moments(self) -> "Moments":
        """The moments of the flight; raises InputError for a path that cannot be used."""
        table = read_table(self.path, NEEDED)
        histories = [name for name in table.columns if name.startswith(HISTORY)]
        moving = all(name in table.columns for name in OBSERVER)
        known = [*NEEDED, *(OBSERVER if moving else ()), *histories]
        for name in table.columns:
            if name not in known:
                raise unknown(
                    f"column of {table.file}", name, [*NEEDED, *OBSERVER, f"{HISTORY}GROUP"]
                )
        rows = table.numbers(known)
        time_s = rows["time_s"]
        if np.any(np.diff(time_s) <= 0):
            line = table.rows[int(np.argmax(np.diff(time_s) <= 0)) + 1][0]
            raise InputError(f"{table.file}, line {line}: time_s must rise from row to row")
        for name in histories:
            table.check_range(name, rows[name], HISTORIES, "; kelvin are Celsius + 273.15")
        for name in ATTITUDE:
            rows[name] = np.unwrap(rows[name], period=360)
        at = time_s
        if self.rate_hz is not None:
            count = (time_s[-1] - time_s[0]) * self.rate_hz
            if count > MOST_MOMENTS:
                raise InputError(
                    f"[flight]: rate_hz = {self.rate_hz:g} makes {count:.3g} moments; at most "
                    f"{MOST_MOMENTS}"
                )
            at = time_s[0] + np.arange(int(count + 1e-9) + 1) / self.rate_hz
        columns = {name: np.interp(at, time_s, values) for name, values in rows.items()}

        def vectors(names):
            return np.stack([columns[name] for name in names], axis=-1)

        moments = Moments(
            at,
            vectors(POSITION),
            vectors(ATTITUDE),
            vectors(OBSERVER) if moving else np.broadcast_to(self.observer_m, (len(at), 3)),
            self.ground_m,
            {name.removeprefix(HISTORY): columns[name] for name in histories},
        )
        moments.check_above(0.0)
        return moments


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of a flight.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    position_m, observer_m : ndarray, shape (n, 3)
        Middle of the target, and observer, in the scene's axes.
    attitude_deg : ndarray, shape (n, 3)
        Yaw, pitch and roll.
    ground_m : float
        z of the ground.
    temperatures : dict of str to ndarray, shape (n,)
        Temperatures, K, by group.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    attitude_deg: np.ndarray
    observer_m: np.ndarray
    ground_m: float
    temperatures: dict[str, np.ndarray]

    @property
    def to_observer_m(self) -> np.ndarray:
        """Vectors from the target to the observer, (n, 3)."""
        return self.observer_m - self.position_m

    @property
    def range_m(self) -> np.ndarray:
        """Distances of target and observer, (n,)."""
        return np.linalg.norm(self.to_observer_m, axis=1)

    @property
    def turned_deg(self) -> np.ndarray:
        """Angle by which direction and attitude have turned since the beginning, degrees, (n,)."""
        direction = self.to_observer_m / self.range_m[:, None]
        chord = np.linalg.norm(np.diff(direction, axis=0), axis=1)
        steps = np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1)))
        steps += np.abs(np.diff(self.attitude_deg, axis=0)).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def check_above(self, below_m: float, attitude_deg: np.ndarray | None = None) -> None:
        """Raise InputError if the target or the observer is in the ground.

        below_m: how far the target reaches below its middle, at an attitude, or at any.
        """
        is_there = np.ones(len(self.time_s), dtype=bool)
        if attitude_deg is not None:
            is_there = np.all(self.attitude_deg == attitude_deg, axis=1)
        for what, heights in (
            ("the target", self.position_m[:, 2] - below_m - self.ground_m),
            ("the observer", self.observer_m[:, 2] - self.ground_m),
        ):
            k = int(np.argmin(np.where(is_there, heights, np.inf)))
            if heights[k] < 0:
                raise InputError(
                    f"[flight]: {what} is {-heights[k]:.4g} m below the ground at "
                    f"{self.time_s[k]:g} s; raise its z, or lower ground_m"
                )
