"""mi-lcair chart propagation: what a scene sends toward the observer, error against rays and
against time.
"""

from dataclasses import asdict

import click

from mi_lcair.cli.charts.output import chart_options, print_cheapest
from mi_lcair.cli.options import progress_bar
from mi_lcair.cli.output import print_json


@click.command("propagation")
@chart_options("propagation.png, .csv and .md, and propagation_closure.png and .csv")
def command(folder, quick, json):
    """The thesis's ways to follow radiation from facet to facet, and path tracing, on six scenes."""
    from mi_lcair.benchmark import propagation_chart
    from mi_lcair.files import filling
    from mi_lcair.reports import propagation_page

    with filling(
        folder
    ) as partial:  # before the work, so that a folder that cannot be written is refused at once
        with progress_bar("curves") as progress:
            result = propagation_chart.measure(quick, progress)
        propagation_page.write(partial, result)
    if json:
        print_json(
            {
                "points": [asdict(point) for point in result.points],
                "closures": [asdict(closure) for closure in result.closures],
            }
        )
        return
    print_cheapest(result.points, "scene", "rays")
    click.echo(f"wrote propagation.png, .csv and .md, propagation_closure.png and .csv to {folder}")
