"""Sections of a facet's hemispherical view."""

import numpy as np

from mi_lcair.results.sections import Facts, Section, Table

MOST_NEIGHBOURS = 20  # largest number of facets in the table; the others are summed
COLUMNS = ["sees", "group", "material", ("solid angle", "sr"), "view factor"]


def sections(view) -> list[Section]:
    """The facet and its neighbours, those with the largest view factors first."""
    entries, columns = view.as_dict(), view.columns()
    shares = np.stack([columns["solid_angle_sr"], columns["view_factor"]], axis=1)
    names = [columns[name][:-1][:MOST_NEIGHBOURS] for name in ("facet", "group", "material")]
    rows = [[*row, *texts(share)] for *row, share in zip(*names, shares)]
    if rest := len(shares) - 1 - len(rows):
        rows.append([f"{rest} more", "", "", *texts(shares[len(rows) : -1].sum(axis=0))])
    rows += [["nothing", "", "", *texts(shares[-1])], ["all", "", "", *texts(shares.sum(axis=0))]]
    facet = (
        f"{view.facet} of {entries['scene_name']}: {entries['type']}, group {entries['group']}, "
        f"{entries['material']}, {entries['area_m2']:.6g} m^2"
    )
    return [Section("Hemispherical view", [Facts([("facet", facet)]), Table(COLUMNS, rows)])]


def texts(share) -> list[str]:
    """Solid angle and view factor as text."""
    return [f"{number:.6f}" for number in share]
