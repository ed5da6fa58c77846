"""mi-lcair chart: measure the speed of the renderer, and compare methods."""

from dataclasses import asdict, fields

import click

from mi_lcair.cli.options import (
    examples,
    json_option,
    output_option,
    progress_bar,
    workers_options,
)
from mi_lcair.cli.output import print_columns, print_json

OF_PROPAGATION = (
    "propagation.png and .csv, propagation_thesis.png, propagation_radiosity.png, "
    "propagation_closure.png and .csv"
)


@click.group("chart", no_args_is_help=False)
def command():
    """Measure the speed of the renderer, and compare methods."""


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


@command.command("reflectance", epilog=examples("mi-lcair chart reflectance --quick -o charts"))
@chart_options("reflectance.png and reflectance.csv")
@workers_options
def reflectance(output, quick, json):
    """Compare eight methods that integrate a BRDF over the hemisphere.

    Printed and written are relative rms errors against samples and time in s.
    """
    from mi_lcair.benchmark import reflectance_chart
    from mi_lcair.files import filling
    from mi_lcair.reports import method_chart

    # `filling` comes before the work, so that an unusable folder is refused at once.
    with filling(output) as partial:
        with progress_bar("points") as progress:
            points = reflectance_chart.measure(quick, progress)
        method_chart.write_reflectance(partial, points)
    if json:
        print_json({"points": list(map(_entries, points))})
        return
    print_cheapest(points, "case", "samples")
    click.echo(f"wrote reflectance.png and reflectance.csv to {output}")


@command.command("propagation", epilog=examples("mi-lcair chart propagation --quick -o charts"))
@chart_options(OF_PROPAGATION)
@workers_options
def propagation(output, quick, json):
    """Compare methods that follow radiation from facet to facet.

    The methods are those of the thesis, path tracing and Mitsuba's own integrator, on six scenes.
    Printed and written are relative rms errors against rays and time in s.
    """
    from mi_lcair.benchmark import propagation_chart
    from mi_lcair.files import filling
    from mi_lcair.reports import closure_chart

    # `filling` comes before the work, so that an unusable folder is refused at once.
    with filling(output) as partial:
        with progress_bar("curves") as progress:
            result = propagation_chart.measure(quick, progress)
        closure_chart.write(partial, result)
    if json:
        print_json(
            {
                "limit_processor_seconds": result.effort.seconds,
                "points": list(map(_entries, result.points)),
                "closures": [asdict(closure) for closure in result.closures],
            }
        )
        return
    print_cheapest(result.points, "scene", "rays", result.limit)
    click.echo(
        "No larger effort of a method is tried once a run takes more than "
        f"{result.effort.seconds:g} s of processor time on each thread, however busy the machine."
    )
    click.echo(f"wrote {OF_PROPAGATION} to {output}")


@command.command("cavity", epilog=examples("mi-lcair chart cavity --quick -o charts"))
@chart_options("cavity.png, cavity.csv and gouffe.png")
@workers_options
def cavity(output, quick, json):
    """Render the thesis's eight cavities after 0 to 4 reflections.

    Printed and written are the areas of its Table B.1, Gouffé's emissivity, the exact one, and the
    apparent emissivity by reflections (its Fig 4.1). gouffe.png is its Fig 3.33. Areas are
    in m^2, emissivities are fractions.
    """
    from mi_lcair.cavities.openings import openings
    from mi_lcair.files import filling
    from mi_lcair.reports import openings_chart

    with filling(output) as partial:
        with progress_bar("cavities") as progress:
            rows = openings(2**14 if quick else 2**20, progress=progress)
        openings_chart.write(partial, rows)
    table = openings_chart.columns(rows)
    if json:
        print_json({"openings": table})
        return
    print_columns(
        [
            [name.replace("_", " ") for name in table],
            *(list(map(_cell, row)) for row in zip(*table.values())),
        ]
    )
    click.echo(f"wrote cavity.png, cavity.csv and gouffe.png to {output}")


@command.command("facet", epilog=examples("mi-lcair chart facet --quick -o charts"))
@chart_options("facet.png and facet.csv")
def facet(output, quick, json):
    """Compute the radiance of one facet with ever more samples of its hemisphere.

    It is a facet at the wing root of cylinder_ir_range (thesis Fig 3.21). Printed and written are
    radiances in W m^-2 sr^-1 by an even grid and by one that is fine about the mirror direction.
    """
    from mi_lcair.benchmark.facet_radiance import facet_radiance
    from mi_lcair.files import filling
    from mi_lcair.reports import facet_chart

    with filling(output) as partial:
        with progress_bar("grids") as progress:
            result = facet_radiance(list(range(20, 401, 60 if quick else 10)), progress)
        facet_chart.write(partial, result)
    if json:
        print_json(asdict(result))
        return
    rows = zip(result.samples, result.even, result.stratified)
    print_columns([["samples", "even", "stratified"], *(list(map(_cell, row)) for row in rows)])
    click.echo(f"finest grid: {result.reference:.5g}")
    click.echo(f"wrote facet.png and facet.csv to {output}")


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


def _entries(point) -> dict:
    """The attributes of a point for JSON: null for a memory that was not measured (NaN)."""
    return {name: None if value != value else value for name, value in asdict(point).items()}


def _cell(value) -> str:
    """A value as text for the table; empty for None."""
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
