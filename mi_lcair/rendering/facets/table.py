"""Numbered table of the facets of a scene, and the facet's number for a hit."""

from collections import defaultdict

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import children, members
from mi_lcair.plugins.emission.source import OTHER
from mi_lcair.plugins.emission.triangles import (
    ABSENT,
    PrimitiveTable,
    is_faceted,
    pointer_id,
    triangle_vertices,
    vertex_positions,
)
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, groups_of, is_thermal
from mi_lcair.rendering.scene import Scene


class FacetTable:
    """Facets of a loaded scene, numbered from 0 to count - 1.

    A facet is a polygon of the model: all triangles of a mesh with the same value of the mesh
    attribute `face_facet`. In a mesh without that attribute each triangle is a facet. A shape that
    is not a mesh is one facet.

    Meshes with `face_facet` whose ids begin with the same `MODEL.` are parts of one model. Their
    facets are numbered together, from 0 within the model. Models and other shapes are numbered one
    after another, in the scene's order. A number without a triangle is a facet of area 0.

    Raises InputError for invalid values of `face_facet`, and for a facet whose triangles have
    different temperatures.

    Attributes
    ----------
    count : int
    shape_index : (count,)
        Index of the scene's shape; -1 for a facet without triangles.
    type : (count,)
        "model", "sky" or "terrain".
    group : (count,)
        Label of the emitter, or "other".
    material : (count,)
        Name of the material, or the class of the BSDF if it has no name.
    temperature : (count,)
        Temperature of the facet [K]; NaN if it has none.
    area : (count,)
        Area [m^2].
    normal, centre : (count, 3)
        Unit normal, and centre of area [m]; NaN for a shape that is not a mesh.
    triangles : (T, 3, 3)
        Corners of all triangles [m], anticlockwise about the normal.
    triangle_facet : (T,)
        Number of each triangle's facet.
    of_primitives : dict of mi.Shape to ndarray
        Number of the facet of each primitive of a shape.
    """

    def __init__(self, scene: Scene):
        shapes = list(scene.mi.shapes())
        if not shapes:
            raise InputError(f"{scene.name}: has no shapes, and therefore no facets")
        corners, local = zip(*(triangles(shape) for shape in shapes))
        blocks, first, self.count = defaultdict(list), np.zeros(len(shapes), dtype=np.int64), 0
        for index, shape in enumerate(shapes):
            blocks[block_of(index, shape)].append(index)
        for block in blocks.values():
            check_apart({shapes[index].id(): local[index] for index in block})
            first[block] = self.count
            self.count += 1 + max(int(local[index].max()) for index in block)
        of_primitive = [numbers + offset for numbers, offset in zip(local, first)]
        self.of_primitives = dict(zip(shapes, of_primitive))

        self.triangles = np.concatenate(corners)
        self.triangle_facet = np.concatenate(
            [numbers[: len(points)] for numbers, points in zip(of_primitive, corners)]
        )
        self._describe(shapes, of_primitive)
        self._measure()
        for shape, points, facets in zip(shapes, corners, of_primitive):
            if not len(points):
                self.area[facets] = area_of(shape)

        keys = [pointer_id(mi.ShapePtr(shape)) for shape in shapes]
        self._numbers = PrimitiveTable(keys, of_primitive, ABSENT)

    def number(self, shape, prim_index, active=True) -> mi.UInt32:
        """The number of the facet of a hit; ABSENT (2^32 - 1) if there is no hit.

        shape: pointer to the shape that was hit; prim_index: its primitive.
        """
        return self._numbers.at(shape, prim_index, active)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each facet: its number, what it is, its temperature and its area."""
        return {
            "facet": np.arange(self.count),
            "type": self.type,
            "group": self.group,
            "material": self.material,
            "temperature_K": self.temperature,
            "area_m2": self.area,
        }

    def _describe(self, shapes, of_primitive) -> None:
        """Set shape, type, group, material and temperature of each facet."""
        self.shape_index = np.full(self.count, -1)
        self.temperature = np.full(self.count, np.nan)
        self.type, self.group, self.material = (
            np.full(self.count, text, dtype=object) for text in ("model", OTHER, "")
        )
        for index, (shape, facets) in enumerate(zip(shapes, of_primitive)):
            self.shape_index[facets] = index
            self.material[facets] = material_of(shape.bsdf())
            emitter = shape.emitter()
            self.group[facets], self.type[facets] = groups_of(emitter)[0], facet_type_of(emitter)
            if is_thermal(emitter):
                known = emitter.temperatures()
                temperatures = np.broadcast_to(np.nan if known is None else known, len(facets))
                self.temperature[facets] = temperatures
                differs = (self.temperature[facets] != temperatures) & np.isfinite(temperatures)
                if differs.any():
                    of_facet = temperatures[facets == facets[differs.argmax()]]
                    raise InputError(
                        f"shape '{shape.id()}': the triangles of one facet have different "
                        f"temperatures, {of_facet.min():g} to {of_facet.max():g} K; triangles with "
                        "the same face_facet must have the same face_temperature"
                    )

    def _measure(self) -> None:
        """Set area, normal and centre of each facet, from its triangles."""

        def total(vectors):
            sums = [np.bincount(self.triangle_facet, axis, self.count) for axis in vectors.T]
            return np.stack(sums, axis=-1)

        p0, p1, p2 = np.moveaxis(self.triangles, 1, 0)
        vector = 0.5 * np.cross(p1 - p0, p2 - p0)
        area = np.linalg.norm(vector, axis=1, keepdims=True)
        normal, weighted = total(vector), total((p0 + p1 + p2) / 3 * area)
        self.area = total(area)[:, 0].astype(float)
        with np.errstate(invalid="ignore"):
            self.normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            self.centre = weighted / self.area[:, None]


def triangles(shape) -> tuple[np.ndarray, np.ndarray]:
    """Corners (T, 3, 3) of a shape's triangles [m], in Float64, and their facets' numbers (T,).

    A shape that is not a mesh has no corners and the one facet 0.
    """
    if not is_faceted(shape):
        return np.empty((0, 3, 3)), np.zeros(1, np.int64)
    buffers = members(shape)
    vertices, faces = vertex_positions(shape), triangle_vertices(shape)
    corners = vertices[faces[:, [0, 2, 1]] if shape.has_flipped_normals() else faces].astype(
        np.float64
    )
    if "face_facet" not in buffers:
        return corners, np.arange(len(faces))
    number = buffers["face_facet"].numpy()
    bad = ~((number >= 0) & (number == np.round(number)))
    if bad.any():
        raise InputError(
            f"shape '{shape.id()}': face_facet = {number[bad][0]:g} must be a whole number "
            "from 0 on"
        )
    return corners, number.astype(np.int64)


def block_of(index: int, shape):
    """Key of the shapes that are numbered together: the name of a model, or the shape's index."""
    model, dot, _ = shape.id().partition(".")
    return model if dot and "face_facet" in members(shape) else index


