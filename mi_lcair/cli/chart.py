"""mi-lcair chart: measurements of the renderer itself, and of methods against each other."""

from dataclasses import asdict, fields

import click

from mi_lcair.cli.charts import propagation as chart_propagation
from mi_lcair.cli.charts import reflectance as chart_reflectance
from mi_lcair.cli.options import json_option, progress_bar
from mi_lcair.cli.output import print_columns, print_json


@click.group("chart", no_args_is_help=False)
def command():
    """Measure the renderer, and chart methods against each other."""


command.add_command(chart_reflectance.command)
command.add_command(chart_propagation.command)


@command.command("throughput")
@json_option
def throughput(json):
    """Paths and rays per second, side by side with stock Mitsuba on the same scene; a minute."""
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
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
