"""Output of the commands: aligned columns or JSON on stdout, notes on stderr."""

import json
import logging
import shlex
import sys
import warnings
from contextlib import contextmanager

import click

from mi_lcair.errors import escaped, printable
from mi_lcair.files import check_suffix, check_writable

QUIET = "mi_lcair.quiet"  # key in the context of click


def quiet() -> bool:
    """Whether the current command was called with -q."""
    context = click.get_current_context(silent=True)
    return bool(context and context.meta.get(QUIET))


def quiet_option(command):
    """Give a command the option -q, of which `quiet` tells."""

    def remember(ctx, option, wanted):
        if wanted:
            ctx.meta[QUIET] = True

    return click.option(
        "-q",
        "--quiet",
        is_flag=True,
        expose_value=False,
        callback=remember,
        help="Print no notes and no progress on stderr; errors are still printed.",
    )(command)


def print_columns(rows) -> None:
    """Print rows of cells on stdout in aligned columns."""
    rows = [[escaped(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def print_result(result, json: bool, rows=(), more=None, **options) -> None:
    """Print a result as JSON, or its sections; its remarks are notes on stderr in both cases.

    Parameters
    ----------
    result : Result
    json : bool
        Whether to print its dictionary instead of its sections.
    rows : sequence of (label, value)
        Further facts, printed below the first ones of the result.
    more : dict, optional
        Further entries of the JSON.
    **options
        Options of `Result.sections`.
    """
    from mi_lcair.results.text import remarks

    sections = result.sections(**options)
    for remark in remarks(sections):
        note(remark)
    if json:
        print_json(result.as_dict() | (more or {}))
    else:
        print_sections(sections, rows)


def print_sections(sections, rows=()) -> None:
    """Print facts, tables and lists of sections on stdout, with blank lines in between.

    rows: further facts (label, value), printed below the first ones.
    """
    from mi_lcair.results.text import blocks

    for number, block in enumerate(blocks(sections, rows)):
        if number:
            click.echo()
        print_columns(block)


def time_row(result) -> tuple[str, str]:
    """Row of facts: how long a result took."""
    return "time", f"{result.seconds:.2f} s"


def check_outputs(*outputs) -> None:
    """Check before the work that all outputs can be written and have the right suffix.

    Each output is (path or None, suffix or suffixes). Raises InputError for the first unusable one.
    """
    for path, suffixes in outputs:
        if path:
            check_suffix(path, (suffixes,) if isinstance(suffixes, str) else suffixes)
            check_writable(path)


def print_written(*paths) -> None:
    """Print on stderr the files that were written, unless -q is given. Paths may be None."""
    for path in filter(None, () if quiet() else paths):
        click.echo(f"wrote {printable(path)}", err=True)


class Called(click.Command):
    """A command whose context keeps the arguments of its call as `obj`, a list of words."""

    def make_context(self, info_name, args, parent=None, **extra):
        words = [info_name, *args]
        context = super().make_context(info_name, args, parent, **extra)
        context.obj = words
        return context


def line_of(words) -> str:
    """The line that calls the command line with these words."""
    return shlex.join(["mi-lcair", *map(str, words)])


# Notes of a command that has traced no path yet. Its input may still be refused, in one line.
_held: list[str] = []


def note(text: object) -> None:
    """Print on stderr, in one line, something that a user should know about the results.

    It is printed when the work begins, see `print_notes`. Nothing is printed with -q.
    """
    if not quiet():
        _held.append(f"mi-lcair: note: {printable(text)}")


def print_next(words) -> None:
    """Print on stderr, at the end, the command that may come next, unless -q is given."""
    if not quiet():
        _held.append(f"next: {line_of(words)}")


def print_notes() -> None:
    """Print the notes so far, because the input can be used."""
    for line in _held:
        if "tqdm" in sys.modules:
            sys.modules["tqdm"].tqdm.write(line, file=sys.stderr)  # keeps the progress bar intact
        else:
            click.echo(line, err=True)
    _held.clear()


class Notes(logging.Handler):
    """Log handler that prints each message as a note."""

    def emit(self, record):
        note(record.getMessage())


def _note_warning(message, *_, **__) -> None:
    """Print a warning of Python as a note."""
    note(message)


@contextmanager
def warnings_as_notes():
    """Context manager: Python's warnings and logged warnings are printed as notes.

    An error drops the notes that are not printed yet.
    """
    handler = Notes(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = _note_warning
            yield
        print_notes()
    finally:
        _held.clear()
        logging.getLogger().removeHandler(handler)


def print_json(data) -> None:
    """Print `data` as strict JSON (no NaN); NumPy's scalars and arrays become numbers and lists."""
    click.echo(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
