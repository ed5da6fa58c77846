"""Sections of an image: of a render, or of the channels and the header of an EXR."""

from functools import partial

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.formats.channels import wavelengths_of
from mi_lcair.rendering.images.exr import window_of
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.reports.page.image_panel import image_panel
from mi_lcair.results.cells import error_row, unpacked, words_of
from mi_lcair.results.sections import Drawing, Facts, Remarks, Section

FIRST = ("apparent.Y", "Y", "temperature.Y")  # channels that are shown first, at most two
FIRST_OF_CAMERA = ("temperature.Y", "apparent.Y")
MEANINGS = {
    "stderr.Y": "stderr.Y is the standard error of Y",
    "apparent.Y": "apparent.Y is the radiance that arrives through the air",
    "temperature.Y": "temperature.Y is the brightness temperature",
    "range.Y": "range.Y is the distance to what is seen",
}


def sections(render) -> list[Section]:
    """The image of a render with its mean radiance and error, and how it was made."""
    height, width = render.channels["Y"].shape
    error = "the rms standard error over the pixels is " + (
        "unknown" if render.rms_error is None else f"{percent(render.rms_error)} of the mean"
    )
    rows = [
        ("image", f"{width} x {height} pixels, {render.band.label}"),
        ("mean radiance", f"{render.mean:.6g} W m^-2 sr^-1"),
        error_row(error, render.tolerance, render.reached),
        ("samples per pixel", render.spp),
    ]
    if render.closure_error is not None:
        rows.append(("closure error", f"{render.closure_error:.2g} W m^-2 sr^-1 (estimated)"))
    remarks = Remarks(invalid_remark(render.invalid, render.paths))
    image, made = image_sections(render.channels, render.header)
    return [Section("Image", [Facts(rows), remarks, *image.parts]), made]


def image_sections(channels: dict, header: dict) -> list[Section]:
    """The images of an EXR, and its header as how it was made.

    Axes are in metres if the header states the window of an orthographic sensor.
    """
    first = FIRST_OF_CAMERA if "counts.Y" in channels else FIRST
    shown = [name for name in first if name in channels][:2]
    height, width = next(iter(channels.values())).shape
    words = f"{width} × {height} pixels, {len(channels)} channels. {meanings(channels)}"
    drawing = Drawing(partial(image_panel, channels, shown, window_of(header)))
    rows = [(words_of(name), unpacked(value)) for name, value in header.items()]
    parts = [words, drawing]
    if spectral := wavelengths_of(channels):
        brightest = sum(channels[name] for name in spectral).argmax()
        row, column = map(int, np.unravel_index(brightest, (height, width)))
        parts += [
            f"The brightest pixel, in row {row} and column {column}, by wavelength:",
            Drawing(partial(pixel_spectrum, channels, (row, column))),
        ]
    return [
        Section("Image", parts),
        Section("How the image was made", [Facts(rows)], is_detail=True),
    ]


def pixel_spectrum(channels: dict, pixel: tuple[int, int]):
    """The panel of the spectrum of a pixel (row, column)."""
    from mi_lcair.reports.page.line_panel import line_panel
    from mi_lcair.reports.pictures.pixel_spectrum import charts

    return line_panel(charts(channels, pixel))


def meanings(channels: dict) -> str:
    """What the channels of an image are, in a sentence or two."""
    words = [meaning for name, meaning in MEANINGS.items() if name in channels]
    if any(name.startswith("seen.") for name in channels):
        words.append(
            "group.LABEL.Y is radiance by what emitted it, seen.LABEL.Y by what is seen first"
        )
    return "; ".join(words) + "." if words else ""
