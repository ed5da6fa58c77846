"""Output of the commands: aligned columns or JSON on stdout, notes on stderr."""

import json
import logging
import sys
import warnings
from contextlib import contextmanager

import click

from mi_lcair.errors import InputError, escaped, printable
from mi_lcair.files import check_writable


def print_columns(rows) -> None:
    """Print rows of cells on stdout in aligned columns."""
    rows = [[escaped(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def check_outputs(*outputs) -> None:
    """Check before the work that all outputs can be written and have the right suffix.

    Each output is (path or None, suffix). Raises InputError for the first unusable one.
    """
    for path, suffix in outputs:
        if path:
            if path.suffix.lower() != suffix:
                raise InputError(f"output '{path}' does not end in {suffix}")
            check_writable(path)


def print_written(*paths) -> None:
    """Print on stderr the files that were written. Paths may be None."""
    for path in filter(None, paths):
        click.echo(f"wrote {printable(path)}", err=True)


def note(text: object) -> None:
    """Print on stderr, in one line, something that a user should know about the results."""
    line = f"mi-lcair: note: {printable(text)}"
    if "tqdm" in sys.modules:
        sys.modules["tqdm"].tqdm.write(line, file=sys.stderr)  # keeps the progress bar intact
    else:
        click.echo(line, err=True)


def note_invalid(result) -> None:
    """Say on stderr how many samples of a result (`invalid` of `paths`) do not count, if any."""
    from mi_lcair.rendering.statistics import invalid_remark

    for remark in invalid_remark(result.invalid, result.paths):
        note(remark)


class Notes(logging.Handler):
    """Log handler that prints each message as a note."""

    def emit(self, record):
        note(record.getMessage())


@contextmanager
def warnings_as_notes():
    """Context manager: Python's warnings and logged warnings are printed as notes."""
    handler = Notes(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = lambda message, *_, **__: note(message)
            yield
    finally:
        logging.getLogger().removeHandler(handler)


def print_json(data) -> None:
    """Print `data` as strict JSON (no NaN); NumPy's scalars and arrays become numbers and lists."""
    click.echo(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
