"""Where paths begin on the facets of a model that moves."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.motions.pose import moved
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

# Shares of the paths that begin on facets by their projected area, because a cold facet may reflect
# much, by projected area times radiance, and by the change of the latter between the poses
SHARES = 0.3, 0.3, 0.4
RAYS = 1024  # rays along each side of the window that find what is seen
HIDDEN = 0.1  # least share of a triangle that counts as seen: a motion may show it
TINY = 1e-6  # parts of the window, and of its area, below which nothing moves or is seen


def meshes_of_model(scene) -> list[mi.Shape] | None:
    """The meshes of a scene's model; None if a part of the model is no mesh."""
    model = model_shapes(scene)
    return model if model and all(map(is_faceted, model)) else None


def seen_shares(scene, sensor) -> np.ndarray:
    """Share of each of the model's triangles that a sensor sees, about, (n,), at least HIDDEN.

    Rays through RAYS x RAYS cells of the window are counted by what they hit first. A triangle that
    is smaller than a cell counts as seen.
    """
    meshes = meshes_of_model(scene)
    projected, cell = np.concatenate([outline(mesh, sensor)[1] for mesh in meshes]), RAYS**-2.0
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
    share = (np.concatenate(counts) + 0.5) / (projected / cell + 0.5)
    return np.clip(share, HIDDEN, 1.0)


def starts_in(scene, sensor, poses: list[dict], seen: np.ndarray) -> list[FacetStarts]:
    """Starts on the facets of a scene's model in several poses, with the same probabilities.

    Parameters
    ----------
    scene : Scene
        Scene whose model consists of meshes.
    sensor : mitsuba.Sensor
        An orthographic sensor.
    poses : list of dict
        Values of motions by name.
    seen : ndarray, shape (n,)
        Share of each triangle that is seen, see `seen_shares`.
    """
    meshes = meshes_of_model(scene)
    radiance = np.concatenate([radiances(mesh) for mesh in meshes])
    outlines, areas = [], []
    for pose in poses:
        with moved(scene, pose):
            of_pose, visible = zip(*(outline(mesh, sensor) for mesh in meshes))
        outlines.append(of_pose)
        areas.append(np.concatenate(visible))
    area, change = np.max(areas, axis=0) * seen, np.ptp(areas, axis=0) * seen
    parts = area, area * radiance, change * radiance
    choice = Choice(sum(k * part / part.sum() for k, part in zip(SHARES, parts) if part.any()))
    return [FacetStarts.at(meshes, *pose, choice) for pose in zip(outlines, areas)]


def moves_in_view(scene, sensor, poses: list[dict]) -> bool:
    """Whether a triangle that a sensor can see differs between two poses; others as above."""
    outlines = []
    for pose in poses:
        with moved(scene, pose):
            of_pose, visible = zip(*(outline(mesh, sensor) for mesh in meshes_of_model(scene)))
        shown = np.concatenate(visible) > TINY
        outlines.append(np.concatenate(of_pose) * shown[:, None, None])
    return bool(np.abs(outlines[0] - outlines[1]).max() > TINY)


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


def radiances(mesh: mi.Shape) -> np.ndarray:
    """Upper bound of the radiance of each triangle of a mesh, (n,); 0 where it is not known."""
    count, emitter = len(triangle_corners(mesh)[0]), mesh.emitter()
    bound = None if emitter is None else radiance_bound(emitter)
    return np.zeros(count) if bound is None else np.broadcast_to(bound, count)
