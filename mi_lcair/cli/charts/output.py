"""Options and printed table that the charts of methods share on the command line."""

import click

from mi_lcair.cli.options import json_option, output_option
from mi_lcair.cli.output import print_columns


def chart_options(files: str):
    """Decorator that gives a command the options -o FOLDER, --quick and --json.

    The command receives `output`, `quick` and `json`. `files` names its files in the help.
    """
    written = output_option(
        f"{files} to FOLDER, which is made if it is absent",
        metavar="FOLDER",
        default=".",
    )
    quick = click.option(
        "--quick",
        is_flag=True,
        help="Measure fewer efforts and repetitions, in seconds instead of minutes.",
    )

    def decorator(command):
        return written(quick(json_option(command)))

    return decorator


def print_cheapest(points, case: str, cost: str, limit: str = "") -> None:
    """Print the cheapest method for each case and tolerance of the rms error.

    `case` and `cost` are the headings of the columns of cases and of samples. `limit` says in words
    up to which effort the methods were tried.
    """
    from mi_lcair.benchmark import chart

    rows = [[case, "rms error", "cheapest", cost, "time"]]
    for name in chart.names(points, "case"):
        for tolerance in chart.TOLERANCES:
            best = chart.cheapest(points, name, tolerance)
            rows.append(
                [
                    name,
                    chart.percent(tolerance),
                    best.method if best else f"none reaches it{limit}",
                    *chart.costs(best),
                ]
            )
    print_columns(rows)
