"""Panel of a fit: measured and fitted BRDF, residuals, and emissivity."""

import numpy as np

from mi_lcair.extras import optional
from mi_lcair.reports.fit_curves import Scan, directional, scans_of
from mi_lcair.reports.line_charts import INK
from mi_lcair.reports.page.figures import LINE, figure_panel, graph_objects, subplots
from mi_lcair.reports.page.panel import Panel

SYMBOLS = {"theta_i": "θi", "theta_r": "θr"}
LIGHTEST = 0.88  # end of the colours in Viridis; lighter ones are hard to see


def fit_panel(fit, measurements=None, directional_data: dict | None = None) -> Panel:
    """The panel of a fit.

    Parameters
    ----------
    fit : Fit or namespace
        Model, form, parameters and settings of the fit, and `used_points` with measurements.
    measurements : Measurements, optional
        The measured points. Without them the fitted curves are shown alone.
    directional_data : dict, optional
        Measured tables of "emissivity" and "dhr", as DirectionalData.
    """
    figure = subplots(
        rows=2,
        cols=2,
        column_widths=[0.66, 0.34],
        row_heights=[0.7, 0.3],
        vertical_spacing=0.08,
        horizontal_spacing=0.11,
        shared_xaxes=True,
        specs=[[{}, {"rowspan": 2}], [{}, None]],
        subplot_titles=("measured and fitted BRDF", "emissivity and reflectance"),
    )
    swept, fixed, scans = scans_of(fit, measurements)
    for scan, color in zip(scans, shades(len(scans))):
        add_scan(figure, scan, f"{SYMBOLS[fixed]} = {scan.setting:.4g}°", SYMBOLS[swept], color)
    figure.add_hline(y=0, line={"color": INK, "width": 1}, row=2, col=1)
    add_hemispherical(figure, fit, directional_data or {})
    figure.update_yaxes(title_text="BRDF (sr⁻¹)", type="log", exponentformat="power", row=1, col=1)
    figure.update_yaxes(title_text="log10(measured / fitted)", row=2, col=1)
    figure.update_xaxes(title_text=f"{SYMBOLS[swept]} (°)", row=2, col=1)
    figure.update_xaxes(title_text="angle to the normal (°)", range=[0, 90], row=1, col=2)
    figure.update_yaxes(title_text="emissivity, reflectance", range=[0, 1], row=1, col=2)
    figure.update_layout(
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "y": -0.1, "yanchor": "top"},
    )
    return figure_panel(figure, 640)


def add_scan(figure, scan: Scan, title: str, symbol: str, color: str) -> None:
    """Add the curve, the points and the residuals of a scan. `symbol`: of its abscissa."""
    of_scan, at = {"legendgroup": title}, f"{title}, {symbol} = %{{x:.4g}}°: "
    fitted = curve(*scan.curve, title, color, f"{at}%{{y:.4g}} sr⁻¹, fitted", **of_scan)
    figure.add_trace(fitted, row=1, col=1)
    x, low, high = scan.band
    if np.isfinite(low).any():
        faint = color.replace("rgb", "rgba").replace(")", ", 0.25)")
        figure.add_trace(band(x, low, high, faint, showlegend=False, **of_scan), 1, 1)
    angles, brdf = scan.fitted
    for row, x, y, symbol_of_marker, words in (
        (1, angles, brdf, "circle", "%{y:.4g} sr⁻¹, measured"),
        (1, *scan.left_out, "circle-open", "%{y:.4g} sr⁻¹, left out"),
        (2, angles, scan.residuals, "circle", "%{y:.3f} decades"),
    ):
        if len(x):
            marker = {"color": color, "size": 4.5, "symbol": symbol_of_marker}
            figure.add_trace(
                points(x, y, title, marker, f"{at}{words}", showlegend=False, **of_scan),
                row=row,
                col=1,
            )


def curve(x, y, name: str, color: str, words: str, **options):
    """A curve of plotly. words: what it says of the place that the mouse points at."""
    line = LINE | {"color": color}
    options |= {"name": name, "mode": "lines", "hovertemplate": f"{words}<extra></extra>"}
    return graph_objects().Scatter(x=x, y=np.asarray(y, float), line=line, **options)


def points(x, y, name: str, marker: dict, words: str, **options):
    """Points of plotly, as `curve`."""
    options |= {"name": name, "mode": "markers", "hovertemplate": f"{words}<extra></extra>"}
    return graph_objects().Scatter(x=x, y=np.asarray(y, float), marker=marker, **options)


def band(at, low, high, color: str, **settings):
    """A filled band between two curves."""
    return graph_objects().Scatter(
        x=np.concatenate([at, at[::-1]]),
        y=np.concatenate([low, high[::-1]]),
        fill="toself",
        fillcolor=color,
        line={"width": 0},
        hoverinfo="skip",
        **settings,
    )


def add_hemispherical(figure, fit, measured: dict) -> None:
    """Add the fitted emissivity 1 - HDR with its interval and DHR, and measured tables."""
    theta = np.radians(np.linspace(0, 89, 90))
    place = {"row": 1, "col": 2}
    if fit.emissivity_interval is not None:
        at, (low, high) = np.degrees(fit.emissivity[0]), np.transpose(fit.emissivity_interval)
        name, color = "95 % interval of the emissivity", "rgba(209, 73, 91, 0.2)"
        figure.add_trace(band(at, low, high, color, name=name), **place)
    for quantity, title, color in (
        ("emissivity", "emissivity", "#d1495b"),
        ("dhr", "directional-hemispherical reflectance", "#1f5fa8"),
    ):
        values = directional(fit, quantity, theta)
        words = f"%{{x:.4g}}°: %{{y:.4f}}, {title}"
        figure.add_trace(curve(np.degrees(theta), values, title, color, words), **place)
        data = measured.get(quantity)
        if data is not None:
            std = None if data.std is None else np.asarray(data.std, float)
            bars = {} if std is None else {"error_y": {"array": std, "thickness": 1}}
            marker, name = {"color": color, "size": 6}, f"{title}, measured"
            words = "%{x:.4g}°: %{y:.4f}, measured"
            of_table = points(np.degrees(data.theta), data.value, name, marker, words, **bars)
            figure.add_trace(of_table, **place)


def shades(count: int) -> list[str]:
    """Colours for `count` curves, from dark to light."""
    colours = optional("plotly.colors", "a report page")
    return colours.sample_colorscale("Viridis", np.linspace(0, LIGHTEST, max(count, 1)))
