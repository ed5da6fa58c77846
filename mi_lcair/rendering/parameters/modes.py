"""Modes: patterns of facet temperatures, whose amplitudes are parameters of a scene.

A file of modes is a CSV facet,kelvin,by_NAME_K,... as `mi-lcair heat` writes it. A scene that is
loaded with it has its temperatures, and for each column `by_NAME_K` the parameter `heat.NAME`. For
an amplitude a of it, the temperatures are a times the column higher. The columns of `heat` are the
changes for one standard uncertainty of an input, so that a is its error in standard uncertainties.
"""

from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike

import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import members, own_memory
from mi_lcair.plugins.emitters.thermal_emitter import thermal_shapes
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.parameters.entries import SingleNumber, StoredNumbers, set_arrays
from mi_lcair.rendering.scene import Scene
from mi_lcair.table import read_table

# Temperatures of single facets of a loaded scene: read them, and set them for a while
# ------------------------------------------------------------------------------------


def facet_temperatures(scene: Scene, groups) -> dict[str, dict[int, float]]:
    """Temperatures [K] of the facets of some groups, as {group: {facet: K}}.

    A group that the scene does not have, or without temperatures, is left out.
    """
    if not groups:
        return {}
    table = FacetTable(scene)
    known = {}
    for group in groups:
        is_known = (table.group == group) & np.isfinite(table.temperature) & (table.area > 0)
        if is_known.any():
            facets = np.flatnonzero(is_known)
            known[group] = dict(zip(facets.tolist(), table.temperature[facets].tolist()))
    return known


def set_facets(scene: Scene, kelvin: dict[int, float]) -> dict:
    """Set temperatures of facets; returns those before, as `set_arrays` takes them.

    Raises InputError for a facet whose emitter has one temperature for the whole shape.
    """
    before, after = {}, {}
    for shape, numbers in facets_of_shapes(scene):
        emitter = shape.emitter()
        wanted = np.array([kelvin.get(int(number), np.nan) for number in numbers])
        if np.isnan(wanted).all():
            continue
        if not emitter.attribute or emitter.attribute not in members(shape):
            raise InputError(
                f"group {emitter.group}: its emitter has one temperature for all facets; give it "
                "a temperature per facet (face_temperature)"
            )
        place = shape, emitter.attribute
        before[place] = mi.Float(mi.traverse(shape)[emitter.attribute])
        after[place] = mi.Float(np.where(np.isnan(wanted), before[place].numpy(), wanted))
    own_memory(after.values())
    set_arrays(after)
    return before


@contextmanager
def with_facets(scene: Scene, kelvin: dict[int, float]):
    """Context manager in which facets have other temperatures."""
    before = set_facets(scene, kelvin) if kelvin else {}
    try:
        yield
    finally:
        set_arrays(before)


def facets_of_shapes(scene: Scene):
    """(shape, number of the facet of each of its primitives) of all emitting shapes."""
    numbers = FacetTable(scene).of_primitives
    return [(shape, numbers[shape]) for shape in thermal_shapes(scene.mi)]


MODES = "modes"  # among the values of a scene's parameters, a file of modes
HEAT, BEFORE, AFTER = "heat", "by_", "_K"  # owner of the names, and the ends of a column's name


@dataclass(frozen=True, kw_only=True)
class TemperatureModes:
    """The modes of a scene.

    loaded: temperatures of the primitives of each shape without modes [K]. changes: {name: {shape:
    change of its primitives for an amplitude of 1}} [K].
    """

    loaded: dict
    changes: dict[str, dict]

    def values(self) -> dict[str, float]:
        """The present amplitudes, which least squares give from the temperatures."""
        columns = [np.concatenate([*of.values()]) for of in self.changes.values()]
        now = [temperatures_of(shape).read() - kelvin for shape, kelvin in self.loaded.items()]
        amplitudes = np.linalg.lstsq(np.stack(columns, axis=1), np.concatenate(now))[0]
        return dict(zip(self.changes, amplitudes.tolist()))


@dataclass(frozen=True, kw_only=True)
class ModeAmplitude(SingleNumber):
    """The amplitude of a mode. changes: of the primitives of each shape for a value of 1 [K]."""

    changes: dict
    upper: float = 100.0
    lower: float = -100.0

    def moved(self, value: float) -> list[np.ndarray]:
        step = value - self.value
        return [stored.read() + step * self.changes[stored.node] for stored in self.stored]


def temperatures_of(shape) -> StoredNumbers:
    """The temperatures of a shape's primitives."""
    return StoredNumbers(shape, shape.emitter().attribute, None, np.ones(1))


def declare_modes(scene: Scene, path: str | PathLike[str]) -> None:
    """Give a scene the temperatures of a file, and its modes as parameters.

    Raises InputError for a file without modes, for a facet that the scene does not have, and for
    emitters without a temperature for each facet.
    """
    table = read_table(path, ("facet", "kelvin"), MODES)
    columns = [name for name in table.columns if name.startswith(BEFORE) and name.endswith(AFTER)]
    if not columns:
        raise InputError(f"{MODES} {path}: has no column {BEFORE}NAME{AFTER}")
    numbers = table.numbers(("facet", "kelvin", *columns))
    table.check_range("kelvin", numbers["kelvin"], Bounds(lower=1, upper=1e5))
    facets = numbers["facet"].astype(int).tolist()
    set_facets(scene, dict(zip(facets, numbers["kelvin"].tolist())))
    row = {facet: number for number, facet in enumerate(facets)}
    rows = {}
    for shape, of_primitives in facets_of_shapes(scene):
        known = np.array([row.get(int(facet), -1) for facet in of_primitives])
        if (known >= 0).any():
            rows[shape] = known
    if not rows:
        raise InputError(f"{MODES} {path}: {scene.name} has none of its facets")
    changes = {
        HEAT + "." + name[len(BEFORE) : -len(AFTER)]: {
            shape: np.where(known >= 0, numbers[name][known], 0) for shape, known in rows.items()
        }
        for name in columns
    }
    loaded = {shape: temperatures_of(shape).read() for shape in rows}
    scene.moved[MODES] = TemperatureModes(loaded=loaded, changes=changes)


def modes_of(scene: Scene) -> Mapping[str, ModeAmplitude]:
    """The modes of a scene by name; none if it has none."""
    patterns = scene.moved.get(MODES)
    if patterns is None:
        return {}
    values = patterns.values()
    return {
        name: ModeAmplitude(
            name, "mode", list(map(temperatures_of, of)), value=values[name], changes=of, sigma=1.0
        )
        for name, of in patterns.changes.items()
    }
