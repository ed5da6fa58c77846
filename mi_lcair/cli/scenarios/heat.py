"""mi-lcair heat: temperatures from what heats and cools a scene."""

from functools import partial

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import write_and_print
from mi_lcair.errors import InputError

OF_HOUR = (".csv", ".vtp", ".vtu")  # files of the temperatures at one time
SUFFIXES = (*OF_HOUR, ".series", ".nc", ".json", ".html", ".png", ".svg", ".pdf")


@options.command("heat", "mi-lcair heat heat.toml -o temperatures.csv --hour 14")
@click.argument("heat", metavar="HEAT.toml")
@options.output(f"the temperatures to FILE ({', '.join(SUFFIXES)})", SUFFIXES)
@options.option(
    "--hour",
    "Time of the temperatures in a .csv, .vtp or .vtu file (default: that of the warmest facet).",
    click.FloatRange(min=0),
)
@options.renderer
def command(heat, output, hour):
    """Temperatures of facets from their heat balance.

    HEAT.toml has the tables [target], [weather], [groups.NAME], [sigma], [run] and [signature].
    Printed are the mean temperatures of the groups in K with their standard uncertainty, and what
    each uncertain input contributes. FILE.csv is what `mi-lcair import --temperatures` takes;
    FILE.nc has all times.
    """
    settings = {} if hour is None else {"hour": hour}
    if settings and (output is None or output.suffix.lower() not in OF_HOUR):
        raise InputError(f"--hour goes with an output {', '.join(OF_HOUR)}")
    result = mi_lcair.heat(heat)
    write_and_print(result, {output: partial(result.save, **settings)})
