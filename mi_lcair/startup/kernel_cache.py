"""The folder in which Dr.Jit keeps compiled kernels: tried before `drjit` is imported.

Where a kernel cannot be written, Dr.Jit 1.5 reports it and tries again for ever, deaf to Ctrl-C. A
folder without room is therefore replaced by one that has some, or the cache is switched off.

Dr.Jit runs the kernels that it finds in the folder. Nobody else may therefore write there.
"""

import atexit
import logging
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from mi_lcair.errors import printable

VARIABLE = "DRJIT_CACHE_DIR"
OFF = os.devnull  # no folder: Dr.Jit then says that it keeps no kernels
ROOM = 2**26  # bytes that must be free; a large scene's kernels take a few million
HAS_OWNERS = os.name == "posix"  # whether files have owners and modes
PROBE = 2**20  # bytes written as a trial, which meet quotas and limits that the free space hides


def prepare() -> None:
    """Name a folder for kernels to Dr.Jit in DRJIT_CACHE_DIR, where its own choice has no room.

    Candidates in order: the user's DRJIT_CACHE_DIR or ~/.drjit, and one in the system's temporary
    folder. The choice of another than the first is one logged line.
    """
    preferred = Path(os.environ.get(VARIABLE) or Path.home() / ".drjit")
    reason = trouble(preferred)
    if reason is None:
        return
    replacement = _temporary()
    os.environ[VARIABLE] = OFF if replacement is None else str(replacement)
    logging.getLogger(__name__).warning(
        "%s",
        printable(
            f"kernel cache {preferred}: {reason}; "
            + (
                "kernels are compiled anew in each run"
                if replacement is None
                else f"{replacement} is used instead"
            )
        ),
    )


def _temporary() -> Path | None:
    """A private folder among the temporary files; None if it has no room.

    Its name is the same in each run, so that kernels can be used again. Anybody may have made a
    folder or a link of that name before. One that is not private is passed over, and a new folder
    serves until the process ends.
    """
    folder = Path(tempfile.gettempdir()) / f"drjit-{os.getuid() if HAS_OWNERS else ''}"
    try:
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if not _is_private(folder):
            folder = Path(tempfile.mkdtemp(prefix=f"{folder.name}-"))
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
    except OSError:
        return None
    return folder if trouble(folder) is None else None


def _is_private(folder: Path) -> bool:
    """Whether a path is a folder, no link, that belongs to the user and is closed to others."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    return not HAS_OWNERS or (
        status.st_uid == os.getuid() and stat.S_IMODE(status.st_mode) == 0o700
    )


def trouble(folder: Path) -> str | None:
    """Why kernels cannot be kept in a folder, or None; the folder is made if it is absent."""
    probe = folder / f".{os.getpid()}.probe"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if HAS_OWNERS and folder.stat().st_mode & stat.S_IWOTH:
            return "all users may write there, and its kernels are run"
        free = shutil.disk_usage(folder).free
        if free < ROOM:
            return f"only {free / 2**20:.0f} MB are free, {ROOM >> 20} MB are needed"
        try:
            probe.write_bytes(bytes(PROBE))
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        return error.strerror or type(error).__name__
    return None
