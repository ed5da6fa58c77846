"""Where paths begin on the facets of a model that moves."""

import mitsuba as mi
import numpy as np

from mi_lcair.motions.motion import model_shapes
from mi_lcair.motions.pose import moved
from mi_lcair.plugins.emission.radiance_bound import radiance_bound
from mi_lcair.plugins.emission.triangles import Choice, is_faceted, triangle_corners
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.rendering.window import window, window_size

# Shares of the paths that begin on facets by their projected area, because a cold facet may reflect
# much, by projected area times radiance, and by the change of the latter between the poses
SHARES = 0.3, 0.3, 0.4
TINY = 1e-6  # parts of the window, and of its area, below which nothing moves or is seen


def meshes_of_model(scene) -> list[mi.Shape] | None:
    """The meshes of a scene's model; None if a part of the model is no mesh."""
    model = model_shapes(scene)
    return model if model and all(map(is_faceted, model)) else None


def starts_in(scene, sensor, poses: list[dict]) -> list[FacetStarts]:
    """Starts on the facets of a scene's model in several poses, with the same probabilities.

    Parameters
    ----------
    scene : Scene
        Scene whose model consists of meshes.
    sensor : mitsuba.Sensor
        An orthographic sensor.
    poses : list of dict
        Values of motions by name.
    """
    meshes = meshes_of_model(scene)
    radiance = np.concatenate([radiances(mesh) for mesh in meshes])
    outlines, areas = [], []
    for pose in poses:
        with moved(scene, pose):
            of_pose, visible = zip(*(outline(mesh, sensor) for mesh in meshes))
        outlines.append(of_pose)
        areas.append(np.concatenate(visible))
    area = np.max(areas, axis=0)
    parts = area, area * radiance, np.ptp(areas, axis=0) * radiance
    choice = Choice(sum(k * part / part.sum() for k, part in zip(SHARES, parts) if part.any()))
    return [FacetStarts.at(meshes, of_pose, choice) for of_pose in outlines]


def moves_in_view(scene, sensor, poses: list[dict]) -> bool:
    """Whether a triangle that a sensor can see differs between two poses; others as above."""
    outlines = []
    for pose in poses:
        with moved(scene, pose):
            of_pose, visible = zip(*(outline(mesh, sensor) for mesh in meshes_of_model(scene)))
        shown = np.concatenate(visible) > TINY * np.prod(window_size(sensor))
        outlines.append(np.concatenate(of_pose) * shown[:, None, None])
    return bool(np.abs(outlines[0] - outlines[1]).max() > TINY)


def outline(mesh: mi.Shape, sensor) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3, 2) of a mesh's triangles in parts of the window, and visible areas (n,).

    The visible area is the projected one, or 0 for a triangle that shows a side from which its
    surface neither emits nor reflects.
    """
    corner, right, up, direction = window(sensor)
    corners = np.stack(triangle_corners(mesh), axis=1).astype(float)
    axes = np.stack([right / (right @ right), up / (up @ up)], axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    toward = -(normal @ direction) * (-1 if mesh.has_flipped_normals() else 1)
    flags = mesh.bsdf().flags()
    sides = [mi.has_flag(flags, side) for side in (mi.BSDFFlags.BackSide, mi.BSDFFlags.FrontSide)]
    shows = np.where(toward > 0, sides[1], sides[0])
    return (corners - corner) @ axes, 0.5 * np.abs(toward) * shows


def radiances(mesh: mi.Shape) -> np.ndarray:
    """Upper bound of the radiance of each triangle of a mesh, (n,); 0 where it is not known."""
    count, emitter = len(triangle_corners(mesh)[0]), mesh.emitter()
    bound = None if emitter is None else radiance_bound(emitter)
    return np.zeros(count) if bound is None else np.broadcast_to(bound, count)
