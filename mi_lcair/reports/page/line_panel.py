"""Panel of line charts."""

import numpy as np

from mi_lcair.reports.line_charts import LineChart
from mi_lcair.reports.page.figures import figure_panel, graph_objects, name, subplots
from mi_lcair.reports.page.panel import Panel
from mi_lcair.results.cells import typeset_unit

HEIGHT = 300  # pixels of a chart that stands below another
HEIGHT_ACROSS = 430  # pixels of charts side by side
LEGEND = 86  # pixels from the lowest chart to the end of the legend


def line_panel(charts: list[LineChart], across: bool = False) -> Panel:
    """The panel of charts, one below the other or, with `across`, side by side.

    Curves with one name share an entry of the legend, which shows and hides all of them.
    """
    go, count = graph_objects(), len(charts)
    rows, columns = (1, count) if across else (count, 1)
    has_right = [{"secondary_y": any(c.on_right for c in chart.curves)} for chart in charts]
    figure = subplots(
        rows=rows,
        cols=columns,
        shared_xaxes=not across,
        horizontal_spacing=0.1,
        vertical_spacing=0.08,
        specs=np.reshape(has_right, (rows, columns)).tolist(),
        subplot_titles=[name(chart.title) for chart in charts],
    )
    names = set()
    for number, chart in enumerate(charts):
        place = {"row": 1, "col": number + 1} if across else {"row": number + 1, "col": 1}
        for curve in chart.curves:
            unit = typeset_unit(curve.unit)
            trace = go.Scatter(
                x=chart.x,
                y=np.asarray(curve.values, float),
                name=name(curve.name),
                legendgroup=curve.name,
                showlegend=curve.name not in names,
                line=curve.line,
                error_y=None if curve.errors is None else {"array": curve.errors},
                hovertemplate=f"%{{x:.4g}} µm: %{{y:.5g}} {unit}",
            )
            figure.add_trace(trace, **place, secondary_y=curve.on_right)
            names.add(curve.name)
            if curve.on_right:
                title = curve.name.removesuffix(" (right)")
                axis = {"range": [0, 1.05], "dtick": 0.25, "showgrid": False}
                figure.update_yaxes(title_text=title, **axis, **place, secondary_y=True)
        mode = "tozero" if chart.from_zero else "normal"
        figure.update_yaxes(title_text=chart.y_label, rangemode=mode, **place, secondary_y=False)
        if across or number == count - 1:
            figure.update_xaxes(title_text=chart.x_label, **place)
    height = HEIGHT_ACROSS if across else HEIGHT * count
    figure.update_layout(
        legend={"orientation": "h", "y": -LEGEND / height, "yanchor": "top"},
        margin={"l": 70, "r": 60, "t": 40, "b": 60},
        hovermode="closest",
    )
    return figure_panel(figure, height)
