"""Temperatures of a scene's facets from their heat balance, as a result."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.heating.conductors import Facets
from mi_lcair.heating.temperatures.description import Sigma
from mi_lcair.rendering.facets.polygons import FacetPolygons
from mi_lcair.results import Result

if TYPE_CHECKING:
    import xarray

HOUR = 3600.0


@dataclass(frozen=True)
class Intensity:
    """In-band intensity of a scene toward a sensor over the day.

    band: its label. values, error: (m,) [W/sr]; the error is that of the paths. changes:
    {input: (m,)} for one standard uncertainty of each input [W/sr].
    """

    band: str
    values: np.ndarray
    error: np.ndarray
    changes: dict[str, np.ndarray]

    @property
    def sigma(self) -> np.ndarray:
        """Combined standard uncertainty, (m,) [W/sr]."""
        return combined(self.error, self.changes.values())


@dataclass(frozen=True, repr=False, eq=False)
class Heat(Result):
    """Temperatures of facets at some times, with their uncertainty by input.

    Attributes
    ----------
    name : str
        Name of the scene.
    facets : Facets
        The n facets that exchange heat.
    seconds : ndarray, shape (m,)
        Times [s] since the beginning of the first day; one for a steady state.
    kelvin : ndarray, shape (m, n)
        Temperatures [K].
    sigmas : dict of str to Sigma
        Standard uncertainties of the inputs.
    changes : dict of str to ndarray
        Change of the temperatures for one standard uncertainty of each input, (m, n) [K].
    noise : ndarray, shape (m, n)
        Standard error from the random numbers of the exchange [K].
    residual_W : float
        Largest power that the balance of a facet leaves over.
    days : int
        Days until the temperatures were periodic; 0 for a steady state.
    drift_K : float
        Largest change of a temperature in the last day.
    intensity : Intensity or None
    polygons : FacetPolygons
        Outlines of all facets of the scene, with those that do not exchange heat.
    scene_kelvin : ndarray, shape (count,)
        Temperatures of all facets in the scene [K]; NaN for none.
    remarks : tuple of str
    """

    name: str
    facets: Facets
    seconds: np.ndarray
    kelvin: np.ndarray
    sigmas: dict[str, Sigma]
    changes: dict[str, np.ndarray]
    noise: np.ndarray
    residual_W: float
    days: int
    drift_K: float
    intensity: Intensity | None
    polygons: FacetPolygons
    scene_kelvin: np.ndarray
    remarks: tuple[str, ...] = ()

    kind = "heat"
    saved_by = {
        ".csv": "mi_lcair.heating.temperatures.files:write_csv",
        ".vtu": "mi_lcair.heating.temperatures.files:write_vtk",
        ".vtp": "mi_lcair.heating.temperatures.files:write_vtk",
        ".series": "mi_lcair.heating.temperatures.files:write_series",
    }

    @property
    def error_K(self) -> np.ndarray:
        """Combined standard uncertainty of each temperature, (m, n) [K]."""
        return combined(self.noise, self.changes.values())

    @property
    def group_error_K(self) -> np.ndarray:
        """Combined standard uncertainty of the mean temperature of each group, (m, groups) [K].

        The errors of the paths count as if they were common to a group's facets.
        """
        return combined(self.of_groups(self.noise), map(self.of_groups, self.changes.values()))

    @property
    def is_steady(self) -> bool:
        return len(self.seconds) == 1

    @property
    def hours(self) -> np.ndarray:
        """The times in hours, (m,)."""
        return self.seconds / HOUR

    def row(self, hour: float | None = None) -> int:
        """Index of the time that is nearest to an hour; without one, that of the warmest facet.

        Raises InputError for an hour before or after all times.
        """
        if hour is None:
            return int(np.argmax(self.kelvin.max(axis=1)))
        if not self.is_steady:
            first, second, last = self.hours[[0, 1, -1]]
            bounds = Bounds(lower=round(2 * first - second, 9), upper=last)
            bounds.check(hour, "hour", rounding=1e-9)
        return int(np.argmin(abs(self.hours - hour)))

    def of_groups(self, values: np.ndarray) -> np.ndarray:
        """Means of values of the facets by group, weighted with areas, (..., groups)."""
        weights = self.facets.membership * self.facets.area
        return values @ (weights.T / weights.sum(axis=1))

    def of_scene(self, values: np.ndarray, others: np.ndarray | float = 0.0) -> np.ndarray:
        """Values (..., n) among those of all facets of the scene, (..., count)."""
        whole = np.zeros((*values.shape[:-1], len(self.scene_kelvin))) + others
        whole[..., self.facets.number] = values
        return whole

    def summary(self) -> str:
        """One line with the range of the temperatures."""
        low, high = self.kelvin.min(), self.kelvin.max()
        when = "steady state" if self.is_steady else f"{len(self.seconds)} times"
        return (
            f"temperatures of {self.name}, {when}: {low:.2f} to {high:.2f} K, "
            f"+- {np.median(self.error_K):.2g} K (median)"
        )

    def entries(self) -> dict:
        """Entries for JSON: by group and time, and the largest effect of each input."""
        of_groups = self.of_groups(self.kelvin).T, self.group_error_K.T
        entries = {
            "scene": self.name,
            "facets": len(self.facets.number),
            "hours": self.hours,
            "residual_W": self.residual_W,
            "days": self.days,
            "drift_K": self.drift_K,
            "groups": {
                group: {"mean_K": mean, "error_K": error}
                for group, mean, error in zip(self.facets.groups, *of_groups)
            },
            "inputs": {
                name: {
                    "sigma": sigma.value,
                    "is_relative": sigma.is_relative,
                    "largest_K": abs(self.changes[name]).max(),
                }
                for name, sigma in self.sigmas.items()
            },
            "remarks": self.remarks,
        }
        if self.intensity:
            entries["intensity_W_sr"] = self.intensity.values
            entries["intensity_sigma_W_sr"] = self.intensity.sigma
        return entries

    def columns(self, hour: float | None = None) -> dict[str, np.ndarray]:
        """A row for each facet that exchanges heat, at a time; see `row`."""
        k = self.row(hour)
        return {
            "facet": self.facets.number,
            "group": np.array(self.facets.groups)[self.facets.group],
            "temperature_K": self.kelvin[k],
            "error_K": self.error_K[k],
        } | {
            f"{key.replace('.', '_')}_changes_K": change[k] for key, change in self.changes.items()
        }

    def to_xarray(self) -> "xarray.Dataset":
        """An xarray Dataset over time and facet; `dT` has the changes by input [K].

        Raises InputError if xarray is not installed.
        """
        over = ("time", "facet")
        variables = {
            "temperature_K": (over, self.kelvin),
            "error_K": (over, self.error_K),
            "area_m2": ("facet", self.facets.area),
            "group": ("facet", np.array(self.facets.groups)[self.facets.group]),
        }
        coordinates = {"time_s": ("time", self.seconds), "facet": ("facet", self.facets.number)}
        if self.changes:
            variables["change_K"] = (("input", *over), np.array([*self.changes.values()]))
            coordinates["input"] = ("input", [*self.changes])
        if self.intensity:
            variables["intensity_W_sr"] = ("time", self.intensity.values)
            variables["intensity_sigma_W_sr"] = ("time", self.intensity.sigma)
        return self.dataset(variables, coordinates)


def combined(error: np.ndarray, changes: Iterable[np.ndarray]) -> np.ndarray:
    """Root of the sum of the squares of an error and of changes by independent inputs."""
    return np.sqrt(sum((change**2 for change in changes), start=error**2))
