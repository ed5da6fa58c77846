"""Output of the commands: aligned columns or JSON on stdout, notes on stderr."""

import json
import logging
import sys
import warnings
from contextlib import contextmanager
from dataclasses import dataclass

import click

from mi_lcair.errors import escaped, printable
from mi_lcair.files import check_suffix, check_writable
from mi_lcair.fraction import percent

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


def interval(half_width: float, value: float, unit: str, of: str, absolute: bool = False) -> str:
    """The 95 % interval of a value in words, as a fraction of the value if it is not zero.

    `half_width` is half of the interval. `of` names the value, such as "the target's intensity".
    `absolute`: state the half width in its unit too.
    """
    width = f"{half_width:.2g} {unit}"
    if half_width >= abs(value):
        return f"the 95 % interval is +- {width}, and {of} may be zero"
    fraction = percent(half_width / abs(value))
    return f"the 95 % interval is +- {f'{width}, ' if absolute else ''}{fraction} of {of}"


def error_row(
    error: str,
    tolerance: float | str | None = None,
    reached: bool | None = None,
    max_spp: int | None = None,
    where: str = "",
    remedy: str = "raise --max-spp",
) -> tuple[str, str]:
    """Row (label, text) for `print_columns`: the error of a result and whether it was allowed.

    All commands use it, so that they say the same in the same words.

    Parameters
    ----------
    error : str
        The error in words, see `interval`.
    tolerance : float or str or None
        Allowed error, a fraction or in words. Without one, the row only states the error.
    reached : bool or None
        Whether the tolerance was reached.
    max_spp : int or None
        Samples per pixel at which a result that did not reach it ended.
    where : str
        Which of several results reached it.
    remedy : str
        What to do if it was not reached.
    """
    if tolerance is None:
        return "error", error
    allowed = tolerance if isinstance(tolerance, str) else f"{100 * tolerance:.4g} %"
    where = f" {where}" if where else ""
    if reached:
        return "tolerance", f"{allowed} reached{where}: {error}"
    ended = f" at {max_spp} samples per pixel" if max_spp else ""
    return "tolerance", f"{allowed} NOT reached{where}{ended}: {error}; {remedy}"


@dataclass(frozen=True)
class Verdict:
    """Tolerance that a command was given for its result, and whether the result reached it.

    tolerance: allowed error as a fraction; None without one. reached: None without a tolerance.
    bias: upper bound of the error of a plan's settings, as a fraction; None without a plan.
    max_spp: limit that was given, if any.
    """

    tolerance: float | None
    reached: bool | None
    bias: float | None
    max_spp: int | None

    @staticmethod
    def on(options, reached: bool | None) -> "Verdict":
        """The verdict on a result of `SceneOptions.run_planned`, which says whether it reached it.

        A planned result was given the tolerance that its plan leaves for noise.
        """
        bias = options.plan.bias if options.plan else None
        return Verdict(options.sampling["tolerance"], reached, bias, options.sampling["max_spp"])

    def as_dict(self) -> dict:
        """Entries for JSON."""
        return {"tolerance": self.tolerance, "reached": self.reached}

    def row(self, error: str) -> tuple[str, str]:
        """Row for `print_columns` with the error in words, see `error_row`."""
        if self.bias:
            error += f", and the plan leaves out at most {percent(self.bias)}"
        max_spp = None
        if self.reached is False:
            from mi_lcair.rendering.render import DEFAULT_MAX_SPP

            max_spp = self.max_spp or DEFAULT_MAX_SPP
        return error_row(error, self.tolerance, self.reached, max_spp)


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


def note(text: object) -> None:
    """Print on stderr, in one line, something that a user should know about the results.

    Nothing is printed with -q.
    """
    if quiet():
        return
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
