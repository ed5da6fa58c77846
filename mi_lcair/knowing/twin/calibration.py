"""Inputs of a heat balance that explain what was measured, and what the data cannot tell."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from mi_lcair.declared import listed
from mi_lcair.files import replacing
from mi_lcair.heating.temperatures.description import GroupTable, HeatDescription
from mi_lcair.heating.temperatures.network import LAYER, OF_INERTIA
from mi_lcair.knowing.twin.answers import advice, alike, verdicts
from mi_lcair.knowing.twin.data import Readings
from mi_lcair.knowing.twin.estimate import TwinEstimate, estimated
from mi_lcair.knowing.twin.model import Twin
from mi_lcair.knowing.twin.problem import TwinProblem
from mi_lcair.knowing.twin.unknowns import INERTIA, Sought, with_value
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.physics.estimation.verdicts import SIGNIFICANCE, correlation
from mi_lcair.progress import Progress
from mi_lcair.rendering.scene import Scene
from mi_lcair.results import Result
from mi_lcair.sections import Lines, Table
from mi_lcair.toml_table import text_of


@dataclass(frozen=True, repr=False)
class HeatCalibration(Result):
    """Inputs of a heat balance that explain measured temperatures and frames.

    Attributes
    ----------
    names : list of str
    before, value, standard_error, lower, upper : ndarray, shape (N,)
        First guess, value, standard error, and ends of the 95 % interval.
    correlation : ndarray, shape (N, N)
        That of the errors; of factors in logarithms.
    verdicts : list of str
        What the data say of each.
    alike, advice : list of str
        Combinations that the data do not determine, and measurements that would help.
    rms_before_K, rms_K : float
        Of what the temperatures alone leave, with the first guess and with the values.
    p_value : float
        Probability of larger residuals by chance.
    instruments : dict of str to list of float
        Errors of cameras and thermometers that were found, each with its standard error.
    of : list of str
        Thermometer, or camera with the group that it shows, of each value of the series.
    hours, measured, predicted : ndarray, shape (S,)
        The series: hours, measured and predicted (apparent) temperatures [K].
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
    advice: list[str]
    rms_before_K: float
    rms_K: float
    p_value: float
    instruments: dict[str, list[float]]
    of: list[str]
    hours: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    tables: dict
    remarks: tuple[str, ...] = ()

    kind = "calibration"
    heading = "Calibration"
    drawn_by = "mi_lcair.show.pictures.temperatures:of_calibration"
    saved_by = {".toml": "mi_lcair.knowing.twin.calibration:write_toml"}

    def summary(self) -> str:
        """One line with the residuals before and after."""
        return (
            f"calibration of {len(self.names)} inputs: {self.rms_K:.2f} K rms, "
            f"{self.rms_before_K:.2f} K before"
        )

    def facts(self) -> Iterator[Any]:
        """The residuals, the values, and what cannot be told apart."""
        yield "means", f"{self.measured.size}, {self.rms_K:.2f} K rms"
        yield "before", f"{self.rms_before_K:.2f} K rms"
        yield "fit", f"p = {self.p_value:.2g}"
        yield self._table_of_inputs()
        if self.instruments:
            rows = [(n, f"{v:.3g} +- {e:.2g}") for n, (v, e) in self.instruments.items()]
            yield Table(["error of", "value"], rows)
        titles = "the data do not determine", "what would help"
        for title, lines in zip(titles, (self.alike, self.advice)):
            if lines:
                yield Lines(title, lines)

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


COARSE = 1.2  # variance of pixels over the stated one from which it is reported


def calibrated(
    scene: Scene,
    description: HeatDescription,
    problem: TwinProblem,
    advise: bool = True,
    progress: Progress | None = None,
) -> HeatCalibration:
    """The unknowns of a heat balance from what was measured; see `mi_lcair.invert`."""
    twin = Twin(scene, description, problem)
    found = estimated(twin, problem.heat.starts, progress)
    unknowns, K = twin.unknowns, len(twin.unknowns)
    x, covariance = found.state.z[:K], found.covariance[:K, :K]
    value = np.array([u.at(step) for u, step in zip(unknowns, x)])
    sd = np.sqrt(np.diag(covariance))
    error = np.where([u.is_linear for u in unknowns], sd, sd * value)
    ends = np.array([[u.at(end) for end in pair] for u, pair in zip(unknowns, found.ends)])
    correlated, left = correlation(covariance), found.means.kelvin(twin, found.state.z)
    rms = [
        float(np.sqrt(np.mean(rest**2)))
        for rest in (found.before.kelvin(twin, np.zeros(len(twin.mean))), left)
    ]
    of, measured = series_of(twin, found)
    return HeatCalibration(
        names=[u.name for u in unknowns], before=np.array([u.value for u in unknowns]),
        value=value, standard_error=error, lower=ends[:, 0], upper=ends[:, 1],
        correlation=correlated, verdicts=verdicts(twin, found), alike=alike(twin, found),
        advice=advice(twin, found) if advise else [], rms_before_K=rms[0], rms_K=rms[1],
        p_value=found.p_value, instruments=instruments_of(twin, found), of=of,
        hours=np.array([hour for _, hour, _ in found.means.of]), measured=measured,
        predicted=measured - left, tables=described(twin, value, error, correlated),
        remarks=remarks_of(twin, found, rms[1]),
    )  # fmt: skip


