"""mi-lcair show: pictures of radiance images, facets and BRDFs."""

from pathlib import Path

import click

from mi_lcair.cli import pictures
from mi_lcair.cli.options import Assignment, json_option
from mi_lcair.cli.usage import completion
from mi_lcair.cli.usage.examples import examples
from mi_lcair.errors import InputError

FILE = click.Path(path_type=Path)
# The function that draws each kind of picture, and its options beside --output.
KINDS = {
    "an image": (pictures.image, ("channels", "log")),
    "--facet": (pictures.facet_view, ("facet", "parameters", "json")),
    "--facets": (pictures.facet_columns, ("facets", "channels", "log", "parameters", "sensor")),
    "a material": (pictures.brdf, ("band", "theta_deg", "materials")),
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
    "-o", "--output", type=FILE, help="The picture, FILE.png (default: named after WHAT)."
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
@click.option(
    "-D",
    "parameters",
    type=Assignment(),
    multiple=True,
    help="Set a $-parameter of the scene; may be repeated.",
)
@click.option(
    "-s",
    "--sensor",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Number of the scene's sensor, from 0.",
)
@click.option("--band", help="Band of the material.")
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
    """Make a PNG of WHAT, one of these:

    \b
    FILE.exr                            channels of a radiance image
    SCENE --facet N                     what a facet sees, its neighbours'
                                        solid angles and view factors
    SCENE --facets FILE.csv -c COLUMN   the facets, coloured by a table
    MATERIAL --band BAND                the BRDF over the hemisphere
    """
    kind = kind_of(ctx, what, options["facet"], options["facets"])
    draw, own = KINDS[kind]
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(parameter.name) is click.core.ParameterSource.COMMANDLINE
        if given and parameter.name not in ("what", "output", *own):
            raise click.UsageError(f"{parameter.opts[-1]} does not go with {kind}", ctx)
    if output and output.suffix.lower() != ".png":
        raise InputError(f"output '{output}' does not end in .png; show makes PNG pictures")
    draw(what, output, **{name: options[name] for name in own})


def kind_of(ctx, what: str, facet: int | None, facets: Path | None) -> str:
    """The kind of picture, a key of KINDS, that the arguments ask for.

    Raises UsageError for a scene without --facet or --facets.
    """
    from mi_lcair import scenes

    if facet is not None:
        return "--facet"
    if facets is not None:
        return "--facets"
    suffix = Path(what).suffix.lower()
    if suffix == ".xml" or what in scenes.names():
        raise click.UsageError(
            f"scene '{what}': give --facet N or --facets FILE.csv; `render` makes an image of it",
            ctx,
        )
    return "an image" if suffix == ".exr" else "a material"
