"""Sections of a camera's image."""

from mi_lcair.declared import percent
from mi_lcair.reports.sections.render import image_sections
from mi_lcair.results.cells import error_row
from mi_lcair.results.sections import Facts, Lines, Remarks, Section, Table


def sections(image) -> list[Section]:
    """The frame of a camera, its measures, and the target over range."""
    frame, made = image_sections(image.channels, image.header)
    columns = image.columns()
    verdicts = ("yes" if row.detected else f"no, too few: {row.lacks}" for row in image.ranges)
    over_range = {
        ("range", "m"): (columns["range_m"], ".6g"),
        "pixels on target": (columns["pixels"], ".4g"),
        "electrons": (columns["electrons"], ".4g"),
        "signal to noise, matched filter": (columns["snr"], ".4g"),
        "of the peak pixel": (columns["peak_snr"], ".4g"),
        "detected by matched filter": (verdicts, ""),
    }
    return [
        frame,
        Section("Camera", [Facts(measured(image)), Remarks(image.remarks)]),
        Section("Target over range", [Table.of(over_range), Lines("", [detected(image)])]),
        made,
    ]


def measured(image) -> list[tuple[str, str]]:
    """Rows about the scenario, the camera, and its measures."""
    scenario, measures, camera = image.scenario, image.measures, image.scenario.camera
    mtf, last = measures.mtf, len(image.measures.mtf["frequency"]) - 1
    uniform = (
        "not measurable, as a uniform scene saturates or its noise is below a count"
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
            f"{measures.temperature:.5g} K, {1e-6 * measures.background:.4g} Me of "
            f"{camera.well_Me:g} Me in {camera.integration_time_ms:g} ms"
            + (
                f", of which {1e-6 * measures.glow:.4g} Me from the optics" if measures.glow else ""
            ),
        ),
        ("count", f"{camera.electrons_per_count:.5g} electrons, {camera.bits} bits"),
        (
            "NETD",
            f"predicted {millikelvin(measures.netd)}, {uniform}; of shot noise alone "
            f"{millikelvin(measures.netd_shot)}",
        ),
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
            f"frames; {image.exposure.spp} paths through a pixel",
        ),
        error_row(
            "the rms standard error over the pixels on the target is "
            f"{percent(image.exposure.rms_error)} of its mean radiance",
            scenario.render.tolerance,
            image.exposure.reached,
        ),
    ]


def millikelvin(kelvin: float) -> str:
    """A temperature difference in mK, as text."""
    return f"{1e3 * kelvin:.4g} mK"


def detected(image) -> str:
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
