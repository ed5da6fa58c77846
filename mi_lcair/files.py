"""Reading of whole files, and writing of files that appear completely or not at all."""

import os
import re
import shutil
import stat
from contextlib import contextmanager
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.interrupts import held_back

LARGEST = 2**28  # largest size of a text file [bytes]
LARGEST_MESH = 2**34  # largest size of a mesh, an image or another file of numbers [bytes]
# Characters of Latin-1 that do not occur in a text file.
NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")


def check_file(path: Path, largest: int = LARGEST_MESH, what: str = "") -> None:
    """Raise InputError for a path that is not a regular file, or for a file that is too large.

    Opening a pipe could wait for ever, and reading a device might never end. A path that does not
    exist is accepted. largest: largest size [bytes]. what: name of the file in messages (its path).
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return  # the error is raised where the file is opened
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
    """Content of a file; raises InputError as `check_file` and for a file that cannot be read.

    what: name of the file in messages (its path). largest: largest size [bytes].
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
    """Text of a file in UTF-8, or in Latin-1 if it is not valid UTF-8.

    Raises InputError as `read_bytes`, and for a file that is not text.
    """
    data = read_bytes(path, what, LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if NO_TEXT.search(text):
        raise InputError(f"{what or path}: not a text file; it must be text in UTF-8 or Latin-1")
    return text


def revision(path: str | Path) -> tuple[int, int] | None:
    """Time of the last change and size of a file, by which caches notice that it was edited.

    It is None for a path that does not exist.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size


def check_suffix(path: str | Path, suffixes, what: str = "output") -> str:
    """The suffix of a path in lower case; raises InputError if it is none of `suffixes`.

    what: name of the path in the message, such as an option.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in suffixes:
        *first, last = suffixes
        known = f"{', '.join(first)} or {last}" if first else last
        raise InputError(f"{what} '{path}' does not end in {known}")
    return suffix


def check_writable(path: str | Path) -> None:
    """Raise InputError if a file cannot be created or replaced at `path`.

    The check leaves no file behind. It is fast, so a command can do it before it renders.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"output '{path}' is not a file; name a file to write")
        if not path.parent.is_dir():
            raise InputError(
                f"output folder '{path.parent}' does not exist; create it or name another"
            )
        # Only an attempt is reliable, because permission bits do not account for root and for
        # read-only file systems.
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
    """Context manager that gives a temporary path, which replaces `path` at the end of the block.

    If the block is interrupted, also by Ctrl-C, the temporary file is removed and `path` is not
    changed. Raises InputError if `path` cannot be written.
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
    """Context manager that gives a temporary folder, whose files move to `folder` at the end.

    `folder` is created if it does not exist. Other files in it are not changed. If the block is
    interrupted, nothing is left behind. Raises InputError if `folder` cannot be written.
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
                    f"cannot write '{folder / file.name}': it is a folder; "
                    "remove it or name another output"
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
