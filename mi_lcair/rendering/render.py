"""Rendering in independent passes, with a given number of samples or to a tolerance."""

import json
import time
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.physics.atmosphere import Atmosphere
from mi_lcair.physics.atmosphere import atmosphere as read_atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.progress import Progress
from mi_lcair.rendering.apparent import apparent
from mi_lcair.rendering.limits import check_memory, check_paths, check_samples
from mi_lcair.rendering.render_result import Render
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.settings import planned
from mi_lcair.rendering.statistics import Totals, check_valid, student_factor
from mi_lcair.rendering.window import window_size

if TYPE_CHECKING:
    from mi_lcair.planning.plan import Plan

BOUNCE_CHANNELS = 17  # bounce channels in the image; the last holds all counts from 16 on
# Paths of one pass. A pass takes seconds, and Ctrl-C takes effect at its end.
PASS_SAMPLES = 2**20
# Independent randomisations of a pixel's points. Their scatter gives the standard error.
RANDOMISATIONS = 4
PILOT_SPP = 16  # samples per pixel before the first estimate of the error
DEFAULT_MAX_SPP = 2**16  # largest number of samples per pixel for a tolerance


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
    plan: "Plan | str | None" = None,
) -> Render:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
    spp : int or None
        Samples per pixel (the number in the scene), rounded up to a multiple of RANDOMISATIONS if
        it is larger. It does not go with a tolerance.
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
        What is recorded beside the radiance, see `PathTracer.trace`.
    atmosphere : Atmosphere, str, Path or None
        Also compute the apparent radiance through this atmosphere (`apparent.Y`, `path.Y`): one
        that is loaded, a bundled name, a CSV, a MODTRAN tape7, or "vacuum".
    range_m : float or None
        Range of the model for the atmosphere [m]. None: each pixel's own range.
    progress : callable or None
        Called with the samples per pixel that are done and their expected number.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    plan : Plan, "auto" or None
        Render under the settings of a plan that `mi_lcair.plan` made with each_pixel=True; "auto"
        makes one for the tolerance (1 %). The tolerance is then that of plan and noise together.

    Returns
    -------
    Render

    Raises
    ------
    InputError
        For settings out of bounds, samples beside a tolerance, a tolerance that cannot be reached,
        and an image that needs more memory than is free.
    """
    scene, tolerance = scene_of(scene, parameters), fraction(tolerance)
    atmosphere = None if atmosphere is None else read_atmosphere(atmosphere)
    with planned(scene, plan, True, spp, tolerance, seed, sensor, progress) as (made, tolerance):
        result = rendered(
            scene,
            spp,
            tolerance,
            max_spp,
            seed,
            sensor,
            split,
            atmosphere,
            range_m,
            progress,
        )
    return replace(result, plan=made)


def rendered(
    scene: Scene,
    spp: int | None,
    tolerance: float | None,
    max_spp: int | None,
    seed: int,
    sensor: int,
    split: str | None,
    atmosphere: Atmosphere | None,
    range_m: float | None,
    progress: Progress | None,
) -> Render:
    """The image of a loaded scene under its own settings; see `render`."""
    check_samples(spp, tolerance, max_spp)
    if atmosphere is not None:
        atmosphere.check_covers(scene.band)
        if range_m is not None:
            atmosphere.path(range_m)  # raises InputError here, before anything is rendered
        split = "target"
    start = time.perf_counter()
    camera = scene.sensor(sensor)
    width, height = camera.film().crop_size()
    goal = (spp or camera.sampler().sample_count()) if tolerance is None else PILOT_SPP
    limit = goal if tolerance is None else (max_spp or DEFAULT_MAX_SPP)
    check_paths(width * height, spp=goal if tolerance is None else spp, max_spp=max_spp)
    randomisations = min(RANDOMISATIONS, goal)
    whole = lambda samples: -(-samples // randomisations) * randomisations
    goal, limit = whole(goal), whole(limit)
    done = 0
    with scene.prepared(by_spectrum=atmosphere is not None) as tracer:
        check_memory(width * height, tracer, split)
        if tolerance is not None:
            check_reachable(tolerance, tracer, scene.name)
        total = Totals(
            width * height,
            randomisations,
            chance=tracer.chance_contribution(camera),
            systematic=tracer.systematic_error,
        )
        while done < min(goal, limit):
            step = min(min(goal, limit) - done, PASS_SAMPLES // (width * height))
            step = max(1, step // randomisations)  # points of each randomisation
            add_points(total, tracer, camera, (width, height), seed, split, done, step)
            done += step * randomisations
            check_valid(total.invalid, done * width * height, scene.name)
            if tolerance is not None and done >= goal:
                goal = whole(samples_needed(total, done, tolerance))
            if progress:
                progress(done, min(goal, limit))
    rms_error = total.rms_error()
    reached = None if tolerance is None else rms_error is not None and rms_error <= tolerance
    closure_error = None if total.tail is None else total.tail.error(tracer.max_bounces)
    channels, air = image_channels(total, scene.band), {}
    if atmosphere is not None:
        air = {
            "atmosphere": atmosphere.name,
            "atmosphere_range_m": "range.Y" if range_m is None else f"{range_m:g}",
        }
        channels |= apparent(
            total.mean(),
            {name: total.mean(name) for name in total.sums},
            tracer.emitters.sources,
            scene.band,
            atmosphere,
            range_m,
        )
    return Render(
        channels={
            name: np.ascontiguousarray(values.reshape(height, width), dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scene, tracer, sensor, done, seed, total, closure_error) | air,
        band=scene.band,
        spp=done,
        mean=float(total.mean().mean()),
        mean_error=total.mean_error(),
        rms_error=rms_error,
        reached=reached,
        invalid=total.invalid,
        paths=done * width * height,
        closure_error=closure_error,
        seconds=time.perf_counter() - start,
        scene_name=scene.name,
        window_m=window_size(camera),
        tolerance=tolerance,
    )


def add_points(
    total: Totals,
    tracer,
    camera,
    size: tuple[int, int],
    seed: int,
    split: str | None,
    done: int,
    points: int,
    kept=lambda sums: sums,
    tables=None,
    progress=None,
) -> None:
    """Trace more points of every window of an image, and add their sums to `total`.

    Parameters
    ----------
    total : Totals
    tracer : PathTracer
    camera : mi.Sensor
    size : tuple of int
        Number of windows in a row, and of rows.
    seed, split : int, str or None
        As for `render`.
    done : int
        Paths of each window that are done.
    points : int
        Points of each randomisation that are added.
    kept : callable
        Gives the `Sums` that are added from those of a launch.
    tables : ColumnTables or None
        Parameters in which the radiance is differentiated, see `PathTracer.trace`.
    progress : callable or None
        Called with the number of windows that are done.
    """
    columns, rows = size
    run = max(1, PASS_SAMPLES // (points * total.randomisations))  # windows
    for first in range(0, columns * rows, run):
        launch = Launch(
            columns=columns,
            rows=rows,
            seed=seed,
            randomisations=total.randomisations,
            points=points,
            first_point=done // total.randomisations,
            first=first,
            windows=min(run, columns * rows - first),
        )
        total.add(launch, kept(tracer.trace(camera, launch, Channels(split, tables=tables))))
        if progress:
            progress(first + launch.windows)


def check_reachable(tolerance: float, tracer, name: str, of_interval: bool = False) -> None:
    """Raise InputError if no number of samples reaches the tolerance, or none can confirm it.

    A tolerance cannot be confirmed if an emitter's radiance has no known bound.

    Parameters
    ----------
    tolerance : float
        Relative error.
    tracer : PathTracer
    name : str
        Name of the scene in messages.
    of_interval : bool
        Whether the tolerance is that of half of the 95 % interval, not of the standard error.
    """
    check_bounded(tracer.emitters, name)
    least = tracer.systematic_error * (student_factor(np.inf) if of_interval else 1.0)
    if tolerance <= least:
        raise InputError(
            f"{name}: tolerance = {tolerance:g} cannot be reached: Float32's rounding and "
            f"tabulated emissivities leave {'half a 95 % interval' if of_interval else 'an error'} "
            f"of {least:.2g}; ask for more than that"
        )


def check_bounded(emitters, name: str) -> None:
    """Raise InputError if the radiance of an emitter has no known bound."""
    if emitters.unbounded:
        raise InputError(
            f"{name}: no tolerance can be confirmed, as nothing bounds the radiance of "
            f"{', '.join(emitters.unbounded)}; give the number of samples (spp) instead"
        )


def samples_needed(total: Totals, done: int, tolerance: float) -> int:
    """Estimated number of samples per pixel for the tolerance, from the error after `done`."""
    error = total.rms_error()
    if error is None:
        return done + 1
    if error <= tolerance:
        return done
    # At most 4 times as many, because the error is itself an estimate
    return min(4 * done, int(done * 1.05 * (error / tolerance) ** 2) + 1)


def image_channels(total: Totals, band: Band) -> dict[str, np.ndarray]:
    """Channels of the radiance EXR by name, in the order in which it has them, (P,) each."""
    mean = total.mean()
    channels = {"Y": mean, "temperature.Y": brightness_temperature(band, mean)}
    if total.randomisations > 1:
        channels["stderr.Y"] = total.standard_error()
    parts = {name: total.mean(name) for name in total.sums}
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
        # Mean over the paths that hit something
        channels["range.Y"] = parts["range"] / np.maximum(parts["hit"], 1e-30)
    return channels


def header(
    scene: Scene, tracer, sensor: int, spp: int, seed: int, total: Totals, closure_error
) -> dict:
    """Header of the radiance EXR: the scene, the settings and the versions."""
    entries = {
        "scene": scene.name,
        "band": scene.band.name,
        "wavelengths_um": f"{scene.band.lower_um:g} {scene.band.upper_um:g}",
        "units": "W m^-2 sr^-1 (temperature.Y: K, range.Y: m, 0 where nothing was hit)",
        "parameters": json.dumps(scene.parameters),
        "sensor": sensor,
        "spp": spp,
        "randomisations": total.randomisations,
        "seed": str(seed),
        "paths": str(spp * len(total.valid)),
        "invalid_samples": str(total.invalid),
        "max_bounces": tracer.max_bounces,
        "emitter_sampling": str(tracer.emitter_sampling),
        "closure": tracer.closure,
        "lobes": json.dumps({surface.material: surface.lobe for surface in scene.surfaces()}),
        "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, "
        f"drjit {dr.__version__}, {mi.variant()}",
    }
    size = window_size(scene.sensor(sensor))
    if size is not None:
        entries["window_m"] = f"{size[0]:.9g} {size[1]:.9g}"
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
