"""mi-lcair flight: contrast and detection of a moving target against time."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_result, print_written, time_row
from mi_lcair.files import together


@options.command("flight", "mi-lcair flight flyby.toml -o flight.csv --plot flight.png")
@options.scenario(
    "flight.rate_hz=1",
    spp="Paths of each traced view, divided by the number of pixels of render.resolution.",
    tolerance="Trace paths until half of the 95 % interval of each intensity is at most this "
    "fraction of it (default: 1%).",
)
@options.output(
    "a row for each moment, FILE.csv or FILE.nc (netCDF)", (".csv", ".nc"), required=True
)
@options.file(
    "--areas",
    "Keep the effective areas in this folder. What it holds is not traced again.",
    metavar="FOLDER",
)
@options.file(
    "--frames", "Write the frames of [camera] as 16-bit counts, pages of FILE.tif.", (".tif",)
)
@options.file("--video", "Write them for people, FILE.gif.", (".gif",))
@options.seed("Seed of the camera's noise and fixed pattern.")
@options.workers
@options.plot("contrast, signal-to-noise ratio and range")
def command(scenario, output, areas, frames, video, seed, plot):
    """Contrast of a scenario's target along a path.

    SCENARIO is a TOML file as for `contrast`, with a table [flight] in place of [observer] and
    [pose]: it names the CSV of a path. FILE has the range in m, the contrast in W/m^2 and the
    signal-to-noise ratio at each moment, with their errors. Printed is when the target is first
    detected.
    """
    files = {"frames": frames, "video": video}
    with together():
        with options.progress_bar() as progress:
            result = mi_lcair.flight(scenario, areas=areas, **files, seed=seed, progress=progress)
        result.save(output)
        if plot:
            result.plot(plot)
    print_result(result, [time_row(result)])
    print_written(output, frames, video, plot)
