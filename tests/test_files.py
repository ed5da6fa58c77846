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
from mi_lcair import formats
from mi_lcair.drawing import drawing
from mi_lcair.errors import InputError
from mi_lcair.files import (
    DEEPEST,
    check_file,
    check_writable,
    filling,
    parse_json,
    parse_toml,
    read_text,
    replacing,
    resumable,
    together,
)
from mi_lcair.rendering.images.files import write_exr
from mi_lcair.signatures.trend import Trend, write_csv

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


def tif(path):
    formats.write_tiff(
        path, np.random.default_rng(0).integers(0, 60000, (256, 256)).astype(np.uint16)
    )


def trend(path):
    columns = ("azimuth_deg", "elevation_deg", "intensity_W_sr")
    write_csv(path, Trend("x", dict.fromkeys(columns, np.arange(360.0) / 7), "MWIR"))


@contextmanager
def full_disk(limit=LIMIT):
    """Within: no file of this process grows beyond a limit.

    It ends before the test does, because pytest itself may write its report into a longer file.
    """
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("write", [text, exr, png, tif, trend])
def test_a_full_disk(tmp_path, write):
    """An error that names the file, the old file as it was, and nothing beside it."""
    path = tmp_path / "file.png"
    path.write_text("old")
    with pytest.raises(InputError, match="File too large; free space") as raised, full_disk():
        write(path)
    assert str(path) in str(raised.value) and ".part" not in str(raised.value)
    assert [file.name for file in tmp_path.iterdir()] == ["file.png"]
    assert path.read_text() == "old"


def test_a_disk_that_is_full_before_a_picture_begins(tmp_path):
    """Matplotlib would say that its stream has no position."""
    full = pytest.raises(InputError, match=r"file\.pdf")
    with full, full_disk(0), drawing(tmp_path / "file.pdf", (8, 8)) as figure:
        figure.subplots().plot([0, 1])
    assert list(tmp_path.iterdir()) == []


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


def test_a_full_disk_during_work_that_can_go_on(tmp_path):
    """A new folder is removed while nothing in it is complete; later the error says what is."""
    folder = tmp_path / "areas"
    for complete, message in (
        ([], "another folder$"),
        (["1.nc"], "areas' keeps the complete parts"),
    ):
        with pytest.raises(InputError, match=message), full_disk(), resumable(folder, "*.nc"):
            folder.mkdir()
            for name in complete:
                (folder / name).touch()
            text(folder / "2.nc")
        assert [file.name for file in folder.glob("*")] == complete
        assert folder.exists() == bool(complete)


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
    with pytest.raises(InputError, match="cannot write"):
        write(folder / "file")
    assert list(tmp_path.iterdir()) == []


WRITING = """
import time
from mi_lcair.files import filling, replacing
with {writer} as partial:
    {write}
    print('writing', flush=True)
    time.sleep(60)
"""


def write_all(folder):
    """Write what the processes below write."""
    with replacing(folder / "out.csv") as partial:
        partial.write_text("old")
    with filling(folder / "new"), filling(folder / "old"):
        pass
    (folder / "new").rmdir()


@pytest.mark.parametrize(
    "writer, write",
    [
        ("replacing('out.csv')", "partial.write_text('half')"),
        ("filling('new')", "(partial / 'a').write_text('half')"),
        ("filling('old')", "(partial / 'a').write_text('half')"),
    ],
)
def test_kill_9_while_a_file_is_written(tmp_path, writer, write):
    """The old file stays; what was begun lies hidden beside it, until it is written again."""
    (tmp_path / "out.csv").write_text("old")
    (tmp_path / "old").mkdir()
    before = sorted(tmp_path.rglob("*"))
    process = subprocess.Popen(
        [sys.executable, "-c", WRITING.format(writer=writer, write=write)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )
    with process:
        assert process.stdout.readline() == "writing\n"
        during = sorted(tmp_path.rglob("*"))
        write_all(tmp_path)
        kept = set(during) <= set(tmp_path.rglob("*"))
        process.send_signal(signal.SIGKILL)
    assert kept, "files of a process that still writes were removed"
    assert (tmp_path / "out.csv").read_text() == "old"
    abandoned = [path for path in tmp_path.rglob("*") if path not in before]
    assert abandoned and all(".part" in str(path) for path in abandoned)
    write_all(tmp_path)
    assert sorted(tmp_path.rglob("*")) == before


def test_files_that_appear_together(tmp_path):
    """Also the file that is written twice; not those of a block that fails."""
    first, second = tmp_path / "first.png", tmp_path / "second"
    with together():
        for content in ("a", "b"):
            with replacing(second) as partial:
                partial.write_text(content)
            check_writable(second)
        with drawing(first, (1, 1)):
            pass
        assert not first.exists() and not second.exists()
    assert first.read_bytes() and second.read_text() == "b"
    with pytest.raises(KeyboardInterrupt), together():
        with replacing(second) as partial:
            partial.write_text("new")
        raise KeyboardInterrupt
    with together(), pytest.raises(KeyError), replacing(second) as partial:
        partial.write_text("new")
        raise KeyError
    assert second.read_text() == "b" and sorted(tmp_path.iterdir()) == [first, second]


def test_two_spellings_of_one_file(tmp_path, monkeypatch):
    """The last content stays, and files that are written together with it appear."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    spellings = ["file", tmp_path / "file", "folder/../file", "link/file"]
    with together():
        for spelling in (*spellings, "other"):
            with replacing(spelling) as partial:
                partial.write_text(str(spelling))
    assert (tmp_path / "file").read_text() == "link/file"
    assert sorted(os.listdir(tmp_path)) == ["file", "folder", "link", "other"]


def test_a_link_is_written_through(tmp_path):
    """The file that an output points to is replaced, and the link stays."""
    (tmp_path / "data").mkdir()
    target = tmp_path / "data" / "file"
    target.write_text("old")
    link, to_folder = tmp_path / "link", tmp_path / "folder"
    link.symlink_to(target)
    to_folder.symlink_to(tmp_path / "data")
    with replacing(link) as partial:
        partial.write_text("new")
    assert link.is_symlink() and target.read_text() == "new"
    with filling(to_folder) as partial:
        (partial / "file").write_text("newer")
    assert to_folder.is_symlink() and target.read_text() == "newer"
    target.unlink()
    with replacing(link) as partial:
        partial.write_text("newest")
    assert link.is_symlink() and target.read_text() == "newest"
    assert [file.name for file in target.parent.iterdir()] == ["file"]


@pytest.mark.parametrize("part", ["a", '"a b"', "'a.b'", r'"\""', "a "])
@pytest.mark.parametrize("place", ["{}=1", "[{}]", "x = {{ {} = 1 }}"])
def test_a_key_with_very_many_parts(part, place):
    """The time of Python's parser grows with their square: 50,000 took more than a minute."""
    long = ".".join([part] * 50_000)
    with pytest.raises(InputError, match=f"x: a key has more than {DEEPEST} dots"):
        parse_toml(place.format(long), "x")
    assert parse_toml(place.format(".".join([part] * (DEEPEST + 1))), "x")


def test_dots_that_are_no_key():
    numbers = ",".join(["1.5"] * 1000)
    text = f"a = [{numbers}]\nb = '{'. ' * 1000}'"
    assert parse_toml(text, "x")["a"] == [1.5] * 1000


def test_texts_that_are_nested_deeply():
    for parse, text in ((parse_json, "[" * 10**5), (parse_toml, "a = " + "[" * 10**5)):
        with pytest.raises(InputError, match="^x: nested too deeply$"):
            parse(text, "x")


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
