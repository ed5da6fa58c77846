"""mi-lcair shape-derivatives: which part of a surface to move."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.formats import VTK


@options.command(
    "shape-derivatives",
    "mi-lcair shape-derivatives cylinder_ir_range --group self --spp 4 -o shape.png",
)
@options.loading
@options.sensor
@options.option("--group", "Group of the model whose surface moves.", required=True)
@options.option(
    "--spp",
    "Number of paths, divided by the number of pixels of the film (default: the scene's own).",
    options.POSITIVE,
)
@options.output(
    "the derivatives by facet, FILE.csv or .json, for ParaView, FILE.vtp or .vtu, as a picture, "
    "FILE.png, or as a page, FILE.html",
    (".csv", ".json", ".html", *VTK, *PICTURES),
)
def command(scene, sensor, group, spp, output):
    """Show where moving a surface changes the intensity.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Printed
    is the derivative of the target's intensity in W/sr with respect to an outward displacement of
    each facet, per m and m^2, and the change if the whole surface moves.
    """
    result = scene.run(mi_lcair.shape_derivatives, group=group, sensor=sensor, spp=spp)
    write_and_print(result, {output: result.save})
