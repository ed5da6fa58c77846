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

NEGLIGIBLE = 1e-3  # parts below this share of the largest intensity are not drawn
KINDS = {"group": "by what emitted it", "bounce": "by number of reflections"}
HEIGHT = 560  # pixels


def trend_panel(columns: dict[str, np.ndarray]) -> Panel:
    """The panel of a trend.

    columns: table of a trend, see `Trend`. Azimuth 0 (the nose) is up, and 90 (the left side) is on
    the left. Bands are the 95 % intervals of the intensity. Its parts are shown at one elevation,
    which a menu chooses.
    """
    go = graph_objects()
    elevations = np.unique(columns["elevation_deg"])
    level = int(np.argmin(np.abs(elevations)))
    kinds = [kind for kind in KINDS if parts(columns, kind)]
    figure = subplots(
        rows=1,
        cols=1 + len(kinds),
        specs=[[{"type": "polar"}] * (1 + len(kinds))],
        horizontal_spacing=0.07,
    )
    visible = []  # elevation of each trace; None for those that are always shown
    for number, elevation in enumerate(elevations):
        rows = at_elevation(columns, elevation)
        azimuth, (middle, half) = closed(rows, "intensity_W_sr", "half_width_W_sr")
        for trace in curve(go, f"{elevation:g}° elevation", azimuth, middle, half, number):
            figure.add_trace(trace.update(legend="legend"), row=1, col=1)
            visible.append(None)
        least = NEGLIGIBLE * np.nanmax(columns["intensity_W_sr"])
        for place, kind in enumerate(kinds, 2):
            large = [key for key in parts(columns, kind) if np.nanmax(columns[key]) > least]
            for order, key in enumerate(large):
                azimuth, (values,) = closed(rows, key)
                title = key.partition(".")[2].removesuffix("_W_sr")
                title = title if kind == "group" else reflections(title)
                for trace in curve(go, title, azimuth, values, None, order):
                    trace.update(visible=number == level, legend=f"legend{place}")
                    figure.add_trace(trace, row=1, col=place)
                    visible.append(number)
    titles = ["by elevation, with 95 % intervals", *(KINDS[kind] for kind in kinds)]
    lay_out(figure, titles)
    menus = [scale_menu(len(titles))]
    if kinds:
        menus.append(elevation_menu(elevations, visible, level))
    figure.update_layout(updatemenus=menus)
    return figure_panel(figure, HEIGHT)


def parts(columns: dict, kind: str) -> list[str]:
    """Columns of the parts of one kind, "group" or "bounce"."""
    return [key for key in columns if key.startswith(f"{kind}.")]


def reflections(number: str) -> str:
    """Words for a number of reflections."""
    return "none" if number in ("0", "00") else number.lstrip("0")


def at_elevation(columns: dict, elevation: float) -> dict[str, np.ndarray]:
    """The rows at an elevation, in the order of their azimuths."""
    rows = np.flatnonzero(columns["elevation_deg"] == elevation)
    rows = rows[np.argsort(columns["azimuth_deg"][rows], kind="stable")]
    return {key: np.asarray(values, float)[rows] for key, values in columns.items()}


def closed(rows: dict, *keys: str) -> tuple[np.ndarray, list[np.ndarray]]:
    """Azimuths and columns; the first view is repeated at the end of a full turn."""
    azimuth = rows["azimuth_deg"]
    values = [rows.get(key, np.full(len(azimuth), np.nan)) for key in keys]
    steps = np.diff(np.append(azimuth, azimuth[0] + 360))
    if len(azimuth) > 2 and np.allclose(steps, 360 / len(azimuth), atol=1e-6):
        azimuth = np.append(azimuth, azimuth[0] + 360)
        values = [np.append(column, column[0]) for column in values]
    return azimuth, values


def curve(go, title: str, azimuth, values, half, number: int) -> list:
    """Traces of a curve and, with half widths, of its band."""
    color, title = colour(number), name(title)
    traces = []
    if half is not None and np.isfinite(half).any():
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


def lay_out(figure, titles: list[str]) -> None:
    """Set titles, axes and legends of the polar plots."""
    for number, title in enumerate(titles, 1):
        suffix = "" if number == 1 else str(number)
        left, right = figure.layout[f"polar{suffix}"].domain.x
        figure.layout[f"polar{suffix}"].update(
            domain={"x": [left, right], "y": [0.14, 0.8]},
            angularaxis={"rotation": 90, "direction": "counterclockwise", "dtick": 30},
            radialaxis={"angle": 90, "tickangle": 90, "rangemode": "tozero", "nticks": 6},
        )
        figure.layout[f"legend{suffix}"] = {
            "orientation": "h",
            "x": (left + right) / 2,
            "xanchor": "center",
            "y": 0.06,
            "yanchor": "top",
        }
        figure.add_annotation(
            text=f"{title}<br>intensity (W sr⁻¹) over azimuth (°)",
            x=(left + right) / 2,
            y=0.96,
            xref="paper",
            yref="paper",
            xanchor="center",
            yanchor="top",
            showarrow=False,
        )
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
