"""Whether pixels that an estimate left out lie together, as dead ones do not."""

import numpy as np
from scipy import ndimage, stats

from mi_lcair.knowing.inversion.data.datum import Datum
from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock
from mi_lcair.physics.estimation.verdicts import SIGNIFICANCE

NEIGHBOURS = np.ones((3, 3), dtype=bool)


def gathering(datum: Datum, block: DatumBlock) -> str | None:
    """Where the pixels that were left out gather, in words; None if they are scattered.

    Dead pixels are anywhere. A scene that is wrong leaves out pixels side by side, of one group,
    or at the edges of groups. Each probability is that of pixels at random places.
    """
    if not datum.is_image or not (is_bad := block.weight == 0).any():
        return None
    bad = np.zeros(datum.counts.shape, dtype=bool)
    bad[datum.counts] = is_bad
    number, count = int(is_bad.sum()), len(is_bad)
    beside = (ndimage.convolve(bad.astype(int), NEIGHBOURS, mode="constant")[bad] - 1).sum() / 2
    expected = number * (number - 1) / 2 * (NEIGHBOURS.size - 1) / max(count - 1, 1)
    chances = {"lie side by side": float(stats.poisson.sf(beside - 1, expected))}
    for where, of in places(datum).items():
        chance = stats.hypergeom.sf(is_bad[of].sum() - 1, count, of.sum(), number)
        chances[f"lie {where}"] = float(chance)
    words, least = min(chances.items(), key=lambda item: item[1])
    return words if least * len(chances) < SIGNIFICANCE else None


def places(datum: Datum) -> dict[str, np.ndarray]:
    """Pixels, (n,) of bool, that mostly show each group, and those at the edges of groups."""
    if not datum.shares:
        return {}
    most = np.argmax(list(datum.shares.values()), axis=0)
    labels = np.full(datum.counts.shape, -1)
    labels[datum.counts] = most
    is_edge = ndimage.maximum_filter(labels, 3) != ndimage.minimum_filter(labels, 3)
    of_groups = {f"on {g}": most == k for k, g in enumerate(datum.shares) if (most == k).any()}
    return of_groups | {"at the edges of groups": is_edge[datum.counts]}
