"""mi-lcair audit: check whether a scene conserves energy."""

import click

import mi_lcair
from mi_lcair.cli.options import examples, file_option, loading_options
from mi_lcair.cli.output import print_result, print_written


@click.command("audit", epilog=examples("mi-lcair audit open_box --photons 4096"))
@loading_options
@click.option(
    "--photons", type=click.IntRange(min=8), default=2**18, help="Photons from each emitter."
)
@file_option("--facets", "Write irradiance and exitance of each facet, FILE.csv.", (".csv",))
def command(options, photons, facets):
    """Follow the flux that SCENE emits.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Photons are followed from the
    emitters until they are absorbed or escape. Printed is their flux by material, in W and in
    percent.
    """
    result = options.run(mi_lcair.audit, photons=photons)
    if facets:
        from mi_lcair.formats import csv

        csv.write(facets, result.facets)
    print_result(result)
    print_written(facets)
