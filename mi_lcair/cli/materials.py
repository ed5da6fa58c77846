"""mi-lcair materials: list the known materials."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_result


@options.command("materials", "mi-lcair materials", "mi-lcair materials own.toml --json")
@click.argument("files", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE|FOLDER]...")
@options.json
def command(files):
    """List the known materials.

    Printed are the name, the reflection model and the band in um of each material, its emissivity
    along the normal and at 60 degrees to it, and where its parameters come from. A FILE of your own
    materials (TOML, or the JSON of a fit) and all TOML files with materials in a FOLDER come first.
    A number in place of a name, such as 0.92, is the emissivity of a grey diffuse surface. Nothing
    is written.
    """
    print_result(mi_lcair.materials(*files))