def series_of(twin: Twin, found: TwinEstimate) -> tuple[list[str], np.ndarray]:
    """Label and measured temperature of each mean; of a camera the apparent one."""
    groups, labels, kelvin = twin.first.network.facets.groups, [], []
    data = {datum.name: datum for datum in [*twin.contact, *twin.cameras]}
    for name, hour, part in found.means.of:
        datum = data[name]
        k = int(np.argmin(abs(datum.hours - hour)))
        if isinstance(datum, Readings):
            labels.append(datum.columns[part])
            kelvin.append(datum.kelvin[k, part])
            continue
        cells = datum.fixed[k]
        weight = cells.weight * (cells.group == part)
        mean = np.average(cells.mean @ datum.measured[k], weights=weight)
        labels.append(f"{name}, {groups[part]}")
        kelvin.append(float(brightness_temperature(datum.scene.band, mean)))
    return labels, np.array(kelvin)


def instruments_of(twin: Twin, found: TwinEstimate) -> dict[str, list[float]]:
    """Errors of the instruments with their standard errors, but those of single frames."""
    result = {}
    for number, datum in enumerate([*twin.contact, *twin.cameras]):
        for label, sigma, k in zip(datum.own, datum.own_sigma, twin.places[f"errors of {number}"]):
            if " at " not in label:
                error = np.sqrt(found.covariance[k, k])
                result[label] = [float(sigma * found.state.z[k]), float(sigma * error)]
    return result


def remarks_of(twin: Twin, found: TwinEstimate, rms: float) -> tuple[str, ...]:
    """What a user should know about an estimate."""
    lines = [*twin.remarks]
    if not found.converged:
        lines.append("the values still move; give first guesses that are nearer")
    if found.p_value < SIGNIFICANCE:
        lines.append(
            f"the balance does not fit this series: the residuals of {rms:.2g} K are larger than "
            f"noise, errors of instruments and model_K allow (p = {found.p_value:.1g}); a term is "
            "missing, and the intervals are too small"
        )
    for camera in found.state.course.traced.cameras:
        coarse = [camera.fixed[k].coarse.mean() for k in range(len(camera.hours))]
        if (ratio := float(np.mean(coarse))) > COARSE:
            lines.append(
                f"{camera.name}: pixels of a facet scatter by {np.sqrt(ratio):.2g} times their "
                "noise, which therefore counts as that much larger"
            )
    bands = sorted({camera.scene.band.label for camera in twin.cameras})
    for u in twin.unknowns:
        if u.is_of_scene and len(bands) > 1:
            lines.append(f"{u.name}: counts as the same in {listed(bands)}")
        if u.is_of_scene:
            lines.append(f"{u.name}: the heat.toml has its value, but not its error")
    return tuple(lines)


def described(twin: Twin, value: np.ndarray, error: np.ndarray, correlated: np.ndarray) -> dict:
    """The tables of a heat.toml with the values, their uncertainties and correlations."""
    description, posterior, kept = twin.description, {}, []
    tables = {name: dict(table) for name, table in description.tree.items() if name != "groups"}
    groups = {name: dict(table) for name, table in description.tree.get("groups", {}).items()}
    for k, (unknown, number) in enumerate(zip(twin.unknowns, value)):
        number = float(f"{number:.6g}")
        if unknown.is_of_scene:
            target = tables["target"]
            target["parameters"] = dict(target.get("parameters", {})) | {unknown.name: number}
            continue
        kept.append(k)
        stated = groups.setdefault(unknown.group, {})
        stated |= entries_of(unknown, number, stated, twin.first.network.tables[unknown.group])
        is_absolute = unknown.is_linear and unknown.key != "h"
        posterior[unknown.name] = (
            float(f"{error[k]:.4g}") if is_absolute else f"{100 * error[k] / value[k]:.3g} %"
        )
    result = tables | {f"groups.{name}": table for name, table in groups.items()}
    sigmas = twin.others | posterior
    result["sigma"] = sigmas | {"model_K": description.model_K}
    if len(kept) > 1:
        rows = correlated[np.ix_(kept, kept)].round(6).tolist()
        result["correlation"] = {"inputs": list(posterior), "matrix": rows}
    return result


def entries_of(unknown: Sought, number: float, stated: dict, table: GroupTable) -> dict:
    """The entries of a group that give an unknown its value. stated: those that it has."""
    bare, index = LAYER.fullmatch(unknown.key).groups()
    if bare == INERTIA:
        changed = with_value(table, bare, number)
        return {key: float(f"{getattr(changed, key):.6g}") for key in OF_INERTIA}
    if index is None:
        return {"h_factor" if bare == "h" else bare: number}
    key = bare if bare in stated else "layers"
    items = list(stated[key])
    items[int(index)] = number if key == bare else items[int(index)] | {bare: number}
    return {key: items}


def write_toml(path: str | PathLike[str], result: HeatCalibration) -> None:
    """Write the heat.toml with the values; its files are relative to its folder."""
    path, tables = Path(path), {name: dict(table) for name, table in result.tables.items()}
    for table, key in (("target", "scene"), ("weather", "file")):
        file = tables.get(table, {}).get(key)
        if file is not None and os.path.isfile(file):
            tables[table][key] = os.path.relpath(file, path.parent)
    with replacing(path) as partial:
        partial.write_text(text_of(tables), encoding="utf-8")
