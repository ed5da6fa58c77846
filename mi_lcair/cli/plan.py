"""mi-lcair plan: find the cheapest settings for a tolerance."""

import click

import mi_lcair
from mi_lcair.cli.options import Fraction, loading_options, sensor_option
from mi_lcair.cli.output import print_columns, print_json


@click.command("plan")
@loading_options
@sensor_option
@click.option(
    "--tolerance",
    type=Fraction(),
    default="1%",
    show_default=True,
    help="Error that is allowed, as a fraction of the mean.",
)
@click.option(
    "--each-pixel",
    is_flag=True,
    help="Bound the rms error over the pixels, as for `render`, instead of that of the intensity.",
)
def command(options, sensor, tolerance, each_pixel):
    """Find the cheapest settings for SCENE.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Cheap probes choose the lobe of each
    material, the number of reflections, closure, emitter sampling and samples per pixel. `--plan
    auto` of render and signature applies such a plan.
    """
    plan = options.run(mi_lcair.plan, sensor=sensor, tolerance=tolerance, each_pixel=each_pixel)
    if options.json:
        print_json(plan.as_dict())
        return
    print_columns(rows(plan))


def rows(plan):
    """Yield (label, text) rows of a plan."""
    yield (
        "lobes",
        ", ".join(f"{material or 'unnamed'}: {lobe}" for material, lobe in plan.lobe.items())
        or "no material with a fidelity ladder",
    )
    yield "reflections", f"{plan.max_bounces}, closure {plan.closure}"
    yield "emitter sampling", "on" if plan.emitter_sampling else "off"
    yield "samples per pixel", plan.spp
    yield (
        "predicted error",
        (
            f"{plan.predicted_error:.2%} of the mean (95 %), "
            + ("rms over the pixels" if plan.each_pixel else "of the target's intensity")
        ),
    )
    yield (
        "predicted time",
        f"{plan.predicted_seconds:.2g} s, after {plan.probe_seconds:.2g} s of probes",
    )
    for sentence in plan.left_out or ["nothing"]:
        yield "left out", sentence
