"""48 view factors of an L-shaped room with 8 black surfaces (Pinney and Bean, test 4, BRE 1988).

Reference: quadrature to 1e-9, which View3D confirms to its six decimals. The room is traced with
12 seeds. Intervals are Student's for the 8 randomisations of each.
"""

import tempfile
from pathlib import Path

import numpy as np
from scipy.stats import t

import mi_lcair
from docs.studies.cases.comparison import DATA, Comparison, columns
from mi_lcair import models3d

SEEDS, RAYS = 12, 4096


def factors(exchange, names) -> tuple[np.ndarray, np.ndarray]:
    """View factors between groups, and their half widths, (pairs,) each."""
    groups, facets = exchange.facets.groups, exchange.facets
    area = facets.membership @ facets.area
    runs = np.array([C.by_group(facets).between.toarray() for C in exchange.traced.replicates])
    runs = runs / area[:, None]
    at = tuple(np.array([[groups.index(a), groups.index(b)] for a, b in names]).T)
    values = runs[:, *at]
    half = t.ppf(0.975, len(runs) - 1) * values.std(axis=0, ddof=1) / np.sqrt(len(runs))
    return values.mean(axis=0), half


def compare() -> Comparison:
    """All pairs that see each other, each seed a value."""
    data, computed, half = columns("l_room_view_factors.csv"), [], []
    seen = data["F"] > 0
    pairs = list(zip(data["from"][seen], data["to"][seen]))
    with tempfile.TemporaryDirectory() as name:
        models3d.export(models3d.read(DATA / "l_room.obj"), Path(name) / "room")
        scene = mi_lcair.load(Path(name) / "room" / "scene.xml")
        for seed in range(SEEDS):
            values, widths = factors(mi_lcair.exchange(scene, paths=RAYS, seed=seed), pairs)
            computed.append(values)
            half.append(widths)
    reference = np.tile(data["F"][seen], SEEDS)
    return Comparison(
        "L-shaped room, view factors", "1", np.ravel(computed), reference, np.ravel(half), 5e-3
    )
