"""Charts of methods as pictures: error against time and against samples."""

from itertools import cycle

import numpy as np

from mi_lcair.benchmark import chart
from mi_lcair.drawing import drawing, plain

MARKERS = "osD^v<>PX*hp"


def draw(path, points, title: str, cases=None, samples="samples", floor=1e-7) -> None:
    """A PNG with a row for each case: error against time and against samples, log-log, one colour
    and marker a method.

    The line is the median, the band its quartiles, the dashed line the rms. Errors below `floor`
    lie on it; a method of one effort is one marker.
    """
    cases = cases or chart.names(points, "case")
    with drawing(path, (11, 1.2 + 3.1 * len(cases)), dpi=120, layout="constrained") as figure:
        styles = {
            method: {"color": f"C{k % 10}", "marker": marker}
            for k, (method, marker) in enumerate(zip(chart.names(points, "method"), cycle(MARKERS)))
        }
        rows = figure.subplots(len(cases), 2, sharey="row", squeeze=False)
        lines = {}
        for row, case in zip(rows, cases):
            for panel, field, label in zip(
                row, ("seconds", "samples"), ("time after the compile (s)", samples)
            ):
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


def draw_curves(panel, points, case: str, field: str, styles: dict, floor: float) -> dict:
    """Error against a field of the points, "seconds" or "samples", of one case in a panel; the line
    of each method drawn.
    """
    from matplotlib.ticker import LogLocator

    lines = {}
    for method, style in styles.items():
        found = chart.curve(points, case, method)
        if not found:
            continue
        x = [getattr(p, field) for p in found]
        low, error, high, rms = (
            np.maximum([getattr(p, name) for p in found], floor)
            for name in ("error_low", "error", "error_high", "rms")
        )
        (lines[method],) = panel.plot(x, error, linewidth=1.2, markersize=4, label=method, **style)
        if len(found) > 1:
            panel.fill_between(x, low, high, color=style["color"], alpha=0.13, linewidth=0)
            panel.plot(x, rms, color=style["color"], linewidth=0.8, linestyle="--")
        else:
            panel.vlines(x, low, high, color=style["color"], alpha=0.5)
    for tolerance in chart.TOLERANCES:
        panel.axhline(tolerance, color="0.6", linewidth=0.6, linestyle=":")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.minorticks_off()  # they take more time to draw than all the rest
    panel.yaxis.set_major_locator(LogLocator(numticks=12))
    return lines
