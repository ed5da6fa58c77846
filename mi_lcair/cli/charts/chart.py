"""mi-lcair chart: measure the speed of the renderer, and compare methods."""

from dataclasses import asdict, fields

import click

from mi_lcair.cli.charts import propagation as chart_propagation
from mi_lcair.cli.charts import reflectance as chart_reflectance
from mi_lcair.cli.options import json_option, progress_bar
from mi_lcair.cli.output import print_columns, print_json


@click.group("chart", no_args_is_help=False)
def command():
    """Measure the speed of the renderer, and compare methods."""


command.add_command(chart_reflectance.command)
command.add_command(chart_propagation.command)


@command.command("throughput")
@json_option
def throughput(json):
    """Measure paths and rays per second.

    Mitsuba's own integrators are measured on the same scenes. Printed are paths and rays per second
    and times in s; nothing is written. This takes about three minutes.
    """
    from mi_lcair.benchmark.throughput import measure

    with progress_bar("runs") as progress:
        result = measure(progress=progress)
    if json:
        print_json(asdict(result))
        return
    columns = [field.name for field in fields(result.rows[0])]
    print_columns(
        [
            [name.replace("_", " ") for name in columns],
            *([_cell(getattr(row, name)) for name in columns] for row in result.rows),
        ]
    )


def _cell(value) -> str:
    """A value as text for the table; empty for None."""
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
