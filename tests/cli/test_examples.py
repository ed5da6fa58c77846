"""The examples at the end of each command's help run as they stand."""

import shlex
import shutil

import click
import pytest

from mi_lcair.cli import COMMANDS, main
from tests.docs.fences import EXAMPLES, all_fences
from tests.docs.running import commands, run_command


def leaves():
    """(name, command) of all commands, in the order of the help; those of groups for the group."""
    context = click.Context(main)
    for name in COMMANDS:
        command = main.get_command(context, name)
        for member, own in getattr(command, "commands", {"": command}).items():
            yield f"{name} {member}".strip(), own


def lines(command):
    """The example lines of a command."""
    text = (command.epilog or "").splitlines()
    return [line.strip() for line in text if line.strip().startswith("mi-lcair")]


@pytest.mark.parametrize("name", [name for name, _ in leaves()])
def test_every_command_has_an_example_of_itself(name):
    assert any(
        line.startswith(f"mi-lcair {name} ") or line == f"mi-lcair {name}"
        for line in lines(dict(leaves())[name])
    )


@pytest.mark.parametrize("name", [name for name, _ in leaves()])
def test_help_says_what_is_written_and_in_which_unit(name):
    help = " ".join(dict(leaves())[name].help.split())
    assert any(
        word in help.lower() for word in ("write", "written", "printed", "png", "prints", "lists")
    ), help
    units = (
        "W/",
        "W m",
        " W",
        " K",
        " m ",
        " m^2 ",
        " um",
        "fraction",
        "1/sr",
        " s.",
        "second",
        "unit",
    )
    assert any(unit in help for unit in units) or name == "show", help


@pytest.mark.slow
def test_examples_run_in_order(tmp_path, monkeypatch):
    """In one folder with the sample files. Some use what earlier ones have written.

    Lines that a page shows are run by the test of the page.
    """
    fences = [fence for fence in all_fences() if fence.is_run and fence.language == "sh"]
    shown = [words for fence in fences for words in commands(fence)]
    shutil.copytree(EXAMPLES, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    run_command(shlex.split("mi-lcair import box.obj -o box"), "preparation")
    for name, command in leaves():
        for words in map(shlex.split, lines(command)):
            if words not in shown:
                run_command(words, name)
