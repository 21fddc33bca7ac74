"""Which candidate may be near which facet: trees on points and facet centres, never all pairs."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray


def near_pairs(points: FloatArray, centres: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs with |points[i] - centres[j]| <= reach[j], as arrays i, j.

    points (np, d), centres (nf, d), reach (nf,) [m]. Facets are grouped in classes of like reach (powers of two), a tree each, so that
    one platen among small facets does not pair everything with everything: cost O((np + nf) log + pairs).
    """
    found = [(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))]
    if len(points) and len(centres):
        tree = cKDTree(points, compact_nodes=False, balanced_tree=False)
        size_class = np.floor(np.log2(reach)).astype(np.int64)
        for one in np.unique(size_class):
            facets = np.flatnonzero(size_class == one)
            those = cKDTree(centres[facets], compact_nodes=False, balanced_tree=False)
            near = tree.sparse_distance_matrix(those, reach[facets].max(), output_type="ndarray")
            i, j = near["i"], facets[near["j"]]
            within = near["v"] <= reach[j]
            found.append((i[within], j[within]))
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def near_facets(slave: FloatArray, radius: FloatArray, master: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs with |slave[i] - master[j]| <= reach[j] + a bound of radius[i] less than twice it, as arrays i, j.

    slave (ns, d) centres and radius (ns,) [m] of facets, master (nm, d) and reach (nm,) [m]; slave facets in classes of like radius.
    """
    found = [(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))]
    size_class = np.floor(np.log2(radius)).astype(np.int64)
    for one in np.unique(size_class):
        facets = np.flatnonzero(size_class == one)
        i, j = near_pairs(slave[facets], master, reach + radius[facets].max())
        found.append((facets[i], j))
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])
