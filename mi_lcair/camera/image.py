"""The image of a scenario's target as its camera records it."""

import time
from dataclasses import asdict, dataclass, field, replace
from functools import partial

import numpy as np

import mi_lcair
from mi_lcair.camera.calibration import AVERAGED, Correction, two_point
from mi_lcair.camera.exposure import Exposure, detector_mean, exposure
from mi_lcair.camera.frames import Pattern, counts, frame, saturated, signal_of
from mi_lcair.camera.measures import measured_mtf, measured_netd, netd, shot_noise_netd
from mi_lcair.camera.optics import MARGIN, Optics
from mi_lcair.camera.range_table import RangeRow, fine_ranges, range_rows, table_ranges
from mi_lcair.camera.response import (
    apparent_temperature,
    electron_band,
    electrons,
    electrons_per_kelvin,
)
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.contrast import setting_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import View, hidden_share

# Temperature of the blackbody whose spectrum weights the diffraction, K.
DIFFRACTION_K = 300.0
MOST_FRAMES = 10_000


@dataclass(frozen=True)
class Measures:
    """Measures of a camera and of the target in its image.

    Attributes
    ----------
    temperature : float
        Apparent temperature of the background, K. The NETD is stated there.
    background : float
        Electrons of the background in a pixel.
    noise : float
        Noise of such a pixel, electrons: in time, and without `nuc` the fixed pattern too.
    netd, netd_measured, netd_shot : float or None
        Noise-equivalent temperature difference, K: in closed form, from frames of a uniform scene,
        and of the shot noise alone. The measured one is None if the uniform scene saturates.
    mtf : dict of str to ndarray
        frequency (cycles/mm), predicted and measured MTF up to Nyquist.
    pixels : float
        Number of pixels on the target.
    peak_snr : float
        Largest difference of a pixel from the background, divided by its noise.
    snr : float
        Signal-to-noise ratio of the whole target with a matched filter.
    render_error : float
        Rms standard error of the rendering over the pixels on the target, K.
    saturated : float
        Share of the pixels that are saturated.
    """

    temperature: float
    background: float
    noise: float
    netd: float
    netd_measured: float | None
    netd_shot: float
    mtf: dict[str, np.ndarray]
    pixels: float
    peak_snr: float
    snr: float
    render_error: float
    saturated: float


@dataclass(frozen=True)
class Image:
    """Image of a scenario by its camera.

    Attributes
    ----------
    scenario : Scenario
    band : Band
        Band of the detector. Its in-band value of a spectral radiance is a number of electrons.
    counts : ndarray of uint16, shape (frames, H, W)
        Frames of the same scene with independent noise.
    channels : dict of str to ndarray, float32 (H, W)
        apparent.Y: radiance at the aperture, W m^-2 sr^-1, as the optics blur it. electrons.Y: mean
        electrons of the signal. counts.Y, temperature.Y: counts of the first frame, and their
        apparent temperature, K. mean_temperature.Y: that of the mean electrons. stderr_K.Y and
        noise_K.Y: standard error of the rendering, and noise of the camera in time, K.
    header : dict
        Header of the EXR.
    measures : Measures
    ranges : list of RangeRow
        The target at other ranges.
    detected_to_m : float or None
        Largest range within `ranges` at which the target is detected, m; None for nowhere. It may
        be more where that is the end of the air's table.
    view : CameraView
        Position and pointing of the camera, and the part of the frame with the target.
    mtf_parts : dict of str to ndarray
        Parts of the MTF by name, at the frequencies of the measures.
    exposure : Exposure
        The render.
    correction : Correction
        Non-uniformity correction, which changes nothing without `nuc`.
    remarks : list of str
        Limits of the results, one line each.
    seconds, render_seconds : float
        Time of the calculation, and of the render in it, s.
    """

    scenario: Scenario
    band: Band
    counts: np.ndarray
    channels: dict[str, np.ndarray]
    header: dict
    measures: Measures
    ranges: list[RangeRow]
    detected_to_m: float | None
    view: CameraView = field(repr=False)
    mtf_parts: dict[str, np.ndarray] = field(repr=False)
    exposure: Exposure = field(repr=False)
    correction: Correction = field(repr=False)
    remarks: list[str]
    seconds: float
    render_seconds: float

    def temperature(self, number: int) -> np.ndarray:
        """Apparent temperature of a frame, (H, W) [K]."""
        recorded = signal_of(self.scenario.camera, self.counts[number].astype(float))
        return apparent_temperature(self.band, self.correction.applied(recorded))

    def as_dict(self) -> dict:
        """A dictionary for JSON: the scenario as it was read, the measures, and the ranges."""
        return {
            "scenario": asdict(self.scenario),
            "band": self.band.label,
            "frames": len(self.counts),
            "measures": asdict(self.measures),
            "ranges": [asdict(row) for row in self.ranges],
            "detected_to_m": self.detected_to_m,
            "spp": self.exposure.spp,
            "rms_error": self.exposure.rms_error,
            "tolerance": self.scenario.render.tolerance,
            "reached": self.exposure.reached,
            "remarks": self.remarks,
            "seconds": self.seconds,
            "render_seconds": self.render_seconds,
        }


