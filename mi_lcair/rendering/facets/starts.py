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
    pointer_id,
    triangle_corners,
    triangle_vertices,
)
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.rendering.views import model_shapes
from mi_lcair.rendering.window import window, window_size

RAYS = 1024  # rays along each side of the window that find what is seen
HIDDEN = 0.1  # least share of a triangle that counts as seen


def meshes_of_model(scene) -> list[mi.Shape] | None:
    """The meshes of a scene's model; None if a part of the model is no mesh."""
    model = model_shapes(scene)
    return model if model and all(map(is_faceted, model)) else None


def starts_on_facets(scene, sensor, brightest: float) -> FacetStarts | None:
    """Starts on the facets of a scene's model that emit, in the window of an orthographic sensor.

    None if a part of the model is no mesh, or if the sensor sees no facet that emits. brightest:
    bound of the radiance of all emitters [W m^-2 sr^-1].
    """
    meshes = meshes_of_model(scene)
    if meshes is None:
        return None
    corners, area = outlines(meshes, sensor)
    # What lies behind a surface that is passed is seen as well
    passes = np.repeat([is_passed(mesh.bsdf().flags()) for mesh in meshes], list(map(len, corners)))
    direct = radiances(meshes) + passes * brightest
    emitted = area * direct * seen_shares(scene, sensor)
    if not emitted.any():
        return None
    return FacetStarts.at(meshes, corners, area, Choice(emitted), direct)


def seen_shares(scene, sensor) -> np.ndarray:
    """Share of each of the model's triangles that a sensor sees, about, (n,), at least HIDDEN.

    Rays through RAYS x RAYS cells of the window are counted by what they hit first. A triangle that
    is smaller than a cell counts as seen.
    """
    meshes = meshes_of_model(scene)
    areas, cell = outlines(meshes, sensor)[1], RAYS**-2.0
    index = dr.arange(mi.UInt32, RAYS**2)
    position = (mi.Point2f(index % RAYS, index // RAYS) + 0.5) / RAYS
    ray, _ = sensor.sample_ray(0, 0, position, mi.Point2f(0.5))
    hit = scene.mi.ray_intersect_preliminary(ray)
    shape, primitive = dr.reinterpret_array(mi.UInt32, hit.shape).numpy(), hit.prim_index.numpy()
    counts = [
        np.bincount(
            primitive[shape == pointer_id(mi.ShapePtr(mesh))],
            minlength=len(triangle_vertices(mesh)),
        )
        for mesh in meshes
    ]
    share = (np.concatenate(counts) + 0.5) / (areas / cell + 0.5)
    return np.clip(share, HIDDEN, 1.0)


def outlines(meshes, sensor) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Corners of the triangles of each mesh, and visible areas of all, as by `outline`."""
    corners, areas = zip(*(outline(mesh, sensor) for mesh in meshes))
    return corners, np.concatenate(areas)


def outline(mesh: mi.Shape, sensor) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 2) of a mesh's triangles in parts of the window, and visible areas (n,).

    The visible area is the projected one in parts of the window's area, or 0 for a triangle that
    shows a side from which its surface neither emits nor reflects.
    """
    corners, toward = projected(np.stack(triangle_corners(mesh), axis=1).astype(float), sensor)
    toward *= facing(mesh)
    back, front = shown_sides(mesh)
    return corners, np.abs(toward) * np.where(toward > 0, front, back)


def projected(corners: np.ndarray, sensor) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 2) of triangles (n, 3, 3) [m] in parts of the window, and their areas there.

    An area (n,) is negative if the triangle's corners are clockwise as the sensor sees them.
    """
    corner, right, up, direction = window(sensor)
    axes = np.stack([right / (right @ right), up / (up @ up)], axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return (corners - corner) @ axes, -0.5 * (normal @ direction) / np.prod(window_size(sensor))


def facing(mesh: mi.Shape) -> float:
    """1 if the normals of a mesh point to where its corners are anticlockwise, otherwise -1."""
    return -1.0 if mesh.has_flipped_normals() else 1.0


def shown_sides(mesh: mi.Shape) -> tuple[bool, bool]:
    """Whether the surface of a mesh emits or reflects from its back, and from its front."""
    flags = mesh.bsdf().flags()
    return tuple(
        mi.has_flag(flags, side) for side in (mi.BSDFFlags.BackSide, mi.BSDFFlags.FrontSide)
    )


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
