"""mi-lcair chart reflectance: integrals of the BRDF, error against samples and against time."""
from dataclasses import asdict

import click

from mi_lcair.cli.options import json_option, progress_bar
from mi_lcair.cli.output import print_columns, print_json


@click.command("reflectance")
@click.option("-o", "--output", "folder", type=click.Path(), default=".", show_default=True,
              help="Folder to write reflectance.png, .csv and .md to; made if it is absent.")
@click.option("--quick", is_flag=True, help="Fewer efforts and repetitions: seconds instead of minutes.")
@json_option
def command(folder, quick, json):
    """Seven ways to integrate a BRDF over the hemisphere, on the materials of the thesis."""
    from mi_lcair.files import filling
    from mi_lcair.products import chart, reflectance_chart

    with filling(folder) as partial:        # before the work, so that a folder that cannot be written is refused at once
        with progress_bar("points") as progress:
            points = reflectance_chart.measure(quick, progress)
        reflectance_chart.write(partial, points, quick)
    if json:
        print_json({"points": [asdict(point) for point in points]})
        return
    rows = [["case", "to reach", "cheapest", "samples", "time"]]
    for case in chart.names(points, "case"):
        for tolerance in chart.TOLERANCES:
            best = chart.cheapest(points, case, tolerance)
            rows.append([case, f"{tolerance:.1%}", best.method if best else "none", *chart.costs(best)])
    print_columns(rows)
    click.echo(f"wrote reflectance.png, reflectance.csv and reflectance.md to {folder}")
