"""mi-lcair render: render a scene to a radiance image."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_next, print_result, time_row
from mi_lcair.errors import InputError


@options.command(
    "render",
    "mi-lcair render open_box --spp 64 -o open_box.exr",
    "mi-lcair render cylinder_ir_range -D band=MWIR --tolerance 5% -o cylinder.exr",
)
@options.scene(
    spp="Samples per pixel, instead of --tolerance (default: the scene's own).",
    tolerance="Render until the rms standard error over the pixels is below this fraction of the "
    "mean radiance, such as 0.01 or 1%.",
)
@options.output("the image, FILE.exr", required=True)
@options.option(
    "--atmosphere",
    "Also write the radiance that arrives through an atmosphere: a bundled name, a CSV, a "
    "MODTRAN tape7, or vacuum.",
)
@options.option(
    "--range range_m",
    "With --atmosphere: one range for the whole model, m (default: that of each pixel).",
    float,
)
@options.option(
    "--bins",
    "Also write the spectral radiance at this number of even wavelengths over the band.",
    int,
    default=0,
)
@options.option(
    "--wavelengths",
    "The same at the wavelengths A, A + STEP, ... up to B, um. Sets the scene's `band`.",
    metavar="A:B:STEP",
)
@options.option(
    "--errors errors_um",
    "Also write the standard error of each pixel at this wavelength of --bins or "
    "--wavelengths, um; may be repeated.",
    float,
    multiple=True,
    metavar="UM",
)
@options.workers
def command(scene, output, atmosphere, range_m, bins, wavelengths, errors_um):
    """Render SCENE to a radiance image.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Written is an OpenEXR file in W m^-2
    sr^-1: channel Y is the total radiance, the other channels are its parts, its standard error,
    the apparent temperature in K and the range in m. With --bins it also has the spectral radiance
    in W m^-2 sr^-1 um^-1, which FILE.hdr in place of FILE.exr makes an ENVI file, and FILE.nc a
    netCDF file with the brightness temperatures. Printed are the mean and the error.
    """
    from mi_lcair.files import check_writable
    from mi_lcair.rendering.images.exr import write_exr

    if wavelengths is not None:
        from mi_lcair.rendering.images.spectral import even_wavelengths

        if bins or "band" in scene.parameters:
            raise InputError("--wavelengths sets bins and band; leave out --bins and -D band")
        scene.parameters["band"], bins = even_wavelengths(wavelengths)
    is_cube = bool(bins) and output.suffix.lower() in (".hdr", ".nc")
    if output.suffix.lower() != ".exr" and not is_cube:
        raise InputError(
            f"output '{output}' does not end in .exr; render writes OpenEXR images, and show "
            "makes PNGs"
        )
    check_writable(output)
    if range_m is not None and atmosphere is None:
        raise InputError("--range is the length of the path through an --atmosphere; name one")
    air = {}
    if atmosphere is not None:
        from mi_lcair.physics.atmosphere import atmosphere as read

        air = {"atmosphere": read(atmosphere), "range_m": range_m}
    result = scene.run(mi_lcair.render, bins=bins, errors_um=errors_um, **air)
    if is_cube:
        result.save(output)
    else:
        write_exr(output, result.channels, result.header)
    rows = [("file", str(output)), time_row(result)]
    print_result(result, rows, {"file": str(output)})
    if not is_cube:
        print_next(["show", output])
