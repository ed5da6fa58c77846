"""Facets of a loaded scene as polygons and as a model."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from itertools import compress
from os import PathLike

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair import formats
from mi_lcair.errors import InputError, shown
from mi_lcair.files import FACET_FILES
from mi_lcair.models3d.model import Model
from mi_lcair.models3d.modellers.naming import Label
from mi_lcair.plugins.bsdfs.plume import is_passed, is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import children, members
from mi_lcair.plugins.emission.draw_table import radiance_bound
from mi_lcair.plugins.emission.emissivity import SIDES, reflects
from mi_lcair.plugins.emission.source import OTHER
from mi_lcair.plugins.emission.triangles import (
    ABSENT,
    Choice,
    PrimitiveTable,
    is_faceted,
    numbers_of_triangles,
    pointer_id,
    triangle_corners,
    triangle_vertices,
    vertex_positions,
)
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of, groups_of, is_thermal
from mi_lcair.plugins.paths.launch import FacetStarts, Offsets, ParallelRays, views_of
from mi_lcair.plugins.paths.sheets import Sheets, nearest_hit
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window, window_axes
from mi_lcair.table import TextTable

# Facets as polygons, put together from their triangles
# -----------------------------------------------------

# `saved_by` of results with facets, whose files `write_vtk` writes
WRITERS = dict.fromkeys(FACET_FILES, f"{__name__}:write_vtk")
PLANAR = 1e-7  # largest relative error of the area for which an outline replaces its triangles


@dataclass(frozen=True)
class FacetPolygons:
    """Polygons of facets.

    vertices: corners (n, 3) [m], in Float64. faces: corners of each polygon, as rows of `vertices`,
    anticlockwise about the facet's normal. facet: number of each polygon's facet. A facet is one
    polygon, or its triangles where no single outline has its area: with holes, in several pieces,
    or out of a plane.
    """

    vertices: np.ndarray
    faces: list[np.ndarray]
    facet: np.ndarray

    @staticmethod
    def of(triangles: np.ndarray, triangle_facet: np.ndarray) -> "FacetPolygons":
        """The polygons of triangles (T, 3, 3) [m] that belong to the facets (T,)."""
        if not len(triangles):
            return FacetPolygons(np.zeros((0, 3)), [], np.zeros(0, np.int64))
        vertices, corners = np.unique(
            np.reshape(triangles, (-1, 3)).astype(np.float64) + 0.0, axis=0, return_inverse=True
        )
        corners = corners.reshape(-1, 3)
        order = np.argsort(triangle_facet, kind="stable")
        numbers, begins = np.unique(triangle_facet[order], return_index=True)
        faces, facet = [], []
        for number, of_facet in zip(numbers, np.split(order, begins[1:])):
            polygons = (
                [corners[of_facet[0]]]
                if len(of_facet) == 1
                else _merged(vertices, corners[of_facet])
            )
            faces += polygons
            facet += [number] * len(polygons)
        return FacetPolygons(vertices, faces, np.array(facet, dtype=np.int64))

    def write(self, path: str | PathLike[str], columns: dict[str, np.ndarray]) -> None:
        """Write the polygons as a file of FACET_FILES with the columns of a table of facets.

        columns: `facet`, the number of each row's facet, and others by name with the unit. Facets
        without a row are left out. Raises InputError as `formats.write_facets`.
        """
        row = {facet: place for place, facet in enumerate(columns["facet"].tolist())}
        listed = [facet in row for facet in self.facet.tolist()]
        faces = list(compress(self.faces, listed))
        places = np.array([row[facet] for facet in self.facet[listed].tolist()], dtype=np.int64)
        cells = {name: values[places] for name, values in columns.items()}
        formats.write_facets(path, self.vertices, faces, cells)


def write_vtk(path: str | PathLike[str], facets) -> None:
    """Write facets with all columns of their table as a file of FACET_FILES.

    facets: what has `triangles`, `triangle_facet` and `columns`, such as a FacetTable.
    """
    FacetPolygons.of(facets.triangles, facets.triangle_facet).write(path, facets.columns())


def _merged(vertices: np.ndarray, triangles: np.ndarray) -> list[np.ndarray]:
    """The outline of some triangles (n, 3) as one polygon, or the triangles themselves."""
    loop = _outline(triangles.tolist())
    if loop is None:
        return list(triangles)
    # A polygon that is not quite planar has an area only with its triangles. Programs split a
    # polygon into a fan about its first corner, so that is the corner that most triangles share.
    corner, shared = np.unique(triangles, return_counts=True)
    start = loop.index(corner[shared.argmax()])
    loop = np.array(loop[start:] + loop[:start])
    area_of_triangles = np.linalg.norm(normals_of(vertices[triangles]), axis=1).sum()
    fan = normals_of(
        vertices[np.stack([np.full(len(loop) - 2, loop[0]), loop[1:-1], loop[2:]], axis=1)]
    )
    # The first holds for concave outlines too, the second also out of a plane
    for area in (np.linalg.norm(fan.sum(axis=0)), np.linalg.norm(fan, axis=1).sum()):
        if abs(area - area_of_triangles) <= PLANAR * area_of_triangles:
            return [loop]
    return list(triangles)


def _outline(triangles: list[list[int]]) -> list[int] | None:
    """Corners along the only outline of some triangles; None if there is no such outline."""
    following = {}
    edges = {(a, b) for p in triangles for a, b in zip(p, (*p[1:], p[0])) if a != b}
    for a, b in edges:
        if (b, a) not in edges:
            if a in following:
                return None
            following[a] = b
    if not following:
        return None
    loop = [next(iter(following))]
    while (corner := following.get(loop[-1])) not in (None, loop[0]):
        loop.append(corner)
        if len(loop) > len(following):
            return None
    return loop if len(loop) == len(following) > 2 else None


def normals_of(triangles: np.ndarray) -> np.ndarray:
    """Normals of triangles (n, 3, 3) whose lengths are twice their areas."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


