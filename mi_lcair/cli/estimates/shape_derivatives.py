"""mi-lcair shape-derivatives: which part of a surface to move."""

import click

import mi_lcair
from mi_lcair.cli.options import POSITIVE, examples, loading_options, output_option, sensor_option
from mi_lcair.cli.output import print_result, print_written
from mi_lcair.drawing import PICTURES
from mi_lcair.formats import VTK


@click.command(
    "shape-derivatives",
    epilog=examples(
        "mi-lcair shape-derivatives cylinder_ir_range --group self --spp 4 -o shape.png",
    ),
)
@loading_options
@sensor_option
@click.option("--group", required=True, help="Group of the model whose surface moves.")
@click.option(
    "--spp",
    type=POSITIVE,
    help="Number of paths, divided by the number of pixels of the film (default: the scene's own).",
)
@output_option(
    "the derivatives by facet, FILE.csv or .json, for ParaView, FILE.vtp or .vtu, as a picture, "
    "FILE.png, or as a page, FILE.html",
    (".csv", ".json", ".html", *VTK, *PICTURES),
)
def command(options, sensor, group, spp, output):
    """Show where moving a surface changes the intensity.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Printed
    is the derivative of the target's intensity in W/sr with respect to an outward displacement of
    each facet, per m and m^2, and the change if the whole surface moves.
    """
    result = options.run(mi_lcair.shape_derivatives, group=group, sensor=sensor, spp=spp)
    if output:
        result.save(output)
    print_result(result)
    print_written(output)
