"""Temperatures of a scene's facets from their heat balance, as a result and its files."""

import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.files import replacing
from mi_lcair.formats import csv
from mi_lcair.heating.conductors import Facets
from mi_lcair.rendering.facets.polygons import FacetPolygons
from mi_lcair.rendering.parameters.modes import AFTER, BEFORE
from mi_lcair.results import Result

if TYPE_CHECKING:
    import xarray

HOUR = 3600.0


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
    estimate : Estimate
        Temperatures [K] with their errors, (m, n). The first contribution is that of the random
        numbers of the exchange, "exchange". The others are the changes for one standard uncertainty
        of each input, with its `sigma` as it was stated, such as 2 or "30 %".
    residual_W : float
        Largest power that the balance of a facet leaves over.
    days : int
        Days until the temperatures were periodic; 0 for a steady state.
    drift_K : float
        Largest change of a temperature in the last day.
    intensity : Estimate or None
        In-band intensity toward a sensor over the day, (m,) [W/sr].
    band : str
        Label of the band of the intensity.
    polygons : FacetPolygons
        Outlines of all facets of the scene, with those that do not exchange heat.
    scene_kelvin : ndarray, shape (count,)
        Temperatures of all facets in the scene [K]; NaN for none.
    remarks : tuple of str
    """

    name: str
    facets: Facets
    seconds: np.ndarray
    estimate: Estimate
    residual_W: float
    days: int
    drift_K: float
    intensity: Estimate | None
    band: str
    polygons: FacetPolygons
    scene_kelvin: np.ndarray
    remarks: tuple[str, ...] = ()

    kind = "heat"
    saved_by = {
        ".csv": "mi_lcair.heating.temperatures.heat_result:write_csv",
        ".vtu": "mi_lcair.heating.temperatures.heat_result:write_vtk",
        ".vtp": "mi_lcair.heating.temperatures.heat_result:write_vtk",
        ".series": "mi_lcair.heating.temperatures.heat_result:write_series",
    }

    @property
    def kelvin(self) -> np.ndarray:
        """Temperatures, (m, n) [K]."""
        return self.estimate.value

    @property
    def error_K(self) -> np.ndarray:
        """Combined standard uncertainty of each temperature, (m, n) [K]."""
        return self.estimate.standard_error

    @property
    def inputs(self) -> tuple[Contribution, ...]:
        """What the inputs of [sigma] contribute."""
        return self.estimate.contributions[1:]

    @property
    def means(self) -> Estimate:
        """Mean temperature of each group, (m, groups) [K].

        The errors of the paths count as if they were common to a group's facets.
        """
        rows = [row.through(self.of_groups) for row in self.estimate.contributions]
        return Estimate.of(self.of_groups(self.kelvin), "K", rows)

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
        of_groups = self.means.value.T, self.means.standard_error.T
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
                row.quantity: {"sigma": row.sigma, "largest_K": abs(row.contribution).max()}
                for row in self.inputs
            },
            "remarks": self.remarks,
        }
        if self.intensity:
            entries["intensity_W_sr"] = self.intensity.value
            entries["intensity_sigma_W_sr"] = self.intensity.standard_error
        return entries

    def quantities(self) -> dict[str, np.ndarray]:
        """What the columns of all files have, at all times: temperatures, errors, modes, (m, n)."""
        changes = {f"{BEFORE}{row.quantity}{AFTER}": row.contribution for row in self.inputs}
        return {"temperature_K": self.kelvin, "error_K": self.error_K, **changes}

    def columns(self, hour: float | None = None) -> dict[str, np.ndarray]:
        """A row for each facet that exchanges heat, at a time; see `row`."""
        k, groups = self.row(hour), np.array(self.facets.groups)
        columns = {"facet": self.facets.number, "group": groups[self.facets.group]}
        return columns | {name: values[k] for name, values in self.quantities().items()}

    def to_xarray(self) -> "xarray.Dataset":
        """An xarray Dataset over time and facet; `by_NAME_K` has the changes by an input [K].

        Raises InputError if xarray is not installed.
        """
        over = ("time", "facet")
        variables = {name: (over, values) for name, values in self.quantities().items()}
        variables["area_m2"] = ("facet", self.facets.area)
        variables["group"] = ("facet", np.array(self.facets.groups)[self.facets.group])
        if self.intensity:
            variables["intensity_W_sr"] = ("time", self.intensity.value)
            variables["intensity_sigma_W_sr"] = ("time", self.intensity.standard_error)
        coordinates = {"time_s": ("time", self.seconds), "facet": ("facet", self.facets.number)}
        return self.dataset(variables, coordinates)


def write_csv(path: str | PathLike[str], heat: Heat, hour: float | None = None) -> None:
    """Write facet,kelvin,error_K of all facets of the scene, as `mi-lcair import` takes them.

    A column `by_NAME_K` for each uncertain input has the change for one standard uncertainty, see
    `mi_lcair.rendering.parameters.modes`. Facets that exchange no heat keep their temperature,
    with the error 0. Those without an area have the mean temperature of the others.

    Parameters
    ----------
    path : path-like
    heat : Heat
    hour : float or None
        The nearest time is written; without one that of the warmest facet.
    """
    values = heat.columns(hour)
    kelvin = heat.of_scene(values.pop("temperature_K"), heat.scene_kelvin)
    kelvin = np.where(np.isnan(kelvin), np.nanmean(kelvin), kelvin)
    columns = {"facet": np.arange(len(kelvin)), "kelvin": kelvin}
    del values["facet"], values["group"]
    csv.write(path, columns | {name: heat.of_scene(rows) for name, rows in values.items()})


def write_vtk(path: str | PathLike[str], heat: Heat, hour: float | None = None) -> None:
    """Write the facets with their temperatures at the time nearest to an hour, .vtp or .vtu."""
    heat.polygons.write(path, heat.columns(hour))


def write_series(path: str | PathLike[str], heat: Heat) -> None:
    """Write NAME.vtp.series, which ParaView opens, and a .vtp file for each time beside it."""
    path = Path(path)
    name = path.name.removesuffix(".series").removesuffix(".vtp")
    files = []
    for k, hour in enumerate(heat.hours):
        file = f"{name}_{k:04}.vtp"
        write_vtk(path.with_name(file), heat, float(hour))
        files.append({"name": file, "time": float(heat.seconds[k])})
    with replacing(path) as partial:
        text = json.dumps({"file-series-version": "1.0", "files": files}, indent=1)
        partial.write_text(f"{text}\n", encoding="utf-8")
