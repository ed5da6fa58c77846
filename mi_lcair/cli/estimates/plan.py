"""mi-lcair plan: find the cheapest settings for a tolerance."""

import math

import click

import mi_lcair
from mi_lcair.cli.options import POSITIVE, Fraction, examples, loading_options, sensor_option
from mi_lcair.cli.output import print_result


@click.command("plan", epilog=examples("mi-lcair plan open_box --tolerance 2%"))
@loading_options
@sensor_option
@click.option(
    "--tolerance",
    type=Fraction(),
    default="1%",
    help="Error that is allowed, as a fraction of the mean.",
)
@click.option(
    "--each-pixel",
    is_flag=True,
    help="Bound the rms error over the pixels, as for `render`, instead of that of the intensity.",
)
@click.option(
    "--renders",
    type=POSITIVE,
    help="Number of renders that the plan is for; probes that save less than they take are left "
    "out (default: try everything).",
)
def command(options, sensor, tolerance, each_pixel, renders):
    """Find the cheapest settings for SCENE.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Printed are the settings, and the
    error that they leave as a fraction of the mean; nothing is written. Cheap probes choose the
    lobe of each material, the number of reflections, closure and emitter sampling, and bound the
    error of these settings. `--plan auto` of render and signature makes such a plan for one render
    and applies it; the render stops when its noise is within the rest of the tolerance.
    """
    plan = options.run(
        mi_lcair.plan,
        sensor=sensor,
        tolerance=tolerance,
        each_pixel=each_pixel,
        renders=renders or math.inf,
    )
    print_result(plan, options.json, [("probes", f"{plan.probe_seconds:.2g} s")])
