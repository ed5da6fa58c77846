"""Which shapes of a scene are closed, so that whoever sees their backs is inside a body."""

import numpy as np
from scipy import sparse

from mi_lcair.models3d.coincident import unique_rows
from mi_lcair.rendering.facets.table import FacetTable

ROUND = ("Sphere", "Ellipsoids")  # shapes without triangles that are closed


def closed_shapes(table: FacetTable, shapes: list, one_sided: np.ndarray) -> np.ndarray:
    """Whether each shape is part of a closed surface, (shapes,).

    A closed surface has a triangle on both sides of each edge, which run through the edge in
    opposite directions. one_sided: whether each shape is; only these are put together.
    """
    shape = table.shape_index[table.triangle_facet]
    closed = np.array([shape.class_name() in ROUND for shape in shapes])
    closed[np.unique(shape)] = True
    used = one_sided[shape]
    if used.any():
        owner = np.repeat(shape[used], 3)
        _, corner = unique_rows(table.triangles[used].reshape(-1, 3))
        start, end = corner, np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
        edges = sparse.csr_array((np.ones(len(start)), (start, end)))
        surplus = (edges - edges.T)[start, end]
        closed[owner[surplus != 0]] = False
    return closed
