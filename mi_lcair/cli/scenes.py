"""mi-lcair scenes: what is bundled."""
import click

from mi_lcair.cli.options import json_option
from mi_lcair.cli.output import print_columns, print_json


@click.command("scenes")
@json_option
def command(json):
    """List the bundled scenes.

    Each with its parameters and their defaults.
    """
    from mi_lcair import scenes

    if json:
        print_json({name: {"path": str(scenes.path(name)), "parameters": scenes.parameters(name)}
                    for name in scenes.names()})
        return
    print_columns([(name, " ".join(f"{key}={value}" for key, value in scenes.parameters(name).items()))
                   for name in scenes.names()])
    click.echo("\nSet a parameter with -D: mi-lcair render SCENE -D key=value -o FILE.exr")
