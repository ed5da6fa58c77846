"""mi-lcair cavity: the effective emissivity of a cavity."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import write_and_print

SUFFIXES = (".csv", ".json", ".html", ".png", ".svg", ".pdf", ".nc")


@options.command("cavity", "mi-lcair cavity cavity.toml -o cavity.png")
@click.argument("cavity", metavar="CAVITY.toml")
@options.option(
    "--tolerance",
    "Half of the 95 % interval for walls that the renderer traces (default: 2e-4).",
    click.FloatRange(min=0, min_open=True),
    metavar="FRACTION",
)
@options.option("--seed", "Seed of the random numbers.", click.IntRange(min=0), default=0)
@options.output(
    "the table to FILE (.csv, .json, .html, .nc), or a picture (.png, .svg, .pdf)", SUFFIXES
)
@options.json
def command(cavity, tolerance, seed, output):
    """Effective emissivity of a cavity with its uncertainty.

    CAVITY.toml has the tables [shape], [wall], [view] and [sigma]. Printed are the effective
    emissivity by wavelength, and what each uncertain quantity contributes to its uncertainty.
    Emissivities are fractions.
    """
    result = mi_lcair.cavity(cavity, seed=seed, **options.given({"tolerance": tolerance}))
    write_and_print(result, {output: result.save})
