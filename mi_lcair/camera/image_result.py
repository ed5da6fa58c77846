"""The frames and measures that `image` returns."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.camera.electronics.calibration import Correction
from mi_lcair.camera.electronics.frames import signal_of
from mi_lcair.camera.electronics.response import apparent_temperature
from mi_lcair.camera.exposure import Exposure
from mi_lcair.camera.quality import Measures
from mi_lcair.camera.ranges.range_table import RangeRow
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.scenario import Scenario
from mi_lcair.formats import tiff
from mi_lcair.formats.channels import column_of, pixel_axes
from mi_lcair.physics.bands import Band
from mi_lcair.results import Result

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
        apparent.Y: radiance at the aperture with the detector's response, W m^-2 sr^-1, as the
        optics blur it. electrons.Y: mean electrons of the signal with the optics' emission.
        electrons.background.Y: those without the target. counts.Y, temperature.Y: counts of the
        first frame, and their apparent temperature, K. mean_temperature.Y: that of the mean
        electrons. stderr_K.Y and noise_K.Y: standard error of the rendering, and noise of the
        camera in time, K. speckle.Y: 1 where the former is larger, else 0.
    header : dict
        Header of the EXR.
    measures : Measures
    ranges : list of RangeRow
        The target at other ranges.
    detected_to_m, peak_detected_to_m : float or None
        Largest range within `ranges` at which the target is detected, m, by a matched filter and by
        its strongest pixel; None for nowhere. It may be more where that is the end of the air's
        table.
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
    """

    scenario: Scenario
    band: Band
    counts: np.ndarray
    channels: dict[str, np.ndarray]
    header: dict
    measures: Measures
    ranges: list[RangeRow]
    detected_to_m: float | None
    peak_detected_to_m: float | None
    view: CameraView = field(repr=False)
    mtf_parts: dict[str, np.ndarray] = field(repr=False)
    exposure: Exposure = field(repr=False)
    correction: Correction = field(repr=False)
    remarks: list[str]
    seconds: float
    render_seconds: float

    kind = "image"
    saved_by = {
        ".exr": "mi_lcair.rendering.images.exr:write_render",
        ".tif": "mi_lcair.camera.image_result:write_counts",
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
            f"pixels, NETD {1e3 * measures.netd:.3g} mK, {measures.pixels:.3g} pixels on the "
            f"target, signal-to-noise ratio {measures.snr:.4g}, detected {detected} by a matched "
            f"filter and {by_peak} by the strongest pixel"
        )

    def entries(self) -> dict:
        """Entries for JSON: the scenario as it was read, the measures, and the ranges."""
        return {
            "scenario_name": self.scenario.name,
            "scenario": self.scenario,
            "band": self.band.label,
            "frames": len(self.counts),
            "measures": self.measures.as_dict(),
            "mtf": self.mtf(),
            "ranges": self.ranges,
            "detected_to_m": self.detected_to_m,
            "peak_detected_to_m": self.peak_detected_to_m,
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
        """A row for each range: pixels and electrons of the target, and its ratios to the noise."""
        rows = self.ranges
        return {name: np.array([getattr(row, name) for row in rows]) for name in vars(rows[0])}

    def to_xarray(self) -> "xarray.Dataset":
        """The channels as an xarray Dataset over (row, column), and the frames' counts.

        Raises InputError if xarray is not installed.
        """
        over = ("row", "column")
        return self.dataset(
            {column_of(name): (over, values) for name, values in self.channels.items()}
            | {"counts": (("frame", *over), self.counts)},  # of all frames
            pixel_axes(self.counts.shape[1:]),
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
