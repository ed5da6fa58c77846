"""mi-lcair heat: temperatures from what heats and cools a scene."""

import click

import mi_lcair
from mi_lcair.cli.options import (
    examples,
    json_option,
    output_option,
    prepare_renderer,
    renderer_options,
)
from mi_lcair.cli.output import check_outputs, print_result, print_written
from mi_lcair.errors import InputError

OF_HOUR = (".csv", ".vtp", ".vtu")  # files of the temperatures at one time
SUFFIXES = (*OF_HOUR, ".series", ".nc", ".json", ".html", ".png", ".svg", ".pdf")


@click.command("heat", epilog=examples("mi-lcair heat heat.toml -o temperatures.csv --hour 14"))
@click.argument("heat", metavar="HEAT.toml")
@output_option(f"the temperatures to FILE ({', '.join(SUFFIXES)})")
@click.option(
    "--hour",
    type=click.FloatRange(min=0),
    help="Time of the temperatures in a .csv, .vtp or .vtu file (default: that of the warmest "
    "facet).",
)
@renderer_options
@json_option
def command(heat, output, hour, variant, threads, json):
    """Temperatures of the facets of a scene from their heat balance.

    HEAT.toml has the tables [target], [weather], [groups.NAME], [sigma], [run] and [signature].
    Printed are the mean temperatures of the groups in K with their standard uncertainty, and what
    each uncertain input contributes. FILE.csv is what `mi-lcair import --temperatures` takes;
    FILE.nc has all times.
    """
    check_outputs((output, SUFFIXES))
    options = {} if hour is None else {"hour": hour}
    if options and (output is None or output.suffix.lower() not in OF_HOUR):
        raise InputError(f"--hour goes with an output {', '.join(OF_HOUR)}")
    prepare_renderer(variant, threads)
    result = mi_lcair.heat(heat)
    if output:
        result.save(output, **options)
    print_result(result, json)
    print_written(output)
