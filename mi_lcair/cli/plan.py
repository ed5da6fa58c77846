"""mi-lcair plan: the cheapest settings for a tolerance."""

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
    help="Error allowed, a fraction of the mean.",
)
@click.option(
    "--each-pixel",
    is_flag=True,
    help="Of each pixel (rms), as `render` needs it, not of the intensity.",
)
def command(options, sensor, tolerance, each_pixel):
    """Find how little model SCENE needs.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Cheap probes choose the lobe of each
    material, the number of reflections, closure, emitter sampling and samples per pixel; `--plan
    auto` of render and signature uses them.
    """
    found = options.run(mi_lcair.plan, sensor=sensor, tolerance=tolerance, each_pixel=each_pixel)
    if options.json:
        print_json(found.as_dict())
        return
    print_columns(rows(found))


def rows(found):
    """(label, text) rows of a plan."""
    yield (
        "lobes",
        ", ".join(f"{material or 'unnamed'}: {lobe}" for material, lobe in found.lobe.items())
        or "no material with a fidelity ladder",
    )
    yield "reflections", f"{found.max_bounces}, closure {found.closure}"
    yield "emitter sampling", "on" if found.emitter_sampling else "off"
    yield "samples per pixel", found.spp
    yield (
        "predicted error",
        (
            f"{found.predicted_error:.2%} of the mean (95 %), "
            + ("rms over the pixels" if found.each_pixel else "of the target's intensity")
        ),
    )
    yield (
        "predicted time",
        f"{found.predicted_seconds:.2g} s, after {found.probe_seconds:.2g} s of probes",
    )
    for sentence in found.left_out or ["nothing"]:
        yield "left out", sentence
