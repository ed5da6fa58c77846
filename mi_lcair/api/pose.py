"""`pose`, where a camera is that sees points of a scene in known pixels."""

from collections.abc import Mapping
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.camera.poses.camera_pose import COLUMNS, CameraPose, camera_pose
from mi_lcair.declared import Bounds
from mi_lcair.detection.scenario import Scenario, tables_of
from mi_lcair.errors import InputError, errors_of
from mi_lcair.startup.threads import exclusively
from mi_lcair.table import FARTHEST, read_table


@exclusively
def pose(
    scenario: str | PathLike[str],
    points: str | PathLike[str] | ArrayLike,
    sigma_px: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> CameraPose:
    """Where the camera of a scenario is, from points of its scene and their pixels.

    The sum of the squared residuals of columns and rows is least (resection). The camera has no
    distortion, and its focal length is that of the scenario. What the scenario says of its observer
    does not matter.

    Parameters
    ----------
    scenario : str or path-like
        Scenario with a table [camera]: the file or bundled name that `Scenario.read` takes.
    points : str, path-like or array-like, shape (n, 5)
        CSV with the columns x_m, y_m, z_m, column_px and row_px, or their values: four or more
        points in the scene's axes, such as corners of facets, and where they lie in the frame. The
        upper left corner of the frame is (0, 0), the middle of its first pixel (0.5, 0.5).
    sigma_px : float, optional
        Standard deviation of a column or row, pixels. By default it follows from the residuals.
    parameters : mapping of str to object, optional
        Entries of the scenario, by dotted key such as {"camera.focal_length_mm": 50}.

    Returns
    -------
    CameraPose
        Its `save("FILE.toml")` writes the scenario with this camera.

    Raises
    ------
    InputError
        If the scenario or the points cannot be used: fewer than four points, points on one line,
        points that would be behind the camera.
    """
    if sigma_px is not None:
        Bounds(is_positive=True, upper=1e6).check(sigma_px, "sigma_px")
    changes = dict(parameters or {})
    read = Scenario.read(scenario, **changes)
    *_, tables = tables_of(scenario, changes)
    with errors_of(f"scenario '{read.name}'"):
        return camera_pose(read, tables, values_of(points), sigma_px)


def values_of(points: str | PathLike[str] | ArrayLike) -> np.ndarray:
    """Values of points, (n, 5), Float64; raises InputError for a file or an array of others."""
    if isinstance(points, (str, PathLike)):
        return np.column_stack(list(read_table(points, COLUMNS).numbers(COLUMNS).values()))
    try:
        values = np.array(points, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.ndim != 2 or values.shape[1] != 5 or not np.all(abs(values) <= FARTHEST):
        raise InputError(f"points must be an array (n, 5) of {', '.join(COLUMNS)}")
    return values
