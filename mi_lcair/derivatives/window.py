"""Derivatives of an intensity with respect to many parameters, from one render."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.derivatives.common_numbers import METHOD, PARTS, USED, CommonNumbers, renders_beside
from mi_lcair.derivatives.motions.differences import Difference, Differences
from mi_lcair.errors import InputError
from mi_lcair.estimate import with_error
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.columns.kinds import MaterialColumn, SourceColumn
from mi_lcair.plugins.columns.tables import (
    CELLS,
    SIZES,
    ColumnTables,
    column_tables,
    incoming_radiance,
    needs_exploring,
    pilot_launch,
)
from mi_lcair.plugins.emission.sources import spectra
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.entries import DIFFERENCED, SCALED, StoredParameter
from mi_lcair.rendering.parameters.values import parameters_named, units
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import Lines, Table

# Derivatives of one number, an intensity, with respect to parameters of a scene
# ------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Sensitivities(Result):
    """An intensity and its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.rendering.parameters.values`.
    value : float
        Intensity, W/sr, or the weighted sum over the sources that was asked for.
    derivative : ndarray, shape (K,)
        Its derivative with respect to each parameter, per unit of the parameter.
    deviations : ndarray, shape (1 + K, R)
        Deviations of R independent randomisations from the value (first row) and from the
        derivatives. The sum of the products of two rows is the covariance of the two results.
    unscattered : ndarray, shape (1 + K,)
        Standard errors of the value and of the derivatives that the deviations do not show, as
        from a source that no path has met.
    method : tuple of str
        How each derivative was found: "linear", "score", "control variate", "mirror" (the same with
        the radiance of the mirror direction), "difference" (of renders), or for a motion "attached
        difference", "difference on the film" or "attached paths".
    by_bounce : ndarray, shape (N,)
        Intensity of paths with 0, 1, ... N - 1 reflections, W/sr.
    paths : int
        Number of paths of the value.
    scene_name, band : str
        Names of the scene and of its band.
    units : tuple of str
        Units of the parameters; "1" for a dimensionless one.
    differences : dict of str to Difference
        The differences with respect to motions, with their steps and verdicts.
    """

    names: tuple[str, ...] = entry()
    value: float = entry("intensity_W_sr")
    derivative: np.ndarray = entry()
    deviations: np.ndarray = entry()
    unscattered: np.ndarray = entry()
    method: tuple[str, ...] = entry()
    by_bounce: np.ndarray = entry("by_bounce_W_sr")
    paths: int
    scene_name: str
    band: str
    units: tuple[str, ...] = entry()
    differences: dict[str, Difference] = entry(default_factory=dict)

    kind = "sensitivities"
    computed = {
        "standard_error_W_sr": "standard_error",
        "derivatives": "as_rows",
        "covariance": "covariance",
    }

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the value and of the derivatives, (1 + K,)."""
        return np.hypot(np.sqrt(np.sum(self.deviations**2, axis=1)), self.unscattered)

    @property
    def standard_error(self) -> float:
        """Standard error of the value, W/sr."""
        return float(self.error[0])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the value and the derivatives by the deviations, (1 + K, 1 + K)."""
        return self.deviations @ self.deviations.T

    def summary(self) -> str:
        """One line with the intensity, its standard error, and the number of derivatives."""
        return (
            f"sensitivities of {self.scene_name}, {self.band}: intensity {self.value:.6g} +- "
            f"{self.error[0]:.2g} W/sr (standard error) and its derivatives with respect to "
            f"{len(self.names)} parameters"
        )

    def facts(self) -> Iterator[Any]:
        """The intensity in one line, a row for each parameter, and a sentence for each kink."""
        yield summary_of(self)
        yield Table.of(self.columns())
        if any(of.verdict == "kink" for of in self.differences.values()):
            yield Lines("", self.kinks())

    def kinks(self) -> list[str]:
        """A sentence for each motion at a kink, with the derivatives on both sides of it."""
        sentences = []
        for name, unit in zip(self.names, self.units):
            of = self.differences.get(name)
            if of is None or of.verdict != "kink":
                continue
            below, above = map(with_error, of.one_sided, of.one_sided_errors)
            where, which = f"within {of.step:.3g} of its value", "mean of both"
            if of.touches:
                where = "at its value, where parts of the model touch"
            if of.kink is not None:
                where = (
                    f"at its value{f' {of.kink:+.3g}' * bool(of.kink)}, where facets turn edge-on"
                )
            if of.kink:
                which = "one below" if of.kink > 0 else "one above"
            sentences.append(
                f"{name} has a kink {where}: the derivative is {below} below and {above} above it "
                f"({per_unit('W/sr', unit)}). The table has the {which}."
            )
        return sentences

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each parameter; derivative and standard error are in the row's unit.

        With motions, also the steps of differences, the one-sided derivatives, and whether the
        curve is smooth there.
        """
        table = {
            "parameter": np.array(self.names),
            "derivative": np.array(self.derivative),
            "standard_error": self.error[1:],
            "unit": np.array([per_unit("W/sr", unit) for unit in self.units]),
            "method": np.array(self.method),
        }
        if not self.differences:
            return table
        steps = [self.differences.get(name) for name in self.names]
        none = np.nan, np.nan
        below, above = np.array([d.one_sided if d else none for d in steps]).T
        of_below, of_above = np.array([d.one_sided_errors if d else none for d in steps]).T
        kinks = [np.nan if d is None or d.kink is None else d.kink for d in steps]
        return table | {
            "step": np.array([d.step if d else np.nan for d in steps]),
            "truncation": np.array([d.truncation if d else np.nan for d in steps]),
            "derivative_below": below,
            "derivative_below_error": of_below,
            "derivative_above": above,
            "derivative_above_error": of_above,
            "kink_offset": np.array(kinks),
            "verdict": np.array([d.verdict if d else "" for d in steps]),
        }


def per_unit(unit: str, of_parameter: str) -> str:
    """Unit of a derivative: "W/sr per K", or "W/sr" for a dimensionless parameter."""
    return unit if of_parameter in ("", "1") else f"{unit} per {of_parameter}"


# Columns of named parameters: derivatives of the radiance that a render records beside it
# ----------------------------------------------------------------------------------------

MOST_COLUMNS = SIZES[-1]  # columns of one render


def columns_of(scene, names) -> dict[str, MaterialColumn | SourceColumn]:
    """The columns of parameters by name, those of materials first.

    Raises InputError if a name is unknown, or if a column would have no derivative.
    """
    entries = sorted(parameters_named(scene, names), key=lambda entry: entry.kind != "material")
    return {entry.name: column_of(entry) for entry in entries}


def explored_by(columns) -> frozenset:
    """The surfaces that a render of these columns has to explore, see `needs_exploring`."""
    names = {}
    for column in columns:
        for surface in column.surfaces if isinstance(column, MaterialColumn) else ():
            names.setdefault(surface, []).append(column.parameter)
    return frozenset(surface for surface in names if needs_exploring(surface, names[surface]))


def by_difference(scene, names) -> list[str]:
    """Parameters whose derivatives are differences of renders.

    These are motions, numbers of other BSDFs, and all parameters of a scene with materials by
    wavelength.
    """
    if has_spectral_materials(scene.mi):
        return list(names)
    return [entry.name for entry in parameters_named(scene, names) if entry.kind in DIFFERENCED]


def without_column(scene, names) -> set[str]:
    """Parameters for which paths do not give the whole derivative of a number."""
    # What a plume hides of a background changes with its parameters, too
    return {*by_difference(scene, names)} | {
        entry.name
        for entry in parameters_named(scene, names)
        if any(is_plume(stored.node) for stored in entry.stored)
    }


def column_of(entry: StoredParameter) -> MaterialColumn | SourceColumn:
    if entry.kind in DIFFERENCED:
        what = "a motion" if entry.kind == "motion" else "of a BSDF that is not of this project"
        raise InputError(f"{entry.name} is {what}, which has no derivative here")
    if entry.kind == "material":
        nodes = tuple(stored.node for stored in entry.stored)
        return MaterialColumn(nodes, entry.stored[0].key.removesuffix(".value"))
    if entry.kind == "mode":
        return mode_column(entry)
    mean, relative = entry.mean(entry.numbers()), {}
    if not mean > 0:
        raise InputError(f"{entry.name} = {mean:g} has no derivative; give it a positive value")
    for stored in entry.stored:
        emitter = stored.node.emitter() if isinstance(stored.node, mi.Shape) else stored.node
        values = stored.array().astype(float)
        # The several numbers of a radiance or an emissivity change by a common factor
        slope = np.full(values.shape, 1 / mean)
        if (of_parts := emitter.relative_slopes(stored.key)) is not None:
            slope = of_parts * (values[0] / mean if entry.kind in SCALED else 1.0)
        elif entry.kind == "temperature":
            slope = relative_slope(emitter.band, values)
        if stored.number is not None:
            others = np.ones(len(values), bool)
            others[stored.number] = False
            slope[others] = 0
        relative[emitter] = slope
    return SourceColumn(relative)


def mode_column(entry: StoredParameter) -> SourceColumn:
    """The column of a mode: all temperatures change by their part of its pattern."""
    relative = {}
    for stored in entry.stored:
        emitter = stored.node.emitter()
        slope = relative_slope(emitter.band, stored.array().astype(float))
        relative[emitter] = slope * entry.changes[stored.node]
    return SourceColumn(relative)


def relative_slope(band, temperatures: np.ndarray) -> np.ndarray:
    """Derivative of a blackbody's in-band radiance, divided by the radiance [1/K]."""
    Float64 = dr.float64_array_t(mi.Float)
    with dr.resume_grad():
        T = Float64(temperatures)
        dr.enable_grad(T)
        L = in_band_radiance(band, T)
        dr.forward_from(T)
        slope, L = dr.grad(L).numpy(), dr.detach(L).numpy()
    return np.divide(slope, L, out=np.zeros_like(L), where=L > 0)


@dataclass(frozen=True)
class Recording:
    """How a render records some columns.

    tables: for `PathTracer.trace`. channels: for each parameter, the channels whose sum is its
    column. method: how each column is found, see `Sensitivities`.
    """

    tables: ColumnTables
    channels: dict[str, list[str]]
    method: dict[str, str]


def recordings(
    scene, tracer, sensor, names, measurands: Measurands, weights=None, seed: int = 0
) -> list[Recording]:
    """How renders record the columns of parameters, at most MOST_COLUMNS in each render.

    There are none with materials by wavelength, see `common_numbers`. Two pilots go through
    the cells of the film. The first one measures the incoming radiance, and the second one decides
    for each column which control variate reduces its noise.

    Parameters
    ----------
    scene : Scene
    tracer : PathTracer
        Integrator of the scene, from `Scene.prepared`.
    sensor : mitsuba.Sensor
    names : sequence of str
        Names of parameters.
    measurands : Measurands
        What the renders record beside the columns.
    weights : mapping or None
        Factor of each source's radiance, by (group, name of its spectrum).
    seed : int

    Raises
    ------
    InputError
        If a name is unknown, if a column would have no derivative, if a weight is missing, or for
        closure = tail.
    """
    scene.mi.integrator().check_differentiable()
    if has_spectral_materials(scene.mi):
        return []
    if weights is not None:
        if tracer.closure == "ambient":
            raise InputError(
                f"{scene.name}: closure = ambient has no source that could be weighted"
            )
        weights = factors(scene, weights)
    columns = list(columns_of(scene, names).items())
    for name, column in columns:
        for surface in column.surfaces if isinstance(column, MaterialColumn) else ():
            if is_plume(surface):
                surface.check_derivative(name, tracer.emitters.draws)
    batches = [columns[k : k + MOST_COLUMNS] for k in range(0, max(len(columns), 1), MOST_COLUMNS)]

    def pilot(tables: ColumnTables, randomisations: int) -> dict:
        """Channels of paths through the cells, (cells, randomisations)."""
        launch = pilot_launch(seed, randomisations)
        return measurands.with_columns(tables).trace(tracer, sensor, launch).channels

    return [recording(scene, dict(batch), weights, pilot) for batch in batches]


def recording(scene, columns: dict, weights, pilot) -> Recording:
    """How one render records some columns; `pilot` gives the channels of a few paths."""
    tables = column_tables(scene.mi, list(columns.values()), weights)
    channels = {name: [f"column.{k}"] for k, name in enumerate(columns)}
    if not tables.materials:
        tables = tables.with_incoming(np.zeros(CELLS**2 + 1))
        return Recording(tables, channels, dict.fromkeys(columns, "linear"))

    traced = pilot(tables, 1)
    measured = ("reflected", "mirrored") if tables.has_mirrors else ("reflected",)
    tables = tables.with_incoming(
        *(incoming_radiance(traced, tables.surfaces, of) for of in measured)
    )
    traced, method = pilot(tables, 2), {}

    def noise(names):
        return np.var(sum(traced[name] for name in names), axis=1).sum()

    for k, name in enumerate(columns):
        method[name] = "score" if k < tables.materials else "linear"
        controlled = [f"column.{k}", f"control.{k}"]
        candidates = {"control variate": controlled}
        if tables.has_mirrors:
            candidates["mirror"] = [*controlled, f"mirror.{k}"]
        for word, names in candidates.items() if k < tables.materials else ():
            if noise(names) < noise(channels[name]):
                channels[name], method[name] = names, word
    return Recording(tables, channels, method)


def factors(scene, weights) -> dict:
    """The weights of each emitter's facets, from those of the sources."""
    return {
        emitter: np.array([weight_of(weights, source) for source in spectra(emitter)])
        for emitter in scene.mi.emitters()
    }


def weight_of(weights, source) -> float:
    """The weight of a source; raises InputError if it has none."""
    key = (source.group, source.name)
    if key not in weights:
        raise InputError(
            f"source '{source.name}' of group {source.group} has no weight; temperatures cannot "
            "change under weights"
        )
    return weights[key]


SPLITS = {"target": "target", "scene": "image"}  # channels that hold each part of the radiance


def differentiate_intensity(
    scene: Scene,
    names: Sequence[str],
    sampling: Sampling,
    part: str = "target",
    weights: Mapping | None = None,
) -> Sensitivities:
    """Intensity of a loaded scene and its derivatives, all from the same paths.

    Parameters
    ----------
    scene : Scene
    names : sequence of str
        Names of parameters.
    sampling : Sampling
        Its tolerance is that of the intensity.
    part : str
        "target" or "scene".
    weights : mapping or None
        Factor of each source's intensity in the sum, by (group, name of the spectrum). None: the
        sum over all sources without factors.
    """
    by_spectrum = weights is not None
    numbers = CommonNumbers(scene, sampling, by_spectrum, part)
    if sampling.tolerance is not None:
        numbers.render()
    motions = [entry.name for entry in parameters_named(scene, names) if entry.kind == "motion"]
    differenced = by_difference(scene, names)
    along_paths = [name for name in names if name not in differenced]
    explored = explored_by(columns_of(scene, along_paths).values())
    measurands = replace(Measurands.of(SPLITS[part], by_spectrum, parts=USED), explored=explored)
    rows, method, first = {}, {}, None
    with scene.prepared(by_spectrum, explored) as tracer:
        numbers.take_aim()
        for batch in recordings(
            scene, tracer, numbers.camera, along_paths, measurands, weights, sampling.seed
        ):
            total = measure(
                scene,
                numbers.windows,
                numbers.sampling,
                measurands.with_columns(batch.tables),
                aim=numbers.aim,
            )
            first = first or total
            method |= batch.method
            rows |= {
                name: mean_and_deviations(total, channels)
                for name, channels in batch.channels.items()
            }
    rows_of = partial(mean_and_deviations, channels=["weighted"])
    of_part = rows_of_part(numbers, weights)
    several = replace(measurands, channels=replace(measurands.channels, split="target"))
    if first is None:
        numbers.take_aim()
        rows_of = of_part
        first = measure(scene, numbers.windows, numbers.sampling, several, aim=numbers.aim)
    value = rows_of(first)
    rest = [name for name in names if name not in motions]
    missed = unscattered(scene, first, rest, part, weights)
    errors = dict(zip(rest, missed[1:]))
    for name in rest:
        if name in differenced:
            *ends, step = renders_beside(
                scene, name, numbers.windows, numbers.repeated, several, numbers.aim
            )
            high, low = map(of_part, ends)
            rows[name], method[name] = (high - low) / step, METHOD
    differences = {name: differences_of(numbers, name, weights).at() for name in motions}
    for name, difference in differences.items():
        rows[name] = np.append(difference.derivative, difference.deviations)
        errors[name], method[name] = difference.unscattered, difference.method
    rows = numbers.area * np.array([value, *(rows[name] for name in names)])
    return Sensitivities(
        names=tuple(names),
        value=float(rows[0, 0]),
        derivative=rows[1:, 0],
        deviations=rows[:, 1:],
        unscattered=numbers.area * np.array([missed[0], *(errors[name] for name in names)]),
        method=tuple(method[name] for name in names),
        by_bounce=numbers.by_reflections(first),
        paths=int(first.traced[0]),
        scene_name=scene.name,
        band=scene.band.label,
        units=units(scene, names),
        differences={name: d.scaled(numbers.area) for name, d in differences.items()},
    )


def differences_of(numbers: CommonNumbers, name: str, weights: Mapping | None = None):
    """The `Differences` of a part's mean radiance, or of its weighted sum, along a motion."""
    parts = ("bounce",) if numbers.by_spectrum else ()  # a budget reads the closure that is in it
    return Differences(
        numbers.scene,
        name,
        numbers.repeated,
        Measurands.of("target", numbers.by_spectrum, parts=parts),
        rows_of_part(numbers, weights),
        PARTS[numbers.part],
        numbers.aim,
        is_target=weights is None and numbers.part == "target",
    )


def rows_of_part(numbers: CommonNumbers, weights: Mapping | None):
    """Function of Totals: mean and deviations of a part's radiance, or of its weighted sum."""

    def rows(total: Totals) -> np.ndarray:
        if weights is None:
            return mean_and_deviations(total, [PARTS[numbers.part]])
        sources = enumerate(total.emitters.sources.list)
        factors = {f"{numbers.prefix}source.{k}": weight_of(weights, s) for k, s in sources}
        return sum(w * mean_and_deviations(total, [channel]) for channel, w in factors.items())

    return rows


def mean_and_deviations(total, channels) -> np.ndarray:
    """Mean of the sum of some channels and its deviations, (1 + randomisations,)."""
    mean, deviations = total.mean(channels)[:, 0], total.deviations(channels)[:, 0]
    return np.append(sum(mean), sum(deviations))


def unscattered(scene, total: Totals, names, part: str, weights: Mapping | None) -> np.ndarray:
    """Standard errors of a mean radiance and its derivatives that no deviation shows, (1 + K,)."""
    largest = max(weights.values(), default=0.0) if weights else 1.0
    missed = [errors[0] for errors in missed_errors(scene, total, names, part)]
    return largest * np.array([total.unscattered_error(PARTS[part])[0], *missed])


def missed_errors(scene, total: Totals, names, part: str = "scene") -> list[np.ndarray]:
    """Standard errors of derivatives from sources that no path has met, (windows,) each.

    The error of the radiance from such a source, times the relative derivative, is the error of the
    derivative with respect to its temperature or radiance. For the parameter of a material, the
    radiance is assumed to be proportional to the parameter.
    """
    errors = []
    for parameter in parameters_named(scene, names):
        numbers, channel = parameter.numbers(), PARTS[part]
        relative = 1 / (abs(parameter.mean(numbers)) or 1.0)
        if parameter.kind not in ("material", "spectrum", "plugin", "mode"):
            channel = f"group.{parameter.name.rpartition('.')[0].partition('@')[0]}"
            channel = channel if part == "scene" else f"target.{channel}"
        if parameter.kind == "mode":
            slopes = columns_of(scene, [parameter.name])[parameter.name].relative.values()
            relative = max(float(abs(slope).max()) for slope in slopes)
        if parameter.kind == "temperature":
            relative = relative_slope(scene.band, np.concatenate(numbers)).max()
        errors.append(total.missed_error(channel) * relative)
    return errors
