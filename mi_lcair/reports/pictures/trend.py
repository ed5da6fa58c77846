"""Polar plot of a trend: by elevation, by emitting group, and by number of reflections."""

import numpy as np

from mi_lcair.drawing import new_figure, plain
from mi_lcair.signatures.trend_result import Trend

NEGLIGIBLE = 1e-3  # parts below this share of the largest intensity are not drawn
UNIT = r"W sr$^{-1}$"


def figure(trend: Trend):
    """Figure with three polar panels.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. The last two panels are at
    the elevation nearest to 0.
    """
    elevations = np.unique(trend.table["elevation_deg"])
    level = elevations[np.argmin(np.abs(elevations))]
    at_level = trend.at_elevation(level)
    figure = new_figure((14, 5.6), layout="constrained")
    panels = figure.subplots(1, 3, subplot_kw={"projection": "polar"})
    draw(
        panels[0],
        "by elevation",
        {
            f"elevation {elevation:g}°": (at, at.table["intensity_W_sr"])
            for elevation in elevations
            for at in [trend.at_elevation(elevation)]
        },
    )
    draw(panels[1], f"by what emitted it, elevation {level:g}°", large_parts("group", at_level))
    draw(
        panels[2],
        f"by number of reflections, elevation {level:g}°",
        large_parts("bounce", at_level),
    )
    figure.suptitle(
        f"{plain(f'{trend.scene_name}, {trend.band}')}: intensity of the model by azimuth ({UNIT})",
        fontsize=12,
    )
    return figure


def large_parts(kind: str, trend: Trend) -> dict:
    """Curves, as `draw` takes them, of the parts that are not negligible everywhere.

    `kind` is "group" or "bounce".
    """
    least = NEGLIGIBLE * trend.table["intensity_W_sr"].max()
    parts = trend.parts(kind)
    return {name: (trend, values) for name, values in parts.items() if values.max() > least}


def draw(panel, title: str, curves: dict) -> None:
    """Draw curves in a polar panel: {label: (Trend, values of its views)}."""
    panel.set_theta_zero_location("N")
    for label, (at, values) in curves.items():
        order = np.argsort(at.table["azimuth_deg"])
        azimuth, values = np.radians(at.table["azimuth_deg"][order]), values[order]
        if closes(at.table["azimuth_deg"][order]):
            azimuth, values = (
                np.append(azimuth, azimuth[0] + 2 * np.pi),
                np.append(values, values[0]),
            )
        panel.plot(
            azimuth,
            values,
            linewidth=1.3,
            label=plain(label),
            marker="." if len(values) < 8 else None,
        )
    panel.set_ylim(0, None)
    panel.set_title(title, fontsize=10)
    panel.tick_params(labelsize=8)
    panel.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=4, fontsize=8, frameon=False
    )


def closes(azimuths_deg) -> bool:
    """Whether the azimuths are evenly spaced over a full turn."""
    return len(azimuths_deg) > 2 and np.allclose(
        np.diff(np.append(azimuths_deg, azimuths_deg[0] + 360)), 360 / len(azimuths_deg), atol=1e-6
    )
