"""Calibration of a heat balance: ground and air from a series of measured temperatures.

Generalised least squares by Gauss and Newton. The covariance of the residuals has the noise of the
readings, an error that all of them share, and the error of the model, alike over some hours.
Unknowns are known beforehand as their material says. What the other inputs contribute with their
uncertainties is added to the covariance of the unknowns.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import combinations
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from mi_lcair.declared import Bounds, Described, entry
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.estimate import relative
from mi_lcair.files import parse_toml, read_text, replacing
from mi_lcair.heating.conductors import Facets
from mi_lcair.heating.temperatures.description import (
    GroupTable,
    HeatDescription,
    default_sigmas,
    sigmas_of,
)
from mi_lcair.heating.temperatures.network import OF_LAW, OF_WALL, Network
from mi_lcair.heating.temperatures.solve import course, network_of
from mi_lcair.knowing.inversion.tables import UnknownEntry
from mi_lcair.rendering.scene import Scene
from mi_lcair.results import Result
from mi_lcair.sections import Lines, Table
from mi_lcair.table import read_table
from mi_lcair.toml_table import check_tables, filled, plain, table_of, text_of

KNOWN = ("h", "absorptance", *OF_LAW, *OF_WALL)  # inputs that may be sought
LINEAR = ("absorptance", "wetness", "back_K", "back_W_m2", "radiative")  # others in logarithms
LIMITS = {f.name: f.metadata["bounds"] for f in fields(GroupTable) if "bounds" in f.metadata}
BROAD = {"absorptance": 0.2, "wetness": 0.3}  # of what no material says; others a factor of e
# Time over which the error of the model is alike, in hours of the weather's rows. It is an eighth
# of a day, also of a long one: what the terms leave out follows the course of sun and air
LASTS_H = 3.0
MOST_STEPS, CLOSE = 12, 0.05  # iterations, and the change in standard errors at which they end
SIGNIFICANCE = 1e-3  # chance below which a series does not fit
FLAT = 0.5  # increase of chi-square that the drift of days may make
LITTLE, ALIKE = 0.7, 0.8  # ratio to the sigma beforehand, and correlation, that are reported
SCALED = "one factor of all that heats, cools and stores changes no temperature"


@dataclass(frozen=True)
class SeriesTable(Described, where="[heat]"):
    """[heat] of a problem: the balance and its measured temperatures.

    Attributes
    ----------
    file : str
        The heat.toml. Its values are the first guess.
    measured : str
        CSV with the column `hour` and a column [K] for groups by name, or for facets as facet_12.
    sigma_K : float
        Noise of a reading.
    common_K : float
        Error that is common to all readings, such as a calibration error.
    """

    file: str = entry(is_file=True)
    measured: str = entry(is_file=True)
    sigma_K: float = entry(0.3, lower=1e-3, upper=1000)
    common_K: float = entry(0.0, lower=0, upper=1000)


@dataclass(frozen=True)
class Sought:
    """An unknown at its first guess: name, group and key; value, sigma beforehand, bounds.

    mean: value that is expected beforehand.
    """

    name: str
    value: float
    sigma: float
    lower: float
    upper: float
    mean: float

    @property
    def expected(self) -> float:
        """x of what is expected beforehand."""
        return self.mean - self.value if self.is_linear else float(np.log(self.mean / self.value))

    @property
    def key(self) -> str:
        return self.name.rpartition(".")[2]

    @property
    def group(self) -> str:
        return self.name.rpartition(".")[0]

    @property
    def is_linear(self) -> bool:
        return self.key in LINEAR

    def at(self, x: float) -> float:
        """The value for x, a difference or the logarithm of a factor."""
        value = self.value + x if self.is_linear else self.value * np.exp(x)
        return float(np.clip(value, self.lower, self.upper))


@dataclass(frozen=True, repr=False)
class HeatCalibration(Result):
    """Inputs of a heat balance that explain measured temperatures.

    Attributes
    ----------
    names : list of str
    before, value, standard_error, lower, upper : ndarray, shape (N,)
        First guess, value, standard error, and ends of the 95 % interval.
    correlation : ndarray, shape (N, N)
        That of the errors; of factors in logarithms.
    verdicts, alike : list of str
        What the series says of each, and which cannot be told apart.
    rms_before_K, rms_K : float
        Of measured less computed temperatures, with the first guess and with the values.
    hours, measured, predicted : ndarray
    tables : dict
        The heat.toml with the values.
    remarks : tuple of str
    """

    names: list[str]
    before: np.ndarray
    value: np.ndarray
    standard_error: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    correlation: np.ndarray
    verdicts: list[str]
    alike: list[str]
    rms_before_K: float
    rms_K: float
    hours: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    tables: dict
    remarks: tuple[str, ...] = ()

    kind = "calibration"
    heading = "Calibration"
    saved_by = {".toml": "mi_lcair.knowing.inversion.calibration:write_toml"}

    def summary(self) -> str:
        """One line with the residuals before and after."""
        return (
            f"calibration of {len(self.names)} inputs: {self.rms_K:.2f} K rms, "
            f"{self.rms_before_K:.2f} K before"
        )

    def facts(self) -> Iterator[Any]:
        """The residuals, the values, and what cannot be told apart."""
        yield "readings", f"{self.measured.size}, {self.rms_K:.2f} K rms"
        yield "before", f"{self.rms_before_K:.2f} K rms"
        yield self._table_of_inputs()
        if self.alike:
            yield Lines("the data cannot tell apart", self.alike)

    def _table_of_inputs(self) -> Table:
        """The inputs with their intervals and verdicts."""
        columns = self.before, self.value, self.lower, self.upper
        rows = [
            (name, f"{b:.4g}", f"{v:.4g}", f"{low:.3g} to {high:.3g}", verdict)
            for name, b, v, low, high, verdict in zip(self.names, *columns, self.verdicts)
        ]
        return Table(["input", "before", "value", "95 % interval", "verdict"], rows)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each input."""
        names = "before", "value", "standard_error", "lower", "upper"
        values = {name: getattr(self, name) for name in names}
        return {"input": np.array(self.names), **values, "verdict": np.array(self.verdicts)}


