"""`render`, which renders an image of a scene."""

from collections.abc import Mapping, Sequence
from os import PathLike

from mi_lcair.api.load import sampling_of, scene_of
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.atmosphere import atmosphere as read_atmosphere
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.render import render_image
from mi_lcair.rendering.images.render_result import Render
from mi_lcair.rendering.reflections.number import reflecting
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.startup.threads import exclusively


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
        radiance, such as 0.01 or "1%", or until max_spp is reached.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same image.
    sensor : int
        Number of the sensor, counted from 0.
    split : str or None
        What is recorded beside the radiance, see `Channels`.
    atmosphere : Atmosphere, str, Path or None
        Also compute the apparent radiance through this atmosphere (`apparent.Y`, `path.Y`): one
        that is loaded, a bundled name, a CSV, a MODTRAN tape7, or "vacuum".
    range_m : float or None
        Range of the model for the atmosphere [m]. None: each pixel's own range.
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
