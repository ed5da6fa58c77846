"""Output of the commands: aligned columns or JSON on stdout, notes on stderr."""

import json
import logging
import shlex
import sys
import warnings
from contextlib import contextmanager

import click

from mi_lcair.declared import listed
from mi_lcair.errors import escaped, printable
from mi_lcair.files import together

QUIET, JSON = "mi_lcair.quiet", "mi_lcair.json"  # keys in the context of click


def is_set(key: str) -> bool:
    """Whether the current command was called with the flag of this key."""
    context = click.get_current_context(silent=True)
    return bool(context and context.meta.get(key))


def flag_option(key: str, *names: str, help: str):
    """Decorator that gives a command a flag, of which `is_set` tells."""

    def remember(ctx, option, wanted):
        if wanted:
            ctx.meta[key] = True

    return click.option(*names, is_flag=True, expose_value=False, callback=remember, help=help)


quiet_option = flag_option(
    QUIET,
    "-q",
    "--quiet",
    help="Print no notes and no progress on stderr; errors are still printed.",
)


def print_columns(rows) -> None:
    """Print rows of cells on stdout in aligned columns."""
    rows = [[escaped(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def print_table(data: dict, rows: list, *lines: str) -> None:
    """Print data as JSON with --json, or rows of cells and lines below them."""
    if is_set(JSON):
        print_json(data)
        return
    print_columns(rows)
    for line in lines:
        click.echo(line)


def print_result(result, rows=(), more=None, **options) -> None:
    """Print a result as JSON, or its sections; its remarks are notes on stderr in both cases.

    Parameters
    ----------
    result : Result
    rows : sequence of (label, value)
        Further facts, printed below the first ones of the result. How long it took follows them.
    more : dict, optional
        Further entries of the JSON.
    **options
        Options of `Result.sections`.
    """
    from mi_lcair.sections import remarks

    sections = result.sections(**options)
    if isinstance(seconds := getattr(result, "seconds", None), float):
        rows = [*rows, ("time", f"{seconds:.2f} s")]
    for remark in remarks(sections):
        note(remark)
    if is_set(JSON):
        print_json(result.as_dict() | (more or {}))
    else:
        print_sections(sections, rows)


def write_and_print(result, files: dict, *arguments, **options) -> None:
    """Write the files of a result together, and print the result.

    files: function that writes each file, by path; a path that is None is not wanted. arguments,
    options: those of `print_result`.
    """
    with together():
        for path, write in files.items():
            if path:
                write(path)
    print_result(result, *arguments, **options)
    print_written(*files)


def print_sections(sections, rows=()) -> None:
    """Print facts, tables and lists of sections on stdout, with blank lines in between.

    rows: further facts (label, value), printed below the first ones.
    """
    from mi_lcair.sections import blocks

    for number, block in enumerate(blocks(sections, rows)):
        if number:
            click.echo()
        print_columns(block)


def print_written(*paths) -> None:
    """Print on stderr the files that were written, unless -q is given. Paths may be None."""
    for path in filter(None, () if is_set(QUIET) else paths):
        click.echo(f"wrote {printable(path)}", err=True)


# Arguments that let the renderer choose the number of samples. None of them goes with --spp.
CHOOSING = ("tolerance", "tolerance_W_m2", "max_spp")
# Commands to which only an option gives a tolerance. A trend has one by default, and the file of a
# scenario may state one.
WITHOUT = ("render", "signature")


class Called(click.Command):
    """A command whose context keeps the arguments of its call as `obj`, a list of words.

    In every command --spp sets the number of samples, and a tolerance lets the renderer choose it.
    Both together are refused.
    """

    def make_context(self, info_name, args, parent=None, **extra):
        words = [info_name, *args]
        context = super().make_context(info_name, args, parent, **extra)
        context.obj = words
        return context

    def invoke(self, ctx):
        values = ctx.params
        options = [option for option in self.params if option.name in CHOOSING]
        chosen = [option.opts[0] for option in options if values[option.name] is not None]
        if values.get("spp") and chosen:
            problem = "--spp sets a fixed number of samples; {} cannot go with it"
            raise click.UsageError(problem.format(listed(chosen)), ctx)
        if self.name in WITHOUT and values["max_spp"] and values["tolerance"] is None:
            problem = "--max-spp needs --tolerance; --spp sets a fixed number of samples"
            raise click.UsageError(problem, ctx)
        return super().invoke(ctx)


def line_of(words) -> str:
    """The line that calls the command line with these words."""
    return shlex.join(["mi-lcair", *map(str, words)])


# Notes of a command that has traced no path yet. Its input may still be refused, in one line.
_held: list[str] = []


def note(text: object) -> None:
    """Print on stderr, in one line, something that a user should know about the results.

    It is printed when the work begins, see `print_notes`. Nothing is printed with -q.
    """
    if not is_set(QUIET):
        _held.append(f"mi-lcair: note: {printable(text)}")


def print_next(words) -> None:
    """Print on stderr, at the end, the command that may come next, unless -q is given."""
    if not is_set(QUIET):
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
            warnings.showwarning = lambda message, *_, **__: note(message)
            yield
        print_notes()
    finally:
        _held.clear()
        logging.getLogger().removeHandler(handler)


def print_json(data) -> None:
    """Print `data` as strict JSON (no NaN); NumPy's scalars and arrays become numbers and lists."""
    click.echo(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
