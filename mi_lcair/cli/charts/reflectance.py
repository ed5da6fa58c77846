"""mi-lcair chart reflectance: error of integrals of the BRDF against samples and time."""

from dataclasses import asdict

import click

from mi_lcair.cli.charts.output import chart_options, print_cheapest
from mi_lcair.cli.options import examples, progress_bar
from mi_lcair.cli.output import print_json


@click.command("reflectance", epilog=examples("mi-lcair chart reflectance --quick -o charts"))
@chart_options("reflectance.png and reflectance.csv")
def command(output, quick, json):
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
        print_json({"points": [asdict(point) for point in points]})
        return
    print_cheapest(points, "case", "samples")
    click.echo(f"wrote reflectance.png and reflectance.csv to {output}")
