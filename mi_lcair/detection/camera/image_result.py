"""The frames and measures that `image` returns."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair import formats
from mi_lcair.declared import percent
from mi_lcair.detection.camera.electronics import Correction, apparent_temperature, signal_of
from mi_lcair.detection.camera.exposure import Exposure
from mi_lcair.detection.camera.measures import Measures
from mi_lcair.detection.camera.ranges import RangeRow
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import option
from mi_lcair.formats import column_of, pixel_axes, quantity_of_channel
from mi_lcair.laboratory.noise import NoiseComponents
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images.render import image_sections
from mi_lcair.rendering.images.truth import Truth
from mi_lcair.rendering.reflections import followed_row
from mi_lcair.rendering.sampling import DEFAULT_MAX_SPP
from mi_lcair.results import Result, entry
from mi_lcair.sections import Facts, Lines, Section, Table, error_row

if TYPE_CHECKING:
    import xarray


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
        apparent.Y: radiance at the aperture with the detector's response, W m^-2 sr^-1, blurred by
        the optics. electrons.Y: mean electrons of the signal with the optics' emission, or power.Y,
        W, of a bolometer. electrons.background.Y: those without the target. counts.Y,
        temperature.Y: counts of the first frame, and their apparent temperature, K.
        mean_temperature.Y: that of the mean electrons. stderr_K.Y and noise_K.Y: standard error of
        the rendering, and noise of the camera in time, K. speckle.Y: 1 where the former is larger,
        else 0.
    header : dict
        Header of the EXR.
    measures : Measures
    ranges : list of RangeRow
        The target at other ranges.
    detected_to_m, peak_detected_to_m : float or None
        Largest range within `ranges` at which the target is detected, m, by a matched filter and by
        its strongest pixel; None if it is not detected anywhere. If this is the end of the air's
        table, the true range may be larger.
    noise : NoiseComponents or None
        Noise of the frames by time, row and column, K at the background's temperature; None for one
        frame, and if more than 1 % of the pixels are saturated.
    view : CameraView
        Position and pointing of the camera, and the part of the frame with the target.
    mtf_parts : dict of str to ndarray
        Parts of the MTF by name, at the frequencies of the measures.
    exposure : Exposure
        The render.
    correction : Correction
        Non-uniformity correction; without `nuc` that of the optics' illumination and emission.
    remarks : list of str
        Limits of the results, one line each.
    seconds, render_seconds : float
        Time of the calculation, and of the render in it, s.
    truth : Truth or None
        True content of each pixel, before optics and noise; None if it was not requested.
    """

    scenario: Scenario
    band: Band = entry("band", "label")
    counts: np.ndarray = entry()
    channels: dict[str, np.ndarray] = entry()
    header: dict = entry()
    measures: Measures
    ranges: list[RangeRow]
    detected_to_m: float | None
    peak_detected_to_m: float | None
    noise: NoiseComponents | None = entry("noise_K")
    view: CameraView = entry()
    mtf_parts: dict[str, np.ndarray] = entry()
    exposure: Exposure = entry()
    correction: Correction = entry()
    remarks: list[str]
    seconds: float = entry("time_s")
    render_seconds: float = entry("render_time_s")
    truth: Truth | None = entry(default=None)

    kind = "image"
    drawn_by = "mi_lcair.show.pictures.image:figure"
    computed = {
        "mtf": "mtf",
        "scenario_name": "scenario.name",
        "frames": "counts.__len__",
        "spp": "exposure.spp",
        "rms_error": "exposure.rms_error",
        "tolerance": "scenario.render.tolerance",
        "reached": "exposure.reached",
    }
    saved_by = {
        ".exr": "mi_lcair.rendering.images.files:write_render",
        ".tif": "mi_lcair.detection.camera.image_result:write_counts",
    }

    def temperature(self, number: int) -> np.ndarray:
        """Apparent temperature of a frame, (H, W) [K]."""
        recorded = signal_of(self.scenario.camera, self.counts[number].astype(float))
        return apparent_temperature(self.band, self.correction.applied(recorded))

    def summary(self) -> str:
        """One line with the noise of the camera and the target's signal-to-noise ratio."""
        measures, (frames, height, width) = self.measures, self.counts.shape
        detected, by_peak = (
            "nowhere" if range_m is None else f"to {range_m:.5g} m"
            for range_m in (self.detected_to_m, self.peak_detected_to_m)
        )
        return (
            f"image of {self.scenario.name}, {self.band.label}: {frames} x {width} x {height} "
            f"pixels, NETD {millikelvin(measures.netd)}, {measures.pixels:.3g} pixels on the "
            f"target, signal-to-noise ratio {measures.snr:.4g}, detected {detected} by a matched "
            f"filter and {by_peak} by the strongest pixel"
        )

    def facts(self) -> Iterator[Any]:
        """The frame of the camera, its measures, and the target over range."""
        frame, made = image_sections(self.channels, self.header)
        yield from frame.parts
        yield Section("Camera", [Facts(list(measured(self)))])
        yield Section("Target over range", [Table.of(self.columns()), Lines("", [detected(self)])])
        yield made

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
        """A row for each range: pixels and electrons of the target, and its ratios to the noise."""
        rows, signal = self.ranges, {"electrons": "power_W"} if self.measures.unit == "W" else {}
        return {
            signal.get(name, name): np.array([getattr(row, name) for row in rows])
            for name in vars(rows[0])
        }

    def to_xarray(self) -> "xarray.Dataset":
        """The channels as an xarray Dataset over (row, column), and the frames' counts.

        Raises InputError if xarray is not installed.
        """
        over = ("row", "column")
        made = self.dataset(
            {column_of(name): (over, values) for name, values in self.channels.items()}
            | {"counts": (("frame", *over), self.counts)},  # of all frames
            pixel_axes(self.counts.shape[1:]),
        )
        for name in self.channels:
            made[column_of(name)].attrs["long_name"] = quantity_of_channel(name)[0]
        return made


