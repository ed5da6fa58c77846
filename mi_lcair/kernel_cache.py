"""The folder in which Dr.Jit keeps compiled kernels: tried before `drjit` is imported.

Where a kernel cannot be written, Dr.Jit 1.5 reports it and tries again for ever, deaf to Ctrl-C. A
folder without room is therefore replaced by one that has some, or the cache is switched off.
"""

import logging
import os
import shutil
import tempfile
from pathlib import Path

from mi_lcair.errors import printable

VARIABLE = "DRJIT_CACHE_DIR"
OFF = os.devnull  # no folder: Dr.Jit then says that it keeps no kernels
ROOM = 2**26  # bytes that must be free; a large scene's kernels take a few million
PROBE = 2**20  # bytes written as a trial, which meet quotas and limits that the free space hides


def prepare() -> None:
    """Name a folder for kernels to Dr.Jit in DRJIT_CACHE_DIR, where its own choice has no room.

    Candidates in order: the user's DRJIT_CACHE_DIR or ~/.drjit, and one in the system's temporary
    folder. The choice of another than the first is one logged line.
    """
    own = Path(os.environ.get(VARIABLE) or Path.home() / ".drjit")
    reason = trouble(own)
    if reason is None:
        return
    other = Path(tempfile.gettempdir()) / f"drjit-{os.getuid() if hasattr(os, 'getuid') else ''}"
    if has_room := trouble(other) is None:
        os.environ[VARIABLE] = str(other)
    else:
        os.environ[VARIABLE] = OFF
    logging.getLogger(__name__).warning(
        "%s",
        printable(
            f"kernel cache {own}: {reason}; "
            + (f"{other} is used instead" if has_room else "kernels are compiled anew in each run")
        ),
    )


def trouble(folder: Path) -> str | None:
    """Why kernels cannot be kept in a folder, or None; the folder is made if it is absent."""
    probe = folder / f".{os.getpid()}.probe"
    try:
        folder.mkdir(parents=True, exist_ok=True)
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