def series_of(problem) -> tuple[SeriesTable, dict[str, UnknownEntry]] | None:
    """The tables of a problem with [heat], from its file or as a dictionary; None for others."""
    if not isinstance(problem, (str, PathLike, dict)):
        return None
    where = "problem" if isinstance(problem, dict) else f"problem '{problem}'"
    is_tree = isinstance(problem, dict)
    tree = plain(problem) if is_tree else parse_toml(read_text(problem, where), where)
    if "heat" not in tree:
        return None
    folder = Path() if is_tree else Path(problem).parent
    with errors_of(where):
        check_tables(["heat", "unknowns"], tree)
        series = filled(SeriesTable, tree["heat"], "[heat]", folder)
        unknowns = {
            name: filled(UnknownEntry, values, f"[unknowns] '{name}'")
            for name, values in named(table_of(tree, "unknowns")).items()
        }
        if not unknowns:
            raise InputError('no [unknowns]: name at least one, such as "ground.conductivity"')
        return series, unknowns


def named(table: dict) -> dict[str, Any]:
    """The unknowns by GROUP.KEY, as TOML nests keys without quotes."""
    result = {}
    for name, values in table.items():
        nests = (
            isinstance(values, dict)
            and values
            and all(isinstance(v, dict) for v in values.values())
        )
        result |= {f"{name}.{k}": v for k, v in values.items()} if nests else {name: values}
    return result


