"""Draw adverse scenes, run the commands on them, and count the claims that hold.

    python -m docs.studies.claims [--scenes N] [--seed S] [--first K] [--kind TEXT]
                                  [--only NAME ...] [--repeats R] [--paths N]
                                  [--csv FILE] [--page FILE]
                                  [--read FILE ...] [--repeated FILE ...]
                                  [--pairs] [--paired FILE ...]
                                  [--workers N | --dask ADDRESS]

A scene takes about two seconds. `--scenes 1 --first K` repeats the scene K of the seed S and prints
its claims. `--only to_tolerance --repeats 10` runs that command alone, ten times a scene with other
random numbers, which share what a scene's load and its kernels cost. Several runs,
of more seeds or of further scenes, may add to one `--csv`. `--read` takes all claims of such files
in place of a run, and `--repeated` those of runs with repeats, which have a section of their own on
the page. `--pairs` compares pairs of scenes that must agree in place of other claims, in two to
four seconds a scene, and `--paired` takes those of such files to the page. `--page
docs/validation/claims.md` writes the page.
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
from docs.studies.claims.pairs import claims_of_pairs
from docs.studies.claims.scenes import case
from docs.studies.claims.witness import MOST_PATHS
from mi_lcair.tasks import in_order


def parsed(arguments=None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=100, help="number of scenes")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random choices")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--kind", default="", help="only scenes whose kind contains this text")
    parser.add_argument("--only", nargs="+", default=[], help="functions of claims.py to run alone")
    parser.add_argument("--repeats", type=int, default=1, help="runs of each command on a scene")
    parser.add_argument("--paths", type=int, default=MOST_PATHS, help="most paths to a tolerance")
    parser.add_argument("--page", help="file of the page to write")
    parser.add_argument("--csv", help="file to which a row for each claim is added")
    parser.add_argument("--read", nargs="+", help="CSV files of earlier runs, in place of a run")
    parser.add_argument("--repeated", nargs="+", default=[], help="such files of runs with repeats")
    parser.add_argument("--pairs", action="store_true", help="compare pairs that must agree")
    parser.add_argument("--paired", nargs="+", default=[], help="CSV files of runs with --pairs")
    parser.add_argument("--workers", type=int, help="draw the scenes in this number of processes")
    parser.add_argument("--dask", help="draw them on the workers of this Dask scheduler")
    return parser.parse_args(arguments)


def run(seed: int, numbers, kind: str = "", path: str | None = None, **tried) -> list[Claim]:
    """The claims of the cases with these numbers; those of each case are added to a CSV file.

    tried: `only`, `repeats` and `most_paths` of `claims`; `pairs` for those of pairs alone.
    """
    found, of_one = [], claims_of
    if tried.pop("pairs", False):
        of_one, tried = claims_of_pairs, {}
    tasks = [partial(of_one, seed, number, kind, **tried) for number in numbers]
    for of_case in tqdm(in_order(tasks), unit="scene", total=len(tasks)):
        found += of_case
        if path:
            add_to(path, of_case)
    return found


def claims_of(seed: int, number: int, kind: str, **tried) -> list[Claim]:
    """The claims of a case, if its kind contains a text."""
    drawn = case(seed, number)
    return claims(drawn, seed, number, **tried) if kind in drawn.kind else []


def add_to(path: str, found: list[Claim]) -> None:
    with Path(path).open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if not file.tell():
            writer.writerow([entry.name for entry in fields(Claim)])
        writer.writerows(map(astuple, found))


def read_from(paths: list[str]) -> list[Claim]:
    """The claims of CSV files."""
    found = []
    for path in paths:
        with Path(path).open(newline="", encoding="utf-8") as file:
            found += [
                Claim(**{entry.name: entry.type(row[entry.name]) for entry in fields(Claim)})
                for row in csv.DictReader(file)
            ]
    return found


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
        found = read_from(options.read)
    else:
        with mi_lcair.workers(options.workers, options.dask):
            tried = {"only": options.only, "repeats": options.repeats, "most_paths": options.paths}
            tried["pairs"] = options.pairs
            found = run(options.seed, numbers, options.kind, options.csv, **tried)
    if options.scenes == 1:
        for claim in found:
            print(claim)
    print(table(found, by_kind=False))
    print(f"tolerances: shares of errors beyond {FALSE} tolerances")
    for (name, kind), text in defects(found).items():
        print(f"DEFECT {name}; {kind}: {text}")
    if options.page:
        write(options.page, found, *map(read_from, (options.repeated, options.paired)))


if __name__ == "__main__":
    main()
