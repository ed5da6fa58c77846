"""Cheap looks at a scene under some settings: what it shows by bounce count, how it scatters, how
long a path takes.
"""

import time
from dataclasses import asdict, dataclass

import numpy as np

from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed

# independent looks, with the same seeds under all settings: differences between settings scatter
# little
BATCHES = 8
PATHS = 2**13  # of one look
PIXELS = 2**11  # at most, spread over the image
EMITTER_SAMPLE = (
    2  # rays that the sample of an emitter costs; between 0.6 and 2.7 in the bundled scenes
)
T_95 = 2.365  # Student's factor for 95 % and BATCHES - 1 degrees of freedom


@dataclass(frozen=True)
class Settings:
    """What a plan may change: the rung of each material with a ladder, and how paths are
    followed.
    """

    lobe: dict[str, str]
    max_bounces: int
    emitter_sampling: bool
    closure: str = "none"

    @staticmethod
    def of(scene: Scene) -> "Settings":
        integrator = scene.mi.integrator()
        return Settings(
            lobe={surface.material: surface.lobe for surface in scene.surfaces()},
            max_bounces=integrator.max_bounces,
            emitter_sampling=integrator.emitter_sampling,
            closure=integrator.closure,
        )

    def applied(self, scene: Scene):
        """Context manager: within, the scene has these settings; afterwards its own again."""
        return changed(scene, **asdict(self), ambient_temperature=None)


@dataclass(frozen=True)
class Probe:
    """Radiance [W m^-2 sr^-1] of some pixels, spread over the image, under one of the settings.

    by_bounce: (BATCHES, bounces, pixels), of what is looked at: the model's facets, or all
    (`each_pixel`). deviation: of one sample, rms over the pixels, by batch. between: the same from
    the scatter of the batches' means, which also shows the noise that all samples of a batch share,
    that of the tail's ratio. cost: of a path, counted, see `cost`; seconds: per path, after the
    compile, for the prediction alone. chance: bound of what one path may gain from a source that no
    other has met.
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
        """(BATCHES, pixels), all bounces."""
        return self.by_bounce.sum(axis=1)

    @property
    def may_lack(self) -> float:
        """What a source that no path has met may add to the mean, as a fraction of it."""
        return self.chance / (self.paths * self.value.mean())


def probe(
    scene: Scene,
    settings: Settings,
    each_pixel: bool,
    seed: int = 0,
    sensor: int = 0,
    factor: int = 1,
) -> Probe:
    """Renders some pixels of a scene BATCHES times, with `factor` times PATHS paths each."""
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    stride = max(1, width * height // PIXELS)
    stride += stride > 1 and width % stride == 0  # otherwise all pixels would lie in a few columns
    pixels = -(-width * height // stride)
    spp = max(2, factor * PATHS // pixels // 2 * 2)  # even: in two halves
    seeds = np.random.SeedSequence(seed).generate_state(BATCHES).tolist()
    prefix = "" if each_pixel else "target."
    looks, deviation, means, segments, times = [], [], [], [], []
    with settings.applied(scene), scene.prepared() as tracer:
        chance = tracer.chance_contribution(camera)
        for batch in range(BATCHES):
            start = time.perf_counter()
            part = tracer.observe(
                camera, seeds[batch], spp, 0, pixels, "target", stride=stride, count_segments=True
            )
            times.append(time.perf_counter() - start)
            names = [name for name in part.channels if name.startswith(f"{prefix}bounce.")]
            looks.append([part.channels[name].mean(axis=0) for name in names])
            deviation.append(scatter(part, each_pixel, spp))
            means.append(part.channels["target"].mean())
            segments.append(part.channels["segments"].mean())
            chance = max(chance, part.chance)
    return Probe(
        by_bounce=np.array(looks),
        deviation=np.array(deviation),
        between=float(np.std(means, ddof=1) * np.sqrt(pixels * spp)),
        cost=cost(float(np.mean(segments)), tracer.emitters.draws),
        seconds=float(np.median(times[1:])) / (pixels * spp),
        paths=BATCHES * pixels * spp,
        chance=chance,
    )


def cost(segments: float, draws_emitters: bool) -> float:
    """Of a path of so many rays, in rays. It is counted, not timed: the load of a machine must not
    decide what is chosen. At each reflection emitter sampling costs EMITTER_SAMPLE more.
    """
    return segments + (EMITTER_SAMPLE * max(segments - 1, 0) if draws_emitters else 0.0)


def scatter(part, each_pixel: bool, spp: int) -> float:
    """Standard deviation of one sample, rms over the pixels: from samples, or from the halves of
    the target's.
    """
    if each_pixel:
        return float(np.sqrt(part.squares.sum() / (part.count - 1).clip(1).sum()))
    first, second = part.channels["target"]
    return float(np.sqrt(np.mean((first - second) ** 2) * spp / 4))
