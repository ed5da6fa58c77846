"""mi-lcair show: pictures of what the commands read and write."""

from pathlib import Path

import click

from mi_lcair.cli.files import pictures, sources
from mi_lcair.cli.options import changes_option, json_option, sensor_option
from mi_lcair.cli.usage import completion
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import check_suffix, check_writable

FILE = click.Path(path_type=Path)
SCALE = ("log", "vmin", "vmax", "cmap", "common_scale", "outlines")
SCENE = ("parameters", "sensor")
# The function that draws each kind of picture, and its options beside --output.
KINDS = {
    sources.FACET: (pictures.facet_view, ("facet", "parameters", "json")),
    sources.FACETS: (pictures.facet_columns, ("facets", "channels", *SCALE, *SCENE)),
    sources.IMAGE: (pictures.image, ("channels", *SCALE, "scene", *SCENE)),
    sources.TREND: (pictures.trend, ()),
    sources.SPECTRUM: (pictures.spectrum, ()),
    sources.MODEL: (pictures.model, ("materials",)),
    sources.SCENE: (pictures.scene, ("parameters",)),
    sources.SCENARIO: (pictures.scenario, ("parameters",)),
    sources.MATERIAL: (pictures.brdf, ("band", "theta_deg", "materials")),
}


@click.command(
    "show",
    epilog=examples(
        "mi-lcair show open_box.exr -o open_box.png",
        "mi-lcair show gloss_black --band LWIR -o brdf.png",
    ),
)
@click.argument("what", shell_complete=completion.pictured)
@click.option(
    "-o",
    "--output",
    type=FILE,
    help="The picture, FILE.png, .svg or .pdf (default: named after WHAT).",
)
@click.option(
    "-c",
    "--channel",
    "channels",
    multiple=True,
    help="Channel of FILE.exr (default: Y) or column of FILE.csv, or a pattern such as 'bounce*'; "
    "may be repeated.",
)
@click.option("--log", is_flag=True, help="Logarithmic colours.")
@click.option("--vmin", type=float, help="Value at the lower end of the colour scale.")
@click.option("--vmax", type=float, help="Value at the upper end of the colour scale.")
@click.option("--cmap", metavar="NAME", help="Colour map of Matplotlib, such as gray or viridis.")
@click.option(
    "--common-scale/--own-scales",
    default=True,
    help="One scale for all panels of a quantity (default), or one for each panel.",
)
@click.option("--outlines", is_flag=True, help="Draw lines between the facets.")
@click.option(
    "--scene",
    help="With --outlines: the scene of FILE.exr, if it is not a bundled one.",
)
@click.option(
    "--facet",
    type=click.IntRange(min=0),
    metavar="N",
    help="Number of the facet whose view is shown, from 0.",
)
@click.option(
    "--facets",
    type=FILE,
    metavar="FILE.csv",
    help="Table with a column `facet` and others to colour the facets by.",
)
@changes_option("Set a $-parameter of the scene, or change an entry of the scenario", "parameters")
@sensor_option
@click.option("--band", help="Band of the material (default: that of a fit of one band).")
@click.option("--materials", type=FILE, metavar="TOML", help="Your own materials.")
@click.option(
    "--theta-deg",
    type=click.FloatRange(0, 90, max_open=True),
    default=30,
    show_default=True,
    help="Angle of incidence in degrees.",
)
@json_option
@click.pass_context
def command(ctx, what, output, **options):
    """Write a picture of WHAT, one of these:

    \b
    FILE.exr                            channels of an image
    FILE.csv, FILE.nc                   a trend, or a spectrum of a signature
    SCENE, MODEL.obj, FOLDER            three views of a model; FOLDER is
                                        what import wrote
    SCENE --facet N                     what a facet sees, its neighbours'
                                        solid angles and view factors
    SCENE --facets FILE.csv -c COLUMN   the facets, coloured by a table
    SCENARIO.toml                       what it states, and its target
    MATERIAL --band BAND                the BRDF over the hemisphere
    """
    kind = sources.kind_of(what, options["facet"], options["facets"], options["materials"])
    draw, own = KINDS[kind]
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(parameter.name) is click.core.ParameterSource.COMMANDLINE
        if given and parameter.name not in ("what", "output", *own):
            raise click.UsageError(f"{parameter.opts[-1]} does not go with {kind}", ctx)
    if options["scene"] and not options["outlines"]:
        raise InputError("--scene names the scene whose facets --outlines draws; give that too")
    if output:
        check_suffix(output, PICTURES)
        check_writable(output)
    draw(what, output, **{name: options[name] for name in own})
