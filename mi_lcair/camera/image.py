"""The image of a scenario's target as its camera records it."""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mi_lcair.camera.calibration import Correction, two_point
from mi_lcair.camera.exposure import Exposure, detector_mean, exposure
from mi_lcair.camera.frames import Pattern, counts, frame, signal_of
from mi_lcair.camera.notes import header, remarks
from mi_lcair.camera.optics import MARGIN, Optics
from mi_lcair.camera.quality import Measures, measured
from mi_lcair.camera.range_table import RangeRow, backgrounds, fine_ranges, range_rows, table_ranges
from mi_lcair.camera.response import (
    apparent_temperature,
    electron_band,
    in_kelvin,
)
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.contrast import setting_of
from mi_lcair.detection.scenario import Scenario, scenario_of
from mi_lcair.errors import InputError
from mi_lcair.formats import tiff
from mi_lcair.formats.channels import column_of
from mi_lcair.fraction import fraction
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Imager
from mi_lcair.progress import Progress
from mi_lcair.rendering.limits import GIB, available_memory
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import View, hidden_share
from mi_lcair.results import Result

if TYPE_CHECKING:
    import xarray

# Temperature of the blackbody whose spectrum weights the diffraction, K.
DIFFRACTION_K = 300.0
# Smallest temperature, K, at which the NETD is stated and the non-uniformity is corrected. It
# stands for the background where that is colder, such as space.
COLDEST_K = 100.0
MOST_FRAMES = 10_000
BYTES_PER_PIXEL = 400  # memory for a pixel of the frame beside its counts [bytes]


