"""Public functions of a scenario at its sensor, and of cameras."""

from collections.abc import Mapping
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Bounds, fraction
from mi_lcair.detection.camera.image import record_image
from mi_lcair.detection.camera.image_result import Image
from mi_lcair.detection.camera.poses import COLUMNS, CameraPose, camera_pose
from mi_lcair.detection.contrast import Contrast, measure_contrast
from mi_lcair.detection.scenario import TO_A_TOLERANCE, Scenario, tables_of
from mi_lcair.errors import InputError, errors_of
from mi_lcair.progress import Progress
from mi_lcair.table import FARTHEST, read_table
from mi_lcair.tasks import exclusively

# The scenario that a caller of a public function means
# -----------------------------------------------------


def scenario_of(
    scenario: Scenario | str | PathLike[str],
    parameters: Mapping[str, object] | None = None,
    **sampling: object,
) -> Scenario:
    """Return the Scenario for a scenario, a name or a file.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario, or the file or bundled name that `Scenario.read` takes.
    parameters : mapping of str to object, optional
        Entries of a scenario given by name or file, by dotted key such as "sensor.band".
    **sampling
        Entries of [render] of a scenario given by name or file. None leaves an entry unchanged.

    Raises
    ------
    InputError
        If the scenario cannot be used, or if entries are given for a Scenario object.
    """
    given = {name: value for name, value in sampling.items() if value is not None}
    if "spp" in given and given.keys() & set(TO_A_TOLERANCE):
        raise InputError(
            "spp sets a fixed number of samples; tolerances and max_spp choose one, and do not go "
            "with it"
        )
    changes = dict(parameters or {}) | {f"render.{name}": value for name, value in given.items()}
    if not isinstance(scenario, Scenario):
        return Scenario.read(scenario, **changes)
    if changes:
        raise InputError(
            f"scenario '{scenario.name}': is already read, so that {', '.join(changes)} cannot "
            "be changed here; give the changes to Scenario.read"
        )
    return scenario


# `contrast`, the contrast of a scenario at its sensor
# ----------------------------------------------------


@exclusively
def contrast(
    scenario: Scenario | str | PathLike[str],
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    tolerance_W_m2: float | None = None,
    max_spp: int | None = None,
) -> Contrast:
    """Contrast of a scenario and its parts (3.19), for each number of reflections.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario, or the file or bundled name that `Scenario.read` takes. For a name or file, `spp`,
        `max_spp` and the tolerances replace the entries of its [render].
    progress : callable, optional
        Called with (samples per pixel done, expected).
    parameters : mapping of str to object, optional
        Entries of a scenario given by name or file, by dotted key such as {"sensor.band": "LWIR"}.
    spp : int or None
        Paths per pixel: the number of paths is spp x the square of render.resolution (64). The
        paths begin anywhere in a window around the target.
    tolerance : float, str or None
        Trace paths until half of the 95 % interval of each result is at most this fraction of it,
        such as 0.01 or "1%".
    tolerance_W_m2 : float or None
        The same in W m^-2, for a contrast that may be zero. With both tolerances, tracing ends when
        either is met.
    max_spp : int or None
        Largest number of paths per pixel for a tolerance (65536).

    Returns
    -------
    Contrast

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    scenario = scenario_of(
        scenario,
        parameters,
        spp=spp,
        tolerance=fraction(tolerance),
        tolerance_W_m2=tolerance_W_m2,
        max_spp=max_spp,
    )
    with errors_of(f"scenario '{scenario.name}'"):
        return measure_contrast(scenario, progress)


# `image`, what the camera of a scenario records
# ----------------------------------------------

MOST_FRAMES = 10_000


@exclusively
def image(
    scenario: Scenario | str | PathLike[str],
    frames: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    truth: bool = False,
) -> Image:
    """The image of a scenario's target as its camera records it.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [camera], or the file or bundled name that `Scenario.read` takes.
        `spp`, `max_spp` and `tolerance` of its [render] apply to pixels. For a name or file, the
        arguments replace them. If [render] has several numbers of reflections, the largest is used.
    frames : int
        Number of frames. They share one render and have independent noise.
    seed : int
        Seed of the camera's noise and fixed pattern. The same seed gives the same frames.
    progress : callable, optional
        Called with (paths through a pixel done, expected).
    parameters : mapping of str to object, optional
        Entries of a scenario given by name or file, by dotted key such as {"sensor.band": "LWIR"}.
    spp : int or None
        Paths per pixel (64).
    tolerance : float, str or None
        Render until the rms standard error over the pixels on the target is at most this fraction
        of its mean radiance, such as 0.01 or "1%".
    max_spp : int or None
        Largest number of paths per pixel for a tolerance (65536).
    truth : bool
        Also write the true content of each pixel, and the parts of its radiance before optics and
        noise: numbers of facets and materials, depth, normal, true temperature, emissivity, emitted
        and reflected radiance, transmittance of the air.

    Returns
    -------
    Image

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    scenario = scenario_of(
        scenario, parameters, spp=spp, tolerance=fraction(tolerance), max_spp=max_spp
    )
    Bounds(lower=1, upper=MOST_FRAMES).check(frames, "frames")
    Bounds(lower=0, upper=2**32 - 1).check(seed, "seed")
    with errors_of(f"scenario '{scenario.name}'"):
        return record_image(scenario, frames, seed, progress, truth)


# `pose`, where a camera is that sees points of a scene in known pixels
# ---------------------------------------------------------------------


@exclusively
def pose(
    scenario: str | PathLike[str],
    points: str | PathLike[str] | ArrayLike,
    sigma_px: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> CameraPose:
    """Position and pointing of a scenario's camera, from points of its scene and their pixels.

    The sum of the squared residuals of columns and rows is minimised (resection). The camera is
    assumed to have no distortion. Its focal length is that of the scenario. The observer of the
    scenario is not used.

    Parameters
    ----------
    scenario : str or path-like
        Scenario with a table [camera]: the file or bundled name that `Scenario.read` takes.
    points : str, path-like or array-like, shape (n, 5)
        CSV with the columns x_m, y_m, z_m, column_px and row_px, or their values: four or more
        points in the scene's axes, such as corners of facets, and their positions in the frame. The
        upper left corner of the frame is (0, 0), and the centre of its first pixel is (0.5, 0.5).
    sigma_px : float, optional
        Standard deviation of a column or row, pixels. By default it is estimated from the
        residuals.
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
    """Values of points, (n, 5), Float64; raises InputError if a file or an array has another
    form."""
    if isinstance(points, (str, PathLike)):
        return np.column_stack(list(read_table(points, COLUMNS).numbers(COLUMNS).values()))
    try:
        values = np.array(points, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.ndim != 2 or values.shape[1] != 5 or not np.all(abs(values) <= FARTHEST):
        raise InputError(f"points must be an array (n, 5) of {', '.join(COLUMNS)}")
    return values
