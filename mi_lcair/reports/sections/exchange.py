"""Sections of the exchange of heat between facets."""

from itertools import combinations

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.heating.conductors import RINGS_DEG, standard_error
from mi_lcair.results.charts import facets_section
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, Remarks, Section, Table

PARTS = ("sky", "ground", "itself", "other groups")  # of what a group emits


def sections(result) -> list[Section]:
    """Shares of the groups, the conductors between them, their sky by elevation, and facets."""
    M, names = result.facets.membership, result.facets.groups
    emitted = M @ result.facets.emitting_area
    areas = result.by_group(lambda C: np.transpose([*C.parts.values()]))
    shares = zip(*(area / emitted[:, None] for area in areas))
    astray = {k: result.facets.share_of_groups(v) for k, v in result.astray.items()}
    counts, area = M.sum(axis=1).astype(int), M @ result.facets.area
    groups = Table(
        ["group", "facets", ("area", "m2"), "emissivity", *PARTS, "inside bodies"],
        [
            (name, count, size, eps, *zip(*share), inside)
            for name, count, size, eps, share, inside in zip(
                names,
                counts,
                area,
                emitted / (M @ result.facets.radiating_area),
                shares,
                astray["buried"],
            )
        ],
    )
    GR, error = result.by_group(lambda C: C.between.toarray())
    pairs = Table(
        ["group", "and", ("conductor", "m2"), "difference of the two directions", "z"],
        [
            (
                names[a],
                names[b],
                (GR[a, b], error[a, b]),
                percent(result.asymmetry.relative[a, b]),
                f"{result.asymmetry.z[a, b]:.1f}",
            )
            for a, b in combinations(range(len(names)), 2)
            if GR[a, b]
        ],
    )
    facts = [
        ("left after the last reflection", percent(astray["truncated"].max())),
        ("on surfaces that take no part", percent(astray["lost"].max())),
    ]
    parts = [summary_of(result), groups, *([pairs] if pairs.rows else []), Facts(facts)]
    parts += [sky_table(result, emitted), *sun_table(result), Remarks(list(result.remarks))]
    drawn = np.isin(result.facets.number, result.triangle_facet)  # a sphere has no triangles
    columns = {name: values[drawn] for name, values in result.columns().items()}
    model = (result.triangles, result.triangle_facet) if drawn.any() else None
    return [Section("Exchange of heat", parts), facets_section(columns, model)]


def sky_table(result, emitted: np.ndarray) -> Table:
    """What reaches the rings of the sky of what each group emits."""
    to_sky, error = (area / emitted[:, None] for area in result.by_group(lambda C: C.to_sky))
    rings = [f"{low:g}-{high:g} deg" for low, high in zip(RINGS_DEG, RINGS_DEG[1:])]
    rows = [
        (name, *zip(values, errors))
        for name, values, errors in zip(result.facets.groups, to_sky, error)
    ]
    return Table(["sky at elevations of", *rings], rows)


def sun_table(result) -> list[Table]:
    """Areas by which the groups absorb sunlight."""
    if result.sun is None:
        return []
    M = result.facets.membership
    names = {"lit": "lit", "direct": "absorbs directly", "reflected": "absorbs after reflections"}
    columns = []
    for name in names:
        runs = (M @ getattr(result.sun, name)[:, 0].T).T
        columns.append(list(zip(runs.mean(axis=0), standard_error(runs))))
    head = ["sunlight", *((words, "m2") for words in names.values())]
    return [Table(head, list(zip(result.facets.groups, *columns)))]
