"""Output of the commands: aligned columns or JSON on stdout, notes on stderr."""

import json
import logging
import shlex
import sys
import warnings
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

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
    help="Print no warnings and no progress on stderr, only errors.",
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
    Both together are refused. A result for people ends with the command that may come next:
    `next_lines` are its templates.
    """

    next_lines: tuple[str, ...] = ()

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
            problem = "--spp sets a fixed number of samples; {} cannot be combined with it"
            raise click.UsageError(problem.format(listed(chosen)), ctx)
        if self.name in WITHOUT and values["max_spp"] and values["tolerance"] is None:
            problem = "--max-spp needs --tolerance; --spp sets a fixed number of samples"
            raise click.UsageError(problem, ctx)
        returned = super().invoke(ctx)
        if not (is_set(QUIET) or is_set(JSON)):
            known = words_of(ctx, returned or {})
            lines = (filled(line, known, ctx) for line in self.next_lines)
            _held.extend(f"next: {line_of(line)}" for line in islice(filter(None, lines), 1))


def words_of(ctx: click.Context, returned: dict) -> dict:
    """What templates of the next command may name after a call.

    Its arguments and options; what the command returned; the first output of each suffix; `name`,
    after its first argument; `call`, its own words.
    """
    known = (ctx.params | returned).items()
    known = {name: value for name, value in known if value not in (None, (), False)}
    outputs = [output for output in known.get("outputs", ()) if isinstance(output, Path)]
    known |= {output.suffix.lower()[1:]: output for output in reversed(outputs)}
    value = next((ctx.params[p.name] for p in ctx.command.params if type(p) is click.Argument), "")
    first = Path(value[0] if isinstance(value, tuple) and value else value or "")
    name = (first.name == "scene.xml" and first.parent.name) or first.stem
    return known | {"name": name, "call": [word for word in ctx.obj if word != "--check"]}


# Options that a next command takes over
TAKEN_OVER = ("-D", "--solution", "--motions", "--plugin", "--materials", "-s")


def filled(template: str, known: dict, ctx: click.Context) -> list[str]:
    """The words of a template; none if one is not known, or if the call had such an output.

    {given} are the options of this call that the next command takes too.
    """
    words = []
    try:
        for word in template.split():
            if word == "{given}":
                words += given_options(ctx, words[0])
            else:
                several = known.get(word[1:-1])
                is_list = isinstance(several, (list, tuple))
                words += several if is_list else [word.format_map(known)]
    except KeyError:
        return []
    return [] if words[-2] == "-o" and Path(words[-1]).suffix[1:] in known else words


def given_options(ctx: click.Context, following: str) -> list[str]:
    """Those options of a call, as they were given, that another command takes too."""
    command = ctx.parent.command.get_command(ctx.parent, following)
    taken = {name for option in command.params for name in option.opts}
    words = []
    for option in ctx.command.params:
        flag, value = option.opts[0], ctx.params.get(option.name)
        if flag in TAKEN_OVER and flag in taken and value is not None and value != option.default:
            for one in value if isinstance(value, tuple) else (value,):
                words += [flag, "=".join(one) if isinstance(one, tuple) else str(one)]
    return words


def line_of(words) -> str:
    """The line that calls the command line with these words."""
    return shlex.join(["mi-lcair", *map(str, words)])


# Notes of a command that has traced no path yet. Its input may still be refused, in one line.
_held: list[str] = []


def note(text: object, kind: str = "warning") -> None:
    """Print on stderr, in one line, something that a user should know about the results.

    It is printed when the work begins, see `print_notes`. Nothing is printed with -q.
    """
    if not is_set(QUIET):
        _held.append(f"mi-lcair: {kind}: {printable(text)}")


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
