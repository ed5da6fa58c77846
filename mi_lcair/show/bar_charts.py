"""Bar charts as pictures: what `mi_lcair/charts.py` holds, drawn with Matplotlib."""

import numpy as np

from mi_lcair.charts import COLOURS, BarChart
from mi_lcair.drawing import new_figure, plain, styled

MOST_BARS = 16  # places of a chart; those with smaller values are left out
NEGLIGIBLE = 1e-3  # places below this share of the largest value are not drawn
MOST_LEVEL = 4  # characters of names, and their number, from which they are turned


@styled
def figure_of(charts: list[BarChart], title: str):
    """Matplotlib Figure of bar charts side by side."""
    tall = 3 + 0.45 * len(charts[0].names)
    is_lying = charts[0].stacked
    width = 7.5 if len(charts) == 1 else 11
    figure = new_figure((width, tall if is_lying else 3.8), layout="constrained")
    for panel, chart in zip(np.atleast_1d(figure.subplots(1, len(charts))), charts):
        (draw_stacked if chart.stacked else draw_beside)(panel, chart)
        panel.set_title(plain(chart.title))
    figure.suptitle(plain(title), fontsize=10)
    return figure


def draw_beside(panel, chart: BarChart) -> None:
    """Draw the bars of each place side by side in Matplotlib's axes, with standard errors."""
    largest = np.max([np.abs(values) for values in chart.bars.values()], axis=0)
    order = np.argsort(-largest, kind="stable")[:MOST_BARS]
    kept = np.sort(order[largest[order] >= NEGLIGIBLE * largest.max()])
    width = 0.8 / len(chart.bars)
    for number, (series, values) in enumerate(chart.bars.items()):
        panel.bar(
            np.arange(len(kept)) + (number - 0.5 * (len(chart.bars) - 1)) * width,
            np.asarray(values)[kept],
            width,
            yerr=np.asarray(chart.errors[series])[kept] if series in chart.errors else None,
            color=COLOURS[number % len(COLOURS)],
            ecolor="black",
            label=plain(series),
        )
    panel.set_xticks(np.arange(len(kept)), [plain(chart.names[k]) for k in kept])
    if max(len(chart.names[k]) for k in kept) > MOST_LEVEL and len(kept) > MOST_LEVEL:
        panel.tick_params(axis="x", rotation=45)
    panel.set(xlim=(-1, len(kept)), xlabel=chart.places, ylabel=chart.label)
    if len(chart.bars) > 1:
        panel.legend()


def draw_stacked(panel, chart: BarChart) -> None:
    """Draw lying bars in Matplotlib's axes, those of one place one behind the other."""
    from matplotlib import colormaps

    names, left = [plain(name) for name in chart.names], np.zeros(len(chart.names))
    shades = [*colormaps["Blues"](np.linspace(0.85, 0.25, chart.shades))]
    others = len(chart.bars) - len(shades)
    distinct = COLOURS[1:] if shades else COLOURS  # the first colour is a blue, too
    colours = [*shades, *(distinct if others <= len(distinct) else colormaps["tab20"].colors)]
    for number, (series, values) in enumerate(chart.bars.items()):
        colour = colours[number % len(colours)]
        panel.barh(names, values, left=left, color=colour, label=plain(series))
        left = left + values
    panel.set(xlabel=chart.label, ylabel=chart.places)
    panel.invert_yaxis()
    panel.legend(fontsize=7, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.22))