@dataclass(frozen=True, repr=False)
class Image(Result):
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

    kind: ClassVar[str] = "image"
    drawn_by: ClassVar[str] = "mi_lcair.reports.camera_plot:figure"
    saved_by: ClassVar[dict[str, str]] = {
        ".exr": "mi_lcair.rendering.image:write_render",
        ".tif": "mi_lcair.camera.image:write_counts",
    }

    def temperature(self, number: int) -> np.ndarray:
        """Apparent temperature of a frame, (H, W) [K]."""
        recorded = signal_of(self.scenario.camera, self.counts[number].astype(float))
        return apparent_temperature(self.band, self.correction.applied(recorded))

    def summary(self) -> str:
        """One line with the noise of the camera and the target's signal-to-noise ratio."""
        measures, (frames, height, width) = self.measures, self.counts.shape
        detected = "nowhere" if self.detected_to_m is None else f"to {self.detected_to_m:.5g} m"
        return (
            f"image of {self.scenario.name}, {self.band.label}: {frames} x {width} x {height} "
            f"pixels, NETD {1e3 * measures.netd:.3g} mK, {measures.pixels:.3g} pixels on the "
            f"target, signal-to-noise ratio {measures.snr:.4g}, detected {detected}"
        )

    def entries(self) -> dict:
        """Entries for JSON: the scenario as it was read, the measures, and the ranges."""
        return {
            "scenario_name": self.scenario.name,
            "scenario": asdict(self.scenario),
            "band": self.band.label,
            "frames": len(self.counts),
            "measures": self.measures.as_dict(),
            "mtf": self.mtf(),
            "ranges": [asdict(row) for row in self.ranges],
            "detected_to_m": self.detected_to_m,
            "spp": self.exposure.spp,
            "rms_error": self.exposure.rms_error,
            "tolerance": self.scenario.render.tolerance,
            "reached": self.exposure.reached,
            "remarks": self.remarks,
            "time_s": self.seconds,
            "render_time_s": self.render_seconds,
        }

    def mtf(self) -> dict[str, np.ndarray]:
        """MTF over frequency_cycles_per_mm: predicted, measured, and the parts of the product."""
        curves = self.measures.mtf
        return {
            "frequency_cycles_per_mm": curves["frequency"],
            "predicted": curves["predicted"],
            "measured": curves["measured"],
            **{f"part.{name}": values for name, values in self.mtf_parts.items()},
        }

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each range: pixels and electrons of the target, and its ratio to the noise."""
        rows = [asdict(row) for row in self.ranges]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def to_xarray(self) -> "xarray.Dataset":
        """The channels as an xarray Dataset over (row, column), and the frames' counts.

        Raises InputError if xarray is not installed.
        """
        _, height, width = self.counts.shape
        over = ("row", "column")
        return self.dataset(
            {column_of(name): (over, values) for name, values in self.channels.items()}
            | {"counts": (("frame", *over), self.counts)},  # of all frames
            {"row": ("row", np.arange(height)), "column": ("column", np.arange(width))},
        )


def write_counts(path, image: Image) -> None:
    """Write the counts of all frames as the pages of a 16-bit TIFF."""
    camera = image.scenario.camera
    tiff.write(
        path,
        image.counts,
        f"{camera.electrons_per_count:.9g} electrons in a count, {camera.pedestal:.9g} counts "
        f"without electrons, {camera.integration_time_ms:g} ms",
    )


def image(
    scenario: Scenario | str | PathLike[str],
    frames: int = 1,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
) -> Image:
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
    parameters : mapping of str to object, optional
        Entries of a scenario that is named, by dotted key such as {"sensor.band": "LWIR"}.
    spp, tolerance, max_spp
        Entries of [render] of a scenario that is named: paths through a pixel, or the allowed rms
        standard error over the pixels on the target, such as 0.01 or "1%", and the most paths.

    Returns
    -------
    Image

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    scenario = scenario_of(
        scenario, parameters, spp=spp, tolerance=fraction(tolerance), max_spp=max_spp
    )
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
    air, target, scene = setting.air, setting.target, setting.view
    behind = setting.backdrop.at_sensor(observer.range_m)
    air.check_covers(scene.band)
    band = electron_band(setting.detector.band, imager, setting.detector.optics_transmittance)
    view = CameraView.of(
        target, View(observer.azimuth_deg, observer.elevation_deg), observer.range_m, imager
    )
    background = detector_mean(behind, band)
    temperature = max(float(apparent_temperature(band, background)), COLDEST_K)
    check_frames(imager, frames)
    pattern = Pattern.of(imager, seed)
    correction = two_point(imager, pattern, band, temperature, seed) if imager.nuc else Correction()

    optics = Optics(imager, band, partial(spectral_radiance, temperature=DIFFRACTION_K))
    optics.check_spread()

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

    signal = background + framed(view, optics.seen(exposed.contrast))
    signal = np.maximum(signal, 0)
    error = np.sqrt(framed(view, optics.variance(exposed.error**2)))
    radiance = detector_mean(behind, scene.band) + framed(view, optics.seen(exposed.radiance))
    recorded_counts = np.array(
        [counts(imager, frame(imager, pattern, signal, seed, k)) for k in range(frames)]
    )
    first = correction.applied(signal_of(imager, recorded_counts[0].astype(float)))
    mean_temperature = apparent_temperature(band, signal)
    share = framed(view, optics.seen(exposed.share))
    channels = {
        "apparent.Y": radiance,
        "electrons.Y": signal,
        "counts.Y": recorded_counts[0],
        "temperature.Y": apparent_temperature(band, first),
        "mean_temperature.Y": mean_temperature,
        "stderr_K.Y": in_kelvin(band, signal, error),
        "noise_K.Y": in_kelvin(band, signal, imager.noise(signal)),
    }
    measures = measured(
        imager,
        band,
        optics,
        temperature,
        background,
        signal,
        share,
        channels["stderr_K.Y"],
        exposed.area / view.pixel_m**2,
        seed,
    )
    to_range = partial(
        range_rows,
        exposed,
        optics,
        scene.band,
        band,
        air,
        noise=measures.noise,
        snr=scenario.sensor.snr,
    )
    ranges, levels = backgrounds(
        setting.backdrop, band, table_ranges(air, target.radius, observer.range_m)
    )
    fine = fine_ranges(ranges)
    found = to_range(background=np.interp(fine, ranges, levels), ranges_m=fine)
    detections = [row.range_m for row in found if row.detected]
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
        ranges=to_range(background=levels, ranges_m=ranges),
        detected_to_m=max(detections, default=None),
        view=view,
        mtf_parts=optics.parts(measures.mtf["frequency"]),
        exposure=exposed,
        correction=correction,
        remarks=[
            *scene.remarks,
            *invalid_remark(exposed.invalid, exposed.paths),
            *remarks(
                imager,
                view,
                signal,
                measures,
                hidden_share(scene, observer.range_m),
                exposed.reached,
            ),
        ],
        seconds=time.perf_counter() - start,
        render_seconds=render_seconds,
    )


def framed(view: CameraView, window) -> np.ndarray:
    """The frame with the pixels of a window that has MARGIN pixels around it; 0 elsewhere."""
    imager = view.imager
    whole = np.zeros((imager.height + 2 * MARGIN, imager.width + 2 * MARGIN))
    column, row = view.window[0]
    height, width = window.shape
    whole[row : row + height, column : column + width] = window
    return whole[MARGIN:-MARGIN, MARGIN:-MARGIN]


def check_frames(imager: Imager, frames: int) -> None:
    """Raise InputError for frames that need more memory than is free."""
    needed = imager.width * imager.height * (BYTES_PER_PIXEL + 4 * frames)
    available = available_memory()
    if available is not None and needed > available:
        raise InputError(
            f"{frames} frames of {imager.width} x {imager.height} pixels need "
            f"{needed / GIB:.1f} GiB of memory, and {available / GIB:.1f} GiB are free; ask for "
            "fewer frames"
        )
