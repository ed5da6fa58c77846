"""mi-lcair invert: unknown parameters of scenes from measurements."""

import click

import mi_lcair
from mi_lcair.cli.options import (
    FILE,
    examples,
    json_option,
    output_option,
    plot_option,
    prepare_renderer,
    progress_bar,
    renderer_options,
    workers_options,
)
from mi_lcair.cli.output import check_outputs, print_result, print_written, time_row
from mi_lcair.drawing import PICTURES
from mi_lcair.files import together


@click.command(
    "invert",
    epilog=examples(
        "mi-lcair render box/scene.xml -D azimuth_deg=30 -D elevation_deg=30 -D resolution=64 "
        "-o camera.exr",
        "mi-lcair invert problem.toml --no-advice -o solution.json",
    ),
)
@click.argument("problem", type=FILE)
@output_option("the solution, FILE.json, for --solution of commands with a SCENE")
@plot_option("measured, predicted and their difference in standard deviations")
@click.option("--no-advice", is_flag=True, help="Do not compute what to measure next.")
@workers_options
@renderer_options
@json_option
def command(problem, output, plot, no_advice, variant, threads, json):
    """Estimate unknown parameters from measurements.

    PROBLEM is a TOML file. It names the measurements with their scenes and their noise, and the
    unknowns: temperatures of groups or facets, parameters of materials, radiances. The command
    prints the values with their standard errors (temperatures in K, radiances in W m^-2 sr^-1),
    what the data do not determine, and which further measurement would help most. With [goal] in
    place of measurements, it looks for the values that give a wanted intensity or contrast.
    """
    check_outputs((output, ".json"), (plot, PICTURES))
    prepare_renderer(variant, threads)
    with progress_bar("renders") as progress:
        solution = mi_lcair.invert(problem, advise=not no_advice, progress=progress)
    with together():
        if plot:
            solution.plot(plot)
        if output:
            solution.write(output)
    print_result(solution, json, [time_row(solution)])
    print_written(output, plot)
