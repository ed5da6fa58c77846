"""Where paths begin for two poses of a model that moves: on its facets, and where it changes."""

import numpy as np

from mi_lcair.plugins.paths.aim import CELLS, Aim, shared_out
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.rendering.aiming import aim_over_model, blurred
from mi_lcair.rendering.facets.starts import (
    in_view,
    meshes_of_model,
    mixed_choice,
    radiances,
    seen_shares,
)
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.motions.pose import moved
from mi_lcair.rendering.settings import changed

# Shares of the paths that begin on facets by their projected area, because a cold facet may reflect
# much, by projected area times radiance, and by the change of the latter between the poses
SHARES = 0.3, 0.3, 0.4
TINY = 1e-6  # part of an area by which rounding may change it
# Cells along each side of a window in which two poses are compared, and the share of the paths that
# begin anywhere on the model all the same
CELLS_OF_CHANGE, ON_MODEL_BESIDE = 1024, 0.15


def starts_in(scene, sensor, poses: list[dict]) -> list[FacetStarts]:
    """Starts on the facets of a scene's model in several poses, with the same probabilities.

    scene: Scene whose model consists of meshes. sensor: an orthographic one. poses: values of
    motions by name.
    """
    meshes = meshes_of_model(scene)
    seen = seen_shares(scene, sensor, in_view(meshes, sensor)[1])[0]
    of_poses = []
    for pose in poses:
        with moved(scene, pose):
            of_poses.append(in_view(meshes, sensor))
    corners, areas = zip(*of_poses)
    areas = np.concatenate(areas)
    radiance = radiances(meshes)
    area, change = np.max(areas, axis=0), np.ptp(areas, axis=0)
    change[change < TINY * area] = 0  # rounding of vertices that are shifted
    parts = np.array([area, area * radiance, change * radiance]) * seen
    choice = mixed_choice(SHARES, parts)
    return [FacetStarts.at(meshes, *pose, choice) for pose in zip(corners, areas)]


def aim_at_change(scene, sensor, poses: list[dict], seed: int) -> Aim | None:
    """An aim at the cells of a window that emit another radiance in two poses; None without such.

    Nearly all noise of a difference on the film is that of paths that meet something else in the
    other pose. They are often few, such as those beside the edge of an opening that grows.
    """
    side, measurands = CELLS_OF_CHANGE, Measurands.of(None)
    launch = Launch(side, side, seed, 1, 1, windows=side**2)
    radiance, on_model = [], []
    for pose in poses:
        with moved(scene, pose), changed(scene, max_bounces=0), scene.prepared() as tracer:
            radiance.append(measurands.trace(tracer, sensor, launch).radiance)
            on_model.append(aim_over_model(scene, sensor).may_be_model[0])
    change = np.abs(np.subtract(*radiance)).reshape(1, side, side)
    if not change.any():
        return None
    seen = np.add(*radiance).reshape(1, side, side)
    importance = shared_out(blurred(change)) + shared_out(seen)
    parts = np.ones((side // CELLS,) * 2, bool)
    cells = np.kron(np.any(on_model, axis=0), parts) | (importance > 0)
    return Aim.at(importance, cells, ON_MODEL_BESIDE)
