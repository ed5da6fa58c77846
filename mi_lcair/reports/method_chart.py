"""Pictures that compare methods: error against time and against other costs."""

from itertools import cycle
from pathlib import Path

import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.benchmark.reflectance_chart import THETA_DEG
from mi_lcair.drawing import drawing, plain

MARKERS = "osD^v<>PX*hp"
TIME = {"seconds": "time after the compile (s)"}


def write_reflectance(folder: Path, points) -> None:
    """Write reflectance.png and reflectance.csv, the chart of `reflectance_chart`, to a folder."""
    title = (
        f"Reflectance DHR({THETA_DEG}°) by eight methods: median error, quartiles, and rms (dashed)"
    )
    costs = TIME | {"samples": "evaluations of the BRDF"}
    draw(folder / "reflectance.png", points, title, costs)
    chart.write_csv(folder / "reflectance.csv", points)


def draw(path, points, title: str, costs: dict[str, str], floor=1e-7) -> None:
    """Write a PNG with a row for each case: error against each cost.

    Both axes are logarithmic. Each method has its own colour and marker. The solid line is the
    median error, the band its quartiles, and the dashed line the rms error. A method with a single
    effort is one marker.

    Parameters
    ----------
    path : path-like
        File to write.
    points : list
        Measured points of all cases and methods.
    title : str
        Title of the picture.
    costs : dict of str to str
        Label of the axis by the field of the points, such as "seconds". A field that was measured
        for no point is left out.
    floor : float
        Smaller errors are drawn at this value.
    """
    cases = chart.names(points, "case")
    costs = {field: label for field, label in costs.items() if any_measured(points, field)}
    size = 5.5 * len(costs), 1.2 + 3.1 * len(cases)
    with drawing(path, size, dpi=120, layout="constrained") as figure:
        styles = {
            method: {"color": colour(k), "marker": marker}
            for k, (method, marker) in enumerate(zip(chart.names(points, "method"), cycle(MARKERS)))
        }
        rows = figure.subplots(len(cases), len(costs), sharey="row", squeeze=False)
        lines = {}
        for row, case in zip(rows, cases):
            for panel, (field, label) in zip(row, costs.items()):
                lines |= draw_curves(panel, points, case, field, styles, floor)
                panel.set_xlabel(label, fontsize=9)
            row[0].set_ylabel("relative error")
            row[0].set_title(plain(case), fontsize=10, loc="left")
        figure.suptitle(title, fontsize=11)
        figure.legend(
            lines.values(),
            lines.keys(),
            loc="outside lower center",
            ncols=3,
            fontsize=8,
            frameon=False,
        )


def any_measured(points, field: str) -> bool:
    """Whether a field of any point is a number above 0."""
    return any(getattr(p, field) > 0 for p in points)


def colour(k: int) -> str | tuple:
    """Colour of line number k: Matplotlib's ten colours, then their lighter variants."""
    import matplotlib

    return f"C{k}" if k < 10 else matplotlib.colormaps["tab20"](2 * (k % 10) + 1)


def draw_curves(panel, points, case: str, field: str, styles: dict, floor: float) -> dict:
    """Draw the error of one case against a field of the points, and return the lines by method.

    Parameters
    ----------
    panel : matplotlib.axes.Axes
        Axes to draw in.
    points : list
        Measured points of all cases and methods.
    case : str
        Name of the case.
    field : str
        Field of the points, such as "seconds".
    styles : dict of str to dict
        Colour and marker of each method.
    floor : float
        Smaller errors are drawn at this value.
    """
    from matplotlib.ticker import LogLocator

    lines = {}
    for method, style in styles.items():
        curve = chart.curve(points, case, method)
        if not curve:
            continue
        x = [getattr(p, field) for p in curve]
        low, error, high, rms = (
            np.maximum([getattr(p, name) for p in curve], floor)
            for name in ("error_low", "error", "error_high", "rms")
        )
        (lines[method],) = panel.plot(x, error, linewidth=1.2, markersize=4, label=method, **style)
        if len(curve) > 1:
            panel.fill_between(x, low, high, color=style["color"], alpha=0.13, linewidth=0)
            panel.plot(x, rms, color=style["color"], linewidth=0.8, linestyle="--")
        else:
            panel.vlines(x, low, high, color=style["color"], alpha=0.5)
    for tolerance in chart.TOLERANCES:
        panel.axhline(tolerance, color="0.6", linewidth=0.6, linestyle=":")
    panel.set(xscale="log", yscale="log")
    panel.minorticks_off()  # drawing them takes longer than all the rest
    panel.yaxis.set_major_locator(LogLocator(numticks=12))
    return lines
