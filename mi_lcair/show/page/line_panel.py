"""Panel of line charts."""

from dataclasses import dataclass
from html import escape

import numpy as np

from mi_lcair.charts import Curve, LineChart
from mi_lcair.errors import printable
from mi_lcair.extras import optional
from mi_lcair.sections import LongTable, heading, typeset_unit

# Parts of a page that scripts draw, and tables among them
# --------------------------------------------------------

LONGEST = 200  # characters of a title or label


@dataclass(frozen=True)
class Panel:
    """A part of a page that a script draws.

    kind: name of the script's function, such as "image". data: what the function gets; arrays may
    lie at any depth. height: height before the script has run, pixels.
    """

    kind: str
    data: dict
    height: int = 480


def table_panel(table: LongTable) -> Panel:
    """The panel of a table of many rows, which is sorted and turned page by page."""
    columns = [column_data(*item) for item in table.columns.items()]
    return Panel("table", {"columns": columns, "sort": table.sort_by}, height=300)


def column_data(name: str, values) -> dict:
    """A column for the scripts: numbers as they are, texts as numbers of a list of names."""
    values = np.asarray(values)
    words, unit = heading(name)
    entries = {"name": name, "title": words, "unit": typeset_unit(unit)}
    if values.dtype.kind == "b":
        values = np.where(values, "yes", "no")
    if values.dtype.kind in "fiu":
        return entries | {"values": values if values.dtype.kind == "f" else values.astype(int)}
    names, codes = np.unique(values.astype(str), return_inverse=True)
    return entries | {"values": codes, "names": [printable(text) for text in names]}


HEIGHT = 300  # pixels of a chart that stands below another
HEIGHT_ACROSS = 430  # pixels of charts side by side
BAND = 0.18  # opacity of a band of errors
LEGEND = 86  # pixels from the lowest chart to the end of the legend


def line_panel(charts: list[LineChart], across: bool = False) -> Panel:
    """The panel of charts, one below the other or, with `across`, side by side.

    Curves with one name share an entry of the legend, which shows and hides all of them.
    """
    count = len(charts)
    rows, columns = (1, count) if across else (count, 1)
    specs = [
        {"type": "polar"}
        if chart.is_polar
        else {"secondary_y": any(c.on_right for c in chart.curves)}
        for chart in charts
    ]
    figure = optional("plotly.subplots", "a report page").make_subplots(
        rows=rows,
        cols=columns,
        shared_xaxes=not across,
        horizontal_spacing=0.1,
        vertical_spacing=0.08,
        specs=np.reshape(specs, (rows, columns)).tolist(),
        subplot_titles=[name(chart.title) for chart in charts],
    )
    names = set()
    for number, chart in enumerate(charts):
        place = {"row": 1, "col": number + 1} if across else {"row": number + 1, "col": 1}
        for curve in chart.curves:
            side = {} if chart.is_polar else {"secondary_y": curve.on_right}
            for trace in traces(chart, curve):
                trace.showlegend = trace.showlegend is not False and curve.name not in names
                figure.add_trace(trace, **place, **side)
            names.add(curve.name)
            if curve.on_right:
                title = curve.name.removesuffix(" (right)")
                axis = {"range": [0, 1.05], "dtick": 0.25, "showgrid": False}
                figure.update_yaxes(title_text=title, **axis, **place, secondary_y=True)
        if chart.is_polar:
            continue
        mode = "tozero" if chart.from_zero else "normal"
        kind = "log" if chart.is_log else "linear"
        axis = {"title_text": chart.y_label, "rangemode": mode, "type": kind}
        figure.update_yaxes(**axis, **place, secondary_y=False)
        if across or number == count - 1:
            figure.update_xaxes(title_text=chart.x_label, **place)
    figure.update_polars(
        angularaxis={"rotation": 90, "direction": "counterclockwise", "dtick": 30},
        radialaxis={"angle": 90, "tickangle": 90, "rangemode": "tozero", "nticks": 6},
    )
    if charts[0].is_polar:
        figure.update_annotations(yshift=16)  # titles, above the angle 0
    height = HEIGHT_ACROSS if across else HEIGHT * count
    figure.update_layout(
        legend={"orientation": "h", "y": -LEGEND / height, "yanchor": "top"},
        margin={"l": 70, "r": 60, "t": 60, "b": 60},
        hovermode="closest",
        height=height,
        template=None,
    )
    drawn = figure.to_dict()
    drawn["layout"].pop("template", None)  # the page's script sets one
    return Panel("figure", drawn, height)


def traces(chart: LineChart, curve: Curve) -> list:
    """The traces of a curve: its band, if it has one, and the curve."""
    go, unit = optional("plotly.graph_objects", "a report page"), typeset_unit(curve.unit)
    of_x = chart.x_label.rpartition("(")[2].rstrip(")")
    make, x, y = (go.Scatterpolar, "theta", "r") if chart.is_polar else (go.Scatter, "x", "y")
    values, result, told = np.asarray(curve.values, float), [], ""
    common = {"name": name(curve.name), "legendgroup": curve.name}
    if curve.half is not None and np.isfinite(curve.half).any():
        told = " ± %{customdata:.2g}"
        ends = np.concatenate([values + curve.half, (values - curve.half)[::-1]])
        around = {x: np.concatenate([chart.x, chart.x[::-1]]), y: np.maximum(ends, 0)}
        fill = {"fill": "toself", "fillcolor": faded(curve.line["color"]), "line": {"width": 0}}
        quiet = {"mode": "lines", "hoverinfo": "skip", "showlegend": False}
        result.append(make(**around, **fill, **quiet, **common))
    bars = {} if curve.errors is None else {"error_y": {"array": curve.errors}}
    words = f"%{{{x}:.4g}} {of_x}: %{{{y}:.5g}}{told} {unit}"
    line = {"line": curve.line, "customdata": curve.half, "hovertemplate": words}
    return [*result, make(**{x: chart.x, y: values}, **line, **bars, **common)]


def faded(colour: str) -> str:
    """A colour as #rrggbb with the opacity of a band of errors."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{BAND})"


def name(text: object) -> str:
    """Name for a curve or title without markup. plotly takes quotes as they are."""
    return escape(printable(text, LONGEST), quote=False)
