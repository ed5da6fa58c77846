"""Images of any Mitsuba scene with standard errors, from renders that are independent."""

from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins import PLUGINS
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import student_factor

RANDOMISATIONS = 8  # independent renders of an image
FIRST_POINTS = 8  # samples per pixel of each of them before the first look at the error


@dataclass(frozen=True)
class ImageWithErrors:
    """The mean of several independent renders, and its standard errors.

    The errors come from the scatter of the renders. They do not include light that no path has hit,
    nor a bias that is common to all renders, such as that of a limited number of reflections.

    Attributes
    ----------
    image : ndarray, shape (H, W, C)
        Mean image, in the units and channels of the film, Float64.
    standard_error : ndarray, shape (H, W, C)
        Standard errors of its pixels, with 7 degrees of freedom.
    mean, mean_error : ndarray, shape (C,)
        Mean over the pixels and its standard error, with 7 degrees of freedom.
    rms_error : float
        Rms standard error over pixels and channels as a fraction of their mean magnitude.
    spp : int
        Samples per pixel, of all renders together.
    reached : bool or None
        Whether the tolerance was reached. None if none was given.
    """

    image: np.ndarray
    standard_error: np.ndarray
    mean: np.ndarray
    mean_error: np.ndarray
    rms_error: float
    spp: int
    reached: bool | None

    def __repr__(self) -> str:
        mean = ", ".join(f"{m:.5g} +- {e:.2g}" for m, e in zip(self.mean, self.mean_error))
        return f"image: mean {mean} (standard errors), {self.spp} samples per pixel"

    @property
    def half_width(self) -> np.ndarray:
        """Half of the 95 % interval (Student's) of each pixel, (H, W, C)."""
        return student_factor(RANDOMISATIONS - 1) * self.standard_error

    @staticmethod
    def of(images: np.ndarray, spp: int) -> "ImageWithErrors":
        """The mean of independent images, (R, H, W, C), with as many samples each."""
        size = np.sqrt(len(images))
        error, means = images.std(axis=0, ddof=1) / size, images.mean(axis=(1, 2))
        image = images.mean(axis=0)
        rms, level = np.sqrt(np.mean(error**2)), np.mean(np.abs(image))
        relative = float(rms / level) if level > 0 else 0.0
        errors_of_means = means.std(axis=0, ddof=1) / size
        return ImageWithErrors(
            image, error, means.mean(axis=0), errors_of_means, relative, spp, None
        )


def image_with_errors(
    scene: "mi.Scene", sampling: Sampling, integrator: "mi.Integrator | None" = None
) -> ImageWithErrors:
    """Render a scene of any plugins; see `mi_lcair.render_with_errors`.

    Without a tolerance, `sampling` has the number of samples. With one, the number is doubled until
    the rms error is within it. A lattice then goes on where it ended, and any other sampler begins
    again with other seeds: its renders are averaged by their samples.
    """
    check_scene(scene, sampling.sensor, integrator)
    sensor = scene.sensors()[sampling.sensor]
    sampler, sampling = sensor.sampler(), sampling.settled(sensor)
    integrator = scene.integrator() if integrator is None else integrator
    is_lattice = isinstance(sampler, PLUGINS["lattice"].type)
    goal = -(-(sampling.limit if sampling.tolerance else sampling.spp) // RANDOMISATIONS)
    done, turn, images, error_before = 0, 0, 0.0, 0.0
    while True:
        points = goal - done
        if sampling.tolerance:
            points = min(points, max(done, FIRST_POINTS))
        points = taken(sampler, points)
        rendered = []
        for k in range(RANDOMISATIONS):
            # The points of a lattice go on only with the seed with which they began
            numbers = np.random.SeedSequence([sampling.seed, k, 0 if is_lattice else turn])
            seed = int(numbers.generate_state(1)[0])
            if is_lattice:
                sampler.first_point = done
            try:
                image = mi.render(
                    scene, sensor=sensor, integrator=integrator, seed=seed, spp=points
                )
            finally:
                if is_lattice:
                    sampler.first_point = 0
            rendered.append(np.array(image, dtype=float))
        rendered = np.reshape(rendered, (RANDOMISATIONS, *rendered[0].shape[:2], -1))
        if invalid := np.count_nonzero(~np.isfinite(rendered).all(axis=(0, 3))):
            raise InputError(
                f"{invalid} of {rendered[0, ..., 0].size} pixels are NaN or infinite; look for "
                "extreme values in the scene"
            )
        images = (done * images + points * rendered) / (done + points)
        before, done, turn = done, done + points, turn + 1
        result = ImageWithErrors.of(images, RANDOMISATIONS * done)
        if sampling.progress:
            sampling.progress(RANDOMISATIONS * done, RANDOMISATIONS * goal)
        if not sampling.tolerance:
            return result
        # An error that fell faster than 1 / samples did so by luck
        error_before = max(result.rms_error, error_before * before / done)
        if error_before <= sampling.tolerance or done >= goal:
            return replace(result, reached=error_before <= sampling.tolerance)


def taken(sampler: "mi.Sampler", points: int) -> int:
    """The number of samples that a sampler takes for a wanted one: some round it up."""
    sampler = sampler.fork()
    sampler.set_sample_count(points)
    return sampler.sample_count()


def check_scene(scene, sensor: int, integrator) -> None:
    """Raise InputError for what is no scene of the present variant or cannot be rendered."""
    if not isinstance(scene, mi.Scene):
        raise InputError(
            f"{type(scene).__name__} is not a scene of variant {mi.variant()}; load one with "
            "mi.load_file or mi.load_dict; use mi_lcair.render for thermal scenes"
        )
    if not 0 <= sensor < len(scene.sensors()):
        raise InputError(f"sensor = {sensor}; the scene has {len(scene.sensors())}, counted from 0")
    if integrator is not None and not isinstance(integrator, mi.Integrator):
        raise InputError(
            f"{type(integrator).__name__} is no integrator; load one with mi.load_dict"
        )
    if integrator is None and scene.integrator() is None:
        raise InputError("the scene has no integrator; add one to it or give one, such as path")
