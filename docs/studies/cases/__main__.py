"""How right are results against measured and published values? The page docs/validation/cases.md;
every number on it is computed here, one case a file of this folder.

    python -m docs.studies.cases [NAME ...]

With names these cases are run and printed, and the page stays as it is. All take some minutes.
"""

import sys
from importlib import import_module
from pathlib import Path

from docs.studies.cases.comparison import Comparison
from docs.studies.page import write_page

FOLDER = Path(__file__).parent
PAGE = "docs/validation/cases.md"
NOT_CASES = ("__init__", "__main__", "comparison")


def results_of(name: str) -> list[Comparison]:
    """The comparisons of a case."""
    result = import_module(f"docs.studies.cases.{name}").compare()
    return result if isinstance(result, list) else [result]


def main(names) -> None:
    cases = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem not in NOT_CASES)
    if unknown := [name for name in names if name not in cases]:
        sys.exit(f"unknown case {unknown[0]}; known are {', '.join(cases)}")
    rows, notes = [], []
    for name in names or cases:
        for result in results_of(name):
            print(result.row, result.note, flush=True)
            rows.append(result.row)
            notes += [result.note] if result.note else []
            if result.rms > result.reach:
                notes.append(f"{result.title}: the rms exceeds the goal of {result.reach:g}.")
    if not names:
        write_page(PAGE, "cases", rows="\n".join(rows), notes="\n".join(f"- {x}" for x in notes))


if __name__ == "__main__":
    main(sys.argv[1:])
