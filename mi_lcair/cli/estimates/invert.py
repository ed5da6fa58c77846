"""mi-lcair invert: unknown parameters of scenes from measurements."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_next, time_row, write_and_print


@options.command(
    "invert",
    "mi-lcair render box/scene.xml -D azimuth_deg=30 -D elevation_deg=30 -D resolution=64 "
    "-o camera.exr",
    "mi-lcair invert problem.toml --no-advice -o solution.json",
)
@click.argument("problem", type=options.FILE)
@options.output("the solution, FILE.json, for --solution of commands with a SCENE", (".json",))
@options.plot("measured, predicted and their difference in standard deviations")
@options.option("--no-advice", "Do not compute what to measure next.", is_flag=True)
@options.workers
@options.renderer
def command(problem, output, plot, no_advice):
    """Estimate unknown parameters from measurements.

    PROBLEM is a TOML file. It names the measurements with their scenes and their noise, and the
    unknowns: temperatures of groups or facets, parameters of materials, radiances. The command
    prints the values with their standard errors (temperatures in K, radiances in W m^-2 sr^-1),
    what the data do not determine, and which further measurement would help most. With [goal] in
    place of measurements, it looks for the values that give a wanted intensity or contrast.
    """
    with options.progress_bar("renders") as progress:
        solution = mi_lcair.invert(problem, advise=not no_advice, progress=progress)
    files = {output: solution.save, plot: solution.plot}
    write_and_print(solution, files, [time_row(solution)])
    if output:
        print_next(["report", output, "-o", f"{output.stem}.html"])
