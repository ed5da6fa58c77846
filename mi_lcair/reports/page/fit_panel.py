"""Panel of a fit: measured and fitted BRDF, residuals, and emissivity."""

import numpy as np

from mi_lcair.reports.line_charts import INK
from mi_lcair.reports.page.figures import LINE, figure_panel, graph_objects, subplots
from mi_lcair.reports.page.panel import Panel
from mi_lcair.reports.pictures.fit import MOST_CURVES, directional, predicted

SYMBOLS = {"theta_i": "θi", "theta_r": "θr"}
POINTS = 300  # points of a fitted curve
INCIDENCES = np.radians([10.0, 30.0, 50.0, 70.0])  # of the curves without measurements
WIDEST = np.radians(80)  # largest angle of the observer of these curves
SHADES = ((68, 1, 84), (49, 104, 142), (53, 183, 121), (180, 200, 40))  # dark to light


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
    swept = brdf_traces(figure, fit, measurements)
    hemispherical_traces(figure, fit, directional_data or {})
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


def brdf_traces(figure, fit, measurements) -> str:
    """Add curves, points and residuals; returns the angle on the abscissa."""
    go = graph_objects()
    if measurements is None:
        x = np.linspace(-WIDEST, WIDEST, POINTS)
        for theta_i, color in zip(INCIDENCES, shades(len(INCIDENCES))):
            add_curve(figure, go, fit, "theta_r", x, "theta_i", theta_i, color)
        return "theta_r"
    angles = {"theta_r": measurements.theta_r, "theta_i": measurements.theta_i}
    swept, fixed = sorted(angles, key=lambda key: -len(np.unique(angles[key])))
    settings = np.unique(angles[fixed])
    picked = np.linspace(0, len(settings) - 1, MOST_CURVES).round().astype(int)
    settings = settings[np.unique(picked)]
    used = np.asarray(fit.used_points, bool)
    model = predicted(fit, measurements.theta_i, measurements.theta_r)
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = np.log10(measurements.brdf / model)
    for setting, color in zip(settings, shades(len(settings))):
        at_setting = angles[fixed] == setting
        x = np.linspace(angles[swept][at_setting].min(), angles[swept][at_setting].max(), POINTS)
        add_curve(figure, go, fit, swept, x, fixed, setting, color)
        for points, symbol, words in (
            (at_setting & used, "circle", "measured"),
            (at_setting & ~used & (measurements.brdf > 0), "circle-open", "left out"),
        ):
            if not points.any():
                continue
            add_points(
                figure, go, 1, np.degrees(angles[swept][points]), measurements.brdf[points],
                symbol, color, setting, f"%{{y:.4g}} sr⁻¹, {words}",
            )  # fmt: skip
        points = at_setting & used
        add_points(
            figure, go, 2, np.degrees(angles[swept][points]), residual[points],
            "circle", color, setting, "%{y:.3f} decades",
        )  # fmt: skip
    figure.add_hline(y=0, line={"color": INK, "width": 1}, row=2, col=1)
    return swept


def add_curve(figure, go, fit, swept, x, fixed, setting, color) -> None:
    """Add a fitted curve over one angle, with the other one fixed (radians)."""
    line = predicted(fit, **{swept: x, fixed: np.full(len(x), setting)})
    title = f"{SYMBOLS[fixed]} = {np.degrees(setting):.4g}°"
    figure.add_trace(
        go.Scatter(
            x=np.degrees(x),
            y=line,
            name=title,
            legendgroup=title,
            mode="lines",
            line=LINE | {"color": color},
            hovertemplate=f"{title}, {SYMBOLS[swept]} = %{{x:.4g}}°: %{{y:.4g}} sr⁻¹, fitted"
            "<extra></extra>",
        ),
        row=1,
        col=1,
    )


def add_points(figure, go, row, x, y, symbol, color, setting, told) -> None:
    """Add points of one setting of the fixed angle."""
    figure.add_trace(
        go.Scatter(
            x=x,
            y=y,
            mode="markers",
            showlegend=False,
            legendgroup=f"{np.degrees(setting):.4g}",
            marker={"color": color, "size": 4.5, "symbol": symbol},
            hovertemplate=f"{np.degrees(setting):.4g}°, %{{x:.4g}}°: {told}<extra></extra>",
        ),
        row=row,
        col=1,
    )


def hemispherical_traces(figure, fit, measured: dict) -> None:
    """Add the fitted emissivity 1 - HDR and DHR over the angle, and measured tables."""
    go = graph_objects()
    theta = np.radians(np.linspace(0, 89, 90))
    for quantity, title, color in (
        ("emissivity", "emissivity", "#d1495b"),
        ("dhr", "directional-hemispherical reflectance", "#1f5fa8"),
    ):
        figure.add_trace(
            go.Scatter(
                x=np.degrees(theta),
                y=np.asarray(directional(fit, quantity, theta), float),
                name=title,
                line=LINE | {"color": color},
                hovertemplate=f"%{{x:.4g}}°: %{{y:.4f}}, {title}<extra></extra>",
            ),
            row=1,
            col=2,
        )
        data = measured.get(quantity)
        if data is not None:
            figure.add_trace(
                go.Scatter(
                    x=np.degrees(data.theta),
                    y=np.asarray(data.value, float),
                    error_y=None
                    if data.std is None
                    else {"array": np.asarray(data.std, float), "thickness": 1},
                    mode="markers",
                    name=f"{title}, measured",
                    marker={"color": color, "size": 6},
                    hovertemplate="%{x:.4g}°: %{y:.4f}, measured<extra></extra>",
                ),
                row=1,
                col=2,
            )


def shades(count: int) -> list[str]:
    """Colours for `count` curves, from dark to light."""
    places = np.linspace(0, 1, len(SHADES))
    channels = [
        np.interp(np.linspace(0, 1, max(count, 1)), places, [shade[k] for shade in SHADES])
        for k in range(3)
    ]
    return [f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in zip(*channels)]
