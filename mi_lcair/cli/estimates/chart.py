"""mi-lcair chart: measure the speed of the renderer, and compare methods."""

from collections.abc import Callable
from dataclasses import asdict, fields
from functools import partial, wraps

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


def chart(name: str, files: str, unit: str, *more: Callable):
    """Decorator that makes a command of the function that says what it measures.

    function(quick) returns measure(progress), write(folder, result), and printed(result): the JSON,
    the table and notes. files: what is written, in words. unit: of the progress. more: decorators
    of further options. An unusable folder is refused before the work.
    """
    what = f"{files} to FOLDER, which is made if it is absent"
    written = options.output(what, metavar="FOLDER", default=".")
    quick = options.option(
        "--quick",
        "Measure fewer efforts and repetitions, in seconds instead of minutes.",
        is_flag=True,
    )

    def decorator(function):
        @wraps(function)
        def run(output, quick):
            measure, write, printed = function(quick)
            with filling(output) as folder:
                with options.progress_bar(unit) as progress:
                    result = measure(progress)
                write(folder, result)
            print_table(*printed(result), f"wrote {files} to {output}")

        register = command.command(
            name, epilog=options.examples(f"mi-lcair chart {name} --quick -o charts")
        )
        for option in (*more, options.json, quick, written, register):
            run = option(run)
        return run

    return decorator


@chart("reflectance", "reflectance.png and reflectance.csv", "points", options.workers)
def reflectance(quick):
    """Compare eight methods that integrate a BRDF over the hemisphere.

    Printed and written are relative rms errors against samples and time in s.
    """
    from mi_lcair.benchmark.reflectance_chart import measure
    from mi_lcair.reports.method_chart import write_reflectance

    def printed(points):
        return {"points": list(map(_entries, points))}, cheapest(points, "case", "samples")

    return partial(measure, quick), write_reflectance, printed


@chart("propagation", OF_PROPAGATION, "curves", options.workers)
def propagation(quick):
    """Compare methods that follow radiation from facet to facet.

    The methods are those of the thesis, path tracing and Mitsuba's own integrator, on six scenes.
    Printed and written are relative rms errors against rays and time in s.
    """
    from mi_lcair.benchmark.propagation_chart import measure
    from mi_lcair.reports.closure_chart import write

    def printed(result):
        entries = {
            "limit_processor_seconds": result.effort.seconds,
            "points": list(map(_entries, result.points)),
            "closures": [asdict(closure) for closure in result.closures],
        }
        note = (
            "No larger effort of a method is tried once a run takes more than "
            f"{result.effort.seconds:g} s of processor time on each thread, however busy the "
            "machine."
        )
        return entries, cheapest(result.points, "scene", "rays", result.limit), note

    return partial(measure, quick), write, printed


@chart("cavity", "cavity.png, cavity.csv and gouffe.png", "cavities", options.workers)
def cavity(quick):
    """Render the thesis's eight cavities after 0 to 4 reflections.

    Printed and written are the areas of its Table B.1, Gouffé's emissivity, the exact one, and the
    apparent emissivity by reflections (its Fig 4.1). gouffe.png is its Fig 3.33. Areas are
    in m^2, emissivities are fractions.
    """
    from mi_lcair.cavities.openings import openings
    from mi_lcair.reports.openings_chart import columns, write

    def printed(rows):
        table = columns(rows)
        return {"openings": table}, cells(table, zip(*table.values()))

    return lambda progress: openings(2**14 if quick else 2**20, progress=progress), write, printed


@chart("facet", "facet.png and facet.csv", "grids")
def facet(quick):
    """Compute the radiance of one facet with ever more samples of its hemisphere.

    It is a facet at the wing root of cylinder_ir_range (thesis Fig 3.21). Printed and written are
    radiances in W m^-2 sr^-1 by an even grid and by one that is fine about the mirror direction.
    """
    from mi_lcair.benchmark.facet_radiance import facet_radiance
    from mi_lcair.reports.facet_chart import write

    def printed(result):
        rows = zip(result.samples, result.even, result.stratified)
        note = f"finest grid: {result.reference:.5g}"
        return asdict(result), cells(["samples", "even", "stratified"], rows), note

    samples = list(range(20, 401, 60 if quick else 10))
    return partial(facet_radiance, samples), write, printed


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
