"""Sections of a facet's hemispherical view."""

from mi_lcair.results.sections import Facts, Section, Table

MOST_NEIGHBOURS = 20  # largest number of facets in the table; the others are summed
COLUMNS = ["sees", "group", "material", ("solid angle", "sr"), "view factor"]


def sections(view) -> list[Section]:
    """The facet and its neighbours, those with the largest view factors first."""
    entries = view.as_dict()
    *neighbours, nothing = entries["neighbours"]
    rest = neighbours[MOST_NEIGHBOURS:]
    rows = [
        [entry["facet"], entry["group"], entry["material"], *shares(entry)]
        for entry in neighbours[:MOST_NEIGHBOURS]
    ]
    if rest:
        rows.append([f"{len(rest)} more", "", "", *shares(*rest)])
    rows += [["nothing", "", "", *shares(nothing)], ["all", "", "", *shares(entries)]]
    facet = (
        f"{view.facet} of {entries['scene_name']}: {entries['type']}, group {entries['group']}, "
        f"{entries['material']}, {entries['area_m2']:.6g} m^2"
    )
    return [Section("Hemispherical view", [Facts([("facet", facet)]), Table(COLUMNS, rows)])]


def shares(*entries) -> list[str]:
    """Solid angle and view factor of one neighbour, or the sums of several."""
    return [
        f"{sum(entry[name] for entry in entries):.6f}" for name in ("solid_angle_sr", "view_factor")
    ]
