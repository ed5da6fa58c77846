"""CONTRIBUTING names every room, and its steps work."""

import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.docs.fences import ROOT, fences
from tests.test_architecture import FLOORS

PAGE = "CONTRIBUTING.md"
TEXT = (ROOT / PAGE).read_text(encoding="utf-8")
ROW = re.compile(r"^\| *(\d*) *\| `([^`]+)/` \|", re.MULTILINE)


def rooms() -> dict[str, int]:
    """Floor by folder, of the table of rooms; a row without a floor has that of the row above."""
    floors, floor = {}, 0
    for number, folder in ROW.findall(TEXT):
        floor = int(number or floor)
        floors[folder] = floor
    return floors


def test_every_room_is_named_with_its_floor():
    """The table goes from the top down, also within a floor."""
    named = rooms()
    order = []
    for module, floor in FLOORS.items():
        folder = module.replace(".", "/")
        if not (ROOT / folder).is_dir() or module.count(".") != 1:
            continue
        top = folder.removeprefix("mi_lcair/")
        folder = top if (ROOT / top).is_dir() else folder
        assert named.get(folder) == floor, folder
        order.append(list(named).index(folder))
    assert order == sorted(order, reverse=True)
    packages = [path.parent for path in (ROOT / "mi_lcair").glob("*/__init__.py")]
    for package in packages:
        assert {package.name, f"mi_lcair/{package.name}"} & named.keys(), package


def test_the_tests_that_are_named_exist():
    """The lines of "Run tests" name files, and a word of tests in them."""
    (block,) = [fence for fence in fences(PAGE) if "# everything" in fence.text]
    lines = [line.partition("#")[0].strip() for line in block.text.splitlines()]
    narrow = [line for line in lines if "tests/" in line]
    assert narrow
    for words in map(str.split, narrow):
        (file,) = (ROOT / word for word in words if word.startswith("tests/"))
        names = [line for line in file.read_text().splitlines() if line.startswith("def test_")]
        assert "-k" not in words or any(words[-1] in name for name in names), words


@pytest.mark.slow
def test_a_command_is_added_by_the_steps(tmp_path):
    """The sample is copied to where it belongs, and its line among the commands."""
    shutil.copytree(ROOT / "mi_lcair", tmp_path / "mi_lcair")
    command, line = (
        fence.text
        for fence in fences(PAGE)
        if fence.language == "python" and "slopes" in fence.text
    )
    assert len(list(filter(str.strip, command.splitlines()))) <= 10
    (tmp_path / "mi_lcair/cli/slopes.py").write_text(command)
    file = tmp_path / "mi_lcair/cli/__init__.py"
    before = '        "laboratory": ("temperature", "cavity", "exchange", "heat", "pose"),\n'
    text = file.read_text()
    assert text.count(before) == 1
    file.write_text(text.replace(before, before + line))
    words = shlex.split(re.search('mi-lcair (.*two_plates.*)"', command)[1])
    done = subprocess.run(
        [sys.executable, "-m", "mi_lcair", *words, "-o", "table.csv", "--json"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )
    assert done.returncode == 0 and '"kind": "sensitivities"' in done.stdout, done.stderr
    assert "plate.temperature" in (tmp_path / "table.csv").read_text()
