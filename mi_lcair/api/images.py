"""Public functions that give images."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.api.scenes import sampling_of, scenario_of, scene_of
from mi_lcair.declared import Bounds, fraction
from mi_lcair.derivatives.images import DerivativeImages, differentiate_image
from mi_lcair.detection.camera.image import record_image
from mi_lcair.detection.camera.image_result import Image
from mi_lcair.detection.camera.poses import COLUMNS, CameraPose, camera_pose
from mi_lcair.detection.scenario import Scenario, tables_of
from mi_lcair.errors import InputError, errors_of
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.atmosphere import atmosphere as read_atmosphere
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.render import Render, render_image
from mi_lcair.rendering.images.with_errors import ImageWithErrors, image_with_errors
from mi_lcair.rendering.reflections import reflecting
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.table import FARTHEST, read_table
from mi_lcair.tasks import exclusively

if TYPE_CHECKING:
    import mitsuba as mi


# `render`, which renders an image of a scene
# -------------------------------------------


@exclusively
def render(
    scene: SceneLike,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    split: str | None = "image",
    atmosphere: Atmosphere | str | PathLike[str] | None = None,
    range_m: float | None = None,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    bins: int = 0,
    errors_um: Sequence[float] = (),
    max_bounces: int | str | None = None,
) -> Render:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    spp : int or None
        Samples per pixel (the number in the scene), rounded up to a multiple of 4 if it is
        larger. It does not go with a tolerance.
    tolerance : float, str or None
        Render until the rms standard error over the pixels is below this fraction of the mean
        radiance, such as 0.01 or "1%", or until `max_spp` is reached.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same result.
    sensor : int
        Number of the sensor, counted from 0.
    split : str or None
        What is recorded beside the radiance, see `Channels`.
    atmosphere : Atmosphere, str, Path or None
        Also compute the apparent radiance through this atmosphere (channels apparent.Y and
        path.Y): a bundled name, a CSV, a MODTRAN tape7, "vacuum", or one that is loaded.
    range_m : float or None
        One range of the whole model for the atmosphere [m]. By default it is that of each pixel.
    progress : callable or None
        Called with the samples per pixel that are done and their expected number.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    bins : int, optional
        Number of even wavelengths over the band, its ends included, at which the spectral radiance
        is rendered too. The response of each is a triangle as wide at half its height as their
        distance.
    errors_um : sequence of float, optional
        Wavelengths [um] of which the nearest `bins` get a standard error of each pixel, in channels
        such as "stderr.S0.8000,000000nm".
    max_bounces : int, "auto" or None
        Largest number of reflections, in place of the scene's. "auto" lets pilot paths choose it,
        so that at most a tenth of the tolerance (1 %) is left out. The errors include the rest.

    Returns
    -------
    Render

    Raises
    ------
    InputError
        For settings out of bounds, samples beside a tolerance, a tolerance that cannot be reached,
        and an image that needs more memory than is free.
    """
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    atmosphere = None if atmosphere is None else read_atmosphere(atmosphere)
    with reflecting(scene, max_bounces, True, sampling):
        return render_image(scene, sampling, split, atmosphere, range_m, bins, errors_um)


# `render_with_errors`, which renders any scene of Mitsuba with standard errors
# -----------------------------------------------------------------------------


@exclusively
def render_with_errors(
    scene: "mi.Scene",
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    integrator: "mi.Integrator | None" = None,
    progress: Progress | None = None,
) -> ImageWithErrors:
    """Render a scene of any of Mitsuba's plugins, with the standard errors of its pixels.

    The scene is rendered eight times with independent seeds. It may have any integrator that
    `mi.render` takes, any sampler, and any variant. With a tolerance, the number of samples is
    doubled until the error is within it. The points of the sampler `lattice` go on where they
    ended. Those of another sampler begin again with other seeds.

    Parameters
    ----------
    scene : mi.Scene
        What `mi.load_file` or `mi.load_dict` returns.
    spp : int or None
        Samples per pixel, of all renders together, rounded up to a multiple of 8. None without a
        tolerance: the number of the sensor's sampler. It does not go with a tolerance.
    tolerance : float, str or None
        Render until the rms standard error over the pixels is below this fraction of the mean
        magnitude, such as 0.01 or "1%", or until `max_spp` is reached.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same result.
    sensor : int
        Number of the sensor, counted from 0.
    integrator : mi.Integrator or None
        In place of the scene's own.
    progress : callable or None
        Called with the samples per pixel that are done and their largest number.

    Returns
    -------
    ImageWithErrors

    Raises
    ------
    InputError
        For settings out of bounds, samples beside a tolerance, and an image with NaN or infinite
        pixels.
    """
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    return image_with_errors(scene, sampling, integrator)


# `derivative_images`, images of the radiance and of its derivatives
# ------------------------------------------------------------------


@exclusively
def derivative_images(
    scene: SceneLike,
    names: Sequence[str],
    *,
    sensor: int = 0,
    spp: int | None = None,
    seed: int = 0,
    randomisations: int = 4,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> DerivativeImages:
    """Images of the radiance and of its derivatives, all from the same paths.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    names : sequence of str
        Names of parameters, see `mi_lcair.rendering.parameters.values`.
    sensor, spp, seed
        As for `render`.
    randomisations : int
        Number of independent images.
    progress : callable or None
        Called with (samples per pixel done, expected) of all renders.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    DerivativeImages

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `render`.
    """
    sampling = Sampling(spp=spp, seed=seed, sensor=sensor, progress=progress)
    return differentiate_image(scene_of(scene, parameters), names, sampling, randomisations)


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
) -> Image:
    """The image of a scenario's target as its camera records it.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [camera], or the file or bundled name that `Scenario.read` takes. Its
        spp, max_spp and tolerance of [render] are those of a pixel, and if it is named, the
        arguments replace them. Of several numbers of reflections, the largest is used.
    frames : int
        Number of frames. They have independent noise, and one render.
    seed : int
        Seed of the camera's noise and fixed pattern. The same seed gives the same frames.
    progress : callable, optional
        Called with (paths through a pixel done, expected).
    parameters : mapping of str to object, optional
        Entries of a scenario that is named, by dotted key such as {"sensor.band": "LWIR"}.
    spp : int or None
        Paths through a pixel (64).
    tolerance : float, str or None
        Render until the rms standard error over the pixels on the target is at most this fraction
        of its mean radiance, such as 0.01 or "1%".
    max_spp : int or None
        Largest number of paths through a pixel for a tolerance (65536).

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
        return record_image(scenario, frames, seed, progress)


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
