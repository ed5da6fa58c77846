"""Welding: facets that touch get common vertices, from which their neighbours are found."""

import numpy as np

TOLERANCE = 1e-6  # distance at which vertices count as equal, as a fraction of the extent


def weld(vertices):
    """Index (V,) of the vertex that replaces each vertex (V, 3).

    It is the first vertex at the same position or within TOLERANCE of it.
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
    """Index of the first occurrence of each different row, and for each row its number (M,).

    rows: (M, n). The function does the same as np.unique with axis=0 and is several times faster.
    """
    order = np.lexsort(rows.T)
    in_order = rows[order]
    starts = np.ones(len(rows), bool)
    starts[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    inverse = np.empty(len(rows), int)
    inverse[order] = np.cumsum(starts) - 1
    # lexsort is stable, so the first one of equal rows comes first
    return order[starts], inverse