def sought(name: str, given: UnknownEntry, network: Network) -> Sought:
    """An unknown with its first guess and what is known of it beforehand."""
    group, _, key = name.rpartition(".")
    where = f"[unknowns] '{name}'"
    check_known("group", network.facets.groups, group)
    with errors_of(where):
        check_known("input", KNOWN, key)
        table = network.tables[group]
        value = table.h_factor if key == "h" else getattr(table, key, None)
        if key == "absorptance" and value is None and network.sun is not None:
            mine = network.facets.group == network.facets.groups.index(group)
            value = float(network.sun.absorptance[mine].mean())
        if value is None:
            raise InputError(f"{key} is missing; give a first guess in the heat.toml")
        known = (*table.by_material, "h") if table.material else ()
        stated = {k: sigma for k, sigma in sigmas_of(table).items() if k in known}
        sigma = stated.get(key, BROAD.get(key, 1.0))
        if isinstance(sigma, str):
            sigma = relative(sigma)
        elif key in stated and key not in LINEAR:
            sigma = sigma / value
        if given.prior is not None:
            value, sigma = given.prior
        mean, value = value, value if given.start is None else given.start
        of_table = LIMITS["h_factor" if key == "h" else key]
        lower = of_table.lower if given.lower is None else given.lower
        upper = of_table.upper if given.upper is None else given.upper
        Bounds(lower=lower, upper=upper).check(value, key)
        if key not in LINEAR:
            if not (mean > 0 and value > 0):
                raise InputError(f"{key} is {min(mean, value):g}; start and prior must be positive")
            sigma = sigma / mean if given.prior is not None else sigma
        return Sought(name, value, sigma, lower, upper, mean)


def changed(network: Network, unknowns: list[Sought], x: np.ndarray) -> Network:
    """The network with the values of the unknowns at x."""
    groups, more = dict(network.tables), 0.0
    for unknown, step in zip(unknowns, x):
        value, group = unknown.at(step), unknown.group
        if unknown.key == "absorptance":  # linear, also in what is reflected on others
            more = more + network.of_absorptance(group, 1.0) * (value - unknown.value)
            continue
        key = "h_factor" if unknown.key == "h" else unknown.key
        groups[group] = replace(groups[group], **{key: value})
    result = replace(network, groups=groups)
    result.__dict__["light"] = network.light + more  # takes the place of the cached property
    return result


class Series:
    """Measured temperatures, and the computed ones at their hours."""

    def __init__(self, path: str, facets: Facets, network: Network, is_periodic: bool):
        where = f"measured {path}"
        table = read_table(path, ("hour",), "measured")
        numbers = table.numbers(table.columns)
        self.hours = numbers.pop("hour")
        if not numbers:
            raise InputError(f"{where}: has no column of temperatures; give one named as a group")
        weights = []
        for name, values in numbers.items():
            row = np.zeros(len(facets.area))
            if name.startswith("facet_") and name[6:].isdigit():
                row[facets.number == int(name[6:])] = 1.0
            else:
                check_known(f"group of {where}", facets.groups, name)
                row = (facets.group == facets.groups.index(name)) * facets.area
            if not row.any():
                raise InputError(f"{where}: there is no {name}")
            table.check_range(name, values, Bounds(lower=10, upper=6000, unit="K"))
            weights.append(row / row.sum())
        self.weights = np.array(weights)
        self.measured = np.array([*numbers.values()]).T
        self.times = network.weather.seconds
        self.period = network.weather.day_s if is_periodic else None
        self.hour_s = network.weather.day_s / 24  # as of the weather's rows
        if is_periodic and not (min(self.hours) >= 0 and max(self.hours) <= 24):
            raise InputError(
                f"{where}: hours {min(self.hours):g} to {max(self.hours):g} are not those of one "
                "day, 0 to 24; give start_K of [run] for a series of days"
            )
        first, last = (2 * self.times[0] - self.times[1]), self.times[-1]
        if not is_periodic and not (
            first <= self.hour_s * min(self.hours) and self.hour_s * max(self.hours) <= last
        ):
            raise InputError(
                f"{where}: hours {min(self.hours):g} to {max(self.hours):g} leave those of the "
                f"weather, {first / self.hour_s:g} to {last / self.hour_s:g}"
            )

    def of(self, values: np.ndarray) -> np.ndarray:
        """Values (m, n) of facets at the readings, (readings,)."""
        columns = (values @ self.weights.T).T
        at = self.hours * self.hour_s
        return np.ravel([np.interp(at, self.times, c, period=self.period) for c in columns], "F")


