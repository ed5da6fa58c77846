"""Panel of a trend: polar curves with bands of error, by elevation."""

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
from mi_lcair.reports.pictures.trend import closed, elevations_of
from mi_lcair.signatures.trend_result import Trend

HEIGHT = 560  # pixels


def trend_panel(trend: Trend) -> Panel:
    """The panel of a trend.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. Bands are the 95 % intervals
    of the intensity.
    """
    go, figure = graph_objects(), subplots(rows=1, cols=1, specs=[[{"type": "polar"}]])
    for number, elevation in enumerate(elevations_of(trend)[0]):
        at = trend.at_elevation(elevation)
        intensity = at.table["intensity_W_sr"]
        half = at.table.get("half_width_W_sr", np.full(len(intensity), np.nan))
        title = f"{elevation:g}° elevation"
        figure.add_traces(curve(go, title, *closed(at, intensity, half), number))
    figure.update_polars(
        angularaxis={"rotation": 90, "direction": "counterclockwise", "dtick": 30},
        radialaxis={"angle": 90, "tickangle": 90, "rangemode": "tozero", "nticks": 6},
    )
    figure.update_layout(
        title="intensity (W sr⁻¹) over azimuth (°)",
        margin={"l": 40, "r": 40, "t": 70, "b": 40},
        updatemenus=[scale_menu()],
    )
    return figure_panel(figure, HEIGHT)


def curve(go, title: str, azimuth, values, half, number: int) -> list:
    """Traces of a curve over azimuth and of its band of values +- half, if it has one."""
    color, title, traces, told = colour(number), name(title), [], ""
    if np.isfinite(half).any():
        low, high, told = np.maximum(values - half, 0), values + half, " ± %{customdata:.2g}"
        band = go.Scatterpolar(
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
        traces.append(band)
    line = go.Scatterpolar(
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
    return [*traces, line]


def scale_menu() -> dict:
    """Buttons for a linear and a logarithmic radius."""
    return {
        "type": "buttons",
        "direction": "right",
        "x": 0,
        "y": 1.14,
        "xanchor": "left",
        "yanchor": "top",
        "buttons": [
            {"label": words, "method": "relayout", "args": [{"polar.radialaxis.type": kind}]}
            for words, kind in (("linear", "linear"), ("logarithmic", "log"))
        ],
    }
