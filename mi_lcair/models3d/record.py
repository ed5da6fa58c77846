"""Record of what an import wrote, from which the next import sees which files were edited."""

import re
from hashlib import sha256
from pathlib import Path

from mi_lcair.errors import InputError, option
from mi_lcair.files import read_bytes

RECORD = re.compile(rb"<!-- checksum ([0-9a-f]{16}) of file (.*) -->\n")


def recorded(contents: dict[str, bytes]) -> str:
    """Lines for model.xml with the checksum of each file, by its name."""
    return "".join(
        f"<!-- checksum {_checksum(contents[name])} of file {_quoted(name)} -->\n"
        for name in sorted(contents)
    )


def signed(text: str) -> str:
    """The text of a scene file with its checksum in the last line, which reveals later edits."""
    return f"{text}<!-- written by mi-lcair import, checksum {_checksum(text.encode())} -->\n"


def check_unedited(folder: Path, contents: dict[str, bytes]) -> None:
    """Raise InputError if files in a folder would be lost that an import has not written, or that
    were edited since.

    contents: what is to be written, by file name. A file with just this content is no loss.
    """
    model = folder / "model.xml"
    record = (
        {name: checksum for checksum, name in RECORD.findall(read_bytes(model))}
        if model.is_file()
        else {}
    )
    edited = []
    for name in sorted(contents):
        path = folder / name
        if not path.is_file():
            continue
        content = read_bytes(path)
        is_written = _is_signed(content) if name.endswith(".xml") else False
        noted = record.get(_quoted(name).encode()) == _checksum(content).encode()
        if not (is_written or noted or content == contents[name]):
            edited.append(str(path))
    if edited:
        raise InputError(
            f"{', '.join(edited)}: {'was' if len(edited) == 1 else 'were'} written by somebody "
            "else or edited since the import; move away what you need, name another folder, or "
            f"give {option('overwrite', True)}"
        )


def _is_signed(content):
    """Whether a scene file is as `signed` made it."""
    text = content.decode("utf-8", "replace")
    head, line, _ = text.rpartition("<!-- written by mi-lcair import")
    return bool(line) and signed(head) == text


def _checksum(content):
    return sha256(content).hexdigest()[:16]


def _quoted(name):
    """A file name for a comment in XML, which must not contain two hyphens in a row."""
    return name.replace("--", "- -")
