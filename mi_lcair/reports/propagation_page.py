"""Page of the chart of propagation methods: pictures, CSVs and Markdown."""

from pathlib import Path

import drjit as dr
import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.propagation import GROUPS
from mi_lcair.benchmark.propagation_chart import CHOICE, CLOSURES, LEAST_REPETITIONS, Chart
from mi_lcair.drawing import drawing
from mi_lcair.files import replacing
from mi_lcair.formats import csv
from mi_lcair.reports import method_chart


def write(folder, result: Chart) -> None:
    """Write propagation.png, .csv and .md, propagation_closure.png and .csv to a folder."""
    folder = Path(folder)
    command = "mi-lcair chart propagation" + (" --quick" if result.quick else "")
    method_chart.draw(
        folder / "propagation.png",
        result.points,
        "What a scene sends toward the observer: error against cost",
        samples="rays",
        floor=1e-6,
    )
    chart.write_csv(folder / "propagation.csv", result.points)
    draw_closures(folder / "propagation_closure.png", result.closures)
    write_closures(folder / "propagation_closure.csv", result.closures)
    template = Path(__file__).with_name("propagation_page.template.md").read_text(encoding="utf-8")
    with replacing(folder / "propagation.md") as partial:
        partial.write_text(template.format(**fields(result, command)), encoding="utf-8")


def label(bounces: int, closure: str) -> str:
    """Label of a number of reflections with a closure."""
    return f"N = {bounces}" + ("" if closure == "none" else f", {closure}")


def write_closures(path, closures) -> None:
    """Write a CSV with the error of each closure, relative to the intensity and with its sign."""
    columns = {
        "case": [c.case for c in closures],
        "opening_share_of_sphere": [np.nan if c.opening is None else c.opening for c in closures],
        "bounces": [c.bounces for c in closures],
        "closure": [c.closure for c in closures],
        "error": [c.error for c in closures],
        "standard_error": [c.standard_error for c in closures],
    }
    csv.write(path, columns)


def sizes(closures) -> np.ndarray:
    """Sizes of the errors, those below the end of the axis at the end."""
    return np.maximum([abs(c.error) for c in closures], 1e-5)


def draw_closures(path, closures) -> None:
    """Write a PNG: error of each closure against the cavity's opening, and on other scenes."""
    with drawing(path, (11, 4.6), dpi=120, layout="constrained") as figure:
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        others = list(dict.fromkeys(c.case for c in closures if c.opening is None))
        for k, (bounces, closure) in enumerate(CLOSURES):
            measured = [c for c in closures if (c.bounces, c.closure) == (bounces, closure)]
            style = {
                "color": f"C{k}",
                "marker": method_chart.MARKERS[k],
                "markersize": 5,
                "label": label(bounces, closure),
                "linestyle": ":" if closure == "none" else "-",
            }
            cavities = [c for c in measured if c.opening is not None]
            left.loglog([c.opening for c in cavities], sizes(cavities), **style)
            rest = [c for c in measured if c.opening is None]
            right.semilogy(
                [others.index(c.case) + (k - 3) * 0.08 for c in rest],
                sizes(rest),
                **style | {"linestyle": "none"},
            )
        noise = max(c.standard_error for c in closures if c.opening is not None)
        left.axhspan(1e-5, noise, color="0.9", zorder=0, label="noise")
        left.set_xlabel("opening (share of the sphere)")
        left.set_ylabel("|error| of the intensity, relative")
        left.set_title("cavity, emissivity 0.5", fontsize=10, loc="left")
        right.set_title("other scenes", fontsize=10, loc="left")
        right.set_xticks(range(len(others)), others)
        right.set_xlim(-0.5, len(others) - 0.5)
        figure.legend(
            *left.get_legend_handles_labels(),
            loc="outside lower center",
            ncols=8,
            fontsize=8,
            frameon=False,
        )
        figure.suptitle(
            "Paths cut after N reflections, and what stands in for the rest", fontsize=11
        )


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
        f"### {p.name}\n\n{chart.table(points, p.name, CHOICE, result.limit)}"
        for p in result.problems
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
    rows = []
    for problem in result.problems:
        for tolerance in chart.TOLERANCES[1:]:
            best = [
                chart.fastest(result.points, problem.name, of[name], tolerance)
                for name in ("lattice", "thesis")
            ]
            cells = [
                f"{name[0]} ({chart.duration(name[1])})"
                if name
                else f"none reaches it{result.limit}"
                for name in best
            ]
            factors = [
                chart.times_faster(result.points, problem.name, of["lattice"], of[rival], tolerance)
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
