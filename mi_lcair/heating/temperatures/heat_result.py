"""Temperatures of a scene's facets from their heat balance, as a result and its files."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair import formats
from mi_lcair.declared import Bounds, percent
from mi_lcair.estimate import Contribution, Estimate, with_error
from mi_lcair.files import FACET_FILES, replacing
from mi_lcair.heating.conductors import Facets
from mi_lcair.rendering.facets import FacetPolygons
from mi_lcair.rendering.parameters.modes import AFTER, BEFORE
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import LongTable, Table

if TYPE_CHECKING:
    import xarray

HOUR = 3600.0
TIMES = 8  # rows of the table of intensities


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
        of each input, with its `sigma` as it was given, such as 2 or "30 %".
    residual_W : float
        Largest remaining imbalance of power of a facet.
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

    name: str = entry("scene")
    facets: Facets = entry()
    seconds: np.ndarray = entry()
    estimate: Estimate = entry()
    residual_W: float
    days: int
    drift_K: float
    intensity: Estimate | None
    band: str
    polygons: FacetPolygons = entry()
    scene_kelvin: np.ndarray = entry()
    remarks: tuple[str, ...] = ()

    kind = "heat"
    drawn_by = "mi_lcair.show.pictures.temperatures:of_heat"
    heading = "Temperatures"
    computed = {"hours": "hours", "groups": "by_group", "inputs": "by_input"}
    saved_by = {
        ".csv": "mi_lcair.heating.temperatures.heat_result:write_csv",
        **dict.fromkeys(FACET_FILES, "mi_lcair.heating.temperatures.heat_result:write_vtk"),
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

    def by_group(self) -> dict[str, Estimate]:
        """Mean temperature of each group over time, (m,) [K], without the contributions."""
        means = self.means
        columns = zip(self.facets.groups, means.value.T, means.standard_error.T)
        return {group: Estimate(mean, error, "K") for group, mean, error in columns}

    def by_input(self) -> dict[str, dict]:
        """Standard uncertainty of each input as it was stated, and its largest effect [K]."""
        return {
            row.quantity: {"sigma": row.sigma, "largest_K": abs(row.contribution).max()}
            for row in self.inputs
        }

    def facts(self) -> Iterator[Any]:
        """The balance, the groups, what the inputs contribute, the intensity and the facets."""
        yield summary_of(self)
        yield "facets", str(len(self.facets.number))
        if self.days:
            yield "periodic", f"after {self.days} days, to {self.drift_K:.2g} K"
        yield "residual", f"{self.residual_W:.2g} W at most in the balance of a facet"
        yield self._table_of_groups()
        if self.inputs:
            yield self._table_of_inputs()
        if self.intensity:
            yield self._table_of_intensities()
        yield LongTable(self.columns(), sort_by="temperature_K")

    def _table_of_groups(self) -> Table:
        """Mean temperature of each group, its error, and when it is reached."""
        areas, rows = self.facets.membership @ self.facets.area, []
        for (group, mean), area in zip(self.by_group().items(), areas):
            ends = [mean.value.argmin(), mean.value.argmax()][self.is_steady :]
            cells = [with_error(mean.value[k], mean.standard_error[k]) for k in ends]
            if not self.is_steady:
                cells = [f"{cell}, {clock(self.hours[k])}" for cell, k in zip(cells, ends)]
            rows.append((group, f"{area:.4g}", *cells))
        ends = ["temperature K"] if self.is_steady else ["lowest K, hour", "highest K, hour"]
        return Table(["group", "area m2", *ends], rows)

    def _table_of_inputs(self) -> Table:
        """What the inputs contribute to the temperatures, at the time of the warmest facet."""
        k, area = self.row(), self.facets.area / self.facets.area.sum()
        first, *inputs = self.estimate.contributions
        total = area @ self.error_K[k] ** 2 or 1.0  # 0 if all is held
        rows = []
        for row in (*inputs, first):
            change, sigma = row.contribution[k], row.sigma
            stated = sigma if isinstance(sigma, str) else f"{sigma or 0:g}"
            mean = f"{area @ change:+.3g}"
            cells = (stated, mean) if row is not first else ("paths", "")
            share = percent(area @ change**2 / total)
            rows.append((row.quantity, *cells, f"{abs(change).max():.3g}", share))
        return Table(["input", "sigma", "mean dT K", "largest K", "share"], rows)

    def _table_of_intensities(self) -> Table:
        """The intensity at some times, with its standard uncertainty."""
        rows = []
        for k in np.unique(np.linspace(0, len(self.seconds) - 1, TIMES).round().astype(int)):
            value, sigma = self.intensity.value[k], self.intensity.standard_error[k]
            relative = percent(sigma / value)
            rows.append((clock(self.hours[k]), f"{value:.5g}", f"{sigma:.2g}", relative))
        return Table(["hour", f"{self.band} W/sr", "sigma", "relative"], rows)

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


def clock(hours: float) -> str:
    """Hours of a day as 07:30."""
    minutes = round(hours * 60)
    return f"{minutes // 60:02}:{minutes % 60:02}"


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
    formats.write_csv(path, columns | {name: heat.of_scene(rows) for name, rows in values.items()})


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
