"""Near pairs kept over searches: a Verlet list (L. Verlet, Phys. Rev. 159, 1967) of candidates and facets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.surfaces._facet_kernels import near_of_list
from fcsim.contact_detection.surfaces.broad_phase import near_pairs

SKIN = 0.05
"""Of a facet's reach by which the list looks farther: a wall's surfaces move by a thousandth of their facets in a hundred steps."""


class _Pairs(NamedTuple):
    """The pairs i, j with |points[i] - centres[j]| <= reach[j] + skin[j] when they were sought, sorted."""

    points: FloatArray
    centres: FloatArray
    reach: FloatArray
    skin: FloatArray
    i: IntArray
    j: IntArray


class VerletList:
    """`near_pairs` of the same points and facets again and again, sorted; what it returns does not depend on earlier searches.

    A tree is asked only where what moved since it was, relative to all points' mean motion, may have brought a pair near that was not in
    the list; the list's pairs are then measured.
    """

    def __init__(self) -> None:
        self._list: _Pairs | None = None

    def __call__(self, points: FloatArray, centres: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs i, j with |points[i] - centres[j]| <= reach[j] for points (np, d), centres (nf, d), reach (nf,) [m]."""
        if not len(points) or not len(centres):
            return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        found = self._list
        if found is None or not _serves(found, points, centres, reach):
            skin = SKIN * reach
            i, j = near_pairs(points, centres, reach + skin)
            order = np.lexsort((j, i))
            found = self._list = _Pairs(points.copy(), centres.copy(), reach.copy(), skin, i[order], j[order])
        if points.shape[1] == 3:
            near: tuple[IntArray, IntArray] = near_of_list(points, centres, reach, found.i, found.j)
            return near
        arm = points[found.i] - centres[found.j]
        within = np.einsum("nd,nd->n", arm, arm) <= (reach * reach)[found.j]
        return found.i[within], found.j[within]


def _serves(found: _Pairs, points: FloatArray, centres: FloatArray, reach: FloatArray) -> bool:
    """Whether all that is near now is in the list: |p - c| <= reach has |p - c| then <= reach now + what p and c moved."""
    if points.shape != found.points.shape or centres.shape != found.centres.shape:
        return False
    moved = points - found.points
    common = moved.mean(axis=0)
    moved, facets = moved - common, centres - found.centres - common
    farthest = np.sqrt(np.einsum("nd,nd->n", moved, moved).max())
    nearer = reach - found.reach + farthest + np.sqrt(np.einsum("nd,nd->n", facets, facets))
    return bool(np.all(nearer <= (1 - 1e-6) * found.skin))  # a hair less: round-off of the distances themselves
