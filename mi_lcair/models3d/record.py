"""Record of what an import wrote, from which the next import sees which files were edited."""

import json
from hashlib import sha256
from pathlib import Path

from mi_lcair.errors import InputError, option
from mi_lcair.files import parse_json, read_bytes, read_text

RECORD = ".import.json"  # file with the checksum of each other file, by its name


def record_of(contents: dict[str, bytes]) -> bytes:
    """Content of the RECORD of files, by name."""
    checksums = {name: _checksum(contents[name]) for name in sorted(contents)}
    return f"{json.dumps(checksums, indent=2)}\n".encode()


def check_unedited(folder: Path, contents: dict[str, bytes]) -> None:
    """Raise InputError if files in a folder would be lost that an import has not written, or that
    were edited since.

    contents: what is to be written, by file name. A file with just this content is no loss.
    """
    record, known = folder / RECORD, {}
    if record.is_file():
        known = parse_json(read_text(record), str(record))
    known = known if isinstance(known, dict) else {}
    edited = [
        str(folder / name)
        for name, content in sorted(contents.items())
        if (folder / name).is_file()
        and _checksum(read_bytes(folder / name)) not in (known.get(name), _checksum(content))
    ]
    if edited:
        raise InputError(
            f"{', '.join(edited)}: {'was' if len(edited) == 1 else 'were'} written by somebody "
            "else or edited since the import; move away what you need, name another folder, or "
            f"give {option('overwrite', True)}"
        )


def _checksum(content: bytes) -> str:
    return sha256(content).hexdigest()[:16]
