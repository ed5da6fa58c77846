"""mi-lcair render: render a scene to a radiance image."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import scene_options
from mi_lcair.cli.output import Verdict, note_invalid, print_columns, print_json
from mi_lcair.cli.plan import rows as plan_rows
from mi_lcair.cli.usage.examples import examples
from mi_lcair.errors import InputError
from mi_lcair.fraction import percent


@click.command(
    "render",
    epilog=examples(
        "mi-lcair render open_box --spp 64 -o open_box.exr",
        "mi-lcair render cylinder_ir_range -D band=MWIR --tolerance 5% -o cylinder.exr",
    ),
)
@scene_options(
    spp="Samples per pixel, instead of --tolerance (default: the scene's own).",
    tolerance="Render until the rms standard error over the pixels is below this fraction of the "
    "mean radiance, such as 0.01 or 1%.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help="The image to write, FILE.exr.",
)
@click.option(
    "--atmosphere",
    help="Also write the radiance that arrives through an atmosphere: a bundled name, a CSV, a "
    "MODTRAN tape7, or vacuum.",
)
@click.option(
    "--range",
    "range_m",
    type=float,
    help="With --atmosphere: one range for the whole model, m (default: that of each pixel).",
)
def command(options, output, atmosphere, range_m):
    """Render SCENE to a radiance image.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Written is an OpenEXR file in W m^-2
    sr^-1: channel Y is the total radiance, the other channels are its parts, its standard error,
    the apparent temperature in K and the range in m. Printed are the mean and the error.
    """
    from mi_lcair.files import check_writable
    from mi_lcair.rendering.image import write_exr

    if output.suffix.lower() != ".exr":
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
    result = options.run_planned(mi_lcair.render, each_pixel=True, **air)
    write_exr(output, result.channels, result.header)
    note_invalid(result)

    verdict = Verdict.on(options, result.reached)
    if options.json:
        print_json(
            {
                "file": str(output),
                **result.as_dict(),
                **verdict.as_dict(),
                **options.planned(),
            }
        )
        return
    height, width = result.channels["Y"].shape
    error = "the rms standard error over the pixels is " + (
        "unknown for one sample"
        if result.rms_error is None
        else f"{percent(result.rms_error)} of the mean"
    )
    print_columns(
        [
            ("image", f"{output}, {width} x {height} pixels, {result.band.label}"),
            ("mean radiance", f"{result.mean:.6g} W m^-2 sr^-1"),
            verdict.row(error),
            ("samples per pixel", result.spp),
            ("time", f"{result.seconds:.2f} s"),
            *_remarks(options, result),
        ]
    )


def _remarks(options, result):
    """Yield (label, text) rows about the plan, unusable samples, and the closure."""
    if options.plan:
        yield "plan", ""
        yield from ((f"  {label}", text) for label, text in plan_rows(options.plan))
    if result.invalid:
        yield "invalid samples", f"{result.invalid} NaN or infinite, left out of the image"
    if result.closure_error is not None:
        yield "closure error", f"{result.closure_error:.2g} W m^-2 sr^-1 (estimated)"
