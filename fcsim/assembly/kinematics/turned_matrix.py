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
        self._counts = np.array([len(group.members) * block.size for group, block in zip(groups, self._blocks, strict=True)], dtype=int)
        self._last: tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]] | None = None
        self._indptr, self._indices, self._source, self._size = _pattern(np.concatenate(rows), np.concatenate(columns), free, eliminated)

    def at(self, Q: FloatArray | None, matrices: Mapping[int, FloatArray], beside: sp.csr_array) -> sp.csr_array:
        """The matrix, and after it the block `beside`, as a csr_array with the rotations Q (n_deformable, d, d) of the bodies (None: none
        turns), and of the bodies of nonlinear groups, by the group's number, their blocks (nb, nblocks, d, d)."""
        values, end = np.empty(self._counts.sum() + 1), np.cumsum(self._counts)
        values[-1] = 1.0
        for k, (group, block) in enumerate(zip(self._groups, self._blocks, strict=True)):
            own = values[end[k] - self._counts[k] : end[k]].reshape(len(group.members), *block.shape)
            if group.laws is not None:
                own[:] = matrices[k].reshape(len(own), -1, len(block)).swapaxes(1, 2)
            elif Q is None or not group.turning:
                own[:] = block
            else:
                R = Q[group.members]
                np.matmul(np.einsum("bai,bcj->bacij", R, R).reshape(len(own), len(block), len(block)), block, out=own)
        count = len(self._source)
        data = np.empty(count + len(beside.data))
        np.take(values, self._source, out=data[:count], mode="clip")  # every number is in range; "raise" would copy
        data[count:] = beside.data
        indptr, indices = self._joined(beside)
        n = len(indptr) - 1
        return sp.csr_array((data, indices, indptr), shape=(n, n))

    def _joined(self, beside: sp.csr_array) -> tuple[IntArray, IntArray]:
        """indptr and indices with the block `beside`: the last ones where its pattern is that of the last time."""
        pattern = beside.indptr, beside.indices
        if self._last is None or not all(np.array_equal(a, b) for a, b in zip(self._last[0], pattern, strict=True)):
            indptr = np.concatenate([self._indptr, self._indptr[-1] + beside.indptr[1:]])
            self._last = pattern, (indptr, np.concatenate([self._indices, self._size + beside.indices]))
        return self._last[1]


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