def calibrated(
    scene: Scene, description: HeatDescription, series: SeriesTable, entries: dict
) -> HeatCalibration:
    """The unknowns of a heat balance from a series; see `mi_lcair.invert`."""
    network, remarks = network_of(scene, description)
    if len(network.weather.seconds) == 1:
        raise InputError(f"heat '{series.file}': a steady state; give a file of [weather]")
    unknowns = [sought(name, given, network) for name, given in entries.items()]
    start_K = description.run.start_K
    data = Series(series.measured, network.facets, network, start_K is None)
    sigmas = description.sigma
    if description.has_defaults:
        sigmas = default_sigmas(network.weather.sky, network.tables)
    others = of_others(sigmas, unknowns, network)
    columns = [(u.name, 1.0 if u.is_linear else "100 %") for u in unknowns]

    def computed(x, inputs):
        at = changed(network, unknowns, x)
        solved = course(at, [at.column(*pair) for pair in inputs], start_K)
        return data.of(solved.kelvin), np.array([data.of(c) for c in solved.changes[: len(inputs)]])

    measured, count = np.ravel(data.measured), len(unknowns)
    T, slopes = computed(np.zeros(count), columns)
    first, J = T, slopes.T
    lag = abs(np.subtract.outer(*2 * [np.repeat(data.hours, data.measured.shape[1])]))
    lag = np.minimum(lag, 24 - lag) if data.period else lag
    C = series.sigma_K**2 * np.eye(len(T)) + series.common_K**2
    C += description.model_K**2 * np.exp(-lag / LASTS_H)
    root = np.linalg.cholesky(C)
    prior, mean = np.array([(u.sigma, u.expected) for u in unknowns]).T
    x = np.zeros(count)

    def cost(x, T):
        return np.sum(np.linalg.solve(root, measured - T) ** 2) + np.sum(((x - mean) / prior) ** 2)

    for _ in range(MOST_STEPS):
        A, r = np.linalg.solve(root, J), np.linalg.solve(root, measured - T)
        covariance = np.linalg.inv(A.T @ A + np.diag(prior**-2.0))
        step, before = covariance @ (A.T @ r - (x - mean) / prior**2), cost(x, T)
        if (abs(step) < CLOSE * np.sqrt(np.diag(covariance))).all():
            break
        for _ in range(4):
            trial, slopes = computed(x + step, columns)
            if cost(x + step, trial) <= before + FLAT:
                break
            step = step / 3
        x, T, J = x + step, trial, slopes.T
    else:
        remarks += ("the values still move; give first guesses that are nearer",)
    chance = float(stats.chi2.sf(cost(x, T), len(T)))
    if chance < SIGNIFICANCE:
        remarks += (
            f"the balance does not fit this series: the residuals of {np.std(measured - T):.2g} "
            f"K are larger than sigma_K, common_K and model_K allow (p = {chance:.1g}); a term "
            "is missing, and the intervals are too small",
        )
    # What the other inputs may have changed, as if they had been other values in this series
    _, nuisance = computed(x, [*others.items()])
    shifts = (
        covariance @ (A.T @ np.linalg.solve(root, nuisance.T)) if others else np.zeros((count, 1))
    )
    covariance = covariance + shifts @ shifts.T
    return answer(description, data, unknowns, x, covariance, (first, T), (sigmas, remarks))


