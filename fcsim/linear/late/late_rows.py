"""Block rows whose entries are made when they are first read: products and parts come from what they are made of, at less cost."""

from __future__ import annotations

import threading
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray, Matrix

_making = threading.Lock()


class Source(Protocol):
    """What the entries of a square matrix A by blocks (d, d) are made of."""

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """A x + q (m,)."""
        ...

    def diagonal_blocks(self) -> FloatArray:
        """The blocks A_aa (m / d, d, d)."""
        ...

    def part(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """The block rows `rows` and block columns `columns` of A, dense, in C order."""
        ...

    def finite(self) -> bool:
        """Whether no number that A is made of is infinite or NaN."""
        ...

    def entries(self) -> FloatArray:
        """The blocks (nnz, d, d) in the order of the pattern."""
        ...


class LateRows(sp.bsr_array):
    """Sorted block rows (bsr) of a pattern that is known and of entries that `source` makes when `data` is first read.

    Products with a vector, the diagonal and `part` always come from the source: their bits do not depend on whether entries were read. An
    array that is derived from this one, or whose `data` is replaced, has entries alone, and no source.
    """

    _source: Source | None = None
    _entries: FloatArray | None = None

    @classmethod
    def of(cls, source: Source, indptr: NDArray[np.integer], indices: NDArray[np.integer], size: int, d: int) -> LateRows:
        """The matrix (size, size) of blocks (d, d) with the pattern of sorted block rows."""
        empty = np.broadcast_to(np.zeros(1), (len(indices), d, d))  # takes no memory; nobody reads it
        rows = cls((empty, indices, indptr), shape=(size, size), blocksize=(d, d))
        if rows.indices.dtype == indices.dtype:
            rows.indices = indices  # SciPy has a view of it, which nobody could tell for the same pattern
        rows._source, rows._entries, rows._block = source, None, d
        rows.has_sorted_indices = True
        return rows

    @property
    def source(self) -> Source | None:
        return self._source

    @property
    def data(self) -> FloatArray:
        """The blocks (nnz, d, d)."""
        if self._entries is None and self._source is not None:
            with _making:  # the next step and a step's files may ask at once
                if self._entries is None:
                    self._entries = self._source.entries()
        return self._entries  # type: ignore[return-value] # made above, where there is a source, else given

    @data.setter
    def data(self, values: FloatArray) -> None:
        self._source, self._entries = None, values

    @property
    def blocksize(self) -> tuple[int, int]:
        return self.data.shape[1:] if self._source is None else (self._block, self._block)

    @property
    def dtype(self) -> np.dtype[np.float64]:
        return self.data.dtype if self._source is None else np.dtype(np.float64)

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """A x + q (m,) for x and q (m,)."""
        return super().__matmul__(x) + q if self._source is None else self._source.affine(x, q)

    def __matmul__(self, x: FloatArray) -> FloatArray:
        if self._source is not None and isinstance(x, np.ndarray) and x.ndim == 1 and x.dtype == np.float64 and len(x) == self.shape[1]:
            return self._source.affine(x, np.zeros(self.shape[0]))
        return super().__matmul__(x)

    def diagonal(self, k: int = 0) -> FloatArray:
        if self._source is None or k:
            return super().diagonal(k)
        return np.einsum("aii->ai", self._source.diagonal_blocks()).ravel()


def source_of(W: Matrix) -> Source | None:
    """What W's entries are made of, where it is of such rows."""
    return W.source if isinstance(W, LateRows) else None


def in_blocks(W: sp.sparray, d: int) -> sp.bsr_array:
    """Sparse W by blocks (d, d): itself where its entries are made late, else a bsr_array that may share its arrays."""
    return W if isinstance(W, LateRows) and W.blocksize == (d, d) else sp.bsr_array(W, blocksize=(d, d))
