"""Write the page docs/validation/charts/propagation.md: error of propagation methods against cost.

    python -m docs.studies.propagation [--quick] [FOLDER]

It measures as `python -m benchmarks.propagation` does and writes the same pictures and CSVs beside
the page. The text is propagation.template.md, whose {fields} are filled in.
"""

import sys
from pathlib import Path

import drjit as dr
import numpy as np

from benchmarks import chart, propagation
from benchmarks.methods.propagation import GROUPS
from benchmarks.propagation import CLOSURES, LEAST_REPETITIONS, Chart, label
from docs.studies.method_tables import fastest, table, times_faster
from docs.studies.page import write_page

QUICK = "--quick"
CHOICE = "quadrature, stratified"  # the method that the thesis chooses (3.5.5)


def main(folder: str = "docs/validation/charts", quick: bool = False) -> None:
    """Measure all methods, and write the page with its pictures and CSVs."""
    write(Path(folder), propagation.measure(quick))


def write(folder: Path, result: Chart) -> None:
    """Write propagation.png, .csv and .md, propagation_closure.png and .csv to a folder."""
    propagation.write(folder, result)
    command = "python -m docs.studies.propagation" + (f" {QUICK}" if result.quick else "")
    write_page(folder / "propagation.md", "propagation", **fields(result, command))


def fields(result: Chart, command: str) -> dict[str, str]:
    """The fields of the page's template, as text."""
    points = result.points
    effort = result.effort
    answers = "\n".join(
        f"| {p.name} | {p.answer:.6g} | "
        f"{'exact' if p.standard_error == 0 else f'{p.standard_error / p.answer:.1e}'} | "
        f"{p.source} | {p.bounces} |"
        for p in result.problems
    )
    tables = "\n\n".join(
        f"### {p.name}\n\n{table(points, p.name, CHOICE, result.limit)}" for p in result.problems
    )
    return {
        "command": command,
        "threads": str(dr.thread_count()),
        "repetitions": str(effort.repetitions),
        "least": str(min(LEAST_REPETITIONS, effort.repetitions)),
        "answers": answers,
        "tables": tables,
        "limit": f"{effort.seconds:g}",
        "rays": f"{1e-6 * max(p.samples for p in points):.0f}",
        "summary": summary(result),
        "closures": closure_table(result.closures),
        "compile": compile_table(points),
        "closure_noise": f"{100 * max(c.standard_error for c in result.closures):.2g} %",
        "tail_worst": percent(
            max(abs(c.error) for c in result.closures if c.opening and c.closure == "tail")
        ),
        "ambient": ambient(result.closures),
    }


def summary(result: Chart) -> str:
    """Table of the times that path tracing with lattice points is faster, as Markdown.

    Each scene and rms error has a row with our fastest method, the thesis's fastest, and the
    factors in time to the thesis, to Mitsuba's integrator and to independent points.
    """
    of = {name: [method.name for method in group] for name, group in GROUPS.items()}
    of["thesis"] += of["radiosity"]  # the thesis's too, in a picture of its own
    rows = []
    for problem in result.problems:
        for tolerance in chart.TOLERANCES[1:]:
            best = [
                fastest(result.points, problem.name, of[name], tolerance)
                for name in ("lattice", "thesis")
            ]
            cells = [
                f"{name[0]} ({chart.duration(name[1])})"
                if name
                else f"none reaches it{result.limit}"
                for name in best
            ]
            factors = [
                times_faster(result.points, problem.name, of["lattice"], of[rival], tolerance)
                for rival in ("thesis", "stock", "independent")
            ]
            rows.append(
                f"| {problem.name} | {chart.percent(tolerance)} | {' | '.join(cells + factors)} |"
            )
    return "\n".join(rows)


def closure_table(closures) -> str:
    """Table of the signed error of each closure by scene, as Markdown."""
    names = [label(*c) for c in CLOSURES]
    lines = [f"| scene | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for case in dict.fromkeys(c.case for c in closures):
        lines.append(
            f"| {case} | "
            f"{' | '.join(percent(c.error, signed=True) for c in closures if c.case == case)} |"
        )
    return "\n".join(lines)


def ambient(closures) -> str:
    """Text: up to which opening ambient with N = 1 is better than no closure with N = 4."""
    error = {(c.opening, c.bounces, c.closure): abs(c.error) for c in closures if c.opening}
    openings = sorted({opening for opening, _, _ in error})
    better = [
        opening for opening in openings if error[opening, 1, "ambient"] < error[opening, 4, "none"]
    ]
    return (
        f"on {len(better)} of {len(openings)} openings, up to {max(better):.3f} of the sphere"
        if better
        else "on no opening"
    )


def compile_table(points) -> str:
    """Table of the longest compilation and the shortest run of each method, as Markdown."""
    lines = [
        "| method | compile, longest | one run at the least effort, median over the scenes |",
        "|---|---|---|",
    ]
    for method in chart.names(points, "method"):
        of_method = [p for p in points if p.method == method]
        cases = chart.names(of_method, "case")
        least = [chart.curve(of_method, case, method)[0].seconds for case in cases]
        lines.append(
            f"| {method} | {chart.duration(max(p.compile_seconds for p in of_method))} | "
            f"{chart.duration(float(np.median(least)))} |"
        )
    return "\n".join(lines)


def percent(value: float, signed: bool = False) -> str:
    """A fraction in percent, with more digits for small ones."""
    digits = 3 if abs(value) < 1e-3 else 2 if abs(value) < 1e-2 else 1
    return f"{100 * value:{'+' if signed else ''}.{digits}f} %"


if __name__ == "__main__":
    main(*[word for word in sys.argv[1:] if word != QUICK], quick=QUICK in sys.argv)
