"""Sections of temperatures from a heat balance."""

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.estimate import with_error
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, LongTable, Remarks, Section, Table

TIMES = 8  # rows of the table of intensities


def sections(heat) -> list[Section]:
    """The balance, the groups, what the inputs contribute, the intensity and the facets."""
    facts = [("facets", str(len(heat.facets.number)))]
    if heat.days:
        facts.append(("periodic", f"after {heat.days} days, to {heat.drift_K:.2g} K"))
    facts.append(("residual", f"{heat.residual_W:.2g} W at most in the balance of a facet"))
    parts = [summary_of(heat), Facts(facts), groups(heat)]
    if heat.inputs:
        parts.append(inputs(heat))
    if heat.intensity:
        parts.append(intensities(heat))
    parts += [Remarks(list(heat.remarks)), LongTable(heat.columns(), sort_by="temperature_K")]
    return [Section("Temperatures", parts)]


def groups(heat) -> Table:
    """Mean temperature of each group, its error, and when it is reached."""
    mean, error = heat.means.value, heat.means.standard_error
    area = heat.facets.membership @ heat.facets.area
    rows = []
    for g, group in enumerate(heat.facets.groups):
        ends = (
            [mean[:, g].argmax()] if heat.is_steady else [mean[:, g].argmin(), mean[:, g].argmax()]
        )
        cells = [with_error(mean[k, g], error[k, g]) for k in ends]
        if not heat.is_steady:
            cells = [f"{cell}, {clock(heat.hours[k])}" for cell, k in zip(cells, ends)]
        rows.append((group, f"{area[g]:.4g}", *cells))
    ends = ["temperature K"] if heat.is_steady else ["lowest K, hour", "highest K, hour"]
    return Table(["group", "area m2", *ends], rows)


def clock(hours: float) -> str:
    """Hours of a day as 07:30."""
    minutes = round(hours * 60)
    return f"{minutes // 60:02}:{minutes % 60:02}"


def inputs(heat) -> Table:
    """What the inputs contribute to the temperatures, at the time of the warmest facet."""
    k = heat.row()
    area = heat.facets.area / heat.facets.area.sum()
    squares = [area @ row.contribution[k] ** 2 for row in heat.estimate.contributions]
    total, rows = sum(squares) or 1.0, []  # 0 if all is held
    for row, square in zip(heat.estimate.contributions, squares):
        change, is_input = row.contribution[k], row.sigma is not None
        stated = row.sigma if isinstance(row.sigma, str) else f"{row.sigma or 0:g}"
        stated, mean = (stated, f"{area @ change:+.3g}") if is_input else ("paths", "")
        rows.append(
            (row.quantity, stated, mean, f"{abs(change).max():.3g}", percent(square / total))
        )
    rows.append(rows.pop(0))  # the noise of the exchange comes last
    return Table(["input", "sigma", "mean dT K", "largest K", "share"], rows)


def intensities(heat) -> Table:
    """The intensity at some times, with its standard uncertainty."""
    rows = []
    for k in np.unique(np.linspace(0, len(heat.seconds) - 1, TIMES).round().astype(int)):
        value, sigma = heat.intensity.value[k], heat.intensity.standard_error[k]
        rows.append((clock(heat.hours[k]), f"{value:.5g}", f"{sigma:.2g}", percent(sigma / value)))
    return Table(["hour", f"{heat.band} W/sr", "sigma", "relative"], rows)
