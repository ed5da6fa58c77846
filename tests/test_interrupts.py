"""Signals end the program in one line, with status 130, and leave neither half files nor half
modules. What is tried happens in a Python of its own.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import mi_lcair

CHECKOUT = Path(mi_lcair.__file__).parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
ENDING = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


def python(code, folder):
    return subprocess.run(
        [sys.executable, "-c", code],
        env=ENVIRONMENT,
        cwd=folder,
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", ENDING)
def test_an_import_is_finished_first(tmp_path, number):
    """A module that is left half made would fail later, with a NameError."""
    (tmp_path / "slow.py").write_text(
        f"import os, time\nos.kill(os.getpid(), {int(number)})\ntime.sleep(0.1)\nwhole = True\n"
    )
    done = python(
        "from mi_lcair import interrupts\n"
        "interrupts.install()\n"
        "import time\n"
        "try:\n"
        "    import slow\n"
        "    time.sleep(5)\n"
        "except KeyboardInterrupt:\n"
        "    import slow\n"
        "    print('interrupted', slow.whole)\n",
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("interrupted True\n", "")


def test_steps_that_belong_together_are_finished_first(tmp_path):
    done = python(
        "import os, signal, time\n"
        "from mi_lcair import interrupts\n"
        "interrupts.install()\n"
        "try:\n"
        "    with interrupts.held_back():\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        time.sleep(0.1)\n"
        "        print('both')\n"
        "    time.sleep(5)\n"
        "except KeyboardInterrupt:\n"
        "    print('then the interrupt')\n",
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("both\nthen the interrupt\n", "")


@pytest.mark.slow
@pytest.mark.parametrize("number", ENDING)
def test_a_signal_while_a_file_is_written(tmp_path, number):
    """Exit 130, one line, no partial file, and the old file as it was."""
    (tmp_path / "out.exr").write_text("old")
    code = """
import time, mi_lcair
from types import SimpleNamespace
from mi_lcair.files import replacing
mi_lcair.load = lambda scene: SimpleNamespace(remarks=[])
def render(scene, **sampling):
    with replacing("out.exr") as partial:
        partial.write_text("half")
        print("writing", flush=True)
        time.sleep(60)
mi_lcair.render = render
import sys
sys.argv = ["mi-lcair", "render", "two_plates", "-o", "out.exr"]
from mi_lcair.__main__ import main
main()
"""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
        cwd=tmp_path,
    )
    assert process.stdout.readline() == "writing\n"
    process.send_signal(number)
    _, errors = process.communicate()
    assert (process.returncode, errors.strip()) == (130, "mi-lcair: interrupted")
    assert [file.name for file in tmp_path.iterdir()] == ["out.exr"]
    assert (tmp_path / "out.exr").read_text() == "old"


def test_a_signal_that_is_ignored_stays_ignored(tmp_path):
    """As under nohup."""
    done = python(
        "import os, signal\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "from mi_lcair import interrupts\n"
        "interrupts.install()\n"
        "os.kill(os.getpid(), signal.SIGHUP)\n"
        "print('goes on')\n",
        tmp_path,
    )
    assert (done.stdout, done.stderr) == ("goes on\n", "")


BUSY = """
import time
from pathlib import Path
from mi_lcair import interrupts
from mi_lcair.files import filling, replacing
interrupts.install()
interrupts.end_soon()
with replacing('file') as partial, filling('folder') as folder:
    partial.write_text('half')
    (folder / 'file').write_text('half')
    Path('busy.py').write_text('import time; print("busy", flush=True); time.sleep(300)')
    {step}
"""


@pytest.mark.parametrize(
    "step",
    [
        "import hashlib\n    while True:\n"
        "        try: print('busy', flush=True) or hashlib.pbkdf2_hmac('sha512', b'', b'', 10**9)\n"
        "        except KeyboardInterrupt: pass  # between the two",
        "import sys; sys.path.append('.'); import busy",
        "while True:\n"
        "        try: print('busy', flush=True) or time.sleep(300)\n"
        "        except KeyboardInterrupt: pass",
    ],
    ids=["a long step of a library", "a long import", "a library that catches the exception"],
)
def test_a_program_that_does_not_answer(tmp_path, step):
    """It ends, says so, and leaves no temporary files."""
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY.format(step=step)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
        cwd=tmp_path,
    )
    assert process.stdout.readline() == "busy\n"
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate()
    assert (process.returncode, errors) == (130, "mi-lcair: interrupted\n")
    assert {path.name for path in tmp_path.iterdir()} <= {"busy.py", "__pycache__"}
