"""Files are whole or absent, whatever ends the writing: a full disk, a vanished folder, kill -9."""

import os
import resource
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import mi_lcair
from mi_lcair.drawing import drawing
from mi_lcair.errors import InputError
from mi_lcair.files import check_file, check_writable, filling, read_text, replacing
from mi_lcair.rendering.image import write_exr
from mi_lcair.rendering.views import View
from mi_lcair.signatures.trend_file import TrendFile

CHECKOUT = Path(mi_lcair.__file__).parents[1]
LIMIT = 4096  # bytes that a file may have, as on a disk that is nearly full


def text(path):
    with replacing(path) as partial:
        partial.write_text("new " * LIMIT)


def exr(path):
    write_exr(path, {"Y": np.random.default_rng(0).random((64, 64))}, {})


def png(path):
    with drawing(path, (8, 8)) as figure:
        figure.subplots().imshow(np.random.default_rng(0).random((256, 256)))


def trend(path):
    views = tuple(View(float(azimuth), 0.0) for azimuth in range(360))
    file = TrendFile(path, {"scene": "x"}, [(0, views)])
    file.add(
        {
            view: {"azimuth_deg": view.azimuth_deg, "elevation_deg": 0.0, "a_W_sr": 1 / 3}
            for view in views
        }
    )


@contextmanager
def full_disk():
    """Within: no file of this process grows beyond LIMIT.

    It ends before the test does, because pytest itself may write its report into a longer file.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("write", [text, exr, png, trend])
def test_a_full_disk(tmp_path, write):
    """An error, the old file as it was, and nothing beside it."""
    path = tmp_path / "file.png"
    path.write_text("old")
    with pytest.raises((OSError, RuntimeError)), full_disk():
        write(path)
    assert [file.name for file in tmp_path.iterdir()] == ["file.png"]
    assert path.read_text() == "old"


def test_a_full_disk_while_a_folder_is_filled(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "a").write_text("old")
    too_large = pytest.raises(InputError, match="cannot write .*: File too large")
    with too_large, full_disk(), filling(folder) as partial:
        (partial / "a").write_text("new")
        (partial / "b").write_text("b" * 2 * LIMIT)
    assert [file.name for file in folder.iterdir()] == ["a"]
    assert (folder / "a").read_text() == "old"


@pytest.mark.parametrize("write", [text, trend])
def test_a_folder_that_vanishes(tmp_path, write, monkeypatch):
    """Between the check and the end of the writing."""
    folder = tmp_path / "folder"
    folder.mkdir()
    replace = os.replace

    def too_late(source, target):
        shutil.rmtree(folder)
        replace(source, target)

    monkeypatch.setattr("mi_lcair.files.os.replace", too_late)
    with pytest.raises(FileNotFoundError):
        write(folder / "file")
    assert list(tmp_path.iterdir()) == []


def test_kill_9_while_a_file_is_written(tmp_path):
    """The old file stays; what was begun lies hidden beside it, under another name."""
    (tmp_path / "out.csv").write_text("old")
    code = (
        "import time\n"
        "from mi_lcair.files import replacing\n"
        "with replacing('out.csv') as partial:\n"
        "    partial.write_text('half')\n"
        "    print('writing', flush=True)\n"
        "    time.sleep(60)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    with process:
        assert process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGKILL)
    assert (tmp_path / "out.csv").read_text() == "old"
    assert all(file.name.startswith(".") for file in tmp_path.iterdir() if file.name != "out.csv")


def test_what_cannot_be_written_is_refused_before(tmp_path):
    for path, message in (
        (tmp_path, "is not a file"),
        (tmp_path / "none" / "file", "does not exist"),
        (tmp_path / ("x" * 300), "cannot write .*: File name too long"),
    ):
        with pytest.raises(InputError, match=message):
            check_writable(path)
    assert list(tmp_path.iterdir()) == []


def test_text_in_any_usual_encoding(tmp_path):
    path = tmp_path / "file"
    for data in (b"\xef\xbb\xbfOrl\xc3\xa9ans", b"Orl\xe9ans"):
        path.write_bytes(data)
        assert read_text(path) == "Orl\xe9ans"
    for data in (b"\x89PNG\r\n\x00", b"a\x1b[31m", "abc".encode("utf-16")):
        path.write_bytes(data)
        with pytest.raises(InputError, match="not a text file"):
            read_text(path)


def test_a_path_that_is_none(tmp_path):
    for path in ("x" * 5000, "a\0b", tmp_path / "none"):
        check_file(Path(path))  # whoever opens it says what is wrong
        with pytest.raises(InputError, match="cannot be read"):
            read_text(path)
