"""Pressures that follow deformable bodies: forces on the faces as they stand, and what they add to the bodies' stiffness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.forms.facet_pressure import facet_forces, facet_tangents, nodal_sum
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.following.when import When
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.loads import FollowerPressure, factor_at

RIM = 1e-9
"""Entries of the skew part of the stiffness, relative to the largest of all, that are round-off: inner edges have none."""


class FollowingPressures:
    """The pressures `loads` on deformable bodies; displacements x (n_dofs,) [m], forces (n_dofs,) [N]."""

    def __init__(self, layout: BodyLayout, loads: Sequence[FollowerPressure]) -> None:
        self.loads, self._layout = tuple(loads), layout
        self._facets, self._thickness = list[IntArray](), list[float]()
        for load in loads:
            number = layout.body_number(load.body)
            part = layout.deformable[number].part  # whose facets are those of its cells; contact sees linear ones
            self._facets.append(part.surfaces[load.surface] + layout.node_offset[number])
            self._thickness.append(part.thickness)

    def __bool__(self) -> bool:
        return bool(self.loads)

    def _pressed(self, x: FloatArray, when: When) -> list[tuple[float, IntArray, FloatArray]]:
        """Of each load -p t, its facets (nf, k) and where their nodes stand (nf, k, d)."""
        layout, d = self._layout, self._layout.dimension
        count = layout.n_elastic // d
        points = layout.reference[:count] + x[: layout.n_elastic].reshape(-1, d)
        found = []
        for load, thickness, facets in zip(self.loads, self._thickness, self._facets, strict=True):
            factor = when.share * factor_at(load, when.end) + (1 - when.share) * factor_at(load, when.begin)
            found.append((-load.pressure * factor * thickness, facets, points[facets]))
        return found

    def force(self, x: FloatArray, when: When) -> FloatArray:
        """F (n_dofs,)."""
        total, d = np.zeros(self._layout.n_dofs), self._layout.dimension
        count = self._layout.n_elastic // d
        for strength, facets, points in self._pressed(x, when):
            total[: count * d] += strength * nodal_sum(facet_forces(points), facets, count).ravel()
        return total

    def with_blocks(self, x: FloatArray, when: When, groups: Sequence[Group], blocks: Sequence[FloatArray], w: float) -> list[FloatArray]:
        """The blocks (nb, nblocks, d, d) of groups of nonlinear bodies less w times the symmetric part of dF/dx: the derivative of
        F_int - F as far as factors of symmetric matrices go."""
        own = [group_blocks.copy() for group_blocks in blocks]
        for (strength, facets, points), load in zip(self._pressed(x, when), self.loads, strict=True):
            number = self._layout.body_number(load.body)
            for group, values in zip(groups, own, strict=True):
                if group.laws is None or number not in group.members:
                    continue
                graph, first = group.laws.graph, int(self._layout.node_offset[number])
                rows = np.repeat(np.arange(len(graph.indptr) - 1), np.diff(graph.indptr))
                count = len(graph.indptr) - 1
                wanted = (facets[:, :, None] - first) * count + (facets[:, None, :] - first)
                place = np.searchsorted(rows * count + graph.indices, wanted)
                K = strength * facet_tangents(points)
                K = 0.5 * (K + K.transpose(0, 2, 1, 4, 3))
                np.subtract.at(values[int(np.flatnonzero(group.members == number)[0])], place, w * K)
        return own

    def skew(self, x: FloatArray, when: When) -> sp.csr_array:
        """The part of dF/dx (n_dofs, n_dofs) that is not symmetric, of the surfaces' rims."""
        n = self._layout.n_dofs
        total = sp.csr_array((n, n))
        for strength, facets, points in self._pressed(x, when):
            total = total + strength * _skew(facet_tangents(points), facets, n)
        return total

    def derivative(self, x: FloatArray, when: When) -> sp.csr_array:
        """dF/dx (n_dofs, n_dofs)."""
        n = self._layout.n_dofs
        total = sp.csr_array((n, n))
        for strength, facets, points in self._pressed(x, when):
            total = total + strength * _sum(facet_tangents(points), facets, n)
        return total

    @property
    def nodes(self) -> IntArray:
        """Numbers of the nodes of the surfaces."""
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *(facets.ravel() for facets in self._facets)]))

    @property
    def rims(self) -> IntArray:
        """Numbers of the nodes on the rims of the surfaces."""
        n, d = self._layout.n_dofs, self._layout.dimension
        found = [np.empty(0, dtype=np.int64)]
        for _, facets, points in self._pressed(np.zeros(n), When.at(0.0)):
            found.append(_skew(facet_tangents(points), facets, n).indices.astype(np.int64) // d)
        return np.unique(np.concatenate(found))


def _sum(K: FloatArray, facets: IntArray, n: int) -> sp.csr_array:
    """The sum (n, n) of the facets' K (nf, k, k, d, d)."""
    d = K.shape[-1]
    axes = np.arange(d)
    rows = np.broadcast_to(d * facets[:, :, None, None, None] + axes[:, None], K.shape)
    columns = np.broadcast_to(d * facets[:, None, :, None, None] + axes, K.shape)
    return sp.csr_array((K.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))


def _skew(K: FloatArray, facets: IntArray, n: int) -> sp.csr_array:
    """(A - A^T) / 2 (n, n) of the sum A of the facets' K (nf, k, k, d, d); what cancels is left out."""
    A = _sum(K, facets, n)
    S = sp.csr_array(0.5 * (A - A.T))
    S.data[np.abs(S.data) <= RIM * np.abs(K).max(initial=0.0)] = 0
    S.eliminate_zeros()
    return S
