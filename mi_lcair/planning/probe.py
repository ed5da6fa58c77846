"""Probes: cheap renders of some pixels of a scene, and comparisons between them.

A probe measures the radiance by number of reflections, its noise, and the cost of a path.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed

# A probe consists of independent batches. Their seeds are the same under all settings, so that the
# difference between two probes has little noise.
BATCHES = 8
PATHS = 2**13  # paths of one batch
PIXELS = 2**11  # largest number of pixels of a probe; they are spread over the image
# Cost of sampling an emitter, in rays. Measured: between 0.6 and 2.7 in the bundled scenes.
EMITTER_SAMPLE = 2
T_95 = 2.365  # Student's factor for 95 % confidence with BATCHES - 1 degrees of freedom


@dataclass(frozen=True)
class Settings:
    """Settings that a plan may change: the lobe by material, and how paths are followed."""

    lobe: dict[str, str]
    max_bounces: int
    emitter_sampling: bool
    closure: str = "none"

    @staticmethod
    def of(scene: Scene) -> "Settings":
        """The settings that `scene` has now."""
        integrator = scene.mi.integrator()
        return Settings(
            lobe={surface.material: surface.lobe for surface in scene.surfaces()},
            max_bounces=integrator.max_bounces,
            emitter_sampling=integrator.emitter_sampling,
            closure=integrator.closure,
        )

    def applied(self, scene: Scene):
        """Context manager that applies these settings to `scene` within the block."""
        return changed(scene, **asdict(self), ambient_temperature=None)


@dataclass(frozen=True)
class Probe:
    """Radiance, W m^-2 sr^-1, of some pixels of a scene under certain settings.

    Attributes
    ----------
    by_bounce : ndarray, shape (BATCHES, n, pixels)
        Radiance of paths with 0, 1, ... n - 1 reflections. It is that of the whole image with
        `each_pixel`, otherwise that of the model's facets.
    deviation : ndarray, shape (BATCHES,)
        Standard deviation of one sample, rms over the pixels.
    between : float
        Standard deviation of one sample, estimated from the means of the batches. It includes the
        noise that all samples of a batch share, such as that of the tail's ratio.
    cost : float
        Cost of a path, in rays; see `cost`.
    seconds : float
        Time of a path, s, without compilation. It is used for predictions only.
    paths : int
        Number of paths of the probe.
    chance : float
        Upper bound of the radiance that one path adds if it hits a source that no other has hit.
    """

    by_bounce: np.ndarray
    deviation: np.ndarray
    between: float
    cost: float
    seconds: float
    paths: int
    chance: float

    @property
    def value(self) -> np.ndarray:
        """Radiance of all bounces, shape (BATCHES, pixels)."""
        return self.by_bounce.sum(axis=1)

    @property
    def may_lack(self) -> float:
        """Upper bound of what a source that no path has hit adds, as a fraction of the mean."""
        return self.chance / (self.paths * self.value.mean())


def probe(
    scene: Scene,
    settings: Settings,
    each_pixel: bool,
    seed: int = 0,
    sensor: int = 0,
    factor: int = 1,
) -> Probe:
    """Render some pixels of a scene in BATCHES independent batches.

    Parameters
    ----------
    scene : Scene
        Scene to probe.
    settings : Settings
        Settings that are applied to the scene during the probe.
    each_pixel : bool
        Whether the whole image is measured. Otherwise the radiance of the model's facets is.
    seed : int
        Seed of the random numbers.
    sensor : int
        Number of the scene's sensor, from 0.
    factor : int
        Paths of a batch, as a multiple of PATHS.

    Returns
    -------
    Probe
    """
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    stride = max(1, width * height // PIXELS)
    # A stride that divides the width would put all pixels into a few columns.
    stride += stride > 1 and width % stride == 0
    pixels = -(-width * height // stride)
    spp = max(2, factor * PATHS // pixels // 2 * 2)  # even: `scatter` compares two halves
    seeds = np.random.SeedSequence(seed).generate_state(BATCHES).tolist()
    prefix = "" if each_pixel else "target."
    by_bounce, deviation, means, segments, times = [], [], [], [], []
    with settings.applied(scene), scene.prepared() as tracer:
        chance = tracer.chance_contribution(camera)
        for batch in range(BATCHES):
            start = time.perf_counter()
            part = tracer.observe(
                camera, seeds[batch], spp, 0, pixels, "target", stride=stride, count_segments=True
            )
            times.append(time.perf_counter() - start)
            names = [name for name in part.channels if name.startswith(f"{prefix}bounce.")]
            by_bounce.append([part.channels[name].mean(axis=0) for name in names])
            deviation.append(scatter(part, each_pixel, spp))
            means.append(part.channels["target"].mean())
            segments.append(part.channels["segments"].mean())
            chance = max(chance, part.chance)
    return Probe(
        by_bounce=np.array(by_bounce),
        deviation=np.array(deviation),
        between=float(np.std(means, ddof=1) * np.sqrt(pixels * spp)),
        cost=cost(float(np.mean(segments)), tracer.emitters.draws),
        # The first batch includes the compilation.
        seconds=float(np.median(times[1:])) / (pixels * spp),
        paths=BATCHES * pixels * spp,
        chance=chance,
    )


@dataclass
class ProbeSeries:
    """Probes of one scene under different settings, with the same pixels and seeds.

    `factor` multiplies the paths of the following probes; `done` counts the probes so far.
    `progress` is called with (probes done, probes expected) after each probe.
    """

    scene: Scene
    each_pixel: bool
    seed: int
    sensor: int
    progress: Callable | None
    factor: int = 1
    done: int = 0

    def __call__(self, settings: Settings) -> Probe:
        """The probe of the scene under `settings`."""
        self.done += 1
        result = probe(self.scene, settings, self.each_pixel, self.seed, self.sensor, self.factor)
        if self.progress:
            self.progress(self.done, self.done + 2)
        return result


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


def scatter(part, each_pixel: bool, spp: int) -> float:
    """Standard deviation of one sample, rms over the pixels.

    It comes from the samples with `each_pixel`, otherwise from two halves of the target's samples.
    """
    if each_pixel:
        return float(np.sqrt(part.squares.sum() / (part.count - 1).clip(1).sum()))
    first, second = part.channels["target"]
    return float(np.sqrt(np.mean((first - second) ** 2) * spp / 4))


def differ(first: Probe, second: Probe, share: float) -> bool:
    """Whether the means of two probes differ by more than their noise explains.

    The difference less its 95 % interval must exceed `share` of the first probe's mean.
    """
    gap = first.value.mean(axis=1) - second.value.mean(axis=1)
    error = T_95 * gap.std(ddof=1) / np.sqrt(BATCHES)
    return abs(gap.mean()) - error > share * first.value.mean()


def difference(result: Probe, reference: Probe, each_pixel: bool) -> float:
    """Upper bound (95 %) of the difference between two probes, as a fraction of the mean radiance.

    It is the rms over the pixels with `each_pixel`, otherwise the difference of the means.
    """
    gap = (result.value - reference.value) / reference.value.mean()
    if not each_pixel:
        return upper(gap.mean(axis=1), signed=True)
    # The mean product of two independent batches is the squared difference without their noise.
    products = np.mean(gap[0::2] * gap[1::2], axis=1)
    error = products.std(ddof=1) / np.sqrt(len(products))
    return float(np.sqrt(max(0.0, products.mean() + T_95 * error)))


def upper(values: np.ndarray, signed: bool = False) -> float:
    """Upper bound (95 %) of the mean of BATCHES independent values.

    With `signed` it bounds the absolute value of the mean.
    """
    mean = abs(values.mean()) if signed else values.mean()
    return float(mean + T_95 * values.std(ddof=1) / np.sqrt(BATCHES))
