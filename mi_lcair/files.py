"""Files that appear complete or not at all."""

import os
import shutil
from contextlib import contextmanager
from pathlib import Path

from mi_lcair.errors import InputError


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
        for file in files:
            os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(
            f"cannot write '{folder}': {error.strerror}; name a folder that can be written"
        ) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _partial(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.part")
