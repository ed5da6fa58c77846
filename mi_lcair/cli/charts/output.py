"""What the charts of methods share on the command line: their options, and the table that they
print.
"""

import click

from mi_lcair.cli.options import json_option
from mi_lcair.cli.output import print_columns


def chart_options(files: str):
    """Give a command -o FOLDER, for its `files`, --quick and --json; it receives `folder`, `quick`
    and `json`.
    """

    def decorator(command):
        command = click.option(
            "--quick",
            is_flag=True,
            help="Fewer efforts and repetitions: seconds instead of minutes.",
        )(json_option(command))
        return click.option(
            "-o",
            "--output",
            "folder",
            type=click.Path(),
            default=".",
            show_default=True,
            help=f"Folder to write {files} to; made if it is absent.",
        )(command)

    return decorator


def print_cheapest(points, case: str, cost: str) -> None:
    """For each case and tolerance the cheapest method; `case` and `cost` head the columns of cases
    and samples.
    """
    from mi_lcair.benchmark import chart

    rows = [[case, "to reach", "cheapest", cost, "time"]]
    for name in chart.names(points, "case"):
        for tolerance in chart.TOLERANCES:
            best = chart.cheapest(points, name, tolerance)
            rows.append(
                [name, f"{tolerance:.1%}", best.method if best else "none", *chart.costs(best)]
            )
    print_columns(rows)
