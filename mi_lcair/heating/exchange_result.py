"""The exchange of heat between facets, as a result."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from mi_lcair.charts import BarChart, BarCharts, facets_section
from mi_lcair.declared import percent
from mi_lcair.heating.conductors import RINGS_DEG, UNMET, Conductors, Facets, Traced, standard_error
from mi_lcair.heating.surfaces import SolarAreas
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.rendering.facets import WRITERS
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import Table

if TYPE_CHECKING:
    import xarray

PARTS = ("sky", "ground", "itself", "other groups")  # of what a group emits
ASYMMETRY, SIGNIFICANT = 0.01, 4.0  # relative difference of two directions and its z for a remark


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """How much two directions of the exchange between groups differ.

    relative: (groups, groups), difference of the two estimates of a conductor, divided by their
    mean. z: the difference in standard errors. Both are 0 where nothing is exchanged.
    """

    relative: np.ndarray
    z: np.ndarray

    @property
    def is_certain(self) -> np.ndarray:
        """Whether the first direction is larger, by more than chance, (groups, groups)."""
        return (self.relative > ASYMMETRY) & (self.z > SIGNIFICANT)


@dataclass(frozen=True, repr=False)
class Exchange(Result):
    """Radiative conductors between the facets of a scene, with their errors.

    Facet i gains from facet j the heat GR_ij sigma (T_j^4 - T_i^4). Standard errors follow from
    independent randomisations of the paths.

    Attributes
    ----------
    scene_name : str
    facets : Facets
    traced : Traced
        The conductors and their randomisations [m^2].
    temperature : ndarray, shape (n,)
        Temperatures of the facets in the scene [K]; NaN if they have none.
    sky_K, ground_K : float or None
        Temperatures of blackbodies in place of sky and ground, for the irradiance [K].
    astray : dict of str to ndarray
        Shares of each facet's radiation that reach nothing, (n,). "buried": radiation that begins
        inside a closed body, where facets of two bodies intersect. "truncated": radiation after the
        last reflection. "lost": radiation that ends on surfaces that do not take part.
    asymmetry : Asymmetry
    sun : SolarAreas or None
        Areas by which the facets absorb sunlight, of one beam.
    triangles, triangle_facet : ndarray, shapes (T, 3, 3) and (T,)
        Corners of the triangles [m], and the number of the facet of each.
    rays, seed : int
        Number of paths for each side of a facet, and the seed of their random numbers.
    seconds : float
    remarks : tuple of str
    """

    scene_name: str
    facets: Facets = entry()
    traced: Traced = entry()
    temperature: np.ndarray = entry()
    sky_K: float | None = entry()
    ground_K: float | None = entry()
    astray: dict[str, np.ndarray] = entry()
    asymmetry: Asymmetry = entry()
    sun: SolarAreas | None = entry()
    triangles: np.ndarray = entry()
    triangle_facet: np.ndarray = entry()
    rays: int
    seed: int
    seconds: float = entry("time_s")
    remarks: tuple[str, ...]

    kind = "exchange"
    heading = "Exchange of heat"
    computed = {"columns": "columns"}
    saved_by = WRITERS

    @property
    def conductors(self) -> Conductors:
        """The mean of the randomisations."""
        return self.traced.mean

    def by_group(self, function: Callable[[Conductors], np.ndarray]) -> tuple:
        """Areas of groups [m^2], linear in the conductors between groups, and standard errors.

        function: a row of areas for each group, (groups, k). None is more than the group emits. See
        `with_unmet` for areas that no path has met.
        """

        def of_groups(conductors: Conductors) -> np.ndarray:
            return function(conductors.by_group(self.facets))

        M = self.facets.membership
        path = (M * self.traced.path_area).max(axis=1).toarray()
        errors = self.traced.standard_error(of_groups)
        return of_groups(self.conductors), with_unmet(errors, path)

    def between_groups(self) -> tuple[np.ndarray, np.ndarray]:
        """Conductors between groups and their standard errors [m^2], (groups, groups).

        Which of two directions that differ is right is not known. Half of the difference is part of
        the error.
        """
        GR, error = self.by_group(lambda C: C.between.toarray())
        certain = self.asymmetry.is_certain
        half = np.where(certain | certain.T, np.abs(self.asymmetry.relative) / 2 * GR, 0)
        return GR, np.hypot(error, half)

    def error(self, function: Callable[[Conductors], np.ndarray]) -> np.ndarray:
        """Standard errors of areas of the facets, (n, ...) [m^2]; see `with_unmet`."""
        return with_unmet(self.traced.standard_error(function), self.traced.path_area)

    @cached_property
    def irradiance(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Irradiance of the facets [W m^-2] at the scene's temperatures, and its error, (n,).

        None if something that radiates has no temperature.
        """
        C, kelvin = self.conductors, self.temperature
        ends = (C.to_sky, self.sky_K), (C.to_ground, self.ground_K)
        if np.isnan(kelvin).any() or any(T is None and area.any() for area, T in ends):
            return None
        around = kelvin, self.sky_K or 0.0, self.ground_K or 0.0
        error = self.traced.standard_error(lambda C: C.irradiance(*around))
        least = STEFAN_BOLTZMANN * self.traced.least_error(*(T**4 for T in around))
        return C.irradiance(*around), np.maximum(error, least / np.maximum(C.total, 1e-300))

    def summary(self) -> str:
        """One line with the numbers of facets, groups and paths."""
        pairs = sparse.triu(self.conductors.between, 1).nnz
        return (
            f"exchange in {self.scene_name}: {len(self.facets.number)} facets of "
            f"{len(self.facets.groups)} groups, {pairs} conductors "
            f"from {self.rays} paths of each side of a facet"
        )

    def group_areas(self) -> dict[str, np.ndarray]:
        """Conductors between groups with their errors [m^2], and shares that reach nothing."""
        conductors, errors = self.between_groups()
        return {
            "groups": self.facets.groups,
            "conductors_m2": conductors,
            "conductors_error_m2": errors,
            "asymmetry": self.asymmetry.relative,
            "asymmetry_z": self.asymmetry.z,
            **{k: self.facets.share_of_groups(self.astray[k]) for k in ("truncated", "lost")},
        }

    def entries(self) -> dict:
        """Entries for JSON: groups, their conductors, and the table of facets."""
        return super().entries() | self.group_areas()

    def facts(self) -> Iterator[Any]:
        """Shares of the groups, the conductors between them, their sky by elevation, and facets."""
        M, names = self.facets.membership, self.facets.groups
        emitted = M @ self.facets.emitting_area
        areas = self.by_group(lambda C: np.transpose([*C.parts.values()]))
        shares = ((area / emitted[:, None]).T for area in areas)
        astray = {k: self.facets.share_of_groups(v) for k, v in self.astray.items()}
        counts, area = M.sum(axis=1).astype(int), M @ self.facets.area
        GR, error = self.between_groups()
        pairs = np.triu(GR, 1).nonzero()
        yield summary_of(self)
        yield Table.of(
            {
                "group": names,
                "facets": counts,
                "area_m2": area,
                "emissivity": emitted / (M @ self.facets.radiating_area),
                **with_errors(*zip(map("share to {}".format, PARTS), repeat(""), *shares)),
                "share inside bodies": astray["buried"],
            }
        )
        if pairs[0].size:
            yield Table.of(
                dict(zip(("group", "and"), np.array(names)[[*pairs]]))
                | with_errors(("conductor", "_m2", GR[pairs], error[pairs]))
                | {"difference of the two directions": map(percent, self.asymmetry.relative[pairs])}
                | {"z": self.asymmetry.z[pairs].round(1)}
            )
        yield "left after the last reflection", percent(astray["truncated"].max())
        yield "on surfaces that take no part", percent(astray["lost"].max())
        yield sky_table(self, emitted)
        yield from sun_table(self)
        drawn = np.isin(self.facets.number, self.triangle_facet)  # a sphere has no triangles
        columns = {name: values[drawn] for name, values in self.columns().items()}
        model = (self.triangles, self.triangle_facet) if drawn.any() else None
        yield facets_section(columns, model)

    def picture(self) -> BarCharts:
        """Where the radiation of each group is absorbed."""
        C, facets = self.conductors.by_group(self.facets), self.facets
        emitted = facets.membership @ facets.emitting_area
        rings = zip(RINGS_DEG, RINGS_DEG[1:])
        areas = {
            **{f"sky, {low:g}-{high:g}°": C.to_sky[:, k] for k, (low, high) in enumerate(rings)},
            "ground": C.parts["ground"],
            "the group itself": C.parts["itself"],
            "other groups": C.parts["others"],
            "inside bodies": facets.share_of_groups(self.astray["buried"]) * emitted,
        }
        shares = {name: area / emitted for name, area in areas.items()}
        label = "share of the group's emission"
        chart = BarChart(
            "where it is absorbed",
            facets.groups,
            label,
            shares,
            stacked=True,
            shades=len(RINGS_DEG) - 1,
        )
        return BarCharts([chart], self.summary())

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each facet. Shares are those of what the facet emits."""
        facets, C = self.facets, self.conductors
        quantities = [("conductor", "_m2", C.outward, self.error(lambda c: c.outward))]
        for name, value in C.parts.items():
            error = self.error(lambda c, name=name: c.parts[name])
            emitted = facets.emitting_area
            quantities.append((name, "", value / emitted, error / emitted))
        if self.irradiance:
            E, E_error = self.irradiance
            kelvin = (E / STEFAN_BOLTZMANN) ** 0.25
            kelvin_error = kelvin * E_error / (4 * np.maximum(E, 1e-300))
            quantities.append(("irradiance", "_W_m2", E, E_error))
            quantities.append(("environment", "_K", kelvin, kelvin_error))
        columns = {
            "facet": facets.number,
            "group": np.array(facets.groups)[facets.group],
            "material": facets.material,
            "temperature_K": self.temperature,
            "area_m2": facets.area,
            "sides": facets.sides,
            "emissivity": facets.emissivity,
            "buried": self.astray["buried"],
        }
        if self.sun is not None:
            columns["absorptance"] = self.sun.absorptance
            for name in ("lit", "direct", "reflected"):
                runs = getattr(self.sun, name)[:, 0]
                values = runs.mean(axis=0), standard_error(runs)
                quantities.append((f"sun_{name}", "_m2", *values))
        return columns | with_errors(*quantities)

    def pairs(self) -> dict[str, np.ndarray]:
        """The conductors between facets, a row for each pair with the facets' numbers.

        Where the randomisations agree to 1 %, the error is at least half of what `UNMET` paths
        stand for, or the conductor itself if that is less, as after reflections.
        """
        upper, facets = sparse.coo_array(sparse.triu(self.conductors.between, 1)), self.facets
        i, j = upper.coords
        area, path = facets.radiating_area, self.traced.path_area
        path = np.maximum(path[i] * area[j], path[j] * area[i]) / (area[i] + area[j])
        scatter = self.traced.standard_error(lambda C: C.between[i, j])
        least = np.minimum(UNMET / 2 * path, upper.data)
        error = np.where(scatter < 0.01 * upper.data, np.maximum(scatter, least), scatter)
        pairs = {"facet": facets.number[i], "other_facet": facets.number[j]}
        return pairs | with_errors(("conductor", "_m2", upper.data, error))

    def to_xarray(self) -> "xarray.Dataset":
        """The facets over `facet`, their conductors to the rings of the sky, and the pairs."""
        rows = {name: (("facet",), value) for name, value in self.columns().items()}
        pairs = {f"pair_{name}": (("pair",), value) for name, value in self.pairs().items()}
        C, error = self.conductors, self.error(lambda C: C.to_sky)
        to_sky = with_errors(("to_sky", "_m2", C.to_sky, error))
        rings = {name: (("facet", "ring"), value) for name, value in to_sky.items()}
        facet = rows.pop("facet")
        return self.dataset(rows | rings | pairs, {"facet": facet})


def with_errors(*quantities: tuple) -> dict[str, np.ndarray]:
    """Columns of values and of their errors, from the name, unit, value and error of each."""
    columns = {}
    for name, unit, value, error in quantities:
        columns |= {f"{name}{unit}": value, f"{name}_error{unit}": error}
    return columns


def with_unmet(errors: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Standard errors of areas, at least half of what `UNMET` paths stand for.

    Where all paths or no path met them, or equally many of each randomisation, there is no scatter.
    errors: by the randomisations, (n, ...) [m^2]. path: what the largest path stands for, (n,).
    """
    return np.maximum(errors.T, UNMET / 2 * path).T


def sky_table(result: Exchange, emitted: np.ndarray) -> Table:
    """What reaches the rings of the sky of what each group emits."""
    shares = ((area / emitted[:, None]).T for area in result.by_group(lambda C: C.to_sky))
    rings = [f"{low:g}-{high:g} deg" for low, high in zip(RINGS_DEG, RINGS_DEG[1:])]
    columns = with_errors(*zip(rings, repeat(""), *shares))
    return Table.of({"share to sky at elevations of": result.facets.groups} | columns)


def sun_table(result: Exchange) -> list[Table]:
    """Areas by which the groups absorb sunlight."""
    if result.sun is None:
        return []
    M = result.facets.membership
    names = {"lit": "lit", "direct": "absorbs directly", "reflected": "absorbs after reflections"}
    runs = ((M @ getattr(result.sun, name)[:, 0].T).T for name in names)
    areas = [("_m2", values.mean(axis=0), standard_error(values)) for values in runs]
    columns = with_errors(*((words, *area) for words, area in zip(names.values(), areas)))
    return [Table.of({"sunlight": result.facets.groups} | columns)]
