"""Run the same jobs in other tools and in mi_lcair, and write docs/validation/peers.md.

    python -m docs.studies.peers PYTHON [PAGE]

PYTHON has the other tools: raysect, pybsm, raystrack and pyviewfactor. Ours runs with the Python of
this command. One that is missing gets a row that says so. It takes about ten minutes.
"""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from benchmarks.chart import duration
from docs.studies.page import write_page
from docs.studies.peers import exact
from docs.studies.rivals import time_to_goal

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[3]
OURS = "mi_lcair"
NAMES = {"raysect": "raysect", "pybsm": "pyBSM", "raystrack": "raystrack", OURS: OURS}
NAMES["pyviewfactor"] = "pyviewfactor"
GOALS = {"plate": 1e-3, "cavity": 1e-3, "room": 1e-4, "sheet": 1e-3}  # errors to be reached
INPUTS = {"pixel_mi_lcair": ("pixel.toml", "pixel_plate.obj")}  # files that a user writes as well


@dataclass(frozen=True)
class Trial:
    """One tool at one job: the script, its case, the efforts and the number of seeds."""

    job: str
    tool: str
    script: str
    efforts: tuple[int, ...]
    unit: str
    seeds: int = 8
    case: str = "-"


def of_factors(job: str, case: str, samples: tuple, spacing: tuple) -> list[Trial]:
    """The trials of view factors of a model. spacing: cells along a metre, of pyviewfactor."""
    return [
        Trial(job, "raystrack", "factors_raystrack", samples, "rays of a cell", 3, case),
        Trial(job, "pyviewfactor", "factors_pyviewfactor", spacing, "cells along 1 m", 1, case),
        Trial(job, OURS, "factors_mi_lcair", (2**12, 2**16, 2**20), "paths of a facet", 4, case),
    ]


TRIALS = [
    Trial("plate", "raysect", "plate_raysect", (10**4, 10**5, 10**6), "samples"),
    Trial("plate", OURS, "plate_mi_lcair", (2**12, 2**16, 2**20), "paths"),
    Trial("cavity", "raysect", "cavity_raysect", (10**3, 10**4, 10**5), "samples"),
    Trial("cavity", OURS, "cavity_mi_lcair", (1,), ""),
    Trial("pixel", "pybsm", "pixel_pybsm", (201, 2001), "wavelengths"),
    Trial("pixel", OURS, "pixel_mi_lcair", (1,), ""),
    *of_factors("room", "../cases/data/l_room.obj", (2**10, 2**12, 2**14), (2, 4, 6)),
    *of_factors("sheet", "obstructed_squares.obj", (2**8, 2**11, 2**14), (5, 13, 21)),
    *of_factors("open", "open_squares.obj", (2**10, 2**14), (1,)),
]


def exact_values(trial: Trial) -> dict[str, float]:
    """The exact answers of a trial by name."""
    if trial.job == "pixel":
        return exact.pixel(trial.tool)
    if trial.job in ("sheet", "open"):
        return exact.squares(trial.job == "sheet")
    return getattr(exact, trial.job)()


def code_lines(script: str) -> int:
    """Lines of a script and of its input files, without empty lines and the docstring."""
    files = [HERE / name for name in (f"{script}.py", *INPUTS.get(script, ()))]
    lines = [line for path in files for line in path.read_text(encoding="utf-8").splitlines()]
    return sum(bool(line) and not line.startswith('"""') for line in lines)


def measured(trial: Trial, python: str) -> dict | None:
    """What the stopwatch prints for a trial, or None where the tool is not installed."""
    if trial.tool != OURS:
        command = [python, "-c", f"import {trial.tool}"]
        if subprocess.run(command, capture_output=True, env=environment("")).returncode:
            return None
    case = trial.case if trial.case == "-" else str(HERE / trial.case)
    words = [trial.script, case, str(trial.seeds), *map(str, trial.efforts)]
    path = str(ROOT) if trial.tool == OURS else ""
    done = subprocess.run(
        [python, str(HERE / "stopwatch.py"), *words],
        capture_output=True,
        text=True,
        check=True,
        env=environment(path),
    )
    return json.loads(done.stdout.splitlines()[-1])


def environment(path: str) -> dict[str, str]:
    """Environment variables with this PYTHONPATH, and with the commands of this Python.

    Numba has one thread: more of them take more of the processor where the machine is busy.
    """
    commands = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return os.environ | {"PYTHONPATH": path, "PATH": commands, "NUMBA_NUM_THREADS": "1"}


