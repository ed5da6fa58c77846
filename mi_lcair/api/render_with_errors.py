"""`render_with_errors`, which renders any scene of Mitsuba with standard errors."""

from typing import TYPE_CHECKING

from mi_lcair.api.load import sampling_of
from mi_lcair.declared import Bounds
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.with_errors import ImageWithErrors, image_with_errors
from mi_lcair.startup.threads import exclusively

if TYPE_CHECKING:
    import mitsuba as mi


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
        magnitude, such as 0.01 or "1%", or until max_spp is reached.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same image.
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
    Bounds(lower=0, upper=2**32 - 1).check(seed, "seed")
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    return image_with_errors(scene, sampling, integrator)
