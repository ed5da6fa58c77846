"""Temperatures of single facets of a loaded scene: read them, and set them for a while."""

from contextlib import contextmanager

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import members, own_memory
from mi_lcair.plugins.emission.triangles import is_faceted, triangle_vertices
from mi_lcair.plugins.emitters.thermal_emitter import thermal_shapes
from mi_lcair.rendering.facets.table import FacetTable
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
    """Set temperatures of facets; returns what `restore` needs.

    Raises InputError for a facet whose emitter has one temperature for the whole shape.
    """
    before = {}
    for shape, numbers in facets_of_shapes(scene):
        emitter = shape.emitter()
        wanted = [kelvin.get(int(number)) for number in numbers]
        if not any(value is not None for value in wanted):
            continue
        if not emitter.attribute or emitter.attribute not in members(shape):
            raise InputError(
                f"group {emitter.group}: its emitter has one temperature for all facets; give it "
                "a temperature per facet (face_temperature)"
            )
        parameters = mi.traverse(shape)
        old = mi.Float(parameters[emitter.attribute])
        before[shape] = old
        new = old.numpy().copy()
        for k, value in enumerate(wanted):
            if value is not None:
                new[k] = value
        attribute = mi.Float(new)
        own_memory([attribute])
        parameters[emitter.attribute] = attribute
        parameters.update()
    return before


@contextmanager
def with_facets(scene: Scene, kelvin: dict[int, float]):
    """Context manager in which facets have other temperatures."""
    before = set_facets(scene, kelvin) if kelvin else {}
    try:
        yield
    finally:
        for shape, old in before.items():
            parameters = mi.traverse(shape)
            parameters[shape.emitter().attribute] = old
            parameters.update()


def facets_of_shapes(scene: Scene):
    """(shape, number of the facet of each of its primitives) of all emitting shapes."""
    table = FacetTable(scene)
    for shape in thermal_shapes(scene.mi):
        count = len(triangle_vertices(shape)) if is_faceted(shape) else 1
        numbers = table.number(mi.ShapePtr(shape), dr.arange(mi.UInt32, count))
        yield shape, numbers.numpy().astype(int)
