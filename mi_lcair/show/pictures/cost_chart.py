"""Picture of a chart of errors: each way to render a scene, over its processor time."""

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, NullFormatter

from mi_lcair.declared import percent
from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.signatures.cost_chart import CostChart

MARKERS = {"": "o", "emitters drawn": "^", "paths kept inside": "s"}


@styled
def figure(chart: CostChart):
    """Figure of error over processor time, with the frontier and what is recommended."""
    table = chart.table
    figure = new_figure((7.2, 5.2), layout="constrained")
    axes = figure.subplots()
    lobes = list(dict.fromkeys(table["reflection"]))
    for number, lobe in enumerate(lobes):
        for drawn, marker in MARKERS.items():
            some = (table["reflection"] == lobe) & (table["drawn"] == drawn)
            if some.any():
                words = lobe if lobe != "scene" else "as the materials state"
                axes.plot(
                    table["cpu_s"][some], 100 * table["error"][some], marker, color=f"C{number}",
                    label=", ".join(filter(None, (words, drawn))),
                )  # fmt: skip
    for x, y, count in zip(table["cpu_s"], table["error"], table["max_bounces"]):
        axes.annotate(
            str(count), (x, 100 * y), xytext=(4, 3), textcoords="offset points", fontsize=7,
            path_effects=[withStroke(linewidth=2, foreground="white")],
        )  # fmt: skip
    on_it = np.flatnonzero(table["on_frontier"])
    on_it = on_it[np.argsort(table["cpu_s"][on_it])]
    axes.step(table["cpu_s"][on_it], 100 * table["error"][on_it], "0.5", where="post", zorder=0)
    axes.axhline(100 * chart.tolerance, color="C3", linewidth=0.9, linestyle="--", zorder=0)
    if chart.recommended is not None:
        place = table["cpu_s"][chart.recommended], 100 * table["error"][chart.recommended]
        axes.plot(*place, "o", markersize=15, markerfacecolor="none", markeredgecolor="C3",
                  label=f"recommended for {percent(chart.tolerance)}")  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel="processor time after the compile (s)",
        ylabel="error of the intensity (%)",
    )  # fmt: skip
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    figure.legend(title="numbers: reflections", loc="outside lower center", ncols=3)
    figure.suptitle(plain(chart.summary()), fontsize=10)
    return figure
