"""mi-lcair audit: check whether a scene conserves energy."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_result, print_written


@options.command("audit", "mi-lcair audit open_box --paths 4096")
@options.loading
@options.option(
    "--paths", "Paths of photons from each emitter.", click.IntRange(min=8), default=2**18
)
@options.file("--facets", "Write irradiance and exitance of each facet, FILE.csv.", (".csv",))
def command(scene, paths, facets):
    """Follow the flux that SCENE emits.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Photons are followed from the
    emitters until they are absorbed or escape. Printed is their flux by material, in W and in
    percent.
    """
    result = scene.run(mi_lcair.audit, paths=paths)
    if facets:
        from mi_lcair.formats import csv

        csv.write(facets, result.facets)
    print_result(result)
    print_written(facets)
