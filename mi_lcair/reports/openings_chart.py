"""Table and picture of the thesis's eight cavities (Table B.1, Fig 4.1)."""

from pathlib import Path

import numpy as np

from mi_lcair.benchmark.propagation.exact import GREY
from mi_lcair.cavities.gouffe import cavity_emissivity
from mi_lcair.cavities.openings import REFLECTIONS, Opening
from mi_lcair.drawing import drawing
from mi_lcair.formats import csv


def write(folder: Path, openings: list[Opening]) -> None:
    """Write cavity.csv and cavity.png to a folder."""
    csv.write(folder / "cavity.csv", columns(openings))
    draw(folder / "cavity.png", openings)


def columns(openings: list[Opening]) -> dict[str, np.ndarray]:
    """A row for each opening."""
    names = ("facets", "s", "printed", "ratio", "contradicts", "share", "gouffe", "exact")
    titles = ("facets_removed", "s_m2", "s_over_S_printed", "s_over_S_of_areas")
    titles += ("printed_contradicts_areas", "share_of_sphere", "gouffe", "exact")
    table = {
        title: np.array([getattr(opening, name) for opening in openings])
        for title, name in zip(titles, names)
    }
    table["printed_contradicts_areas"] = np.where(table["printed_contradicts_areas"], "yes", "no")
    for k in REFLECTIONS:
        table[f"apparent_{k}_reflections"] = np.array([row.apparent[k] for row in openings])
    return table | {"standard_error": np.array([row.error.max() for row in openings])}


def draw(path, openings: list[Opening]) -> None:
    """Write a PNG: apparent emissivity against s/S by number of reflections, and its limit."""
    with drawing(path, (7, 4.6), dpi=120, layout="constrained") as figure:
        axes = figure.subplots()
        share = np.geomspace(5e-3, 0.4, 200)
        axes.semilogx(share, cavity_emissivity(GREY, share, 1.0), "k", label="limit, Eq 3.12")
        for k in reversed(REFLECTIONS):
            kept = (1 - GREY) * (1 - share)
            series = GREY * (1 - kept ** (k + 1)) / (1 - kept)
            (line,) = axes.semilogx(
                [row.share for row in openings],
                [row.apparent[k] for row in openings],
                "o",
                markersize=4,
                label=f"{k} reflection{'' if k == 1 else 's'}",
            )
            axes.semilogx(share, series, ":", color=line.get_color(), linewidth=1)
        axes.set(
            xlabel="s/S, opening as a share of the sphere",
            ylabel="apparent emissivity of the cavity",
            ylim=(0.4, 1.02),
            title="Cavity of emissivity 0.5: rendered (points) and series (dotted)",
        )
        axes.legend(loc="lower left", fontsize=8, ncols=2)