def of_others(sigmas: dict, unknowns: list[Sought], network: Network) -> dict:
    """The uncertainties without those of the unknowns.

    One of all groups, such as that of h, becomes one of each other group.
    """
    sought, keys, result = {u.name for u in unknowns}, {u.key for u in unknowns}, {}
    for name, sigma in sigmas.items():
        if name not in keys:
            result[name] = sigma
            continue
        for group, table in network.tables.items():
            has_it = name not in OF_WALL or table.thickness_mm or table.layers
            if table.temperature is None and has_it:
                result[f"{group}.{name}"] = sigmas.get(f"{group}.{name}", sigma)
    return {name: sigma for name, sigma in result.items() if name not in sought}


def answer(description, data, unknowns, x, covariance, temperatures, more) -> HeatCalibration:
    """The result from x, its covariance, the temperatures before and now, sigmas and remarks."""
    (first, T), (sigmas, remarks) = temperatures, more
    sd = np.sqrt(np.diag(covariance))
    R = covariance / np.outer(sd, sd)
    value = np.array([u.at(v) for u, v in zip(unknowns, x)])
    ends = [np.array([u.at(v + s * 1.96 * e) for u, v, e in zip(unknowns, x, sd)]) for s in (-1, 1)]
    error = np.array([e if u.is_linear else u.at(v) * e for u, v, e in zip(unknowns, x, sd)])
    verdicts = [
        "determined" if e < LITTLE * u.sigma else "not determined: known beforehand as well"
        for u, e in zip(unknowns, sd)
    ]
    alike = [
        f"{unknowns[i].name} and {unknowns[j].name} (correlation {R[i, j]:+.2f}); {SCALED}"
        for i, j in combinations(range(len(unknowns)), 2)
        if abs(R[i, j]) > ALIKE
    ]
    measured = np.ravel(data.measured)
    posterior = {u.name: float(f"{e:.4g}") for u, e in zip(unknowns, error)}
    for u, v, e in zip(unknowns, value, error):
        if u.key == "h" or not u.is_linear:
            posterior[u.name] = f"{100 * e / v:.3g} %"
    before = np.array([u.value for u in unknowns])
    return HeatCalibration(
        names=[u.name for u in unknowns], before=before, value=value, standard_error=error,
        lower=ends[0], upper=ends[1], correlation=R, verdicts=verdicts, alike=alike,
        rms_before_K=float(np.sqrt(np.mean((first - measured) ** 2))),
        rms_K=float(np.sqrt(np.mean((T - measured) ** 2))),
        hours=data.hours, measured=data.measured, predicted=T.reshape(data.measured.shape),
        tables=described(description, unknowns, value, sigmas | posterior), remarks=remarks,
    )  # fmt: skip


def described(description: HeatDescription, unknowns, value, sigmas) -> dict:
    """The tables of a heat.toml with the values and their uncertainties."""
    tables = {name: dict(table) for name, table in description.tree.items() if name != "groups"}
    groups = {name: dict(table) for name, table in description.tree.get("groups", {}).items()}
    for unknown, number in zip(unknowns, value):
        key = "h_factor" if unknown.key == "h" else unknown.key
        groups.setdefault(unknown.group, {})[key] = float(f"{number:.6g}")
    return (
        tables
        | {f"groups.{name}": table for name, table in groups.items()}
        | {"sigma": sigmas | {"model_K": description.model_K}}
    )


def write_toml(path: str | PathLike[str], result: HeatCalibration) -> None:
    """Write the heat.toml with the values; its files are relative to its folder."""
    path, tables = Path(path), {name: dict(table) for name, table in result.tables.items()}
    for table, key in (("target", "scene"), ("weather", "file")):
        file = tables.get(table, {}).get(key)
        if file is not None and os.path.isfile(file):
            tables[table][key] = os.path.relpath(file, path.parent)
    with replacing(path) as partial:
        partial.write_text(text_of(tables), encoding="utf-8")
