"""Rendering in independent passes: radiance with its standard error, to a number of samples or to a tolerance."""
import json
import time
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature

from .scene import Scene

BOUNCE_CHANNELS = 17        # in the image; the last holds every bounce count from 16 on
PASS_SAMPLES = 2**23        # paths in flight at once: below 2 GB with all channels
PILOT_SPP = 16
DEFAULT_MAX_SPP = 2**16


@dataclass(frozen=True)
class Render:
    """A rendered scene.

    channels: name -> float32 (H, W), the channels of the radiance EXR [W m^-2 sr^-1; temperature.Y K; range.Y m].
    by_bounce: mean radiance over the pixels by number of reflections, Float64, all counts up to 64 apart.
    mean: mean radiance; rms_error: rms over the pixels of the standard error, as a fraction of the mean (None for one
    sample per pixel); reached: whether the tolerance was met (None without one); invalid: NaN or infinite samples,
    left out; closure_error: estimated error of closure = tail [W m^-2 sr^-1], None otherwise.
    """
    channels: dict[str, np.ndarray]
    header: dict[str, str | int | float]
    band: Band
    by_bounce: np.ndarray
    spp: int
    mean: float
    rms_error: float | None
    reached: bool | None
    invalid: int
    paths: int
    closure_error: float | None
    seconds: float


