"""mi-lcair audit: whether a scene conserves energy."""
import click

import mi_lcair
from mi_lcair.cli.options import loading_options
from mi_lcair.cli.output import print_columns, print_json


@click.command("audit")
@loading_options
@click.option("--photons", type=click.IntRange(min=8), default=2**18, show_default=True, help="From each emitter.")
def command(options, photons):
    """Follow the flux that SCENE emits.

    SCENE is a Mitsuba XML file or the name of a bundled scene. What is emitted is followed forward until it is absorbed or
    escapes, and listed by material.
    """
    result = options.run(mi_lcair.audit, photons=photons)
    if options.json:
        print_json(result.as_dict())
        return
    emitted = result.total["emitted"][0]

    def percent(figure):
        value, error = figure
        return f"{value / emitted:.3%} +- {100 * error / emitted:.1g}" if emitted else "0"

    print_columns([("band", result.band), ("emitted", f"{emitted:.6g} W +- {result.total['emitted'][1]:.2g}"),
                   *((name, percent(result.total[name])) for name in ("absorbed", "escaped", "behind", "created", "unfinished", "balance"))])
    click.echo()
    columns = ("emitted", "incident", "absorbed", "reflected", "created", "scaled")
    print_columns([("material", *columns), *((name, *(percent(flux[key]) for key in columns)) for name, flux in result.materials.items())])
    click.echo()
    for remark in result.remarks or ["nothing to remark: energy is conserved within the errors above"]:
        click.echo(remark)
