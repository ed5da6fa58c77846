"""Temperatures of single facets of a loaded scene: read them, and set them for a while."""

from contextlib import contextmanager

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import members, own_memory
from mi_lcair.plugins.emitters.thermal_emitter import thermal_shapes
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.parameters.entries import set_arrays
from mi_lcair.rendering.scene import Scene


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
