"""mi-lcair temperature: the temperature of an object from an image of a thermographic camera."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import Called, print_next, write_and_print

SUFFIXES = (".tif", ".tiff", ".csv", ".exr", ".json", ".html", ".png", ".svg", ".pdf", ".nc")
QUANTITIES = {
    "reflected": ("K", "Apparent temperature of what the object reflects."),
    "transmittance": ("0..1", "Transmittance of the air (default: 1)."),
    "air-temperature": (
        "K",
        "Temperature of the air (default: that of --reflected; with --distance, the atmosphere's).",
    ),
    "distance": ("M", "Distance of the object in m: the air is computed."),
    "humidity": ("0..0.98", "Relative humidity of the air, with --distance."),
}


def quantities(command):
    """Give a command an option for each quantity."""
    for name, (metavar, help) in reversed(QUANTITIES.items()):
        command = click.option(f"--{name}", metavar=metavar, help=help)(command)
    return command


@options.command(
    "temperature",
    "mi-lcair temperature 305.2 --band LWIR --emissivity 0.92+-0.02 --reflected 293+-2",
    "mi-lcair temperature seen.exr --emissivity 0.92+-0.02 --reflected 285+-2 "
    "--distance 1000 -o object.tif",
    cls=Called,
)
@click.argument("image", metavar="IMAGE|K")
@options.option("--band", "Band of the camera; an EXR states its own.", metavar="BAND")
@options.option(
    "--emissivity", "Emissivity of the object in the band.", required=True, metavar="0..1"
)
@quantities
@options.option(
    "--sigma",
    "Standard uncertainty of the image, common to all pixels.",
    click.FloatRange(min=0),
    default=0.0,
    metavar="K",
)
@options.option("--scale", "Kelvin of one count of the image, such as 0.01.", float, metavar="K")
@options.option("--offset", "273.15 for an image in degrees Celsius, else 0.", float, metavar="K")
@options.output(
    "the temperatures to FILE (.tif, .csv, .exr with their uncertainty), or a picture", SUFFIXES
)
@options.json
@click.pass_obj
def command(call, image, band, output, sigma, **measurement):
    """Temperature of an object with its uncertainty.

    IMAGE holds apparent temperatures in K, as a camera shows them for an emissivity of 1: a TIFF,
    CSV or NPY file, an EXR with temperature.Y, or one number. Counts and degrees Celsius
    need --scale or --offset. A quantity may have a standard uncertainty: 0.92+-0.02. Printed are
    the temperature in K and what each quantity contributes to its uncertainty; written is the image
    in K.
    """
    result = mi_lcair.temperature(image, band, sigma=sigma, **options.given(measurement))
    write_and_print(result, {output: result.save})
    if not output and result.kelvin.ndim == 2:
        print_next([*call, "-o", f"{Path(image).stem}_object.png"])
