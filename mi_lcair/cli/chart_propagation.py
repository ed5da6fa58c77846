"""mi-lcair chart propagation: what a scene sends toward the observer, error against rays and against time."""
from dataclasses import asdict

import click

from mi_lcair.cli.options import json_option, progress_bar
from mi_lcair.cli.output import print_columns, print_json


@click.command("propagation")
@click.option("-o", "--output", "folder", type=click.Path(), default=".", show_default=True,
              help="Folder to write propagation.png, .csv and .md to, and propagation_closure.png and .csv; made if it is absent.")
@click.option("--quick", is_flag=True, help="Fewer efforts and repetitions: seconds instead of minutes.")
@json_option
def command(folder, quick, json):
    """The thesis's ways to follow radiation from facet to facet, and path tracing, on six scenes."""
    from mi_lcair.files import filling
    from mi_lcair.products import chart, propagation_chart

    with filling(folder) as partial:        # before the work, so that a folder that cannot be written is refused at once
        with progress_bar("curves") as progress:
            result = propagation_chart.measure(quick, progress)
        propagation_chart.write(partial, result)
    if json:
        print_json({"points": [asdict(point) for point in result.points], "closures": [asdict(closure) for closure in result.closures]})
        return
    rows = [["scene", "to reach", "cheapest", "rays", "time"]]
    for case in chart.names(result.points, "case"):
        for tolerance in chart.TOLERANCES:
            best = chart.cheapest(result.points, case, tolerance)
            rows.append([case, f"{tolerance:.1%}", best.method if best else "none", *chart.costs(best)])
    print_columns(rows)
    click.echo(f"wrote propagation.png, .csv and .md, propagation_closure.png and .csv to {folder}")
