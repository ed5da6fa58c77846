"""What the shell completes, as click asks for it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

import mi_lcair
from mi_lcair import scenes
from mi_lcair.cli import COMMANDS, main
from tests.models3d.shapes import cube

HEAVY = ("mitsuba", "drjit", "matplotlib", "colour", "scipy", "OpenEXR", "numpy", "tqdm")
CHECKOUT = Path(mi_lcair.__file__).parents[1]


def completions(*words):
    """The values that complete the last word."""
    complete = ShellComplete(main, {}, "mi-lcair", "_MI_LCAIR_COMPLETE")
    return [item.value for item in complete.get_completions(list(words[:-1]), words[-1])]


def kinds(*words):
    complete = ShellComplete(main, {}, "mi-lcair", "_MI_LCAIR_COMPLETE")
    return {item.type for item in complete.get_completions(list(words[:-1]), words[-1])}


def test_commands_and_options():
    assert completions("") == list(COMMANDS)
    assert completions("si") == ["signature"]
    assert {"--spp", "--spectrum", "--solution"} <= set(completions("signature", "--s"))
    assert completions("fit", "--loss", "c") == ["cube_root"]


@pytest.mark.parametrize("command", ["render", "signature", "trend", "audit", "budget"])
def test_scenes(command):
    assert completions(command, "cyl") == ["cylinder_ir_range"]
    assert set(scenes.names()) <= set(completions(command, ""))


def test_scenarios():
    names = ("approach", "position_1", "position_2", "position_3")
    expected = [f"a340_landing/{name}" for name in names]
    assert completions("contrast", "a34") == completions("image", "a34") == expected
    assert set(expected) <= set(completions("budget", "a34"))


def test_files_beside_names(folder):
    (folder / "own.xml").touch()
    (folder / "own.toml").touch()
    assert completions("render", "ow") == ["own.xml"]
    assert completions("contrast", "ow") == ["own.toml"]
    assert kinds("render", "folder/") == {"file"}  # the shell completes names of files


def test_parameters_of_the_scene_on_the_line(folder):
    assert completions("render", "cavity", "-D", "op") == ["opening="]
    assert "finish=" in completions("signature", "cylinder_ir_range", "--spp", "4", "-D", "")
    assert completions("budget", "open_box", "-D", "ref") == ["reflector="]
    assert completions("report", "cavity", "-D", "op") == ["opening="]  # one of several WHAT
    assert completions("show", "cavity", "-D", "op") == ["opening="]
    assert completions("convert", "f.csv", "f.vtp", "--scene", "cavity", "-D", "op") == ["opening="]
    assert completions("render", "-D", "op") == []  # no scene yet
    assert completions("render", "cavity", "-D", "opening=") == []  # a value
    assert completions("render", "none.xml", "-D", "o") == []


def test_parameters_of_an_imported_scene(folder):
    from mi_lcair.models3d import export, read

    (folder / "model.obj").write_text(cube(label="f*bareAl*300*"))
    export(read(folder / "model.obj"), folder / "out")
    found = completions("render", "out/scene.xml", "-D", "a")
    assert found == ["allow_band=", "azimuth_deg="]
    assert completions("render", "out", "-D", "a") == found  # the folder stands for its scene


def test_entries_of_the_scenario_on_the_line():
    assert completions("contrast", "a340_landing/position_1", "-D", "sensor.b") == ["sensor.band="]
    assert "render.spp=" not in completions("image", "a340_landing/position_1", "-D", "sensor")


def test_materials():
    assert completions("import", "--material", "gloss") == ["gloss_black"]
    assert "gloss_black" in completions("show", "gl")


def test_an_unknown_command_is_no_error():
    assert "signature" not in completions("rendr", "cav")


def test_a_completion_loads_nothing_heavy(folder):
    """The slowest completions, in a fresh Python: no module of a renderer, and no message."""
    for words in (
        ["mi-lcair", "render", "cavity", "-D", "op"],
        ["mi-lcair", "contrast", "a340_landing/position_1", "-D", "sensor.b"],
        ["mi-lcair", "show", "gl"],
        ["mi-lcair", "rendr", "ca"],
    ):
        code = (
            "import sys; from mi_lcair.cli import main\n"
            "try: main(prog_name='mi-lcair')\n"
            f"finally: print([m for m in {HEAVY} if m in sys.modules], file=sys.stderr)"
        )
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            env={
                **os.environ,
                "PYTHONPATH": str(CHECKOUT),
                "_MI_LCAIR_COMPLETE": "bash_complete",
                "COMP_WORDS": " ".join(words),
                "COMP_CWORD": str(len(words) - 1),
            },
        )
        assert done.stderr == "[]\n", (words, done.stderr)


@pytest.mark.skipif(not shutil.which("bash"), reason="no bash on this machine")
def test_bash_adds_no_blank_behind_a_key(folder):
    """The script that `eval` gets completes in a real bash, and a key's value follows at once."""
    (folder / "mi-lcair").write_text(
        f"#!/bin/sh\nexec {sys.executable} -c 'from mi_lcair.__main__ import main; main()' \"$@\"\n"
    )
    (folder / "mi-lcair").chmod(0o755)
    script = """
eval "$(_MI_LCAIR_COMPLETE=bash_source mi-lcair)"
compopt() { echo option "$@"; }
COMP_WORDS=(mi-lcair render cavity -D op); COMP_CWORD=4; COMPREPLY=()
_mi_lcair_completion mi-lcair
echo "${COMPREPLY[@]}"
"""
    done = subprocess.run(
        ["bash", "-c", script],
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "PATH": f"{folder}:{os.environ['PATH']}",
            "PYTHONPATH": str(CHECKOUT),
        },
    )
    assert done.stdout.splitlines() == ["option -o nospace", "opening="], done.stderr