def image(scenario, frames: int = 1, seed: int = 0, progress=None) -> Image:
    """The image of a scenario's target as its camera records it.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [camera], or the file or bundled name that `Scenario.read` takes. Its
        spp, max_spp and tolerance of [render] are those of a pixel. Of several numbers of
        reflections, the largest is used.
    frames : int
        Number of frames. They have independent noise, and one render.
    seed : int
        Seed of the camera's noise and fixed pattern. The same seed gives the same frames.
    progress : callable, optional
        Called with (paths through a pixel done, expected).

    Returns
    -------
    Image

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario.read(scenario)
    for name, value, least, most in (
        ("frames", frames, 1, MOST_FRAMES),
        ("seed", seed, 0, 2**32 - 1),
    ):
        if not least <= value <= most:
            raise InputError(f"{name} = {value}; must lie in {least}..{most}")
    try:
        return recorded(scenario, frames, seed, progress)
    except InputError as error:
        raise InputError(f"scenario '{scenario.name}': {error}") from None


def recorded(scenario: Scenario, frames: int, seed: int, progress) -> Image:
    """The image of a scenario; see `image`."""
    start = time.perf_counter()
    imager, observer = scenario.camera, scenario.observer
    if imager is None:
        raise InputError(
            "has no table [camera]; give focal_length_mm, f_number, pitch_um, width, height, "
            "integration_time_ms and well_Me in it"
        )
    setting = setting_of(scenario)
    air, behind, target, scene = setting.air, setting.backdrop, setting.target, setting.view
    air.check_covers(scene.band)
    band = electron_band(setting.detector.band, imager, setting.detector.optics_transmittance)
    view = CameraView.of(
        target, View(observer.azimuth_deg, observer.elevation_deg), observer.range_m, imager
    )
    background = detector_mean(behind, band)
    temperature = float(apparent_temperature(band, background))
    pattern = Pattern.of(imager, seed)
    correction = two_point(imager, pattern, band, temperature, seed) if imager.nuc else Correction()

    rendering = time.perf_counter()
    bounces = max(scenario.render.max_bounces, default=scene.mi.integrator().max_bounces)
    with changed(scene, lobe=scenario.render.lobe, max_bounces=bounces):
        exposed = exposure(
            scene,
            view,
            scenario.render,
            band,
            air,
            behind,
            observer.range_m,
            scenario.atmosphere.extrapolate,
            progress,
        )
    render_seconds = time.perf_counter() - rendering

    optics = Optics(imager, band, partial(spectral_radiance, temperature=DIFFRACTION_K))
    signal = background + framed(view, optics.seen(exposed.contrast))
    signal = np.maximum(signal, 0)
    error = np.sqrt(framed(view, optics.variance(exposed.error**2)))
    radiance = detector_mean(behind, scene.band) + framed(view, optics.seen(exposed.radiance))
    recorded_counts = np.array(
        [counts(imager, frame(imager, pattern, signal, seed, k)) for k in range(frames)]
    )
    first = correction.applied(signal_of(imager, recorded_counts[0].astype(float)))
    mean_temperature = apparent_temperature(band, signal)
    per_kelvin = slope(band, mean_temperature)
    share = framed(view, optics.seen(exposed.share))
    channels = {
        "apparent.Y": radiance,
        "electrons.Y": signal,
        "counts.Y": recorded_counts[0],
        "temperature.Y": apparent_temperature(band, first),
        "mean_temperature.Y": mean_temperature,
        "stderr_K.Y": error / per_kelvin,
        "noise_K.Y": imager.noise(signal) / per_kelvin,
    }
    measures = measured(
        imager, band, optics, background, signal, share, channels["stderr_K.Y"], exposed, view, seed
    )
    to_range = partial(
        range_rows,
        exposed,
        optics,
        scene.band,
        band,
        air,
        background,
        measures.noise,
        scenario.sensor.snr,
    )
    ranges = table_ranges(air, target.radius, observer.range_m)
    detections = [row.range_m for row in to_range(fine_ranges(ranges)) if row.detected]
    return Image(
        scenario=scenario,
        band=band,
        counts=recorded_counts,
        channels={
            name: np.ascontiguousarray(values, dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scenario, scene, exposed, measures, bounces, frames, seed),
        measures=measures,
        ranges=to_range(ranges),
        detected_to_m=max(detections, default=None),
        view=view,
        mtf_parts=optics.parts(measures.mtf["frequency"]),
        exposure=exposed,
        correction=correction,
        remarks=[
            *scene.remarks,
            *invalid_remark(exposed.invalid, exposed.paths),
            *remarks(imager, view, signal, measures, hidden_share(scene, observer.range_m)),
        ],
        seconds=time.perf_counter() - start,
        render_seconds=render_seconds,
    )


def framed(view: CameraView, window) -> np.ndarray:
    """The frame with the pixels of a window that has MARGIN pixels around it; 0 elsewhere."""
    imager = view.imager
    whole = np.zeros((imager.height + 2 * MARGIN, imager.width + 2 * MARGIN))
    column, row = view.first
    height, width = window.shape
    whole[row : row + height, column : column + width] = window
    return whole[MARGIN:-MARGIN, MARGIN:-MARGIN]


def slope(band: Band, temperature) -> np.ndarray:
    """Change of the electrons with temperature, electrons/K, at many temperatures, K."""
    low, high = float(np.min(temperature)), float(np.max(temperature))
    at = np.linspace(max(low, 1.0), max(high, 1.0) + 1e-6, 64)
    return np.interp(temperature, at, [electrons_per_kelvin(band, T) for T in at])


def measured(
    imager: Imager,
    band: Band,
    optics: Optics,
    background: float,
    signal,
    share,
    error_K,
    exposed: Exposure,
    view: CameraView,
    seed: int,
) -> Measures:
    """The measures of a camera and of the target in an image, see `Measures`.

    signal, share, error_K: mean electrons, share of the target and standard error of the rendering
    in kelvin of each pixel, (H, W).
    """
    temperature = float(apparent_temperature(band, background))
    pattern = 0.0
    if not imager.nuc:
        pattern = np.hypot(imager.gain_nonuniformity * background, imager.offset_nonuniformity_e)
    noise = float(np.hypot(imager.noise(background), pattern))
    frequency, value = measured_mtf(optics)
    difference = signal - background
    on = share >= 0.5
    on = on if on.any() else share >= share.max()
    # The well must hold the uniform scene and its noise
    held = electrons(band, temperature) + imager.dark + 6 * imager.noise(background) < imager.well
    uniform = replace(imager, gain_nonuniformity=0.0, offset_nonuniformity_e=0.0)
    return Measures(
        temperature=temperature,
        background=background,
        noise=noise,
        netd=netd(imager, band, temperature),
        netd_measured=measured_netd(uniform, band, temperature, seed) if held else None,
        netd_shot=float(shot_noise_netd(band, temperature)),
        mtf={"frequency": frequency, "predicted": optics.mtf(frequency), "measured": value},
        pixels=exposed.area / view.pixel_m**2,
        peak_snr=float(np.abs(difference).max() / noise),
        snr=float(np.sqrt(np.sum(difference**2)) / noise),
        render_error=float(np.sqrt(np.mean(error_K[on] ** 2))),
        saturated=saturated(imager, signal),
    )


def remarks(
    imager: Imager, view: CameraView, signal, measures: Measures, hidden: float
) -> list[str]:
    """Remarks on the limits of an image, one line each."""
    lines = []
    if measures.saturated:
        lines.append(
            f"the detector is saturated in {100 * measures.saturated:.2g} % of the pixels, which "
            f"collect up to {1e-6 * signal.max():.4g} Me in a well of {imager.well_Me:g} Me: their "
            "temperature is at least the stated one; shorten integration_time_ms"
        )
    if view.is_cut:
        lines.append(
            "a part of the target is outside the frame; signal, pixels and ranges are those of the "
            "part inside"
        )
    if hidden > 0:
        lines.append(
            f"{hidden:.0%} of the target has sky or terrain of the scene between it and the "
            "observer; this sky or terrain is ignored and does not hide the target"
        )
    if measures.render_error > measures.netd:
        lines.append(
            f"the rendering's error, {1e3 * measures.render_error:.3g} mK on the target, is larger "
            f"than the camera's NETD, {1e3 * measures.netd:.3g} mK, and is the same in all frames; "
            "raise spp of [render]"
        )
    return lines


def header(
    scenario: Scenario, scene, exposed: Exposure, measures: Measures, bounces: int, frames, seed
) -> dict:
    """Header of the EXR: the scenario, the camera, its measures and the versions."""
    camera = {f"camera_{name}": value for name, value in asdict(scenario.camera).items()}
    return {
        "scenario": scenario.name,
        "scene": scene.name,
        "band": scenario.sensor.detector().band.label,
        "units": "apparent.Y: W m^-2 sr^-1; electrons.Y: 1; counts.Y: 1; others: K",
        "max_bounces": bounces,
        "spp": exposed.spp,
        "rms_error": exposed.rms_error,
        "range_m": scenario.observer.range_m,
        "frames": frames,
        "noise_seed": str(seed),
        "seed": str(scenario.render.seed),
        "netd_K": measures.netd,
        "electrons_per_count": scenario.camera.electrons_per_count,
        "pedestal_counts": scenario.camera.pedestal,
        "nuc_frames": AVERAGED if scenario.camera.nuc else 0,
        "versions": f"mi_lcair {mi_lcair.__version__}",
        **camera,
    }