# Where paths of a window begin on the facets of a scene's model, and more on those that emit more
# ------------------------------------------------------------------------------------------------
# What the sensor sees of a facet is then drawn with a known probability, however small it is.

# Rays along each side of a window, and of one of many windows, that find what is seen
RAYS, RAYS_OF_MANY = 1024, 64
HIDDEN = 0.1  # least share of a triangle that counts as seen
MOST_STARTS = 2**22  # triangles of all windows together, which take about 100 bytes each


def meshes_of_model(scene) -> list[mi.Shape] | None:
    """The meshes of a scene's model; None if a part of the model is no mesh."""
    model = model_shapes(scene)
    return model if model and all(map(is_faceted, model)) else None


def background_meshes(scene) -> list[mi.Shape]:
    """The meshes of a scene that are no part of its model: sky and terrain."""
    of_model = model_shapes(scene)
    return [shape for shape in scene.mi.shapes() if shape not in of_model and is_faceted(shape)]


def starts_on_facets(scene, sensor, brightest: float) -> FacetStarts | None:
    """Starts on the facets of a scene's model that emit, in the window of an orthographic sensor.

    The sensor may be a batch of them, with a window each. None if a part of the model is no mesh,
    if there are too many triangles, or if a sensor sees no facet that emits. brightest: bound of
    the radiance of all emitters [W m^-2 sr^-1].
    """
    meshes, views = meshes_of_model(scene), views_of(sensor)
    if meshes is None:
        return None
    counts = [len(triangle_vertices(mesh)) for mesh in meshes]
    if len(views) * sum(counts) > MOST_STARTS:
        return None
    corners, area = in_view(meshes, sensor)
    # What lies behind a surface that is passed is seen as well
    passes = np.repeat([is_passed(mesh.bsdf().flags()) for mesh in meshes], counts)
    direct = radiances(meshes) + passes * brightest
    emitted = area * direct * seen_shares(scene, sensor, area)
    if not emitted.any(axis=1).all():
        return None
    return FacetStarts.at(meshes, corners, area, Choice(emitted), direct)


def mixed_choice(shares, parts) -> Choice:
    """What draws a triangle: shares of the paths follow parts (n,), or all triangles without any.

    shares: of the paths, one for each part. A part that is 0 everywhere gets none.
    """
    weights = sum(k * part / part.sum() for k, part in zip(shares, parts) if part.any())
    return Choice(weights if np.any(weights) else np.ones_like(parts[0]))


