"""Columns of named parameters: derivatives of the radiance that a render records beside it."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.spectral_bsdf import has_spectral_materials
from mi_lcair.plugins.columns.exploring import needs_exploring
from mi_lcair.plugins.columns.kinds import MaterialColumn, SourceColumn
from mi_lcair.plugins.columns.tables import (
    CELLS,
    SIZES,
    ColumnTables,
    column_tables,
    incoming_radiance,
    pilot_launch,
)
from mi_lcair.plugins.emission.sources import spectra
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.parameters.entries import DIFFERENCED, SCALED, StoredParameter
from mi_lcair.rendering.parameters.values import parameters_named

MOST_COLUMNS = SIZES[-1]  # columns of one render


def columns_of(scene, names) -> dict[str, MaterialColumn | SourceColumn]:
    """The columns of parameters by name, those of materials first.

    Raises InputError if a name is unknown, or if a column would have no derivative.
    """
    entries = sorted(parameters_named(scene, names), key=lambda entry: entry.kind != "material")
    return {entry.name: column_of(entry) for entry in entries}


def explored_by(columns) -> frozenset:
    """The surfaces that a render of these columns has to explore, see `exploring`."""
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


def of_plumes(scene, names) -> set[str]:
    """Parameters of plumes. What a plume hides of a background changes with them, too."""
    entries = parameters_named(scene, names)
    return {e.name for e in entries if any(is_plume(stored.node) for stored in e.stored)}


def without_column(scene, names) -> set[str]:
    """Parameters for which paths do not give the whole derivative of a number."""
    return {*by_difference(scene, names), *of_plumes(scene, names)}


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
