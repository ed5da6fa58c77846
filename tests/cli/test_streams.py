"""What goes to stdout and what to stderr: results alone on stdout, and a line for each note."""

import json
import logging
import warnings

import pytest

import mi_lcair
from mi_lcair.cli.output import print_columns

NAME = "paint\nmi-lcair: note: all is well\x1b[31m $x^$"


def test_mitsubas_warnings_go_to_stderr(run, monkeypatch, capfd):
    """They went to stdout, so that --json was no JSON."""
    import mitsuba as mi

    def audit(scene, **sampling):
        mi.Log(mi.LogLevel.Warn, "a mesh has\n no normals\x1b[31m")
        return mi_lcair.planning.audit.audit(scene, **sampling)

    import mi_lcair.planning.audit

    monkeypatch.setitem(vars(mi_lcair), "audit", audit)
    result = run("audit", "two_plates", "--photons", 64, "--json")
    assert json.loads(result.stdout)["band"]
    assert result.stderr == "mi-lcair: note: audit(): a mesh has no normals\\x1b[31m\n"
    assert capfd.readouterr().out == ""


def test_mitsubas_messages_go_through_python(caplog):
    import mitsuba as mi

    mi.Log(mi.LogLevel.Warn, "one")
    found = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert found[0][0] == "WARNING" and found[0][1].endswith(": one")


def test_warnings_are_notes(run, monkeypatch):
    """Of Python and of its logging; a second line in one of them forges no note."""

    def audit(scene, **sampling):
        warnings.warn(f"extended\n{NAME}", stacklevel=1)
        logging.getLogger("anything").warning("logged %s", NAME)
        raise mi_lcair.InputError(NAME)

    monkeypatch.setitem(vars(mi_lcair), "audit", audit)
    result = run("audit", "two_plates")
    name = r"paint mi-lcair: note: all is well\x1b[31m $x^$"
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.splitlines() == [
        f"mi-lcair: note: extended {name}",
        f"mi-lcair: note: logged {name}",
        f"mi-lcair: {name}",
    ]


@pytest.mark.parametrize("length", [10_000, 2_000_000])
def test_no_line_is_endless(refused, length):
    for name in ("x" * length, "\x1b" * length):
        assert len(refused("render", name, "-o", "out.exr")) < 600
        assert len(refused("render", "two_plates", "-D", f"band={name}", "-o", "out.exr")) < 600
        assert len(refused("rendr" + name)) < 600


def test_a_cell_that_is_no_line(capsys):
    """A material's name in a table of results."""
    print_columns([("a", "b"), (NAME, "c")])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 and lines[1].startswith(
        r"paint\nmi-lcair: note: all is well\x1b[31m $x^$"
    )
