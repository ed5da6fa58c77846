"""Tests of the streams: only results on stdout, and one line for each note on stderr."""

import json
import logging
import subprocess
import sys
import warnings

import pytest

import mi_lcair
from mi_lcair.cli.output import print_columns

NAME = "paint\nmi-lcair: warning: all is well\x1b[31m $x^$"


def test_mitsubas_warnings_go_to_stderr(run, monkeypatch, capfd):
    """Messages of Mitsuba appear on stderr, so that stdout is valid JSON."""
    import mitsuba as mi

    original = mi_lcair.audit

    def audit(scene, **sampling):
        mi.Log(mi.LogLevel.Warn, "a mesh has\n no normals\x1b[31m")
        return original(scene, **sampling)

    monkeypatch.setitem(vars(mi_lcair), "audit", audit)
    result = run("audit", "two_plates", "--paths", 64, "--json")
    assert json.loads(result.stdout)["band"]
    assert result.stderr == "mi-lcair: warning: audit(): a mesh has no normals\\x1b[31m\n"
    assert capfd.readouterr().out == ""


def test_mitsubas_messages_go_through_python(caplog):
    import mitsuba as mi

    mi.Log(mi.LogLevel.Warn, "one")
    found = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert found[0][0] == "WARNING" and found[0][1].endswith(": one")


def test_warnings_are_notes(run, monkeypatch):
    """Warnings of Python and of logging become notes, each in a single line."""

    def begins(scene, **sampling):
        warnings.warn(f"extended\n{NAME}", stacklevel=1)
        logging.getLogger("anything").warning("logged %s", NAME)
        sampling["progress"](1, 2)  # paths are traced: the input can be used
        raise mi_lcair.InputError(NAME)

    monkeypatch.setitem(vars(mi_lcair), "audit", begins)
    result = run("audit", "two_plates")
    name = r"paint mi-lcair: warning: all is well\x1b[31m $x^$"
    assert result.exit_code == 2 and result.stdout == ""
    assert result.stderr.splitlines() == [
        f"mi-lcair: warning: extended {name}",
        f"mi-lcair: warning: logged {name}",
        f"mi-lcair: {name}",
    ]


def test_input_that_is_refused_has_no_notes(refused, monkeypatch):
    """What warns while it is checked, and is refused before any path, gets the one line of it."""

    def refuses(scene, **sampling):
        warnings.warn("extended", stacklevel=1)
        raise mi_lcair.InputError("no such quantity")

    monkeypatch.setitem(vars(mi_lcair), "audit", refuses)
    for _ in range(2):
        assert refused("audit", "two_plates") == "mi-lcair: no such quantity\n"


@pytest.mark.slow
@pytest.mark.parametrize("length", [10_000, 200_000])
def test_no_line_is_endless(refused, length):
    for name in ("x" * length, "\x1b" * length):
        assert len(refused("render", name, "-o", "out.exr")) < 600
        assert len(refused("render", "two_plates", "-D", f"band={name}", "-o", "out.exr")) < 600
        assert len(refused("rendr" + name)) < 600


def test_a_cell_that_is_no_line(capsys):
    """A material's name with control characters stays in its row of a table."""
    print_columns([("a", "b"), (NAME, "c")])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 and lines[1].startswith(
        r"paint\nmi-lcair: warning: all is well\x1b[31m $x^$"
    )


@pytest.mark.slow
def test_streams_that_are_closed(tmp_path):
    """Notes and progress go nowhere, and not into the next file that is opened."""
    command = f"{sys.executable} -m mi_lcair signature two_plates --spp 4 --facets facets.csv"
    for closed, status in (("2>&-", 0), ("0<&- 1>&- 2>&-", 0), ("--no-such 2>&-", 2)):
        done = subprocess.run(
            f"{command} {closed}", shell=True, cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == status and done.stderr == ""
        assert bool(done.stdout) == (closed == "2>&-")
    assert (tmp_path / "facets.csv").read_text().startswith("facet,")
