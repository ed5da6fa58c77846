"""mi-lcair image: what the camera of a scenario records."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_next, time_row, write_and_print
from mi_lcair.files import check_writable


@options.command("image", "mi-lcair image box.toml --spp 4 -o seen.exr --plot seen.png")
@options.scenario(
    "camera.f_number=2",
    spp="Paths through a pixel (default: 64).",
    tolerance="Render until the rms standard error over the pixels on the target is at most this "
    "fraction of its mean radiance.",
)
@options.output(
    "the image, FILE.exr, and the counts to FILE.tif beside it", (".exr",), required=True
)
@options.option(
    "--frames",
    "Number of frames with independent noise, pages of FILE.tif. There is one render.",
    options.POSITIVE,
    default=1,
)
@options.seed("Seed of the camera's noise and fixed pattern.")
@options.plot("frame and measures")
def command(scenario, output, frames, seed, plot):
    """Record the target of a scenario with its camera.

    SCENARIO is a TOML file as for `contrast`, with a table [camera]. FILE.exr has the radiance at
    the aperture in W m^-2 sr^-1, electrons, counts and apparent temperature in K; FILE.tif has the
    counts of all frames. Printed are the camera's noise in mK and its sharpness, predicted and
    measured, and the target's electrons and signal-to-noise ratio over range in m.
    """
    pages = output.with_suffix(".tif")
    check_writable(pages)
    with options.progress_bar() as progress:
        result = mi_lcair.image(scenario, frames=frames, seed=seed, progress=progress)
    rows = [time_row(result), ("rendering time", f"{result.render_seconds:.2f} s")]
    more = {"file": str(output), "counts_file": str(pages)}
    files = {output: result.save, pages: result.save, plot: result.plot}
    write_and_print(result, files, rows, more)
    print_next(["show", output])
