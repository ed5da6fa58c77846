"""Where paths of a window begin on the facets of a scene's model, and more on those that emit more.

What the sensor sees of a facet is then drawn with a known probability, however small it is.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.bsdfs.plume import is_passed
from mi_lcair.plugins.emission.radiance_bound import radiance_bound
from mi_lcair.plugins.emission.triangles import (
    Choice,
    is_faceted,
    numbers_of_triangles,
    triangle_corners,
    triangle_vertices,
)
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.plugins.paths.launch import ParallelRays, views_of
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window, window_axes

# Rays along each side of a window, and of one of many windows, that find what is seen
RAYS, RAYS_OF_MANY = 1024, 64
HIDDEN = 0.1  # least share of a triangle that counts as seen
MOST_STARTS = 2**22  # triangles of all windows together, which take about 100 bytes each


def meshes_of_model(scene) -> list[mi.Shape] | None:
    """The meshes of a scene's model; None if a part of the model is no mesh."""
    model = model_shapes(scene)
    return model if model and all(map(is_faceted, model)) else None


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
    hit = scene.mi.ray_intersect_preliminary(ray, coherent=True)
    triangle = triangles.at(hit.shape, hit.prim_index, hit.is_valid())
    counts = dr.zeros(mi.UInt32, windows * (1 + count))
    dr.scatter_add(counts, mi.UInt32(1), window_of_ray * size + triangle)
    hits = counts.numpy().reshape(windows, 1 + count)[:, 1:]
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
