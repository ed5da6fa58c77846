"""mi-lcair chart: measure the speed of the renderer, and compare methods."""

from collections.abc import Callable
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path

import click

from mi_lcair.cli import options
from mi_lcair.cli.output import print_table
from mi_lcair.files import filling

OF_PROPAGATION = (
    "propagation.png and .csv, propagation_thesis.png, propagation_radiosity.png, "
    "propagation_closure.png and .csv"
)


@click.group("chart", no_args_is_help=False)
def command():
    """Measure the speed of the renderer, and compare methods."""


def chart_options(files: str):
    """Decorator that gives a command the options -o FOLDER, --quick and --json.

    The command receives `output` and `quick`. `files` names its files in the help.
    """
    what = f"{files} to FOLDER, which is made if it is absent"
    written = options.output(what, metavar="FOLDER", default=".")
    quick = click.option(
        "--quick",
        is_flag=True,
        help="Measure fewer efforts and repetitions, in seconds instead of minutes.",
    )

    def decorator(command):
        return written(quick(options.json(command)))

    return decorator


def charted(output: Path, unit: str, measure: Callable, write: Callable):
    """What `measure(progress)` returns, after `write(folder, result)` has written its files.

    unit: of the progress. An unusable folder is refused before the work.
    """
    with filling(output) as folder:
        with options.progress_bar(unit) as progress:
            result = measure(progress)
        write(folder, result)
    return result


@command.command(
    "reflectance", epilog=options.examples("mi-lcair chart reflectance --quick -o charts")
)
@chart_options("reflectance.png and reflectance.csv")
@options.workers
def reflectance(output, quick):
    """Compare eight methods that integrate a BRDF over the hemisphere.

    Printed and written are relative rms errors against samples and time in s.
    """
    from mi_lcair.benchmark.reflectance_chart import measure
    from mi_lcair.reports.method_chart import write_reflectance

    points = charted(output, "points", partial(measure, quick), write_reflectance)
    print_table(
        {"points": list(map(_entries, points))},
        cheapest(points, "case", "samples"),
        f"wrote reflectance.png and reflectance.csv to {output}",
    )


@command.command(
    "propagation", epilog=options.examples("mi-lcair chart propagation --quick -o charts")
)
@chart_options(OF_PROPAGATION)
@options.workers
def propagation(output, quick):
    """Compare methods that follow radiation from facet to facet.

    The methods are those of the thesis, path tracing and Mitsuba's own integrator, on six scenes.
    Printed and written are relative rms errors against rays and time in s.
    """
    from mi_lcair.benchmark.propagation_chart import measure
    from mi_lcair.reports.closure_chart import write

    result = charted(output, "curves", partial(measure, quick), write)
    print_table(
        {
            "limit_processor_seconds": result.effort.seconds,
            "points": list(map(_entries, result.points)),
            "closures": [asdict(closure) for closure in result.closures],
        },
        cheapest(result.points, "scene", "rays", result.limit),
        "No larger effort of a method is tried once a run takes more than "
        f"{result.effort.seconds:g} s of processor time on each thread, however busy the machine.",
        f"wrote {OF_PROPAGATION} to {output}",
    )


@command.command("cavity", epilog=options.examples("mi-lcair chart cavity --quick -o charts"))
@chart_options("cavity.png, cavity.csv and gouffe.png")
@options.workers
def cavity(output, quick):
    """Render the thesis's eight cavities after 0 to 4 reflections.

    Printed and written are the areas of its Table B.1, Gouffé's emissivity, the exact one, and the
    apparent emissivity by reflections (its Fig 4.1). gouffe.png is its Fig 3.33. Areas are
    in m^2, emissivities are fractions.
    """
    from mi_lcair.cavities.openings import openings
    from mi_lcair.reports.openings_chart import columns, write

    paths = 2**14 if quick else 2**20
    rows = charted(output, "cavities", lambda p: openings(paths, progress=p), write)
    print_table(
        {"openings": (table := columns(rows))},
        cells(table, zip(*table.values())),
        f"wrote cavity.png, cavity.csv and gouffe.png to {output}",
    )


@command.command("facet", epilog=options.examples("mi-lcair chart facet --quick -o charts"))
@chart_options("facet.png and facet.csv")
def facet(output, quick):
    """Compute the radiance of one facet with ever more samples of its hemisphere.

    It is a facet at the wing root of cylinder_ir_range (thesis Fig 3.21). Printed and written are
    radiances in W m^-2 sr^-1 by an even grid and by one that is fine about the mirror direction.
    """
    from mi_lcair.benchmark.facet_radiance import facet_radiance
    from mi_lcair.reports.facet_chart import write

    samples = list(range(20, 401, 60 if quick else 10))
    result = charted(output, "grids", partial(facet_radiance, samples), write)
    rows = zip(result.samples, result.even, result.stratified)
    print_table(
        asdict(result),
        cells(["samples", "even", "stratified"], rows),
        f"finest grid: {result.reference:.5g}",
        f"wrote facet.png and facet.csv to {output}",
    )


@command.command("throughput")
@options.json
def throughput():
    """Measure paths and rays per second.

    Mitsuba's own integrators are measured on the same scenes. Printed are paths and rays per second
    and times in s; nothing is written. This takes about three minutes.
    """
    from mi_lcair.benchmark.throughput import measure

    with options.progress_bar("runs") as progress:
        result = measure(progress=progress)
    columns = [field.name for field in fields(result.rows[0])]
    rows = ([getattr(row, name) for name in columns] for row in result.rows)
    print_table(asdict(result), cells(columns, rows))


def cheapest(points, case: str, cost: str, limit: str = "") -> list[list[str]]:
    """Table of the cheapest method for each case and tolerance of the rms error.

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
    return rows


def _entries(point) -> dict:
    """The attributes of a point for JSON: null for a memory that was not measured (NaN)."""
    return {name: None if value != value else value for name, value in asdict(point).items()}


def cells(names, rows) -> list[list[str]]:
    """A heading and rows of values as texts for a table; empty for None."""

    def cell(value):
        return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)

    return [[name.replace("_", " ") for name in names], *(list(map(cell, row)) for row in rows)]
