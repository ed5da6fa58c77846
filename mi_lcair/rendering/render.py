"""Rendering in independent passes: radiance with its standard error, to a number of samples or to a
tolerance.
"""

import json
import time
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.rendering.apparent import apparent
from mi_lcair.rendering.limits import check_memory, check_paths
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Accumulator, check_valid

BOUNCE_CHANNELS = 17  # in the image; the last holds every bounce count from 16 on
PASS_SAMPLES = 2**20  # paths in flight at once: a pass takes seconds, and Ctrl-C waits for its end
PILOT_SPP = 16
DEFAULT_MAX_SPP = 2**16


@dataclass(frozen=True)
class Render:
    """A rendered scene.

    channels: name -> float32 (H, W), the channels of the radiance EXR [W m^-2 sr^-1; temperature.Y
    K; range.Y m]. parts: name -> (mean over the pixels, its standard error or None) of everything
    that was recorded, Float64, under the names of `plugins.channels`; covariance: of the means of
    those in COVARYING, in their order in `parts`, None without them. sources: what `source.N` stand
    for. mean: mean radiance, mean_error: its standard error; rms_error: rms over the pixels of the standard error, with what a
    source that too few paths meet may add, as a fraction of the mean (None for one sample per
    pixel); reached: whether the tolerance was met (None without one); invalid: NaN or infinite
    samples, left out; closure_error: estimated error of closure = tail [W m^-2 sr^-1], None
    otherwise.
    """

    channels: dict[str, np.ndarray]
    header: dict[str, str | int | float]
    band: Band
    parts: dict[str, tuple[float, float | None]]
    covariance: np.ndarray | None
    sources: Sources
    spp: int
    mean: float
    mean_error: float | None
    rms_error: float | None
    reached: bool | None
    invalid: int
    paths: int
    closure_error: float | None
    seconds: float

    @property
    def by_bounce(self) -> np.ndarray:
        """Mean radiance over the pixels by number of reflections, all counts up to 64 apart."""
        return np.array(
            [mean for name, (mean, _) in self.parts.items() if name.startswith("bounce.")]
        )