class Accumulator:
    """Running mean and variance per pixel, and mean channels, over passes (Chan, Golub and LeVeque 1983); Float64."""

    def __init__(self, pixels: int):
        self.count, self.mean, self.squares = (np.zeros(pixels) for _ in range(3))
        self.channels = None
        self.invalid = 0

    def add(self, first: int, part) -> None:
        """Adds the statistics of a run of pixels that starts at pixel `first`."""
        run = slice(first, first + len(part.count))
        if self.channels is None:
            self.channels = np.zeros((len(part.channels), len(self.count)))
        count = self.count[run] + part.count
        share = part.count / np.maximum(count, 1)
        difference = part.mean - self.mean[run]
        self.squares[run] += part.squares + difference**2 * self.count[run] * share
        self.mean[run] += difference * share
        self.channels[:, run] += (part.channels - self.channels[:, run]) * share
        self.count[run] = count
        self.invalid += part.invalid

    def standard_error(self) -> np.ndarray:
        """Standard error of each pixel's mean; infinite below two samples."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.count > 1, np.sqrt(self.squares / (self.count * (self.count - 1))), np.inf)

    def rms_error(self) -> float | None:
        """Rms standard error over the pixels as a fraction of the mean; None below two samples."""
        if self.count.min() < 2:
            return None
        mean, rms = self.mean.mean(), np.sqrt(np.mean(self.standard_error() ** 2))
        return float(rms / mean) if mean > 0 else 0.0


def render(scene: Scene, spp: int | None = None, tolerance: float | None = None, max_spp: int | None = None, seed: int = 0,
           sensor: int = 0, split: bool = True, progress=None) -> Render:
    """Renders a scene.

    spp: samples per pixel (the scene's own). tolerance: instead render until the rms standard error over the pixels is
    below this fraction of the mean radiance, or max_spp (65536) is reached. seed: the same seed gives the same image.
    sensor: which one, counted from 0. split: also the channels beside the radiance. progress: called with (samples per
    pixel done, total expected).
    """
    for name, value in (("spp", spp), ("max_spp", max_spp), ("tolerance", tolerance)):
        if value is not None and not value > 0:
            raise InputError(f"{name} = {value} must be positive")
    start = time.perf_counter()
    camera, integrator = scene.sensor(sensor), scene.mi.integrator()
    integrator.refresh(scene.mi)
    width, height = camera.film().crop_size()
    total = Accumulator(width * height)
    goal = (spp or camera.sampler().sample_count()) if tolerance is None else (spp or PILOT_SPP)
    limit = goal if tolerance is None else (max_spp or DEFAULT_MAX_SPP)
    seeds = np.random.SeedSequence(seed)
    done, tail_errors = 0, []
    while done < min(goal, limit):
        step = min(goal, limit) - done
        if width * height * step > PASS_SAMPLES:
            step = max(1, min(step, PASS_SAMPLES // (width * height)))
        pixels_at_once = min(width * height, PASS_SAMPLES // step)
        for first in range(0, width * height, pixels_at_once):
            pass_seed = int(seeds.spawn(1)[0].generate_state(1)[0])
            pixels = min(pixels_at_once, width * height - first)
            total.add(first, integrator.observe(scene.mi, camera, pass_seed, step, first, pixels, split))
            tail_errors.append(integrator.tail_error)
        done += step
        if tolerance is not None and done >= goal:
            goal = samples_needed(total, done, tolerance)
        if progress:
            progress(done, min(goal, limit))
    rms_error = total.rms_error()
    reached = None if tolerance is None else rms_error is not None and rms_error <= tolerance
    closure_error = float(np.mean(tail_errors)) if integrator.closure == "tail" else None
    labels = integrator.emitters.labels
    return Render(image_channels(total, labels, (height, width), scene.band, split),
                  header(scene, integrator, sensor, done, seed, total, closure_error), scene.band,
                  total.channels[:-2 - 2 * len(labels)].mean(axis=1) if split else np.empty(0), done,
                  float(total.mean.mean()), rms_error, reached, total.invalid, done * width * height, closure_error,
                  time.perf_counter() - start)


def samples_needed(total: Accumulator, done: int, tolerance: float) -> int:
    """Samples per pixel that the error so far asks for; at most four times as many as are done, as it is itself an estimate."""
    error = total.rms_error()
    if error is None:
        return done + 1
    if error <= tolerance:
        return done
    return min(4 * done, max(done + 1, int(1.05 * done * (error / tolerance) ** 2) + 1))


def image_channels(total: Accumulator, labels: list[str], shape, band: Band, split: bool) -> dict[str, np.ndarray]:
    """The channels of the radiance EXR, in the order of design."""
    channels = {"Y": total.mean, "temperature.Y": brightness_temperature(band, total.mean)}
    if total.count.min() > 1:
        channels["stderr.Y"] = total.standard_error()
    if split:
        bounces = len(total.channels) - 2 * len(labels) - 2
        by_bounce, rest = total.channels[:bounces], iter(total.channels[bounces:])
        for k in range(min(bounces, BOUNCE_CHANNELS)):
            channels[f"bounce{k:02d}.Y"] = by_bounce[k] if k < BOUNCE_CHANNELS - 1 else by_bounce[k:].sum(axis=0)
        channels["closure.Y"] = next(rest)
        channels.update((f"group.{label}.Y", next(rest)) for label in labels)
        channels.update((f"seen.{label}.Y", next(rest)) for label in labels)
        channels["range.Y"] = next(rest)
    return {name: np.ascontiguousarray(values.reshape(shape), dtype=np.float32) for name, values in channels.items()}


def header(scene: Scene, integrator, sensor: int, spp: int, seed: int, total: Accumulator, closure_error) -> dict:
    """What the image must say about itself."""
    entries = {"scene": scene.name, "band": scene.band.name, "wavelengths_um": f"{scene.band.lower_um:g} {scene.band.upper_um:g}",
               "units": "W m^-2 sr^-1 (temperature.Y: K, range.Y: m, 0 where nothing was hit)",
               "parameters": json.dumps(scene.parameters), "sensor": sensor, "spp": spp, "seed": str(seed),
               "paths": str(spp * len(total.mean)), "invalid_samples": str(total.invalid), "max_bounces": integrator.max_bounces,
               "emitter_sampling": str(integrator.emitter_sampling), "closure": integrator.closure,
               "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, drjit {dr.__version__}, {mi.variant()}"}
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
