"""Which candidate may be near which facet: trees on points and facet centres, never all pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PairList:
    """Possible pairs (candidate, facet), valid while nothing has moved far (a Verlet list).

    candidate, facet (np,); positions (nodes, d) [m] where it was made; skin [m], how much two points may have come closer since.
    """

    candidate: IntArray
    facet: IntArray
    positions: FloatArray
    skin: float

    def covers(self, positions: FloatArray) -> bool:
        """Whether no node has moved more than half the skin, so that every pair within reach at `positions` is in the list."""
        move = positions - self.positions
        return bool(4.0 * np.einsum("nd,nd->n", move, move).max(initial=0.0) <= self.skin**2)


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