def write_counts(path, image: Image) -> None:
    """Write the counts of all frames as the pages of a 16-bit TIFF."""
    camera = image.scenario.camera
    formats.write_tiff(
        path,
        image.counts,
        f"{camera.electrons_per_count:.9g} {camera.unit} in a count, {camera.pedestal:.9g} counts "
        f"without {'power' if camera.unit == 'W' else camera.unit}, {1e3 * camera.seconds:g} ms",
    )


def measured(image: Image) -> list[tuple[str, str]]:
    """Rows about the scenario, the camera, and its measures."""
    scenario, measures, camera = image.scenario, image.measures, image.scenario.camera
    mtf, last = measures.mtf, len(image.measures.mtf["frequency"]) - 1
    uniform = (
        "not measurable, as a uniform scene fills the well or its noise is below a count"
        if measures.netd_measured is None
        else f"measured {millikelvin(measures.netd_measured)}"
    )
    return [
        ("scenario", scenario.heading),
        (
            "camera",
            f"{camera.width} x {camera.height} pixels of {camera.pitch_um:g} um, "
            f"{camera.focal_length_mm:g} mm, f/{camera.f_number:g}, "
            f"{1e6 * camera.pixel_angle:.4g} urad a pixel, {image.band.label}",
        ),
        (
            "background",
            f"{measures.temperature:.5g} K, {camera.amount(measures.background)} of "
            + camera.amount(camera.well)
            + (f" in {1e3 * camera.seconds:g} ms" if camera.seconds else "")
            + (
                f", of which {camera.amount(measures.glow)} from the optics"
                if measures.glow
                else ""
            ),
        ),
        ("count", f"{camera.electrons_per_count:.5g} {camera.unit}, {camera.bits} bits"),
        (
            "NETD",
            f"predicted {millikelvin(measures.netd)}, {uniform}"
            + (
                f"; of shot noise alone {millikelvin(measures.netd_shot)}"
                if camera.detector == "photon"
                else ""
            ),
        ),
        *([("noise of the frames", image.noise.in_mK())] if image.noise else []),
        *(
            (
                f"MTF at {name}",
                f"predicted {mtf['predicted'][k]:.3f}, measured {mtf['measured'][k]:.3f}, "
                f"{mtf['frequency'][k]:.4g} cycles/mm",
            )
            for name, k in (("half of Nyquist", (last + 1) // 2), ("Nyquist", last))
        ),
        ("pixels on target", f"{measures.pixels:.4g}"),
        (
            "signal to noise",
            f"{measures.peak_snr:.4g} in the strongest pixel, {measures.snr:.4g} of the target "
            "with a matched filter",
        ),
        (
            "rendering",
            f"standard error {millikelvin(measures.render_error)} on the target, the same in all "
            f"frames; {image.exposure.spp} paths through a pixel{ending(image)}",
        ),
        followed_row(image.exposure.followed),
        error_row(
            "the rms standard error over the pixels on the target is "
            f"{percent(image.exposure.rms_error)} of its mean radiance",
            scenario.render.tolerance,
            image.exposure.reached,
        ),
    ]


def ending(image: Image) -> str:
    """Whether the largest number of paths has ended the rendering, in words."""
    most, spp = image.scenario.render.max_spp or DEFAULT_MAX_SPP, image.exposure.spp
    if image.exposure.reached is not False:
        return ""
    parts = image.view.parts**2
    rounded = f", rounded up for each of its {parts} parts" if spp > most else ""
    return f", ended by {option('max_spp', most)}{rounded}"


def millikelvin(kelvin: float | None) -> str:
    """A temperature difference in mK, as text. None is that of a background that saturates."""
    return "none, as the background saturates" if kelvin is None else f"{1e3 * kelvin:.3g} mK"


def detected(image: Image) -> str:
    """Up to which range the target is detected, in words."""
    scenario = image.scenario
    needed = (
        f"with a signal-to-noise ratio of {scenario.sensor.snr:g} and "
        f"{scenario.camera.least_pixels:g} pixels on the target"
    )
    last = 0.999 * image.ranges[-1].range_m
    by_filter, by_peak = (
        "at none of these ranges"
        if range_m is None
        else f"up to {range_m:.5g} m{' at least' if range_m > last else ''}"
        for range_m in (image.detected_to_m, image.peak_detected_to_m)
    )
    return f"detected by a matched filter {by_filter}, by the peak pixel {by_peak}, {needed}"
