"""Table and picture of the thesis's eight cavities (Table B.1, Fig 4.1)."""

from pathlib import Path

import numpy as np

from mi_lcair.benchmark.propagation.exact import GREY
from mi_lcair.cavities.gouffe import aperture_shares, cavity_emissivity
from mi_lcair.cavities.openings import REFLECTIONS, Opening
from mi_lcair.drawing import drawing
from mi_lcair.formats import csv

WALLS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)  # emissivities of the walls in the figure of Gouffé


def write(folder: Path, openings: list[Opening]) -> None:
    """Write cavity.csv, cavity.png and gouffe.png to a folder."""
    csv.write(folder / "cavity.csv", columns(openings))
    draw_gouffe(folder / "gouffe.png")
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


def draw_gouffe(path) -> None:
    """Write a PNG: Gouffé's emissivity against s/S, and s/S of three shapes (Fig 3.33)."""
    with drawing(path, (7, 7.5), dpi=120, layout="constrained") as figure:
        above, below = figure.subplots(2, 1, sharex=True)
        share = np.geomspace(1e-3, 1, 400)
        for emissivity in WALLS:
            label = f"{emissivity:g}"
            above.semilogx(share, cavity_emissivity(emissivity, share, 1.0), label=label)
        above.set(ylabel="emissivity of the cavity, Eq 3.12", ylim=(0, 1.02))
        above.legend(title="wall", loc="lower left", fontsize=8, ncols=2)
        depth = np.geomspace(0.1, 1e3, 400)
        for shape, shares in aperture_shares(depth).items():
            below.loglog(shares, depth, label=shape)
        below.set(
            xlabel="s/S, aperture as a share of the cavity",
            ylabel="l/r, depth in radii of the aperture",
            xlim=(1e-3, 1),
            ylim=(0.1, 1e3),
        )
        below.legend()
        for axes in (above, below):
            axes.grid(alpha=0.3)
        figure.suptitle("Method of Gouffé")
