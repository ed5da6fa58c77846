"""mi-lcair audit: check whether a scene conserves energy."""

import click

import mi_lcair
from mi_lcair.cli.options import loading_options
from mi_lcair.cli.output import print_columns, print_json
from mi_lcair.cli.usage.examples import examples


@click.command(
    "audit",
    epilog=examples(
        "mi-lcair audit open_box --photons 4096",
    ),
)
@loading_options
@click.option(
    "--photons",
    type=click.IntRange(min=8),
    default=2**18,
    show_default=True,
    help="Photons from each emitter.",
)
def command(options, photons):
    """Follow the flux that SCENE emits.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Photons are followed from the
    emitters until they are absorbed or escape. Printed is their flux by material, in W and in
    percent; nothing is written.
    """
    result = options.run(mi_lcair.audit, photons=photons)
    if options.json:
        print_json(result.as_dict())
        return

    def percent(name, key):
        """A share with its standard error, in percent."""
        value, error = result.shares[name][key]
        return f"{100 * value:.3f} +- {100 * error:.1g}"

    print_columns(
        [
            ("band", result.band),
            ("emitted", f"{result.total['emitted'][0]:.6g} W +- {result.total['emitted'][1]:.2g}"),
            *(
                (f"{key} %", percent("scene", key))
                for key in ("absorbed", "escaped", "behind", "created", "unfinished", "balance")
            ),
        ]
    )
    click.echo()
    shares = ("absorbed", "reflected", "behind", "created", "scaled")
    print_columns(
        [
            ("material", "emitted W", "incident W", *(f"{key} % of incident" for key in shares)),
            *(
                (
                    name,
                    f"{flux['emitted'][0]:.5g}",
                    f"{flux['incident'][0]:.5g}",
                    *(percent(name, key) for key in shares),
                )
                for name, flux in result.materials.items()
            ),
        ]
    )
    click.echo()
    for remark in result.remarks or [
        "nothing to remark: energy is conserved within the errors above"
    ]:
        click.echo(remark)
