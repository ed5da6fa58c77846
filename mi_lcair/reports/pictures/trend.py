"""Polar plot of a trend: by elevation, by emitting group, and by number of reflections."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.signatures.trend_result import Trend

NEGLIGIBLE = 1e-3  # parts below this share of the largest intensity are not drawn
KINDS = {"group": "by what emitted it", "bounce": "by number of reflections"}
UNIT = r"W sr$^{-1}$"


@styled
def figure(trend: Trend):
    """Figure with three polar panels.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. The last two panels are at
    the elevation nearest to 0.
    """
    elevations, level = elevations_of(trend)
    at_level = trend.at_elevation(elevations[level])
    figure = new_figure((14, 5.6), layout="constrained")
    panels = figure.subplots(1, 3, subplot_kw={"projection": "polar"})
    curves = {}
    for elevation in elevations:
        at = trend.at_elevation(elevation)
        curves[f"elevation {elevation:g}°"] = closed(at, at.table["intensity_W_sr"])
    draw(panels[0], "by elevation", curves)
    for panel, (kind, words) in zip(panels[1:], KINDS.items()):
        draw(panel, f"{words}, elevation {elevations[level]:g}°", large_parts(at_level, kind))
    figure.suptitle(
        f"{plain(f'{trend.scene_name}, {trend.band}')}: intensity of the model by azimuth ({UNIT})"
    )
    return figure


def elevations_of(trend: Trend) -> tuple[np.ndarray, int]:
    """Elevations of a trend, degrees, and the number of the one nearest to 0."""
    elevations = np.unique(trend.table["elevation_deg"])
    return elevations, int(np.argmin(np.abs(elevations)))


def closed(at: Trend, *columns: np.ndarray) -> list[np.ndarray]:
    """Azimuths, degrees, and columns of a trend at one elevation, in the order of the azimuths.

    The first view is repeated at the end of an even full turn.
    """
    azimuth = np.asarray(at.table["azimuth_deg"], float)
    order = np.argsort(azimuth, kind="stable")
    azimuth, *columns = (np.asarray(values, float)[order] for values in (azimuth, *columns))
    steps = np.diff(np.append(azimuth, azimuth[0] + 360))
    if len(azimuth) > 2 and np.allclose(steps, 360 / len(azimuth), atol=1e-6):
        azimuth = np.append(azimuth, azimuth[0] + 360)
        columns = [np.append(values, values[0]) for values in columns]
    return [azimuth, *columns]


def large_parts(at: Trend, kind: str) -> dict[str, list[np.ndarray]]:
    """Curves of the parts of a trend at one elevation that are not negligible everywhere.

    `kind` is "group" or "bounce". Each curve is as `closed` gives it.
    """
    least = NEGLIGIBLE * np.nanmax(at.table["intensity_W_sr"])
    return {
        name: closed(at, values)
        for name, values in at.parts(kind).items()
        if np.nanmax(values, initial=0) > least
    }


def draw(panel, title: str, curves: dict) -> None:
    """Draw curves in a polar panel: {label: [azimuths in degrees, values]}."""
    panel.set_theta_zero_location("N")
    for label, (azimuth, values) in curves.items():
        panel.plot(
            np.radians(azimuth),
            values,
            linewidth=1.3,
            label=plain(label),
            marker="." if len(values) < 8 else None,
        )
    panel.set(ylim=(0, None), title=title)
    panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=4)
