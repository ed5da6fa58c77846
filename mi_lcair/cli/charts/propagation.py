"""mi-lcair chart propagation: error of a scene's intensity against rays and time."""

from dataclasses import asdict

import click

from mi_lcair.cli.charts.output import chart_options, print_cheapest
from mi_lcair.cli.options import examples, progress_bar
from mi_lcair.cli.output import print_json


@click.command("propagation", epilog=examples("mi-lcair chart propagation --quick -o charts"))
@chart_options("propagation.png and .csv, and propagation_closure.png and .csv")
def command(output, quick, json):
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
                "points": [asdict(point) for point in result.points],
                "closures": [asdict(closure) for closure in result.closures],
            }
        )
        return
    print_cheapest(result.points, "scene", "rays", result.limit)
    click.echo(
        "No larger effort of a method is tried once a run takes more than "
        f"{result.effort.seconds:g} s of processor time on each thread, however busy the machine."
    )
    click.echo(f"wrote propagation.png and .csv, propagation_closure.png and .csv to {output}")