def check_apart(numbers: dict) -> None:
    """Raise InputError for a facet that is in two shapes of one model.

    numbers: facets of the triangles of each shape, by the shape's id.
    """
    owner = {}
    for name, facets in numbers.items():
        for number in np.unique(facets).tolist() if len(numbers) > 1 else ():
            if owner.setdefault(number, name) != name:
                raise InputError(
                    f"shapes '{owner[number]}' and '{name}' both have facet {number} of their "
                    "model; face_facet must be another number in each"
                )


def material_of(bsdf) -> str:
    """Name of the material of a BSDF or of one that it wraps; the BSDF's class if there is none."""
    layers = [b for b in (bsdf, *children(bsdf)) if is_reflection_bsdf(b) or is_plume(b)]
    names = [layer.material for layer in layers if layer.material]
    # Mitsuba's class_name() is "BSDF" for every plugin that is written in Python
    python_name = type(bsdf).__name__
    return names[0] if names else bsdf.class_name() if python_name == "BSDF" else python_name


def area_of(shape):
    """Surface area of a shape that is not a mesh [m^2].

    NaN for shapes whose area Mitsuba cannot compute, such as curves.
    """
    try:
        return np.ravel(shape.surface_area()).astype(float)
    except RuntimeError:
        return np.full(1, np.nan)
