"""mi-lcair report: a page in HTML of results, scenes and scenarios."""

import click

import mi_lcair
from mi_lcair.cli import completion, options
from mi_lcair.cli.output import Called, line_of, note


@options.command("report", "mi-lcair report two_plates --spp 16 -o two_plates.html", cls=Called)
@click.argument("what", nargs=-1, required=True, shell_complete=completion.scenes_and_scenarios)
@options.output("the page, FILE.html", required=True)
@options.option("--scene", "Scene whose model shows the facets of a FILE.csv.", metavar="SCENE")
@options.changes("Set a $-parameter of the scene, or an entry of the scenario", "parameters")
@options.option("-s --sensor", "Number of the scene's sensor (default: 0).", click.IntRange(min=0))
@options.sampling(
    "Samples per pixel (default: the scene's or scenario's own).",
    "Trace paths until half of the 95 % interval of the signature's intensity, or of the "
    "scenario's contrast, is at most this fraction of it.",
    options.MAX_SPP,
)
@options.option("--seed", "Seed of the random numbers.", click.IntRange(0, 2**32 - 1))
@options.renderer
@click.pass_obj
def command(call, what, output, parameters, **settings):
    """Write a page of WHAT, to hover and to turn.

    \b
    FILE.exr             images with the values of every channel
    FILE.json            tables of a signature, contrast, solution, budget or
                         audit; data and curves of a fit
    MODEL.obj            the facets of a model
    FILE.csv, FILE.nc    polar curves of a trend; facets; spectra; the table
                         of a sweep or a flight
    SCENE                image, signature, facets, spectrum, audit
    SCENARIO             image through the air, contrast, ranges, and the rest

    SCENE is an XML file or a bundled name, SCENARIO a TOML file or a bundled name. Several WHAT
    share one page. The page is one file that needs no network. Radiances are in W m^-2 sr^-1,
    temperatures in K, intensities in W/sr, contrasts in W/m^2.
    """
    options.check_max_spp(**settings)
    with options.progress_bar() as progress:
        notes = mi_lcair.report(
            what,
            output,
            parameters=dict(parameters),
            command=line_of(call),
            progress=progress,
            **settings,
        )
    for remark in notes:
        note(remark)
    click.echo(output)
