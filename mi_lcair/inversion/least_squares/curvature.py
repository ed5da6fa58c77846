"""Second derivatives of predictions, learned from the renders that an iteration makes anyway.

The prediction is linear in the blackbody radiances of sources, and their products with material
parameters bend it: a wall's (1 - R) B(T) is the same along a curve of R and T. A step along such a
valley leaves it at once without second derivatives.
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from mi_lcair.inversion.least_squares.prediction import DatumBlock

LARGEST = 30_000_000  # second derivatives of a datum above which they are left out


def bent(block: DatumBlock, other: DatumBlock) -> DatumBlock:
    """A block whose second derivatives explain the first ones at the values of another block.

    Of the derivatives that do, those with the smallest change of what the block knows are taken
    (Powell's symmetric update of quasi-Newton methods, for each value), where they are 0 between
    two temperatures that are followed. The columns are scaled to the same norm before.
    """
    size = len(block.columns) * len(block.measured) * len(block.unknown) ** 2
    is_large = any(sparse.issparse(of.columns[0]) for of in (block, other)) or size > LARGEST
    if is_large or not block.learns_curvature:
        return block
    (u, rate), (other_u, other_rate) = (of.rendered_coordinates for of in (block, other))
    J, other_J = np.array(block.columns) / rate, np.array(other.columns) / other_rate
    known = 0.0 if block.curvature is None else block.curvature
    moved = other_u - u
    missing = other_J - J
    if block.curvature is not None:
        missing -= block.curvature @ moved
    scale = np.linalg.norm(J, axis=(0, 1))
    scale[scale == 0] = 1
    missing, moved = missing / scale, moved * scale
    curved = np.where(block.is_temperature, 0.0, moved)
    squared = curved @ curved
    if squared == 0:
        return block
    y = missing - (missing @ (moved - curved))[..., None] * curved / squared
    outer = y[..., None] * curved
    total = outer + outer.swapaxes(-1, -2)
    total -= (y @ curved)[..., None, None] * np.outer(curved, curved) / squared
    return replace(block, curvature=known + total / squared * np.outer(scale, scale))
