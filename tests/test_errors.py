"""Text from outside becomes one printable line of bearable length."""

import ast
import re
from pathlib import Path

import pytest

import mi_lcair
from mi_lcair.errors import (
    LONGEST,
    InputError,
    escaped,
    in_shell,
    mitsuba_error,
    option,
    printable,
    shown,
    unknown,
)


@pytest.mark.parametrize(
    "text, line",
    [
        ("plain: é ½ 漢", "plain: é ½ 漢"),
        ("two  blanks", "two  blanks"),
        ("b is\n 2\r\n", "b is 2"),
        ("a\tb\u2028c\x85d\xa0e", "a b c d e"),
        ("\x1b[31mred\x07", r"\x1b[31mred\x07"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        ("file\udcff", r"file\udcff"),
        ("a" * 2_000_000, "a" * 329 + " ... " + "a" * 166),
    ],
)
def test_a_message_is_one_printable_line(text, line):
    for shown_line in (printable(text), str(InputError(text))):
        assert shown_line == line and shown_line.isprintable() and len(shown_line) <= LONGEST
    assert printable(line) == line  # once is enough


def test_an_escaped_text_keeps_its_blanks():
    assert escaped("  a\n\tb ") == r"  a\n\tb "


def test_a_piece_of_a_file_is_quoted_and_short():
    assert shown("x\x1b") == r"'x\x1b'" and len(shown("x" * 10_000)) == 32


@pytest.mark.slow
def test_a_long_name_among_many_is_told_in_one_line():
    known = [f"material_{k}" for k in range(10_000)]
    message = str(unknown("material", "m" * 10_000 + "\n", known))
    assert len(message) <= LONGEST and message.endswith(", ...") and "material_0" in message


def test_of_many_names_only_the_nearest_are_listed():
    """The parameters of an airliner are hundreds; a reader wants the one that was misspelt."""
    known = [f"{group}.{key}" for group in "abcdefghij" for key in ("temperature", "emissivity")]
    message = str(unknown("quantity", "c.temperture", [*known, "wing.area"]))
    assert message.startswith("unknown quantity 'c.temperture'; known: c.temperature, ")
    assert message.endswith(", ...") and message.count(",") == 5
    few = [f"band_{k}" for k in range(12)]
    assert str(unknown("band", "band_7x", few)).count(",") == 11


def test_a_line_break_in_a_name_does_not_hide_the_message():
    """Mitsuba passes an exception of a plugin on as text, of which the last line is taken."""
    error = InputError("unknown material: gloss\nmi-lcair: warning: all is well")
    text = (
        "[parser.cpp:1] At scene.xml (line 2): failed: Traceback (most recent call last):\n  x\n"
        f"mi_lcair.errors.InputError: {error}"
    )
    assert (
        str(mitsuba_error(RuntimeError(text)))
        == "scene.xml (line 2): unknown material: gloss mi-lcair: warning: all is well"
    )


def test_an_exception_of_several_lines_is_told_whole():
    """Dr.Jit's TypeErrors end with a line that names neither the function nor the exception."""
    text = (
        "[parser.cpp:1] At scene.xml (line 2): failed: Traceback (most recent call last):\n"
        '  File "model.py", line 61, in HDR\n    exp(x)\n'
        "TypeError: exp(): incompatible arguments:\n    1. exp(arg)\n\n"
        "Invoked with types: ndarray\n"
    )
    assert str(mitsuba_error(RuntimeError(text))) == (
        "TypeError: scene.xml (line 2): exp(): incompatible arguments:     1. exp(arg)  "
        "Invoked with types: ndarray"
    )


def test_options_are_named_as_the_caller_writes_them():
    """Python's names in Python, and those of the command line within a command."""
    assert option("max_spp") == "max_spp" and option("up", "-Z") == "up='-Z'"
    assert option("robust", True) == "robust=True"
    with in_shell():
        assert option("max_spp") == "--max-spp" and option("up", "-Z") == "--up -Z"
        assert option("robust", True) == "--robust"
    assert option("max_spp") == "max_spp"


def test_messages_outside_the_command_line_name_no_options():
    """They use `option`, because Python callers see them too."""
    folder = Path(mi_lcair.__file__).parent
    named = re.compile(r"""["' (]--[a-z][a-z-]+""")
    for file in folder.rglob("*.py"):
        if "cli" in file.relative_to(folder).parts:
            continue
        texts = [
            node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Constant)
        ]
        texts = [
            node.value for node in texts if isinstance(node.value, str) and "\n" not in node.value
        ]
        assert not [text for text in texts if named.search(text) and "in the shell" not in text], (
            file
        )
