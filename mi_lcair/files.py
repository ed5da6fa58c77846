"""Files that appear complete or not at all."""
import os
from contextlib import contextmanager
from pathlib import Path

from mi_lcair.errors import InputError


def check_writable(path: str | Path) -> None:
    """Raise InputError unless a file can be created (or replaced) at `path`; nothing is left behind.

    Cheap, so that a command can ask before it renders.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"output '{path}' is not a file; name a file to write")
        if not path.parent.is_dir():
            raise InputError(f"output folder '{path.parent}' does not exist; create it or name another")
        # An attempt is the only sure answer: permission bits say nothing about root or read-only file systems.
        probe = _partial(path)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror}; name a folder that can be written") from error


@contextmanager
def replacing(path: str | Path):
    """A temporary path in the folder of `path`, to be written in the block; it takes the place of `path` at the end.

    Whatever interrupts the block, Ctrl-C included, leaves neither the temporary nor a changed `path`. Raises InputError
    where `path` cannot be written.
    """
    check_writable(path)
    partial = _partial(Path(path))
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _partial(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.part")
