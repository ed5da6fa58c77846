"""Files that are read whole, and files that appear complete or not at all."""

import os
import re
import shutil
import stat
from contextlib import contextmanager
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.interrupts import held_back

LARGEST = 2**28  # bytes of a text that is read whole
LARGEST_MESH = 2**34  # bytes of a mesh, an image or any other file of numbers
NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")  # in Latin-1; no text file holds them


def check_file(path: Path, largest: int = LARGEST_MESH, what: str = "") -> None:
    """Raise InputError for what exists but is no regular file (a pipe, a device), or is too large.

    Opening a pipe waits for ever, and a device may never end. what: what errors call the file
    (default: its path).
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return  # whoever opens it says why it cannot
    if stat.S_ISDIR(status.st_mode):
        return
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{what or path}: is no regular file; name a file on disk")
    if status.st_size > largest:
        raise InputError(
            f"{what or path}: has {status.st_size / 2**20:.0f} MiB; "
            f"at most {largest / 2**20:.0f} are read"
        )


def read_bytes(path: str | Path, what: str = "", largest: int = LARGEST_MESH) -> bytes:
    """The content of a file; InputError as `check_file`, and for what cannot be read.

    what: what errors call the file (default: its path).
    """
    path = Path(path)
    check_file(path, largest, what)
    try:
        with path.open("rb") as file:
            return file.read()
    except OSError as error:
        raise InputError(f"{what or path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a null character in the name
        raise InputError(f"{what or path}: cannot be read: {error}") from None


def read_text(path: str | Path, what: str = "") -> str:
    """The text of a file in UTF-8, or in Latin-1 where it is not; InputError as `read_bytes`, and
    for what is no text.
    """
    data = read_bytes(path, what, LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if NO_TEXT.search(text):
        raise InputError(f"{what or path}: not a text file; it must be text in UTF-8 or Latin-1")
    return text


def check_writable(path: str | Path) -> None:
    """Raise InputError unless a file can be created (or replaced) at `path`; nothing is left
    behind.

    Cheap, so that a command can ask before it renders.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"output '{path}' is not a file; name a file to write")
        if not path.parent.is_dir():
            raise InputError(
                f"output folder '{path.parent}' does not exist; create it or name another"
            )
        # An attempt is the only sure answer: permission bits say nothing about root or read-only
        # file systems.
        probe = _partial(path)
        with held_back():
            probe.touch()
            probe.unlink()
    except OSError as error:
        raise InputError(
            f"cannot write '{path}': {error.strerror}; name a folder that can be written"
        ) from error


@contextmanager
def replacing(path: str | Path):
    """A temporary path in the folder of `path`, to be written in the block; it takes the place of
    `path` at the end.

    Whatever interrupts the block, Ctrl-C included, leaves neither the temporary nor a changed
    `path`. Raises InputError where `path` cannot be written.
    """
    check_writable(path)
    partial = _partial(Path(path))
    try:
        yield partial
        os.replace(partial, path)
    finally:
        with held_back():
            partial.unlink(missing_ok=True)


@contextmanager
def filling(folder: str | Path):
    """A temporary folder, to be filled with files in the block; at its end they move into `folder`,
    made if it is absent.

    Other files in `folder` are left alone. Whatever interrupts the block leaves nothing behind.
    Raises InputError where `folder` cannot be written.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"output '{folder}' is not a folder; name a folder to write to")
    if not folder.resolve().parent.is_dir():
        raise InputError(
            f"output folder '{folder.parent}' does not exist; create it or name another"
        )
    is_new = not folder.exists()
    partial = _partial(folder if is_new else folder / "files")
    try:
        partial.mkdir()
        yield partial
        if is_new:
            partial.rename(folder)
            return
        files = sorted(partial.iterdir())
        for file in files:
            if (folder / file.name).is_dir():
                raise InputError(
                    f"cannot write '{folder / file.name}': it is a folder; remove it or name another output"
                )
        with held_back():
            for file in files:
                os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(
            f"cannot write '{folder}': {error.strerror}; name a folder that can be written"
        ) from error
    finally:
        with held_back():
            shutil.rmtree(partial, ignore_errors=True)


def _partial(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.part")
