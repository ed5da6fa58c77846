"""Probes: small launches through some pixels or a whole window, and comparisons between them.

A probe measures the radiance by number of reflections, and its noise from randomisations. Its
kernel is that of the later render, so that a probe under the chosen settings compiles nothing that
the render does not need.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from math import gcd

import numpy as np

from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.by_bounce import SIZES
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import UNSEEN, student_factor

# Randomisations of a probe, under all settings the same ones, so that the difference between two
# probes has little noise. In a window their number decides how well the noise is known.
WINDOW_RANDOMISATIONS, PIXEL_RANDOMISATIONS = 64, 8
WINDOW_POINTS, PIXEL_POINTS = 2**7, 2  # points of each randomisation
# A probe of pixels takes one of 16, so that it costs little beside the image. They are spread over
# the image. Their number lies between the limits, if the image has as many.
PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS = 16, 2**6, 2**11
FEW_COUNTS = SIZES[0] - 1  # reflections counted separately by the fastest kernel
# Cost of sampling an emitter, in rays. Measured: between 0.6 and 2.7 in the bundled scenes.
EMITTER_SAMPLE = 2


@dataclass(frozen=True)
class Settings:
    """Settings that a plan may change: the lobe by material, and how paths are followed."""

    lobe: dict[str, str]
    max_bounces: int
    emitter_sampling: bool
    closure: str = "none"
    ambient_temperature: float | None = None

    @staticmethod
    def of(scene: Scene) -> "Settings":
        """The settings that `scene` has now."""
        integrator = scene.mi.integrator()
        return Settings(
            lobe={surface.material: surface.lobe for surface in scene.surfaces()},
            max_bounces=integrator.max_bounces,
            emitter_sampling=integrator.emitter_sampling,
            closure=integrator.closure,
            ambient_temperature=integrator.ambient_temperature,
        )

    def applied(self, scene: Scene) -> AbstractContextManager[None]:
        """Context manager that applies these settings to `scene` within the block."""
        return changed(scene, **asdict(self))


@dataclass(frozen=True)
class Probe:
    """Radiance, W m^-2 sr^-1, of a window or of some pixels of a scene under certain settings.

    Attributes
    ----------
    value : ndarray, shape (R, P)
        Mean radiance of each randomisation and pixel. It is that of the whole image for a probe of
        pixels. Otherwise it is that of the model's facets, and P = 1.
    by_bounce : ndarray, shape (R, n, P)
        The part after 0, 1, ... n - 1 reflections.
    closure : ndarray, shape (R, P)
        The part that the closure adds.
    reflections : int
        Largest number of reflections that were followed. If it is n or more, the last entry of
        `by_bounce` holds all from n - 1 to this number.
    segments : float or None
        Mean number of rays of a path, if they were counted.
    paths : int
        Number of paths of the probe.
    chance : float
        Upper bound of the radiance that a source which no path has hit adds to all paths together.
    """

    value: np.ndarray
    by_bounce: np.ndarray
    closure: np.ndarray
    reflections: int
    segments: float | None
    paths: int
    chance: float

    @property
    def mean(self) -> float:
        """Mean radiance."""
        return float(self.value.mean())

    @property
    def is_complete(self) -> bool:
        """Whether each number of reflections was counted separately."""
        return self.by_bounce.shape[1] == self.reflections + 1

    @property
    def variance(self) -> float:
        """Variance of the mean of one randomisation, averaged over the pixels."""
        return float(self.value.var(axis=0, ddof=1).mean())

    @property
    def may_lack(self) -> float:
        """Upper bound of what a source that no path has hit adds, as a fraction of the mean."""
        return self.chance / (self.paths * self.mean)


def pixels_launch(width: int, height: int, seed: int, factor: int) -> Launch:
    """The launch of a probe of some pixels of an image."""
    wanted = np.clip(width * height // PIXEL_SHARE, LEAST_PIXELS, MOST_PIXELS)
    stride = max(1, width * height // int(wanted))
    # A stride with a divisor of the width would put all pixels into a few columns.
    while gcd(stride, width) > 1:
        stride += 1
    return Launch(
        columns=width,
        rows=height,
        seed=seed,
        randomisations=PIXEL_RANDOMISATIONS,
        points=PIXEL_POINTS * factor,
        windows=-(-width * height // stride),
        stride=stride,
    )


@dataclass
class ProbeSeries:
    """Probes of one scene under different settings, with the same pixels and random numbers.

    Attributes
    ----------
    scene : Scene
    each_pixel : bool
        Whether pixels of the image are measured. Otherwise the radiance of the model's facets is.
    seed : int
        Seed of the random numbers.
    sensor : int
        Number of the scene's sensor, from 0.
    progress : callable or None
        Called with (probes done, probes expected) after each probe.
    factor : int
        Points of each randomisation of the following probes, as a multiple of the usual number.
    done : int
        Number of probes so far.
    """

    scene: Scene
    each_pixel: bool
    seed: int = 0
    sensor: int = 0
    progress: Callable | None = None
    factor: int = 1
    done: int = 0

    def __call__(
        self, settings: Settings, counted: int | None = None, count_segments: bool = False
    ) -> Probe:
        """Trace a few paths through some pixels of the scene, or through its whole window.

        The scene has `settings` meanwhile. counted, count_segments: as for `Channels`.
        """
        camera = self.scene.sensor(self.sensor)
        split, prefix = ("image", "") if self.each_pixel else ("target", "target.")
        launch = self.launch(camera)
        with settings.applied(self.scene), self.scene.prepared() as tracer:
            sums = tracer.trace(camera, launch, Channels(split, counted, count_segments))
            unmet = float(tracer.unmet_sources(camera).bound(sums.draws.sum()))
            chance = UNSEEN * max(unmet, float(sums.chance.max()))
        valid = np.maximum(sums.valid, 1)

        def mean(values):
            return (values / valid).T

        names = [name for name in sums.channels if name.startswith(f"{prefix}bounce.")]
        self.done += 1
        if self.progress:
            self.progress(self.done, self.done + 2)
        return Probe(
            value=mean(sums.radiance if self.each_pixel else sums.channels["target"]),
            by_bounce=np.stack([mean(sums.channels[name]) for name in names], axis=1),
            closure=mean(sums.channels[f"{prefix}closure"]),
            reflections=settings.max_bounces,
            segments=float(mean(sums.channels["segments"]).mean()) if count_segments else None,
            paths=launch.paths,
            chance=chance,
        )

    def launch(self, camera) -> Launch:
        """The launch of a probe."""
        if self.each_pixel:
            return pixels_launch(*camera.film().crop_size(), self.seed, self.factor)
        return Launch(
            columns=1,
            rows=1,
            seed=self.seed,
            randomisations=WINDOW_RANDOMISATIONS,
            points=WINDOW_POINTS * self.factor,
            aim=Aim.anywhere(),
        )


def cost(segments: float, draws_emitters: bool) -> float:
    """Cost of a path, in rays.

    Emitter sampling adds EMITTER_SAMPLE rays at each reflection. The cost is counted and not timed,
    so that the load of the machine does not decide which settings are chosen.

    Parameters
    ----------
    segments : float
        Mean number of rays of a path.
    draws_emitters : bool
        Whether the path samples emitters.
    """
    return segments + (EMITTER_SAMPLE * max(segments - 1, 0) if draws_emitters else 0.0)


def differ(first: Probe, second: Probe, share: float) -> bool:
    """Whether the means of two probes differ by more than their noise explains.

    The difference less its 95 % interval must exceed `share` of the first probe's mean.
    """
    gap = first.value.mean(axis=1) - second.value.mean(axis=1)
    return abs(gap.mean()) - half_width(gap) > share * first.mean


def difference(gap: np.ndarray, each_pixel: bool) -> float:
    """Upper bound (95 %) of a difference of radiances, in its own unit.

    It is the rms over the pixels with `each_pixel`, otherwise the absolute value of the mean.

    Parameters
    ----------
    gap : ndarray, shape (R, P)
        Difference in each randomisation and pixel.
    each_pixel : bool
    """
    if not each_pixel:
        return upper(gap.mean(axis=1), signed=True)
    # The mean product of two independent randomisations is the squared difference without their
    # noise. The scatter over the pixels also contains that of the choice of pixels.
    products = np.mean(gap[0::2] * gap[1::2], axis=0)
    return float(np.sqrt(max(0.0, upper(products))))


def upper(values: np.ndarray, signed: bool = False) -> float:
    """Upper bound (95 %) of the mean of independent values.

    With `signed` it bounds the absolute value of the mean.
    """
    mean = abs(values.mean()) if signed else values.mean()
    return float(mean + half_width(values))


def half_width(values: np.ndarray) -> float:
    """Half of the 95 % interval of the mean of independent values."""
    return student_factor(len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
