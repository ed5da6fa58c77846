"""mi-lcair chart reflectance: integrals of the BRDF, error against samples and against time."""

from dataclasses import asdict

import click

from mi_lcair.cli.charts.output import chart_options, print_cheapest
from mi_lcair.cli.options import progress_bar
from mi_lcair.cli.output import print_json


@click.command("reflectance")
@chart_options("reflectance.png, .csv and .md")
def command(folder, quick, json):
    """Seven ways to integrate a BRDF over the hemisphere, on the materials of the thesis."""
    from mi_lcair.benchmark import reflectance_chart
    from mi_lcair.files import filling
    from mi_lcair.reports import reflectance_page

    with filling(
        folder
    ) as partial:  # before the work, so that a folder that cannot be written is refused at once
        with progress_bar("points") as progress:
            points = reflectance_chart.measure(quick, progress)
        reflectance_page.write(partial, points, quick)
    if json:
        print_json({"points": [asdict(point) for point in points]})
        return
    print_cheapest(points, "case", "samples")
    click.echo(f"wrote reflectance.png, reflectance.csv and reflectance.md to {folder}")
