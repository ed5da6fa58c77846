"""Sections of a trend."""

from functools import partial

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.reports.page.line_panel import line_panel
from mi_lcair.reports.pictures.trend import charts
from mi_lcair.results.cells import error_row
from mi_lcair.results.sections import Drawing, Facts, LongTable, Remarks, Section, Table

COLUMNS = [
    "elevation", "views", ("least", "W sr-1"), "at azimuth", ("mean", "W sr-1"),
    ("greatest", "W sr-1"), "at azimuth",
]  # fmt: skip


def sections(trend) -> list[Section]:
    """Extremes by elevation, polar curves and the table of a trend."""
    elevations = dict.fromkeys(np.asarray(trend.table["elevation_deg"]).tolist())
    parts = [
        f"Band {trend.band or 'not stated'}. Azimuth 0° sees the nose, 90° the left side. Shaded "
        "bands are 95 % intervals of the intensity; its parts have none in the table.",
        Table(COLUMNS, [extremes(trend.at_elevation(angle), angle) for angle in elevations]),
    ]
    if {"half_width_W_sr", "reached"} <= trend.table.keys():
        parts.append(Facts([accuracy(trend)]))
    invalid = np.any(trend.table.get("invalid", 0))
    remark = "some samples were NaN or infinite and count as 0; see column invalid"
    parts += [
        Remarks([remark] if invalid else []),
        Drawing(partial(polar_curves, trend)),
        LongTable(trend.columns()),
    ]
    return [Section("Intensity by aspect", parts)]


def polar_curves(trend):
    """The panel of the polar charts of a trend."""
    return line_panel(charts(trend), across=True)


def accuracy(trend) -> tuple[str, str]:
    """Row about the widest 95 % interval, and about the tolerance if there is one."""
    views = len(trend.table["reached"])
    widest = f"+- {percent(trend.widest)}" if np.isfinite(trend.widest) else "as wide as it"
    return error_row(
        f"the widest 95 % interval is {widest} of the intensity",
        trend.tolerance,
        not trend.missed,
        where=f"in {trend.missed or views} of {views} views",
    )


def extremes(trend, elevation: float) -> list:
    """Row of the table: least, mean and greatest intensity of a trend at one elevation."""
    azimuth, intensity = trend.table["azimuth_deg"], trend.table["intensity_W_sr"]
    low, high = intensity.argmin(), intensity.argmax()
    return [
        f"{elevation:g}",
        len(azimuth),
        f"{intensity[low]:.5g}",
        f"{azimuth[low]:g}",
        f"{intensity.mean():.5g}",
        f"{intensity[high]:.5g}",
        f"{azimuth[high]:g}",
    ]
