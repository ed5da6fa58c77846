"""One vertex for each position, over the whole model: without it no facet would know its
neighbours.
"""

import numpy as np

TOLERANCE = 1e-6  # as a fraction of the model's extent


def weld(vertices):
    """Which vertex (V,) stands for each of vertices (V, 3): the first at its position or within
    TOLERANCE of it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    firsts, position = unique_rows(vertices)
    extent = np.ptp(vertices, axis=0).max()
    near = cKDTree(vertices[firsts], balanced_tree=False, compact_nodes=False).query_pairs(
        TOLERANCE * extent, output_type="ndarray"
    )
    if len(near) == 0:
        return firsts[position]
    links = coo_array((np.ones(len(near), bool), near.T), shape=(len(firsts), len(firsts)))
    _, cluster = connected_components(links, directed=False)
    first_of_cluster = np.full(cluster.max() + 1, len(vertices))
    np.minimum.at(first_of_cluster, cluster, firsts)
    return first_of_cluster[cluster][position]


def unique_rows(rows):
    """The first index of each different row of an array (M, n), and which of these rows (M,) each
    one equals.

    As np.unique with axis=0, which is several times slower.
    """
    order = np.lexsort(rows.T)
    in_order = rows[order]
    starts = np.ones(len(rows), bool)
    starts[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    inverse = np.empty(len(rows), int)
    inverse[order] = np.cumsum(starts) - 1
    return order[starts], inverse  # lexsort is stable, so that the first of equals comes first
