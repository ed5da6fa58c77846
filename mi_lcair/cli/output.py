"""How commands print results on stdout: aligned columns for people, JSON for machines."""

import json

import click

from mi_lcair.errors import InputError
from mi_lcair.files import check_writable


def print_columns(rows) -> None:
    """Print rows of strings, each column as wide as its widest cell."""
    rows = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def check_outputs(*outputs) -> None:
    """Refuse, before the work, files that cannot be written or are called wrongly. outputs: (path
    or None, suffix).
    """
    for path, suffix in outputs:
        if path:
            if path.suffix.lower() != suffix:
                raise InputError(f"output '{path}' does not end in {suffix}")
            check_writable(path)


def print_written(*paths) -> None:
    """Say on stderr which of these files there are now; None: not asked for."""
    for path in filter(None, paths):
        click.echo(f"wrote {path}", err=True)


def print_json(data) -> None:
    """Print `data` as strict JSON (no NaN); NumPy's scalars and arrays become numbers and lists."""
    click.echo(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
