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
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.atmosphere import atmosphere as read_atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.progress import Progress
from mi_lcair.rendering.criteria import PixelError
from mi_lcair.rendering.images.apparent import apparent
from mi_lcair.rendering.images.render_result import Render
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.settings import planned
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import PILOT_SPP, PIXEL_RANDOMISATIONS, Windows, window_size

if TYPE_CHECKING:
    from mi_lcair.planning.plan import Plan

BOUNCE_CHANNELS = 17  # bounce channels in the image; the last holds all counts from 16 on
# Pixels along each side of the neighbourhood in which the errors of pixels are averaged
POOLED = 5


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
    sampling = Sampling(
        spp=spp, tolerance=tolerance, max_spp=max_spp, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    atmosphere = None if atmosphere is None else read_atmosphere(atmosphere)
    with planned(scene, plan, True, sampling) as (made, sampling):
        result = rendered(scene, sampling, split, atmosphere, range_m)
    return replace(result, plan=made)


def rendered(
    scene: Scene,
    sampling: Sampling,
    split: str | None = "image",
    atmosphere: Atmosphere | None = None,
    range_m: float | None = None,
) -> Render:
    """The image of a loaded scene under its own settings; see `render`."""
    if atmosphere is not None:
        atmosphere.check_covers(scene.band)
        if range_m is not None:
            atmosphere.path(range_m)  # raises InputError here, before anything is rendered
        split = "target"
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    sampling = sampling.settled(camera)
    randomisations = min(PIXEL_RANDOMISATIONS, sampling.spp or PILOT_SPP)
    windows = Windows.of_image(camera, randomisations)
    total = measure(
        scene,
        windows,
        sampling,
        Measurands.of(split, by_spectrum=atmosphere is not None),
        None if sampling.tolerance is None else PixelError(sampling.tolerance),
    )
    spp = int(total.traced[0])
    closure_error = None
    if total.tail is not None:
        closure_error = total.tail.error(scene.mi.integrator().max_bounces)
    size = windows.rows, windows.columns
    channels, air = image_channels(total, scene.band, size), {}
    if atmosphere is not None:
        air = {
            "atmosphere": atmosphere.name,
            "atmosphere_range_m": "range.Y" if range_m is None else f"{range_m:g}",
        }
        channels |= apparent(
            total.mean(),
            {name: total.mean(name) for name in total.sums},
            total.emitters.sources,
            scene.band,
            atmosphere,
            range_m,
        )
    return Render(
        channels={
            name: np.ascontiguousarray(values.reshape(size), dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scene, sampling, spp, total, closure_error) | air,
        band=scene.band,
        spp=spp,
        mean=float(total.mean().mean()),
        mean_error=total.mean_error(),
        rms_error=total.rms_error(),
        reached=total.reached,
        invalid=total.invalid,
        paths=int(total.traced.sum()),
        closure_error=closure_error,
        seconds=time.perf_counter() - start,
        scene_name=scene.name,
        window_m=window_size(camera),
        tolerance=sampling.tolerance,
    )


def image_channels(total: Totals, band: Band, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """Channels of the radiance EXR by name, in the order in which it has them, (P,) each.

    size: height and width of the image.
    """
    mean = total.mean()
    channels = {"Y": mean, "temperature.Y": brightness_temperature(band, mean)}
    if total.randomisations > 1:
        channels["stderr.Y"] = pixel_errors(total.standard_error(), size)
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


def pixel_errors(errors: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Standard errors of pixels, from the scatter in their neighbourhood, (P,).

    The scatter of a few paths through one pixel says little about its error: where paths rarely
    meet a source, most pixels have none. The rms over POOLED x POOLED pixels says more.
    """
    from scipy.ndimage import uniform_filter

    variance = uniform_filter(errors.reshape(size) ** 2, POOLED, mode="nearest")
    return np.sqrt(np.maximum(variance, 0)).ravel()


def header(scene: Scene, sampling: Sampling, spp: int, total: Totals, closure_error) -> dict:
    """Header of the radiance EXR: the scene, the settings and the versions."""
    integrator = scene.mi.integrator()
    entries = {
        "scene": scene.name,
        "band": scene.band.name,
        "wavelengths_um": f"{scene.band.lower_um:g} {scene.band.upper_um:g}",
        "units": "W m^-2 sr^-1 (temperature.Y: K, range.Y: m, 0 where nothing was hit)",
        "parameters": json.dumps(scene.parameters),
        "sensor": sampling.sensor,
        "spp": spp,
        "randomisations": total.randomisations,
        "seed": str(sampling.seed),
        "paths": str(int(total.traced.sum())),
        "invalid_samples": str(total.invalid),
        "max_bounces": integrator.max_bounces,
        "emitter_sampling": str(integrator.emitter_sampling),
        "closure": integrator.closure,
        "lobes": json.dumps({surface.material: surface.lobe for surface in scene.surfaces()}),
        "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, "
        f"drjit {dr.__version__}, {mi.variant()}",
    }
    size = window_size(scene.sensor(sampling.sensor))
    if size is not None:
        entries["window_m"] = f"{size[0]:.9g} {size[1]:.9g}"
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
