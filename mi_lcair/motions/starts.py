"""Where paths begin on the facets of a model that moves."""

import numpy as np

from mi_lcair.motions.pose import moved
from mi_lcair.plugins.emission.triangles import Choice
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.rendering.facets.starts import meshes_of_model, outlines, radiances

# Shares of the paths that begin on facets by their projected area, because a cold facet may reflect
# much, by projected area times radiance, and by the change of the latter between the poses
SHARES = 0.3, 0.3, 0.4
# Parts of the window, and of its area, below which nothing moves or is seen. Also the part of an
# area by which rounding may change it.
TINY = 1e-6


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
    radiance, corners, areas = radiances(meshes), *in_poses(scene, sensor, poses)
    area, change = np.max(areas, axis=0), np.ptp(areas, axis=0)
    change[change < TINY * area] = 0  # rounding of vertices that are shifted
    parts = np.array([area, area * radiance, change * radiance]) * seen
    choice = Choice(sum(k * part / part.sum() for k, part in zip(SHARES, parts) if part.any()))
    return [FacetStarts.at(meshes, *pose, choice) for pose in zip(corners, areas)]


def moves_in_view(scene, sensor, poses: list[dict]) -> bool:
    """Whether a triangle that a sensor can see differs between two poses; others as above."""
    shown = [
        corners * (area > TINY)[:, None, None]
        for corners, area in zip(*in_poses(scene, sensor, poses))
    ]
    return bool(np.abs(shown[0] - shown[1]).max() > TINY)


def in_poses(scene, sensor, poses: list[dict]) -> tuple[tuple, tuple]:
    """The `outlines` of a model's meshes in several poses: corners, and visible areas."""
    of_poses = []
    for pose in poses:
        with moved(scene, pose):
            of_poses.append([of_view[0] for of_view in outlines(meshes_of_model(scene), sensor)])
    return tuple(zip(*of_poses))
