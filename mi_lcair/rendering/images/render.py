"""Rendering in independent passes, with a given number of samples or to a tolerance."""

import json
import time
from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.physics.air.atmosphere import Atmosphere
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.plugins.recorders.by_bounce import BOUNCE_CHANNELS
from mi_lcair.rendering.images.apparent import apparent, through
from mi_lcair.rendering.images.render_result import Render
from mi_lcair.rendering.images.spectral import (
    LAYOUT,
    check_bins,
    spectral_channels,
    spectral_measurands,
)
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.pixels.errors import PixelError, pixel_errors
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import PILOT_SPP, PIXEL_RANDOMISATIONS, Windows, window_size


def render_image(
    scene: Scene,
    sampling: Sampling,
    split: str | None = "image",
    atmosphere: Atmosphere | None = None,
    range_m: float | None = None,
    bins: int = 0,
    errors_um: Sequence[float] = (),
) -> Render:
    """Render the image of a loaded scene under its own settings.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is the rms standard error over the pixels, as a fraction of the mean.
    split : str or None
        What is recorded in addition to the radiance, see `Channels`.
    atmosphere : Atmosphere or None
        Air for the apparent radiance.
    range_m : float or None
        Range of the model for the atmosphere [m]. None: each pixel's own range.
    bins : int
        Number of wavelengths at which the spectral radiance is recorded; 0 for none.
    errors_um : sequence of float
        Wavelengths of which the nearest ones get a standard error of each pixel [um].
    """
    check_bins(scene, bins, errors_um, atmosphere)
    if atmosphere is not None:
        atmosphere.check_covers(scene.band)
        if range_m is not None:
            atmosphere.path(range_m)  # raises InputError here, before anything is rendered
        split = "target"
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    sampling = sampling.settled(camera)
    randomisations = min(PIXEL_RANDOMISATIONS, sampling.spp or PILOT_SPP)
    windows = Windows.of_image(camera, randomisations, by_randomisation=bool(errors_um))
    measurands = Measurands.of(split, by_spectrum=atmosphere is not None)
    if bins:
        measurands = spectral_measurands(scene, split, bins)
    criterion = None if sampling.tolerance is None else PixelError(sampling.tolerance)
    with through(scene, atmosphere, range_m):
        total = measure(scene, windows, sampling, measurands, criterion)
    spp = round(total.traced.mean())
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
    wavelengths = Bins(scene.band, bins)
    channels |= spectral_channels(total, wavelengths, size, errors_um) if bins else {}
    return Render(
        channels={
            name: np.ascontiguousarray(values.reshape(size), dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scene, sampling, spp, total, closure_error) | air | (LAYOUT if bins else {}),
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
        wavelengths_um=wavelengths.nodes_um if bins else np.empty(0),
    )


def image_channels(total: Totals, band: Band, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """Channels of the radiance EXR by name, in the order in which it has them, (P,) each.

    size: height and width of the image.
    """
    mean = total.mean()
    channels = {"Y": mean, "temperature.Y": brightness_temperature(band, mean)}
    if total.randomisations > 1:
        channels["stderr.Y"] = pixel_errors(total, size)
    if np.ptp(total.traced):
        channels["spp.Y"] = total.traced
    parts = {name: total.mean(name) for name in total.sums if not name.startswith("bin.")}
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
        "opening_sampling": str(integrator.opening_sampling),
        "closure": integrator.closure,
        "lobes": json.dumps({surface.material: surface.lobe for surface in scene.surfaces()}),
        "versions": f"mi_lcair {mi_lcair.__version__}, mitsuba {mi.__version__}, "
        f"drjit {dr.__version__}, {mi.variant()}",
    }
    size = window_size(scene.sensor(sampling.sensor))
    if total.bins:
        entries["wavelengths"] = total.bins
    if size is not None:
        entries["window_m"] = f"{size[0]:.9g} {size[1]:.9g}"
    if closure_error is not None:
        entries["closure_error"] = closure_error
    return entries
