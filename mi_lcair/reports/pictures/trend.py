"""Polar charts of a trend: by elevation, by emitting group, and by number of reflections."""

import numpy as np

from mi_lcair.reports.line_charts import Curve, LineChart, figure_of, label
from mi_lcair.signatures.trend_result import Trend

NEGLIGIBLE = 1e-3  # parts below this share of the largest intensity are not drawn
KINDS = {"group": "by what emitted it", "bounce": "by number of reflections"}
UNIT = "W sr-1"


def figure(trend: Trend):
    """Figure with a polar panel for each chart. Bands are 95 % intervals."""
    words = f"{trend.scene_name}, {trend.band}: intensity of the model"
    return figure_of(charts(trend), f"{words} ({label('', UNIT)[2:-1]}) by azimuth", across=True)


def charts(trend: Trend) -> list[LineChart]:
    """Intensity by elevation, and its parts at the elevation nearest to 0.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. The first view is repeated at
    the end of an even full turn.
    """
    of_view = trend.table["elevation_deg"]
    azimuth, elevations = np.unique(trend.table["azimuth_deg"]).astype(float), np.unique(of_view)
    level = elevations[np.argmin(np.abs(elevations))]
    turn = np.diff(azimuth, append=azimuth[0] + 360)
    is_closed = len(azimuth) > 2 and np.allclose(turn, 360 / len(azimuth), atol=1e-6)
    ends = [0] if is_closed else []

    def over(elevation: float, column) -> np.ndarray:
        """A column at an elevation, by azimuth; NaN where there is no view."""
        rows, values = of_view == elevation, np.full(len(azimuth), np.nan)
        values[np.searchsorted(azimuth, trend.table["azimuth_deg"][rows])] = column[rows]
        return np.append(values, values[ends])

    def chart(title: str, curves: list[Curve]) -> LineChart:
        x = np.append(azimuth, azimuth[ends] + 360)
        return LineChart(title, x, "azimuth (°)", label("intensity", UNIT), curves, is_polar=True)

    intensity = trend.table["intensity_W_sr"]
    half = trend.table.get("half_width_W_sr", np.full(len(intensity), np.nan))
    by_elevation = [
        Curve(f"elevation {angle:g}°", over(angle, intensity), UNIT, k, half=over(angle, half))
        for k, angle in enumerate(elevations)
    ]
    result, least = [chart("by elevation", by_elevation)], NEGLIGIBLE * np.nanmax(intensity)
    for kind, words in KINDS.items():
        parts = {name: over(level, values) for name, values in trend.parts(kind).items()}
        large = {name: of for name, of in parts.items() if np.nanmax(of, initial=0) > least}
        curves = [Curve(name, of, UNIT, k) for k, (name, of) in enumerate(large.items())]
        result += [chart(f"{words}, elevation {level:g}°", curves)] if curves else []
    return result
