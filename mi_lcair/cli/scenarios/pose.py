"""mi-lcair pose: where a camera is, from points and their pixels."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_next, write_and_print

SUFFIXES = (".toml", ".csv", ".json", ".html", ".nc")


@options.command(
    "pose",
    "mi-lcair pose box.toml corners.csv -D pose.yaw_deg=0 -o seen.toml",
    "mi-lcair image seen.toml --spp 4 -o seen.exr",
)
@click.argument("scenario")
@click.argument("points", type=options.FILE, metavar="POINTS.csv")
@options.changes("Change an entry of the scenario, such as camera.focal_length_mm=50")
@options.option(
    "--sigma",
    "Standard deviation of a column or row, pixels (default: that of the residuals).",
    click.FloatRange(min=0, min_open=True),
    metavar="PX",
)
@options.output(
    "the scenario with this camera to FILE.toml; or a table, .csv, .json, .html", SUFFIXES
)
@options.renderer
def command(scenario, points, changes, sigma, output):
    """Find where a camera is from points and pixels.

    SCENARIO is a TOML file with a table [camera]. POINTS.csv has the columns x_m, y_m, z_m,
    column_px and row_px: four or more points, such as corners of facets, in the scene's axes, and
    where they are in the frame, whose upper left corner is (0, 0). Printed are position and
    pointing with 95 % intervals, in m and degrees. `image` and `invert` take FILE.toml.
    """
    result = mi_lcair.pose(scenario, points, sigma, parameters=dict(changes))
    write_and_print(result, {output: result.save})
    if output and output.suffix == ".toml":
        print_next(["image", output, "-o", f"{output.stem}.exr"])
