"""Draw adverse scenes, run the commands on them, and count the claims that hold.

    python -m docs.studies.claims [--scenes N] [--seed S] [--first K] [--kind TEXT] [--page FILE]
                                  [--csv FILE] [--read FILE ...] [--workers N | --dask ADDRESS]

A scene takes about two seconds. `--scenes 1 --first K` repeats the scene K of the seed S and prints
its claims. Several runs, of more seeds or of further scenes, may add to one `--csv`. `--read` takes
all claims of such files in place of a run. `--page docs/validation/claims.md` writes the page.
"""

import argparse
import csv
from dataclasses import astuple, fields
from functools import partial
from pathlib import Path

from tqdm import tqdm

import mi_lcair
from docs.studies.claims.claims import Claim, claims
from docs.studies.claims.coverage import FALSE, defects, is_tolerance, rows
from docs.studies.claims.page import write
from docs.studies.claims.scenes import case
from mi_lcair.startup.tasks import in_order


def parsed(arguments=None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=100, help="number of scenes")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random choices")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--kind", default="", help="only scenes whose kind contains this text")
    parser.add_argument("--page", help="file of the page to write")
    parser.add_argument("--csv", help="file to which a row for each claim is added")
    parser.add_argument("--read", nargs="+", help="CSV files of earlier runs, in place of a run")
    parser.add_argument("--workers", type=int, help="draw the scenes in this number of processes")
    parser.add_argument("--dask", help="draw them on the workers of this Dask scheduler")
    return parser.parse_args(arguments)


def run(seed: int, numbers, kind: str = "", path: str | None = None) -> list[Claim]:
    """The claims of the cases with these numbers; those of each case are added to a CSV file."""
    found = []
    tasks = [partial(claims_of, seed, number, kind) for number in numbers]
    for of_case in tqdm(in_order(tasks), unit="scene", total=len(tasks)):
        found += of_case
        if path:
            add_to(path, of_case)
    return found


def claims_of(seed: int, number: int, kind: str) -> list[Claim]:
    """The claims of a case, if its kind contains a text."""
    drawn = case(seed, number)
    return claims(drawn, seed, number) if kind in drawn.kind else []


def add_to(path: str, found: list[Claim]) -> None:
    with Path(path).open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if not file.tell():
            writer.writerow([entry.name for entry in fields(Claim)])
        writer.writerows(map(astuple, found))


def read_from(path: str) -> list[Claim]:
    """The claims of a CSV file."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        return [
            Claim(**{entry.name: entry.type(row[entry.name]) for entry in fields(Claim)})
            for row in csv.DictReader(file)
        ]


def table(found: list[Claim], by_kind: bool) -> str:
    lines = []
    for row in rows(found, by_kind):
        missed = " ".join(f"{share:.1%}" for share in row.beyond) if is_tolerance(row.name) else ""
        lines.append(
            f"{row.name:22} {row.kind:24} {row.claims:6} {row.held:6.1%} "
            f"[{row.lower:.1%}, {row.upper:.1%}] worst {row.worst.excess:.3g} times "
            f"({row.worst.error:+.2g}) in {row.worst.number} {row.worst.kind} {missed}"
        )
    return "\n".join(lines)


def main(arguments=None) -> None:
    options = parsed(arguments)
    numbers = range(options.first, options.first + options.scenes)
    if options.read:
        found = [claim for path in options.read for claim in read_from(path)]
    else:
        with mi_lcair.workers(options.workers, options.dask):
            found = run(options.seed, numbers, options.kind, options.csv)
    if options.scenes == 1:
        for claim in found:
            print(claim)
    print(table(found, by_kind=False))
    print(f"tolerances: shares of errors beyond {FALSE} tolerances")
    for (name, kind), text in defects(found).items():
        print(f"DEFECT {name}; {kind}: {text}")
    if options.page:
        write(options.page, found)


if __name__ == "__main__":
    main()
