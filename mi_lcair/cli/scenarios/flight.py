"""mi-lcair flight: contrast and detection of a moving target against time."""

import click

import mi_lcair
from mi_lcair.cli.options import (
    examples,
    file_option,
    output_option,
    plot_option,
    progress_bar,
    read_scenario,
    scenario_options,
    seed_option,
    workers_options,
)
from mi_lcair.cli.output import print_result, print_written, time_row
from mi_lcair.files import together


@click.command(
    "flight", epilog=examples("mi-lcair flight flyby.toml -o flight.csv --plot flight.png")
)
@scenario_options(
    "flight.rate_hz=1",
    spp="Paths of each traced view, divided by the number of pixels of render.resolution.",
    tolerance="Trace paths until half of the 95 % interval of each intensity is at most this "
    "fraction of it (default: 1%).",
)
@output_option(
    "a row for each moment, FILE.csv or FILE.nc (netCDF)", (".csv", ".nc"), required=True
)
@file_option(
    "--areas",
    "Keep the effective areas in this folder. What it holds is not traced again.",
    metavar="FOLDER",
)
@file_option(
    "--frames", "Write the frames of [camera] as 16-bit counts, pages of FILE.tif.", (".tif",)
)
@file_option("--video", "Write them for people, FILE.gif.", (".gif",))
@seed_option("Seed of the camera's noise and fixed pattern.")
@workers_options
@plot_option("contrast, signal-to-noise ratio and range")
def command(scenario, changes, output, areas, frames, video, seed, plot):
    """Contrast of a scenario's target along a path.

    SCENARIO is a TOML file as for `contrast`, with a table [flight] in place of [observer] and
    [pose]: it names the CSV of a path. FILE has the range in m, the contrast in W/m^2 and the
    signal-to-noise ratio at each moment, with their errors. Printed is when the target is first
    detected.
    """
    stated, files = read_scenario(scenario, changes), {"frames": frames, "video": video}
    with together():
        with progress_bar() as progress:
            result = mi_lcair.flight(stated, areas=areas, **files, seed=seed, progress=progress)
        result.save(output)
        if plot:
            result.plot(plot)
    print_result(result, [time_row(result)])
    print_written(output, frames, video, plot)
