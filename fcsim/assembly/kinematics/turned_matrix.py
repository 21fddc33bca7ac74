"""The deformable bodies' system matrix T (a M + b K) T^T as their frames turn and their tangents change: one pattern, new values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.linear.over_ranks.rows import whole


class TurnedMatrix:
    """Blocks of one matrix a M + b K a group, turned body by body: node blocks B become Q B Q^T = (Q x Q) vec B, one product a body."""

    def __init__(self, groups: tuple[Group, ...], mass: float, stiffness: float, free: BoolArray, eliminated: bool) -> None:
        """free (n_elastic,): degrees of freedom that are not driven; these alone are numbered where driven ones are eliminated, otherwise
        driven ones are rows of the identity."""
        self._groups = groups
        rows, columns, self._blocks = [np.empty(0, dtype=np.int32)], [np.empty(0, dtype=np.int32)], []
        for group in groups:
            d = len(group.rotation)
            if group.laws is None:
                A = sp.bsr_array(sp.csr_array(mass * whole(group.M) + stiffness * whole(group.K)), blocksize=(d, d))
            else:
                graph = group.laws.graph
                A = sp.bsr_array((np.zeros((len(graph.indices), d, d)), graph.indices, graph.indptr))
            i = np.repeat(np.arange(A.shape[0] // d), np.diff(A.indptr))
            a, c = np.divmod(np.arange(d * d), d)
            rows.append((group.first[:, None, None] + d * i + a[:, None]).astype(np.int32).ravel())
            columns.append((group.first[:, None, None] + d * A.indices + c[:, None]).astype(np.int32).ravel())
            self._blocks.append(A.data.reshape(-1, d * d).T.copy())
        self._indptr, self._indices, self._source, self._size = _pattern(np.concatenate(rows), np.concatenate(columns), free, eliminated)

    def at(self, Q: FloatArray | None, matrices: Mapping[int, FloatArray]) -> sp.csr_array:
        """The matrix as a csr_array with the rotations Q (n_deformable, d, d) of the bodies (None: none turns), and of the bodies of
        nonlinear
        groups, by the group's number, their blocks (nb, nblocks, d, d)."""
        values = []
        for k, (group, block) in enumerate(zip(self._groups, self._blocks, strict=True)):
            if group.laws is not None:
                values.append(matrices[k].reshape(len(group.members), -1, len(block)).swapaxes(1, 2).ravel())
                continue
            if Q is None or not group.turning:
                values.append(np.tile(block.ravel(), len(group.members)))
                continue
            own = Q[group.members]
            values.append((np.einsum("bai,bcj->bacij", own, own).reshape(len(own), len(block), len(block)) @ block).ravel())
        data = np.take(np.concatenate([*values, np.ones(1)]), self._source)
        return sp.csr_array((data, self._indices, self._indptr), shape=(self._size, self._size))


def _pattern(rows: IntArray, columns: IntArray, free: BoolArray, eliminated: bool) -> tuple[IntArray, IntArray, IntArray, int]:
    """indptr and indices of the matrix, where each of its values stands among the bodies' (the last: a one), and its size."""
    kept = np.flatnonzero(free[rows] & free[columns])
    source, i, j, n = kept, rows[kept], columns[kept], len(free)
    if eliminated:
        number = np.cumsum(free) - 1
        i, j, n = number[i].astype(rows.dtype), number[j].astype(rows.dtype), int(np.count_nonzero(free))
    else:
        driven = np.flatnonzero(~free).astype(rows.dtype)
        source = np.concatenate([source, np.full(len(driven), len(rows))])
        i, j = np.concatenate([i, driven]), np.concatenate([j, driven])
    csr = sp.coo_array((source, (i, j)), shape=(n, n)).tocsr()
    return csr.indptr, csr.indices, csr.data, n
