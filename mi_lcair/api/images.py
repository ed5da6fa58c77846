"""Public functions that give images."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

from mi_lcair.api.scenes import sampling_of, scene_of
from mi_lcair.derivatives.images import DerivativeImages, differentiate_image
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.atmosphere import atmosphere as read_atmosphere
from mi_lcair.plugins.recorders.channels import PARTS
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.render import Render, render_image
from mi_lcair.rendering.images.with_errors import ImageWithErrors, image_with_errors
from mi_lcair.rendering.reflections import reflecting
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
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
    parts: bool = False,
    atmosphere: Atmosphere | str | PathLike[str] | None = None,
    range_m: float | None = None,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    bins: int = 0,
    errors_um: Sequence[float] = (),
    max_bounces: int | str | None = None,
    truth: bool = False,
) -> Render:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    spp : int or None
        Samples per pixel (default: the scene's number). A number above 4 is rounded up to a
        multiple of 4. It cannot be combined with a tolerance.
    tolerance : float, str or None
        Render until the rms standard error over the pixels is below this fraction of the mean
        radiance, such as 0.01 or "1%", or until `max_spp` is reached.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same result.
    sensor : int
        Number of the sensor, counted from 0.
    parts : bool
        Also split the radiance by number of reflections, by emitting group and by the group that is
        seen first (channels bounceNN.Y and closure.Y, group.LABEL.Y, seen.LABEL.Y).
    atmosphere : Atmosphere, str, Path or None
        Also compute the apparent radiance through this atmosphere (channels apparent.Y and
        path.Y): a bundled name, a CSV, a MODTRAN tape7, "vacuum", or one that is loaded.
    range_m : float or None
        Range of the whole model for the atmosphere [m]. By default each pixel has its own range.
    progress : callable or None
        Called with the samples per pixel that are done and their expected number.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    bins : int, optional
        Also render the spectral radiance at this number of evenly spaced wavelengths. They include
        both ends of the band. The response at each wavelength is a triangle. Its full width at half
        maximum is the distance between the wavelengths.
    errors_um : sequence of float, optional
        Wavelengths [um]. The nearest of the `bins` also get a standard error for each pixel, in
        channels such as "stderr.S0.8000,000000nm".
    max_bounces : int, "auto" or None
        Largest number of reflections, instead of the scene's. "auto" chooses it from a pilot run,
        so that at most a tenth of the tolerance (default: 1 %) is left out. The errors include this
        part.
    truth : bool
        Also write the true content of each pixel: numbers of facets and materials, depth, normal,
        temperature, emissivity, emitted and reflected radiance.

    Returns
    -------
    Render

    Raises
    ------
    InputError
        For settings out of bounds, samples together with a tolerance, a tolerance that cannot be
        reached, and an image that needs more memory than is free.
    """
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    atmosphere = None if atmosphere is None else read_atmosphere(atmosphere)
    with reflecting(scene, max_bounces, True, sampling):
        split = PARTS if parts else ()
        return render_image(scene, sampling, split, atmosphere, range_m, bins, errors_um, truth)


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
    doubled until the error is within it. With the sampler `lattice`, the samples continue where
    they ended. Other samplers begin again with other seeds.

    Parameters
    ----------
    scene : mi.Scene
        What `mi.load_file` or `mi.load_dict` returns.
    spp : int or None
        Samples per pixel, of all renders together, rounded up to a multiple of 8 (default: the
        number of the sensor's sampler). It cannot be combined with a tolerance.
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
        Integrator to use instead of the scene's integrator.
    progress : callable or None
        Called with the samples per pixel that are done and their largest number.

    Returns
    -------
    ImageWithErrors

    Raises
    ------
    InputError
        For settings out of bounds, samples together with a tolerance, and an image with NaN or
        infinite pixels.
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