def render(
    scene: Scene,
    spp: int | None = None,
    tolerance: float | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    split: str | None = "image",
    by_spectrum: bool = False,
    facets=None,
    atmosphere: Atmosphere | None = None,
    range_m: float | None = None,
    progress=None,
) -> Render:
    """Renders a scene.

    spp: samples per pixel (the scene's own). tolerance: instead render until the rms standard error
    over the pixels is below this fraction of the mean radiance, or max_spp (65536) is reached.
    seed: the same seed gives the same image. sensor: which one, counted from 0. split, by_spectrum,
    facets: what is recorded beside the radiance, see `PathTracer.sampled`. atmosphere: also
    what of the picture arrives through it, over range_m or else each pixel's own range
    (`apparent.Y`, `path.Y`). progress: called with (samples per pixel done, total expected).
    """
    for name, value in (("spp", spp), ("max_spp", max_spp), ("tolerance", tolerance)):
        if value is not None and not value > 0:
            raise InputError(f"{name} = {value} must be positive")
    if atmosphere is not None:
        atmosphere.check_covers(scene.band)
        if range_m is not None:
            atmosphere.path(range_m)  # refused now, not after the work
        split, by_spectrum = "target", True
    start = time.perf_counter()
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    goal = (spp or camera.sampler().sample_count()) if tolerance is None else (spp or PILOT_SPP)
    limit = goal if tolerance is None else (max_spp or DEFAULT_MAX_SPP)
    check_paths(width * height, spp=goal if tolerance is None else spp, max_spp=max_spp)
    seeds = np.random.SeedSequence(seed)
    done = 0
    with scene.prepared(by_spectrum) as tracer:
        check_memory(width * height, tracer, split)
        if tolerance is not None:
            check_reachable(tolerance, tracer, scene.name)
        total = Accumulator(
            width * height, tracer.chance_contribution(camera), tracer.systematic_error
        )
        while done < min(goal, limit):
            step = max(1, min(min(goal, limit) - done, PASS_SAMPLES // (width * height)))
            step -= step % 2 if step > 1 else 0  # even: a pass can be told in two halves
            run = min(width * height, PASS_SAMPLES // step)
            for first in range(0, width * height, run):
                pass_seed = int(seeds.spawn(1)[0].generate_state(1)[0])
                pixels = min(run, width * height - first)
                total.add(
                    first,
                    tracer.observe(camera, pass_seed, step, first, pixels, split, facets),
                )
            done += step
            check_valid(total.invalid, done * width * height, scene.name)
            if tolerance is not None and done >= goal:
                goal = samples_needed(total, done, tolerance)
            if progress:
                progress(done, min(goal, limit))
    rms_error = total.rms_error()
    reached = None if tolerance is None else rms_error is not None and rms_error <= tolerance
    closure_error = None if total.tail is None else total.tail.error(tracer.max_bounces)
    scale = total.error_scale()
    covariance = total.covariance * scale if by_spectrum and scale is not None else None
    channels, air = image_channels(total, scene.band), {}
    if atmosphere is not None:
        air = {
            "atmosphere": atmosphere.name,
            "atmosphere_range_m": "range.Y" if range_m is None else f"{range_m:g}",
        }
        channels |= apparent(
            total.mean, total.channels, tracer.emitters.sources, scene.band, atmosphere, range_m
        )
    return Render(
        channels={
            name: np.ascontiguousarray(values.reshape(height, width), dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scene, tracer, sensor, done, seed, total, closure_error) | air,
        band=scene.band,
        parts=total.means(),
        covariance=covariance,
        sources=tracer.emitters.sources,
        spp=done,
        mean=float(total.mean.mean()),
        mean_error=total.mean_error(),
        rms_error=rms_error,
        reached=reached,
        invalid=total.invalid,
        paths=done * width * height,
        closure_error=closure_error,
        seconds=time.perf_counter() - start,
    )


def check_reachable(tolerance: float, tracer, name: str) -> None:
    """Raises InputError for a tolerance that no number of samples reaches, and where nothing bounds
    the radiance of an emitter.
    """
    check_bounded(tracer.emitters, name)
    if tolerance <= tracer.systematic_error:
        raise InputError(
            f"{name}: tolerance = {tolerance:g} cannot be reached: Float32's rounding and tabulated "
            f"emissivities leave a relative error of {tracer.systematic_error:.1g}; ask for more than that"
        )


def check_bounded(emitters, name: str) -> None:
    """Raises InputError if the radiance of an emitter has no known bound."""
    if emitters.unbounded:
        raise InputError(
            f"{name}: no tolerance can be confirmed, as nothing bounds the radiance of "
            f"{', '.join(emitters.unbounded)}; give the number of samples (spp) instead"
        )


def samples_needed(total: Accumulator, done: int, tolerance: float) -> int:
    """Samples per pixel that the error so far asks for."""
    error = total.rms_error()
    if error is None:
        return done + 1
    if error <= tolerance:
        return done
    return min(4 * done, int(done * growth(error / tolerance)) + 1)


def growth(excess: float) -> float:
    """By what factor more samples an error asks for that is `excess` (> 1) times too large; at most
    4, as it is itself an estimate.
    """
    return min(4.0, 1.05 * excess**2)


def image_channels(total: Accumulator, band: Band) -> dict[str, np.ndarray]:
    """The channels of the radiance EXR, in the order of design, one value per pixel."""
    channels = {"Y": total.mean, "temperature.Y": brightness_temperature(band, total.mean)}
    if total.count.min() > 1:
        channels["stderr.Y"] = total.standard_error()
    parts = total.channels
    if parts:
        by_bounce = [values for name, values in parts.items() if name.startswith("bounce.")]
        for k in range(min(len(by_bounce), BOUNCE_CHANNELS)):
            channels[f"bounce{k:02d}.Y"] = (
                by_bounce[k] if k < BOUNCE_CHANNELS - 1 else sum(by_bounce[k:])
            )
        channels["closure.Y"] = parts["closure"]
        channels.update(
            (f"{name}.Y", values)
            for name, values in parts.items()
            if name.startswith(("group.", "seen."))
        )
        channels["target.Y"] = parts["target"]
        channels["range.Y"] = parts["range"] / np.maximum(
            parts["hit"], 1e-30
        )  # over the hits alone
    return channels


def header(
    scene: Scene, tracer, sensor: int, spp: int, seed: int, total: Accumulator, closure_error
) -> dict:
    """What the image must say about itself."""
    entries = {
        "scene": scene.name,
        "band": scene.band.name,
        "wavelengths_um": f"{scene.band.lower_um:g} {scene.band.upper_um:g}",
        "units": "W m^-2 sr^-1 (temperature.Y: K, range.Y: m, 0 where nothing was hit)",
        "parameters": json.dumps(scene.parameters),
        "sensor": sensor,
        "spp": spp,
        "seed": str(seed),
        "paths": str(spp * len(total.mean)),
        "invalid_samples": str(total.invalid),
        "max_bounces": tracer.max_bounces,
        "emitter_sampling": str(tracer.emitter_sampling),
        "closure": tracer.closure,
        "lobes": json.dumps({surface.material: surface.lobe for surface in scene.surfaces()}),
        "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, drjit {dr.__version__}, {mi.variant()}",
    }
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
