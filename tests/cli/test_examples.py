"""The examples at the end of each command's help run as they stand."""

import re
import shlex
import shutil
from pathlib import Path

import click
import pytest

from mi_lcair.cli import COMMANDS, main
from tests.docs.fences import EXAMPLES, all_fences
from tests.docs.running import commands, run_command

FILES = (".xml", ".toml", ".obj", ".csv", ".json", ".exr", ".nc")
ENDS = ("report", "convert")  # what they write is for other programs
NEXT = re.compile("^next: mi-lcair (.*)", re.MULTILINE)


def leaves():
    """(name, command) of all commands, in the order of the help."""
    return [(name, main.get_command(click.Context(main), name)) for name in COMMANDS]


def check_next(output, words):
    """The next command of a call parses, is another one, and what it reads is there."""
    after = [shlex.split(line) for line in NEXT.findall(output)]
    if words[1] in ENDS or "--json" in words:
        assert not after
        return
    ((name, *arguments),) = after
    program = click.Context(main, **main.context_settings)
    command = main.get_command(program, name)
    given = command.make_context(name, arguments, program)
    assert given.params and after[0] != words[1:]
    of_options = [option.name for option in command.params if "-o" in option.opts]
    for key, value in given.params.items():
        for read in value if isinstance(value, tuple) else (value,):
            is_path = isinstance(read, str | Path) and Path(read).suffix in FILES
            assert key in of_options or not is_path or Path(read).exists(), after


def lines(command):
    """The example lines of a command."""
    text = (command.epilog or "").splitlines()
    return [line.strip() for line in text if line.strip().startswith("mi-lcair")]


def examples():
    """(name, words) of the example lines of all commands, in the order of the help."""
    return [(name, shlex.split(line)) for name, command in leaves() for line in lines(command)]


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

    Lines that a page shows are run by the test of the page. Each line names the next command.
    """
    fences = [fence for fence in all_fences() if fence.is_run and fence.language == "sh"]
    shown = [words for fence in fences for words in commands(fence)]
    shutil.copytree(EXAMPLES, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    run_command(shlex.split("mi-lcair import box.obj -o box"), "preparation")
    for name, words in examples():
        if words not in shown:
            check_next(run_command(words, name), words)
