"""mi-lcair scenes: list the bundled scenes."""

import click

from mi_lcair.cli import options
from mi_lcair.cli.output import JSON, is_set, print_columns, print_json


@options.command("scenes", "mi-lcair scenes", "mi-lcair scenes --json")
@options.json
def command():
    """List the bundled scenes.

    Each scene is printed with its parameters, their defaults, meanings and units, and with its
    scenarios. Nothing is written.
    """
    from mi_lcair import scenes

    if is_set(JSON):
        print_json(
            {
                name: {
                    "title": scenes.title(name),
                    "path": str(scenes.path(name)),
                    "parameters": {
                        key: parameter._asdict()
                        for key, parameter in scenes.parameters(name).items()
                    },
                    "scenarios": {
                        scenario: scenes.scenario_title(scenario)
                        for scenario in scenes.scenarios(name)
                    },
                }
                for name in scenes.names()
            }
        )
        return
    for name in scenes.names():
        click.echo(f"{name}: {scenes.title(name)}")
        print_columns(
            [
                (f"    {key}={parameter.default}", parameter.description)
                for key, parameter in scenes.parameters(name).items()
            ]
        )
        for scenario in scenes.scenarios(name):
            click.echo(f"    scenario {scenario}: {scenes.scenario_title(scenario)}")
        click.echo()
    click.echo(
        "Set a parameter with -D: mi-lcair render SCENE -D key=value -o FILE.exr. Measure a "
        "scenario: mi-lcair contrast SCENARIO"
    )
