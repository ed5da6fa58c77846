"""The command line that the charts share."""

import argparse
import json
from collections.abc import Callable, Iterable

from tqdm import tqdm

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.files import filling


def run(
    name: str,
    description: str,
    measure: Callable,
    write: Callable,
    printed: Callable,
    arguments: list[str] | None = None,
) -> None:
    """Parse the command line, measure, write files and print a table or JSON.

    An unusable folder is refused before the work.

    Parameters
    ----------
    name, description
        Name of the module in `benchmarks`, and its docstring.
    measure
        measure(quick, progress) -> result; progress: function of (steps done, steps in total).
    write
        write(folder, result) writes the files.
    printed
        printed(result) -> (entries of the JSON, rows of cells, a note or none).
    arguments
        Words of the command line; those of this process if they are not given.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks.{name}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("-o", "--output", metavar="FOLDER", default=".", help="folder of the files; made if absent")
    add("--quick", action="store_true", help="fewer efforts and repetitions")
    add("--json", action="store_true", help="print JSON")
    add("--workers", type=int, metavar="N", help="work in this number of processes")
    add("--dask", metavar="ADDRESS", help="work on the workers of this Dask scheduler")
    given = parser.parse_args(arguments)
    try:
        with mi_lcair.workers(given.workers, given.dask), filling(given.output) as folder:
            with tqdm(disable=None, leave=False) as bar:

                def progress(done, total):
                    bar.n, bar.total = done, total
                    bar.refresh()

                result = measure(given.quick, progress)
            write(folder, result)
    except InputError as error:
        parser.exit(2, f"error: {error}\n")
    data, rows, *notes = printed(result)
    if given.json:
        print(json.dumps(data, indent=2, allow_nan=False, default=lambda value: value.tolist()))
        return
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())
    print(*notes, f"wrote files to {given.output}", sep="\n")


def cells(names: Iterable[str], rows: Iterable) -> list[list[str]]:
    """A heading and rows of values as texts for a table; empty for None."""

    def cell(value):
        return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)

    return [[name.replace("_", " ") for name in names], *(list(map(cell, row)) for row in rows)]
