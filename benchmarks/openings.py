"""Render the thesis's eight cavities after 0 to 4 reflections.

    python -m benchmarks.openings [--quick] [-o FOLDER]

Printed and written are the areas of its Table B.1, Gouffé's emissivity, the exact one, and the
apparent emissivity by reflections (its Fig 4.1). gouffe.png is its Fig 3.33. Areas are in m^2,
emissivities are fractions.
"""

from dataclasses import dataclass
from functools import partial
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from benchmarks import command
from benchmarks.methods.propagation import exact
from benchmarks.methods.propagation.exact import GREY
from mi_lcair import formats
from mi_lcair.drawing import drawing
from mi_lcair.laboratory.cavities.rings import cavity_emissivity, gouffe
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.progress import stepper
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.window import Windows
from mi_lcair.tasks import in_order

WALL_M2, SPHERE_M2 = 3.106, pi  # S and S0 of Table B.1
# Facets removed -> s [m^2] and s/S, as Table B.1 prints them
PRINTED = {
    2: (0.0244, 0.0079),
    4: (0.0487, 0.0157),
    8: (0.0963, 0.0310),
    16: (0.1926, 0.0620),
    24: (0.2820, 0.0910),
    36: (0.4240, 0.1366),
    60: (0.6540, 0.2110),
    80: (0.8749, 0.2810),
}
REFLECTIONS = (0, 1, 2, 3, 4)  # of the curves in Fig 4.1
WALLS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)  # emissivities of the walls in the figure of Gouffé


@dataclass(frozen=True)
class Opening:
    """One of the thesis's cavities.

    Attributes
    ----------
    facets : int
        Facets removed.
    s, printed, ratio : float
        Area of the opening [m^2] and s/S as Table B.1 prints them, and s/S of the printed areas.
    contradicts : bool
        Whether the printed ratio is not that of the printed areas.
    share : float
        Share of the sphere's area that the opening covers.
    gouffe : float
        Emissivity by Gouffé's method, with the printed areas (Eq 3.10).
    exact : float
        Emissivity of the sphere for infinitely many reflections (Eq 3.12 with `share`).
    apparent, error : ndarray, shape (reflections,)
        Rendered emissivity after each of REFLECTIONS, and its standard error.
    """

    facets: int
    s: float
    printed: float
    ratio: float
    contradicts: bool
    share: float
    gouffe: float
    exact: float
    apparent: np.ndarray
    error: np.ndarray


def openings(paths: int, seed: int = 0, progress=None) -> list[Opening]:
    """The eight cavities, each rendered with a number of paths."""
    step, rows = stepper(progress, len(PRINTED)), []
    for row in in_order([partial(opening, facets, paths, seed) for facets in PRINTED]):
        rows.append(row)
        step()
    return rows


def opening(facets: int, paths: int, seed: int) -> Opening:
    """The cavity with so many facets removed."""
    s, printed = PRINTED[facets]
    scene = load("cavity", opening=facets)
    windows = Windows.whole(scene.sensor(0))
    totals = measure(scene, windows, Sampling(paths=paths, seed=seed), Measurands.of("image"))
    L = in_band_radiance(scene.band, 800.0)
    terms = [f"bounce.{k}" for k in REFLECTIONS]
    apparent = np.cumsum([totals.mean(name)[0] for name in terms]) / L
    deviations = np.cumsum([totals.deviations(name)[0] for name in terms], axis=0) / L
    share = exact.cavity_opening_fraction(facets)
    return Opening(
        facets=facets,
        s=s,
        printed=printed,
        ratio=s / WALL_M2,
        contradicts=f"{s / WALL_M2:.4f}" != f"{printed:.4f}",
        share=share,
        gouffe=gouffe(GREY, s, WALL_M2, SPHERE_M2),
        exact=cavity_emissivity(GREY, share, 1.0),
        apparent=apparent,
        error=np.sqrt(np.sum(deviations**2, axis=1)),
    )


def write(folder: Path, rows: list[Opening]) -> None:
    """Write openings.csv, openings.png and gouffe.png to a folder."""
    formats.write_csv(folder / "openings.csv", columns(rows))
    draw_gouffe(folder / "gouffe.png")
    draw(folder / "openings.png", rows)


def columns(rows: list[Opening]) -> dict[str, np.ndarray]:
    """A row for each opening."""
    names = ("facets", "s", "printed", "ratio", "contradicts", "share", "gouffe", "exact")
    titles = ("facets_removed", "s_m2", "s_over_S_printed", "s_over_S_of_areas")
    titles += ("printed_contradicts_areas", "share_of_sphere", "gouffe", "exact")
    table = {
        title: np.array([getattr(row, name) for row in rows]) for title, name in zip(titles, names)
    }
    table["printed_contradicts_areas"] = np.where(table["printed_contradicts_areas"], "yes", "no")
    for k in REFLECTIONS:
        table[f"apparent_{k}_reflections"] = np.array([row.apparent[k] for row in rows])
    return table | {"standard_error": np.array([row.error.max() for row in rows])}


def draw(path, rows: list[Opening]) -> None:
    """Write a PNG: apparent emissivity against s/S by number of reflections, and its limit."""
    with drawing(path, (7, 4.6), dpi=120, layout="constrained") as figure:
        axes = figure.subplots()
        share = np.geomspace(5e-3, 0.4, 200)
        axes.semilogx(share, cavity_emissivity(GREY, share, 1.0), "k", label="limit, Eq 3.12")
        for k in reversed(REFLECTIONS):
            kept = (1 - GREY) * (1 - share)
            series = GREY * (1 - kept ** (k + 1)) / (1 - kept)
            (line,) = axes.semilogx(
                [row.share for row in rows],
                [row.apparent[k] for row in rows],
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


def aperture_shares(l_over_r: ArrayLike) -> dict[str, np.ndarray]:
    """s/S of cavities whose depth is l and whose aperture has the radius r, by shape (Fig 3.33).

    That of a sphere is the share of the whole sphere that is missing, for which Eq 3.12 is exact.
    """
    depth = np.asarray(l_over_r, dtype=float)
    return {
        "sphere": 1 / (1 + depth**2),
        "cone": 1 / (1 + np.sqrt(1 + depth**2)),
        "cylinder": 1 / (2 * (1 + depth)),
    }


def measured(quick: bool, progress) -> list[Opening]:
    """The eight cavities."""
    return openings(2**14 if quick else 2**20, progress=progress)


def printed(rows: list[Opening]) -> tuple:
    """JSON and table of the cavities."""
    table = columns(rows)
    return {"openings": table}, command.cells(table, zip(*table.values()))


def main(arguments: list[str] | None = None) -> None:
    """Measure, write the files and print a table."""
    command.run("openings", __doc__, measured, write, printed, arguments)


if __name__ == "__main__":
    main()
