"""mi-lcair image: what the camera of a scenario records."""

import click

import mi_lcair
from mi_lcair.cli.options import (
    POSITIVE,
    examples,
    given,
    output_option,
    plot_option,
    scenario_options,
    seed_option,
    solution_option,
)
from mi_lcair.cli.output import check_outputs, print_result, print_written, time_row
from mi_lcair.drawing import PICTURES
from mi_lcair.files import together


@click.command(
    "image", epilog=examples("mi-lcair image box.toml --spp 4 -o seen.exr --plot seen.png")
)
@scenario_options(
    "camera.f_number=2",
    spp="Paths through a pixel (default: 64).",
    tolerance="Render until the rms standard error over the pixels on the target is at most this "
    "fraction of its mean radiance.",
)
@output_option("the image, FILE.exr, and the counts to FILE.tif beside it", required=True)
@click.option(
    "--frames",
    type=POSITIVE,
    default=1,
    help="Number of frames with independent noise, pages of FILE.tif. There is one render.",
)
@seed_option("Seed of the camera's noise and fixed pattern.")
@plot_option("frame and measures")
@solution_option
def command(options, output, frames, seed, plot, solution):
    """Record the target of a scenario with its camera.

    SCENARIO is a TOML file as for `contrast`, with a table [camera]. FILE.exr has the radiance at
    the aperture in W m^-2 sr^-1, electrons, counts and apparent temperature in K; FILE.tif has the
    counts of all frames. Printed are the camera's noise in mK and its sharpness, predicted and
    measured, and the target's electrons and signal-to-noise ratio over range in m.
    """
    pages = output.with_suffix(".tif")
    check_outputs((output, ".exr"), (pages, ".tif"), (plot, PICTURES))
    options.changes |= given({"target.solution": solution or None})
    scenario = options.read()
    result = options.run(mi_lcair.image, scenario, frames=frames, seed=seed)
    with together():
        result.save(output)
        result.save(pages)
        if plot:
            result.plot(plot)
    rendering = ("rendering time", f"{result.render_seconds:.2f} s")
    files = {"file": str(output), "counts_file": str(pages)}
    print_result(result, options.json, [time_row(result), rendering], files)
    print_written(output, pages, plot)
