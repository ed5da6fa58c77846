"""Line charts as pictures: what `mi_lcair/charts.py` holds, drawn with Matplotlib."""

from textwrap import fill

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from mi_lcair.charts import Curve, LineChart
from mi_lcair.drawing import new_figure, plain, styled

WIDEST_TITLE = 75  # characters of a line


def draw_with_band(axes, x, values, half, **style) -> None:
    """Draw a curve in Matplotlib's axes, and its band of values +- half."""
    (line,) = axes.plot(x, values, **style)
    axes.fill_between(x, values - half, values + half, color=line.get_color(), alpha=0.2, lw=0)


@styled
def figure_of(charts: list[LineChart], title: str, across: bool = False):
    """Matplotlib Figure of charts, one below the other or, with `across`, side by side."""
    count = len(charts)
    is_polar = charts[0].is_polar
    size = (4.7 * count, 5.6) if is_polar else (11, 4.5) if across else (7, 3 * count)
    figure = new_figure(size, layout="constrained")
    rows, columns = (1, count) if across else (count, 1)
    is_common = len({chart.x_label for chart in charts}) == 1
    kind = {"projection": "polar" if is_polar else None}
    axes = figure.subplots(rows, columns, sharex=is_common, squeeze=False, subplot_kw=kind).ravel()
    for panel, chart in zip(axes, charts):
        (draw_polar if is_polar else draw)(panel, chart)
        if is_polar:
            continue
        if across or not is_common or chart is charts[-1]:
            panel.set_xlabel(chart.x_label)
    figure.suptitle(plain(title))
    return figure


def draw_polar(panel, chart: LineChart) -> None:
    """Draw a polar chart in Matplotlib's axes."""
    panel.set_theta_zero_location("N")
    for curve in chart.curves:
        style = {"label": plain(curve.name), "color": curve.line["color"]}
        style["marker"] = "." if len(chart.x) < 8 else None
        half = np.zeros(len(chart.x)) if curve.half is None else np.nan_to_num(curve.half)
        draw_with_band(panel, np.radians(chart.x), curve.values, half, linewidth=1.3, **style)
    panel.set(ylim=(0, None), title=chart.title)
    panel.yaxis.set_major_locator(MaxNLocator(5))
    for text in panel.get_yticklabels():  # they lie on the curves
        text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=4)


def draw(panel, chart: LineChart) -> None:
    """Draw a chart in Matplotlib's axes."""
    right = None
    if any(curve.on_right for curve in chart.curves):
        right = panel.twinx()
        right.set(ylim=(0, 1.25), yticks=np.linspace(0, 1, 5))
    lines = []
    for curve in chart.curves:
        style = {"linewidth": 0.7 * curve.line["width"], "color": curve.line["color"]}
        target = right if curve.on_right else panel
        lines += target.plot(chart.x, curve.values, label=plain(curve.name), **style)
        if curve.half is not None:
            ends = curve.values - curve.half, curve.values + curve.half
            target.fill_between(chart.x, *ends, color=curve.line["color"], alpha=0.2, lw=0)
        if curve.errors is not None:
            target.errorbar(chart.x, curve.values, curve.errors, fmt="none", capsize=3, **style)
        if curve.on_right:
            target.set_ylabel(curve.name.removesuffix(" (right)"))
    values = np.concatenate([extent_of(curve) for curve in chart.curves if not curve.on_right])
    values = values[np.isfinite(values)]
    low, high = values.min(initial=0), values.max(initial=0)
    if chart.is_close:
        low = values.min(where=values > 0, initial=high)
    extent = (high - low) or 1e-30
    # A quarter more than the largest value leaves room for the legend.
    if chart.is_log:
        panel.set_yscale("log")
        if len(lines) > 1:
            low, high = panel.get_ylim()
            panel.set_ylim(low, high * (high / low) ** 0.25)
    else:
        panel.set_ylim(0 if chart.from_zero else low - 0.05 * extent, high + 0.25 * extent)
    panel.set_xlim(chart.x.min(), chart.x.max())
    if not (chart.is_close or chart.is_log):
        panel.axhline(0, color="black", linewidth=0.5)
    panel.set(title=fill(plain(chart.title), WIDEST_TITLE), ylabel=chart.y_label)
    if len(lines) > 1:
        names = [line.get_label() for line in lines]
        panel.legend(lines, names, ncols=4, loc="upper center")


def extent_of(curve: Curve) -> np.ndarray:
    """The values of a curve, with both ends of its band."""
    half = 0 if curve.half is None else np.nan_to_num(curve.half)
    return np.concatenate([curve.values - half, curve.values + half])
