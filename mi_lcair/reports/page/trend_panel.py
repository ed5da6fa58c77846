"""Panel of a trend: polar curves with bands of error, by elevation and by part."""

import numpy as np

from mi_lcair.reports.page.figures import (
    LINE,
    colour,
    faded,
    figure_panel,
    graph_objects,
    name,
    subplots,
)
from mi_lcair.reports.page.panel import Panel
from mi_lcair.reports.pictures.trend import KINDS, closed, elevations_of, large_parts
from mi_lcair.signatures.trend_result import Trend

HEIGHT = 560  # pixels


def trend_panel(trend: Trend) -> Panel:
    """The panel of a trend.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. Bands are the 95 % intervals
    of the intensity. Its parts are shown at one elevation, which a menu chooses.
    """
    go = graph_objects()
    elevations, level = elevations_of(trend)
    kinds = [kind for kind in KINDS if trend.parts(kind)]
    titles = ["by elevation, with 95 % intervals", *(KINDS[kind] for kind in kinds)]
    figure = subplots(
        rows=1,
        cols=len(titles),
        specs=[[{"type": "polar"}] * len(titles)],
        subplot_titles=[f"{title}<br>intensity (W sr⁻¹) over azimuth (°)" for title in titles],
        horizontal_spacing=0.07,
    )
    visible = []  # elevation of each trace; None for those that are always shown
    for number, elevation in enumerate(elevations):
        at = trend.at_elevation(elevation)
        intensity = at.table["intensity_W_sr"]
        half = at.table.get("half_width_W_sr", np.full(len(intensity), np.nan))
        title = f"{elevation:g}° elevation"
        for trace in curve(go, title, closed(at, intensity, half), number):
            figure.add_trace(trace.update(legend="legend"), row=1, col=1)
            visible.append(None)
        for place, kind in enumerate(kinds, 2):
            for order, (part, values) in enumerate(large_parts(at, kind).items()):
                title = part if kind == "group" else reflections(part)
                for trace in curve(go, title, values, order):
                    trace.update(visible=number == level, legend=f"legend{place}")
                    figure.add_trace(trace, row=1, col=place)
                    visible.append(number)
    lay_out(figure)
    menus = [scale_menu(len(titles))]
    if kinds:
        menus.append(elevation_menu(elevations, visible, level))
    figure.update_layout(updatemenus=menus)
    return figure_panel(figure, HEIGHT)


def reflections(number: str) -> str:
    """Words for a number of reflections."""
    return "none" if number in ("0", "00") else number.lstrip("0")


def curve(go, title: str, columns: list[np.ndarray], number: int) -> list:
    """Traces of a curve and its band: columns are azimuths, values and, if any, half widths."""
    azimuth, values, *rest = columns
    half = rest[0] if rest and np.isfinite(rest[0]).any() else None
    color, title = colour(number), name(title)
    traces = []
    if half is not None:
        low, high = np.maximum(values - half, 0), values + half
        traces.append(
            go.Scatterpolar(
                theta=np.concatenate([azimuth, azimuth[::-1]]),
                r=np.concatenate([high, low[::-1]]),
                fill="toself",
                fillcolor=faded(color),
                line={"width": 0},
                mode="lines",
                hoverinfo="skip",
                showlegend=False,
                legendgroup=title,
            )
        )
    told = "" if half is None else " ± %{customdata:.2g}"
    traces.append(
        go.Scatterpolar(
            theta=azimuth,
            r=values,
            customdata=half,
            name=title,
            legendgroup=title,
            mode="lines+markers",
            marker={"size": 4 if len(values) < 100 else 2.5},
            line=LINE | {"color": color},
            hovertemplate=f"azimuth %{{theta:.5g}}°: %{{r:.5g}}{told} W sr⁻¹",
        )
    )
    return traces


def lay_out(figure) -> None:
    """Place titles, axes and legends of the polar plots."""
    figure.update_polars(
        domain_y=[0.14, 0.8],
        angularaxis={"rotation": 90, "direction": "counterclockwise", "dtick": 30},
        radialaxis={"angle": 90, "tickangle": 90, "rangemode": "tozero", "nticks": 6},
    )
    figure.update_annotations(y=0.96, yanchor="top", font=None)
    for number, polar in enumerate(figure.select_polars(), 1):
        middle = {"x": sum(polar.domain.x) / 2, "xanchor": "center"}
        legend = {"orientation": "h", "y": 0.06, "yanchor": "top", **middle}
        figure.update_layout({f"legend{'' if number == 1 else number}": legend})
    figure.update_layout(margin={"l": 40, "r": 40, "t": 60, "b": 20})


def scale_menu(count: int) -> dict:
    """Buttons for linear and logarithmic radii."""
    axes = [f"polar{'' if k == 1 else k}.radialaxis.type" for k in range(1, count + 1)]
    return {
        "type": "buttons",
        "direction": "right",
        "x": 0,
        "y": 1.14,
        "xanchor": "left",
        "yanchor": "top",
        "buttons": [
            {"label": words, "method": "relayout", "args": [dict.fromkeys(axes, kind)]}
            for words, kind in (("linear", "linear"), ("logarithmic", "log"))
        ],
    }


def elevation_menu(elevations, visible: list, level: int) -> dict:
    """Menu of the elevation at which the parts are shown."""
    return {
        "x": 1,
        "y": 1.14,
        "xanchor": "right",
        "yanchor": "top",
        "active": level,
        "buttons": [
            {
                "label": f"parts at {elevation:g}° elevation",
                "method": "restyle",
                "args": [{"visible": [of in (None, number) for of in visible]}],
            }
            for number, elevation in enumerate(elevations)
        ],
    }
