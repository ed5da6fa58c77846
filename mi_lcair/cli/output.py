"""How commands print results on stdout: aligned columns for people, JSON for machines."""
import json

import click


def print_columns(rows) -> None:
    """Print rows of strings, each column as wide as its widest cell."""
    rows = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        click.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def print_json(data) -> None:
    """Print `data` as strict JSON (no NaN); NumPy's scalars and arrays become numbers and lists."""
    click.echo(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
