"""Reading of whole files, and writing of files that appear completely or not at all."""

import json
import os
import re
import stat
import tomllib
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.interrupts import held_back, remove, temporary

LARGEST = 2**28  # largest size of a text file [bytes]
LARGEST_MESH = 2**34  # largest size of a mesh, an image or another file of numbers [bytes]
DEEPEST = 64  # largest number of dots in a key of a TOML file, whose time grows with its square
VTK = ".vtp", ".vtu"  # suffixes of facets as VTK's XML files
USD = ".usd", ".usda", ".usdc"  # and as OpenUSD
FACET_FILES = (*VTK, *USD)
PART = ".part"  # suffix of temporary files and folders
# Characters of Latin-1 that do not occur in a text file.
NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")
DEEP_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    f"{{{DEEPEST + 1}}}"
)

# Within a block of `together`: the temporary path of each written file, and what it replaces.
_waiting: ContextVar[dict[Path, Path] | None] = ContextVar("_waiting", default=None)


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


def revision(path: str | Path) -> tuple[int, ...] | None:
    """What caches notice by that a file was edited or replaced; None if it does not exist.

    It is the time of its last change, which can be set, with the time of its last change of state,
    the file's number and its size.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_ctime_ns, status.st_dev, status.st_ino, status.st_size


def parse_toml(text: str, what: str) -> dict:
    """The tables of a text in TOML; raises InputError for any other text.

    what: name of the text in messages.
    """
    if DEEP_KEY.search(text):
        raise InputError(f"{what}: a key has more than {DEEPEST} dots")
    return _parsed(tomllib.loads, text, what)


def parse_json(text: str, what: str):
    """The value of a text in JSON; raises InputError for any other text.

    what: name of the text in messages.
    """
    return _parsed(json.loads, text, what)


def _parsed(parse, text: str, what: str):
    try:
        return parse(text)
    except RecursionError:
        raise InputError(f"{what}: nested too deeply") from None
    except ValueError as error:
        hint = "; write a number such as 0.5 (not .5 or 0,5) and a text in quotes"
        is_value = str(error).startswith("Invalid value")  # of TOML
        raise InputError(f"{what}: {error}{hint * is_value}") from None


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
    target = _target(path)
    with _writing(path, target.parent):
        if target.exists() and not target.is_file():
            raise InputError(f"output '{path}' is not a file; name a file to write")
        # Only an attempt is reliable, because permission bits do not account for root and for
        # read-only file systems.
        probe = _partial(target)
        with held_back():
            if not probe.exists():  # otherwise it waits for the end of a block of `together`
                probe.touch()
                probe.unlink()


@contextmanager
def _writing(path: str | Path, folder: Path):
    """Context manager that writes into a folder; raises InputError where `path` cannot be written.

    The folder must exist.
    """
    try:
        if not folder.is_dir():
            raise InputError(f"output folder '{folder}' does not exist; create it or name another")
        yield
    except OSError as error:
        raise InputError(
            f"cannot write '{path}': {error.strerror}; name a folder that can be written"
        ) from error


@contextmanager
def replacing(path: str | Path):
    """Context manager that gives a temporary path, which replaces `path` at the end of the block.

    Within a block of `together` it replaces `path` at the end of that block. If the block is
    interrupted, also by Ctrl-C, the temporary file is removed and `path` is not changed. Where
    `path` is a link, the file that it points to is replaced. Temporary files that earlier processes
    left behind when they were killed are removed.

    Raises
    ------
    InputError
        If `path` cannot be written, the disk is full or the folder vanishes.
    """
    check_writable(path)
    target = _target(path)
    _remove_abandoned(target)
    partial, waiting = _partial(target), _waiting.get()
    with together() if waiting is None else nullcontext(waiting) as waiting, _naming(path, partial):
        waiting[partial] = target
        temporary.add(partial)
        try:
            yield partial
        except BaseException:
            del waiting[partial]
            _discard(partial)
            raise


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a file, completely or not at all; raises as `replacing`.

    A library that writes to memory first raises no errors of its own on a full disk.
    """
    with replacing(path) as partial:
        partial.write_bytes(content)


@contextmanager
def together():
    """Context manager: what `replacing` writes within the block appears at the end of the block.

    All files appear, or none if the block is interrupted. They must not be read within the block.
    """
    waiting = {}  # temporary path of each file, and the path that it replaces
    token = _waiting.set(waiting)
    try:
        yield waiting
        for partial, target in waiting.items():
            with _naming(target, partial), partial.open("rb+") as file:
                os.fsync(file.fileno())  # renaming waits for nothing then, and a full disk shows
        with held_back():
            for partial, target in waiting.items():
                with _naming(target, partial):
                    os.replace(partial, target)
    finally:
        _waiting.reset(token)
        for partial in waiting:
            _discard(partial)


@contextmanager
def resumable(folder: Path, complete: str):
    """Context manager for work into a folder, whose files let a later call go on.

    If the block fails before there is a file of the pattern `complete`, a new folder is removed.
    Otherwise the error of a file that cannot be written says that the folder keeps them.
    """
    is_new = not folder.exists()
    try:
        yield
    except BaseException as error:
        if not any(folder.glob(complete)):
            if is_new:
                _discard(folder)
        elif isinstance(error, InputError) and isinstance(error.__cause__, (OSError, RuntimeError)):
            kept = f"'{folder}' keeps the complete parts; run the same command again to resume"
            raise InputError(f"{error}; {kept}") from error.__cause__
        raise


@contextmanager
def filling(folder: str | Path):
    """Context manager that gives a temporary folder, whose files move to `folder` at the end.

    `folder` is created if it does not exist. Other files in it are not changed. If the block is
    interrupted, nothing is left behind. Raises InputError if `folder` cannot be written.
    """
    folder = _target(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"output '{folder}' is not a folder; name a folder to write to")
    is_new = not folder.exists()
    written = folder if is_new else folder / "files"
    partial = _partial(written)
    temporary.add(partial)
    try:
        with _writing(folder, folder.parent):
            _remove_abandoned(written)
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
    finally:
        _discard(partial)


@contextmanager
def _naming(path, partial: Path):
    """Context manager: errors of the temporary file are InputErrors that name its target."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None)
        is_own = reason and error.filename in (None, str(partial))
        if isinstance(error, RuntimeError):  # OpenEXR's
            is_own = str(partial) in str(error)
            reason = str(error).rpartition('". ')[2].rstrip(".")
        if not is_own:
            raise
        raise InputError(
            f"cannot write '{path}': {reason}; free space, or name another folder"
        ) from error


def _target(path: str | Path) -> Path:
    """The file that is written for a path: where the path is a link, what it points to."""
    return Path(os.path.realpath(path) if os.path.islink(path) else path)


def _partial(path: Path) -> Path:
    """Temporary path of this process beside a file or folder, however its folder is spelled."""
    return Path(os.path.realpath(path.parent), f".{path.name}.{os.getpid()}{PART}")


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files and folders of `path` whose processes have ended."""
    beginning = f".{path.name}."
    with os.scandir(path.parent) as entries:
        names = [
            entry.name
            for entry in entries
            if entry.name.startswith(beginning) and entry.name.endswith(PART)
        ]
    for name in names:
        process = name[len(beginning) : -len(PART)]
        if process.isdecimal() and not _is_alive(int(process)):
            remove(path.with_name(name))


def _discard(partial: Path) -> None:
    with held_back():
        remove(partial)
        temporary.discard(partial)


def _is_alive(process: int) -> bool:
    """Whether a process of this machine has the number; True where that cannot be asked."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it belongs to another user
        return True
    return True
