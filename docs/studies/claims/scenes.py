"""The kinds of scenes, and the case of a seed and a number."""

from collections.abc import Callable

import numpy as np

from docs.studies.claims import bodies, combined, enclosed, lit, seen
from docs.studies.claims.case import Case, Draw, Unsuitable

KINDS = {
    lit.lamp: 5,  # how often, relative to the others
    combined.combined: 8,
    lit.in_mirror: 1,
    lit.ball: 1,
    lit.box: 2,
    lit.keyhole: 1,
    lit.shadow: 1,
    seen.stripes: 2,
    seen.specks: 2,
    seen.layers: 3,
    seen.mirrored: 1,
    enclosed.cavity: 2,
    enclosed.nested: 2,
    enclosed.furnace: 1,
    enclosed.part: 2,
    bodies.body: 6,
}
DARKEST = 1e-9  # least mean radiance of a scene; Float32 underflows at 1e-38 [W m^-2 sr^-1]


def case(seed: int, number: int, draw: Callable[..., Draw] = Draw) -> Case:
    """The case of a number; it is the same for the same seed, whatever the other cases are.

    draw: makes the random choices of a case from their generator.
    """
    rng = np.random.default_rng([seed, number])
    kinds, weights = list(KINDS), np.array(list(KINDS.values()), float)
    while True:
        kind = kinds[rng.choice(len(kinds), p=weights / weights.sum())]
        try:
            result = kind(draw(rng))
        except Unsuitable:
            continue
        if result.mean > DARKEST:
            return result