def seen_shares(scene, sensor, area: np.ndarray) -> np.ndarray:
    """Share of each of the model's triangles that sensors see, about, at least HIDDEN.

    Rays through cells of each window are counted by what they hit first. A triangle that is smaller
    than a cell counts as seen.

    sensor: an orthographic sensor, or a batch of them. area: visible areas of the triangles in
    parts of each window's area, (windows, n), the shape of the shares.
    """
    windows, count = area.shape
    rays, triangles = ParallelRays.of(sensor), numbers_of_triangles(meshes_of_model(scene))
    side = RAYS if windows == 1 else RAYS_OF_MANY
    index = dr.arange(mi.UInt32, windows * side**2)
    window_of_ray, cell = index // side**2, index % side**2
    position = (mi.Point2f(cell % side, cell // side) + 0.5) / side
    # Opaque numbers, so that one kernel serves all sensors and models
    of_sensor, size = dr.opaque(mi.UInt32, windows), dr.opaque(mi.UInt32, 1 + count)
    ray = rays.at(window_of_ray, mi.UInt32(0), position, of_sensor, mi.UInt32(1))
    hit = nearest_hit(scene.mi, Sheets.of(scene.mi), ray, coherent=True)
    triangle = triangles.at(hit.shape, hit.prim_index, hit.is_valid())
    counts = dr.zeros(mi.UInt32, windows * (1 + count))
    dr.scatter_add(counts, mi.UInt32(1), window_of_ray * size + triangle)
    hits = counts.numpy().reshape(windows, -1)[:, 1:]
    return np.clip((hits + 0.5) / (area * side**2 + 0.5), HIDDEN, 1.0)


def in_view(meshes, sensor) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 3) [m] and visible areas (views, n) of the triangles of meshes.

    The visible area is the projected one in parts of the window's area, or 0 for a triangle that
    shows a side from which its surface neither emits nor reflects. The sensor is an orthographic
    one, or a batch of them.
    """
    corners = np.concatenate([np.stack(triangle_corners(mesh), axis=1) for mesh in meshes])
    faces, (back, front) = facings(meshes)
    views = views_of(sensor)
    toward = faces * np.array([projected(corners.astype(float), view) for view in views])
    return corners, np.abs(toward) * np.where(toward > 0, front, back)


def projected(corners: np.ndarray, sensor) -> np.ndarray:
    """Areas (n,) of triangles (n, 3, 3) [m] in parts of the window's area.

    An area is negative if the triangle's corners are clockwise as the sensor sees them.
    """
    corner, axes = window_axes(sensor)
    direction = window(sensor)[-1]
    # A product of one long array is much faster than one of many short ones
    places = (np.reshape(corners - corner, (-1, 3)) @ axes).reshape(*corners.shape[:2], 2)
    (x, y), (v, w) = (places[:, k].T - places[:, 0].T for k in (1, 2))
    return (y * v - x * w) * np.sign(np.cross(*axes.T) @ direction) / 2


def facings(meshes) -> tuple[np.ndarray, np.ndarray]:
    """Whether triangles' normals point to where their corners are anticlockwise: 1 or -1, (n,).

    Also, whether they emit or reflect from their backs, and from their fronts, (2, n): 1 or 0.
    """
    sides, of_meshes = (mi.BSDFFlags.BackSide, mi.BSDFFlags.FrontSide), []
    for mesh in meshes:
        shown = [float(mi.has_flag(mesh.bsdf().flags(), side)) for side in sides]
        of_meshes.append([-1.0 if mesh.has_flipped_normals() else 1.0, *shown])
    counts = [len(triangle_vertices(mesh)) for mesh in meshes]
    facing, *shown = np.repeat(of_meshes, counts, axis=0).T
    return facing, np.array(shown)


def radiances(meshes) -> np.ndarray:
    """Upper bound of the radiance of each triangle of meshes, (n,); 0 where it is not known."""
    bounds = []
    for mesh in meshes:
        emitter = mesh.emitter()
        bound = None if emitter is None else radiance_bound(emitter)
        bounds.append(
            np.broadcast_to(0.0 if bound is None else bound, len(triangle_vertices(mesh)))
        )
    return np.concatenate(bounds)


# Numbered table of the facets of a scene, and the facet's number for a hit
# -------------------------------------------------------------------------


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

    def of_hit(self, pi) -> mi.UInt32:
        """The number of the facet of a preliminary hit. Each instance of a group is one facet."""
        shape, placed = (dr.reinterpret_array(mi.UInt32, part) for part in (pi.shape, pi.instance))
        return self.number(dr.select(placed > 0, placed, shape), pi.prim_index, pi.is_valid())

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


# Images of a facet table: each pixel gets a column's value for the facet that it shows
# -------------------------------------------------------------------------------------

FACET = "facet"  # the column of facet numbers


def by_facet(table: TextTable, name: str, count: int) -> np.ndarray:
    """Values of a column by facet number, (count,); NaN for a facet without a row or value.

    The table needs a column `facet`. Raises InputError, with the line, for a facet that is not one
    of `count` or has two rows, and for a cell that is no number.
    """
    columns = table.numbers([FACET, name], may_lack=True)
    facet = columns[FACET]
    bad = ~((facet >= 0) & (facet < count) & (facet == np.round(facet)))
    if bad.any():
        line, cells = table.rows[bad.argmax()]
        raise InputError(
            f"{table.file}, line {line}: facet "
            f"{shown(cells[table.columns.index(FACET)])} is not in the scene, "
            f"whose facets are numbered from 0 to {count - 1}"
        )
    numbers, rows = np.unique(facet, return_counts=True)
    if rows.max() > 1:
        raise InputError(
            f"{table.file}: facet {numbers[rows.argmax()]:g} has {rows.max()} rows; "
            "it must have one"
        )
    values = np.full(count, np.nan)
    values[facet.astype(int)] = columns[name]
    return values


def seen_facets(scene: Scene, facets: FacetTable, sensor: int = 0) -> np.ndarray:
    """Number of the facet that each pixel of a sensor shows, (H, W); -1 where there is none.

    The facet is the one that the ray through the pixel's centre hits.
    """
    ray, shape = pixel_rays(scene.sensor(sensor))
    hit = nearest_hit(scene.mi, Sheets.of(scene.mi), ray, coherent=True)
    return facets.of_hit(hit).numpy().astype(np.int32).reshape(shape)


def pixel_rays(camera) -> tuple[mi.Ray3f, tuple[int, int]]:
    """Rays through the pixels' centres, row by row, and the film's (height, width)."""
    width, height = camera.film().crop_size()
    row, column = np.indices((height, width)).reshape(2, -1)
    position = mi.Point2f((column + 0.5) / width, (row + 0.5) / height)
    ray, _ = camera.sample_ray(camera.shutter_open(), 0, position, mi.Point2f(0.5))
    return ray, (height, width)


def facet_images(scene: Scene, table: TextTable, names, sensor: int = 0) -> dict[str, np.ndarray]:
    """Images of some columns of a facet table, as a sensor sees the facets.

    Parameters
    ----------
    scene : Scene
    table : TextTable
        Table with a column `facet`.
    names : iterable of str
        Columns to show.
    sensor : int
        Number of the sensor, counted from 0.

    Returns
    -------
    dict
        An image (H, W) for each name; NaN where there is no facet or no value.
    """
    facets = FacetTable(scene)
    columns = {name: by_facet(table, name, facets.count) for name in names}
    seen = seen_facets(scene, facets, sensor)
    return {name: np.where(seen >= 0, values[seen], np.nan) for name, values in columns.items()}


# The facets of a loaded scene as a model, for pictures and files of its geometry
# -------------------------------------------------------------------------------

TYPES = {"model": "f", "sky": "s", "terrain": "t"}  # letters of labels


def model_of(scene: Scene) -> Model:
    """The facets of a scene's meshes as a `Model`, in the scene's axes.

    Shapes that are not meshes have no facets. Raises InputError if the scene has no mesh.
    """
    table = FacetTable(scene)
    if not len(table.triangles):
        raise InputError(f"{scene.name}: has no mesh that could be drawn")
    vertices, corners = np.unique(table.triangles.reshape(-1, 3), axis=0, return_inverse=True)
    numbers, facet = np.unique(table.triangle_facet, return_inverse=True)
    kinds = [(TYPES[table.type[k]], str(table.material[k]), str(table.group[k])) for k in numbers]
    order = np.argsort(facet, kind="stable")
    labels = list(dict.fromkeys(kinds))
    place = {kind: number for number, kind in enumerate(labels)}
    return Model(
        vertices=vertices,
        corners=corners.reshape(-1, 3)[order].ravel(),
        first=3 * np.searchsorted(facet[order], np.arange(len(numbers) + 1)),
        labels=[Label(kind, material, None, group) for kind, material, group in labels],
        label=np.array([place[kind] for kind in kinds]),
        temperature=table.temperature[numbers],
        triangles=corners.reshape(-1, 3),
        triangle_facet=facet,
        off_plane=np.zeros(len(numbers)),
    )


# Steps from facet to facet, for paths that the walk cannot follow
# ----------------------------------------------------------------
# The walk follows light from the observer, in the band of the scene, and sums radiance. Heat
# exchange needs the scene's surfaces in other bands, and notes every facet that absorbs. The energy
# audit follows light forward, with the two directions of a BRDF swapped, and splits the flux at
# each hit.


@dataclass(frozen=True, eq=False)
class Radiator:
    """A BSDF and its emissivity; equal BSDFs of a scene share one.

    emissivity: a function of an interaction and of `active`. mode: Radiance for paths against the
    light, Importance for paths with it.
    """

    bsdf: mi.BSDF
    emissivity: Callable[..., mi.Float]
    mode: mi.TransportMode = mi.TransportMode.Radiance

    @property
    def sides(self) -> tuple[int, ...]:
        """The sides that emit: 1 in front, -1 behind."""
        return tuple(side for side, flag in SIDES if self.bsdf.flags() & int(flag))

    def respond(self, si, u, v, active):
        """What `FacetTracer.respond` returns, for hits of this surface."""
        bs, weight = self.bsdf.sample(mi.BSDFContext(self.mode), si, u, v, active)
        has_side = reflects(int(self.bsdf.flags()), si.wi.z)
        return has_side, mi.Float(self.emissivity(si, active)), bs.wo, weight[0]


class FacetTracer:
    """Traces rays through a scene, step by step.

    table: the facets of the scene. surfaces: the different surfaces. of_shape: index of the surface
    of each shape.
    """

    def __init__(self, scene, table: FacetTable, surfaces: list[Radiator], of_shape: list[int]):
        self.scene, self.table, self.surfaces = scene.mi, table, surfaces
        self.name, self.offsets, self.sheets = scene.name, Offsets(scene.mi), Sheets.of(scene.mi)
        self.ids = [pointer_id(mi.ShapePtr(shape)) for shape in scene.mi.shapes()]
        of_pointer = np.zeros(max(self.ids) + 1, dtype=np.uint32)
        of_pointer[self.ids] = of_shape
        self.surface_of = mi.UInt32(of_pointer)
        dr.eval(self.surface_of)

    def meet(self, ray, active=True) -> tuple[mi.SurfaceInteraction3f, mi.UInt32]:
        """What rays hit, and the number of its facet; ABSENT (2^32 - 1) if there is no hit."""
        pi = nearest_hit(self.scene, self.sheets, ray, active=active)
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
        return si, self.table.number(si.shape, si.prim_index, si.is_valid())

    def respond(self, si, active, u=0.5, v=0.5):
        """Emissivity of the surfaces at hits toward `si.wi`, and a direction with its weight.

        Before them comes whether the surface has this side. u, v: random numbers for the direction,
        in which the path goes on.
        """
        targets = [surface.respond for surface in self.surfaces]
        arguments = si, mi.Float(u), mi.Point2f(v), active
        if len(targets) == 1:
            return targets[0](*arguments)
        pointer = dr.reinterpret_array(mi.UInt32, si.shape)
        surface = dr.gather(mi.UInt32, self.surface_of, pointer, active)
        return dr.switch(surface, targets, *arguments)

    def leave(self, si, d) -> mi.Ray3f:
        """The ray that leaves a surface in a direction of the world."""
        return mi.Ray3f(self.offsets.leave(si, d), d)
