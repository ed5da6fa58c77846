"""Files of the chart of propagation methods: error against cost, and the error of each closure."""

from pathlib import Path

import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.propagation import AMBIENT, GROUPS
from mi_lcair.benchmark.propagation_chart import CLOSURES, Chart
from mi_lcair.drawing import drawing
from mi_lcair.formats import csv
from mi_lcair.reports import method_chart

COSTS = method_chart.TIME | {"samples": "rays", "memory_MB": "largest memory (MB)"}


def write(folder: Path, result: Chart) -> None:
    """Write pictures and tables to a folder.

    They are propagation.png, propagation_thesis.png, propagation_radiosity.png,
    propagation_closure.png, propagation.csv and propagation_closure.csv.
    """
    for name, groups, methods in (
        ("propagation.png", ("lattice", "independent", "stock", "closure"), "Path tracing"),
        ("propagation_thesis.png", ("thesis",), "The thesis's methods"),
        ("propagation_radiosity.png", ("radiosity",), "The thesis's radiosity"),
    ):
        drawn = {method.name for group in groups for method in GROUPS[group]} - {AMBIENT.name}
        points = [p for p in result.points if p.method in drawn]
        title = f"{methods}: error of what a scene sends toward the observer, against cost"
        method_chart.draw(folder / name, points, title, COSTS, floor=1e-6)
    chart.write_csv(folder / "propagation.csv", result.points)
    draw_closures(folder / "propagation_closure.png", result.closures)
    write_closures(folder / "propagation_closure.csv", result.closures)


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