def errors(run: dict, truth: dict[str, float], scale: float) -> tuple[np.ndarray, list]:
    """Errors of a run, (seeds, values), and those that the tool states or None, by scale."""
    of_seeds = [[result[name] for name in truth] for result in run["results"]]
    values = np.array([[value for value, _ in row] for row in of_seeds])
    stated = [error for row in of_seeds for _, error in row]
    return (values - list(truth.values())) / scale, [
        None if error is None else error / scale for error in stated
    ]


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(np.array(values, float)))))


def rows(trial: Trial, found: dict | None) -> list[str]:
    """Rows of the tables of radiances and view factors."""
    if found is None:
        return [f"| {NAMES[trial.tool]} | not installed | | | | | | |"]
    truth = exact_values(trial)
    scale = truth.get("radiance", 1.0)
    reached, lines = [], []
    for run in found["runs"]:
        off, stated = errors(run, truth, scale)
        reached.append((run["seconds"], rms(off)))
        effort = f"{run['effort']:,} {trial.unit}".replace(",", " ") if trial.unit else "closed"
        cells = [NAMES[trial.tool], effort]
        cells += [f"{rms(off):.1e}", f"{np.abs(off).max():.1e}"]
        cells += ["none" if stated[0] is None else f"{rms(stated):.1e}"]
        lines.append([*cells, duration(run["seconds"]), "", ""])
    lines[0][6] = duration(found["first"])
    lines[0][7] = str(code_lines(trial.script))
    return ["| " + " | ".join(line) + " |" for line in lines] + goal_row(trial, reached)


def goal_row(trial: Trial, reached: list) -> list[str]:
    """A row with the time to the job's goal."""
    goal = GOALS.get(trial.job)
    if goal is None or len(reached) < 2:
        return []
    seconds = time_to_goal(*np.array(reached).T, goal)
    return [f"| {NAMES[trial.tool]} | to {goal:.0e} | | | | **{duration(seconds)}** | | |"]


def pixel_rows(trial: Trial, found: dict | None) -> list[str]:
    """Rows of the table of the pixel."""
    if found is None:
        return [f"| {NAMES[trial.tool]} | not installed | | | | | |"]
    truth, lines = exact_values(trial), []
    for run in found["runs"]:
        result = run["results"][0]
        cells = [NAMES[trial.tool], f"{run['effort']} {trial.unit}" if trial.unit else ""]
        for name, value in truth.items():
            given = result[name][0]
            cells.append(f"{given:.7g} ({given / value - 1:+.1e})")
        lines.append([*cells, duration(run["seconds"]), duration(found["first"])])
    return [f"| {' | '.join(line)} | {code_lines(trial.script)} |" for line in lines]


def versions(python: str) -> str:
    """The tools that PYTHON has, with their versions."""
    code = "import importlib.metadata as m, sys; print(m.version(sys.argv[1]))"
    named = []
    for tool in dict.fromkeys(trial.tool for trial in TRIALS if trial.tool != OURS):
        done = subprocess.run([python, "-c", code, tool], capture_output=True, text=True)
        named.append(f"{NAMES[tool]} {done.stdout.strip() or '(not installed)'}")
    return ", ".join(named)


def main(python: str, page="docs/validation/peers.md") -> None:
    """Write the page."""
    tables: dict[str, list[str]] = {}
    for trial in tqdm(TRIALS):
        found = measured(trial, sys.executable if trial.tool == OURS else python)
        table = pixel_rows if trial.job == "pixel" else rows
        tables.setdefault(trial.job, []).extend(table(trial, found))
        print(*tables[trial.job][-4:], sep="\n", flush=True)
    write_page(
        page,
        "peers",
        versions=versions(python),
        plate_exact=f"{exact.plate()['radiance']:.8g}",
        cavity_exact=f"{exact.cavity()['radiance']:.8g}",
        **{job: "\n".join(lines) for job, lines in tables.items()},
        **{f"pixel_{name}": f"{value:.8g}" for name, value in exact.pixel("pybsm").items()},
        our_snr=f"{exact.pixel(OURS)['snr']:.6g}",
    )


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("python -m docs.studies.peers PYTHON [PAGE]: PYTHON has the other tools")
    if shutil.which(sys.argv[1]) is None:
        sys.exit(f"{sys.argv[1]} is no program; give the python of the other tools' environment")
    main(*sys.argv[1:])
