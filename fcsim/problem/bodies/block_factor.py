"""Factors of a block diagonal M, body by body as its graph tells them: M^-1, W = H^T M^-1 H and what each body has of W."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray, Matrix
from fcsim.errors import InputError
from fcsim.linear import storage
from fcsim.linear.factors import DenseCholesky, DenseLU, Factor, SingularMatrix, factorise, inverse_on, is_symmetric
from fcsim.linear.singularity import refuse_singular
from fcsim.linear.small_blocks import small_blocks
from fcsim.problem._reduction_kernels import alike_in_contacts, asymmetry, block_of, connected_components, equal_blocks
from fcsim.problem.bodies.shares import BodyShares, Run, shares_of
from fcsim.problem.delassus_sum import DelassusSum

EQUAL = 1e-13
"""Blocks of M whose entries differ by less, relative to the largest, are one body's (5e-15 to 1e-14 between the blocks of a wall)."""


@dataclass(frozen=True)
class _Block:
    """Degrees of freedom of the components that share one factor: dofs (copies, size), in the factor's order."""

    dofs: IntArray
    factor: Factor

    def compliance(self, surface: IntArray) -> FloatArray:
        """A^-1 on the unknowns `surface` (k,) of one copy, (k, k); of a Cholesky factor its last ones."""
        if isinstance(self.factor, DenseCholesky):
            return self.factor.inverse_on_last(len(surface))
        return inverse_on(surface, self.factor, self.dofs.shape[1])


@dataclass(frozen=True)
class _Places:
    """Which body each unknown (n,) is of, and which unknown of its compliance; `count` bodies: those of `blocks` with their first numbers
    and the unknowns that H touches, small ones from `begins` on, and last unknowns coupled to nothing, body k of group[k]:group[k + 1]."""

    body: IntArray
    column: IntArray
    count: int
    blocks: list[tuple[int, _Block, IntArray]]
    begins: list[int]
    group: IntArray


class BlockFactor:
    """Factor of a block diagonal sparse matrix A whose blocks are found as connected components; equal blocks are factored once,
    small ones (`small_blocks`) each for itself.

    Copies of a body that stand elsewhere were assembled with other round-off: blocks that differ by no more than that (`EQUAL`) share
    a factor too, and `solve` then corrects x by the residual of A itself.
    """

    def __init__(self, A: Matrix, touched: BoolArray | None = None) -> None:
        """touched (n,): degrees of freedom on which A^-1 will be asked for by `delassus`; it is the cheaper for knowing them."""
        if isinstance(A, np.ndarray) or A.format not in ("csr", "csc"):
            A = sp.csr_array(A)
        if not A.has_sorted_indices:
            A = A.sorted_indices()
        self.n = A.shape[0]
        arrays = A.indptr, A.indices, A.data  # by rows or by columns, which is all the same up to the blocks' storage
        dofs, start, place = connected_components(A.indptr, A.indices)
        size = np.diff(start)
        self._single = dofs[start[:-1][size == 1]]
        self._inverse_diagonal = 1 / _diagonal(A, self._single)
        self._small, taken = small_blocks(arrays, dofs, start, place)
        kind, exact = equal_blocks(*arrays, dofs, start, place, (size > 1) & ~taken, EQUAL)
        self.blocks = []
        for k in range(kind.max(initial=-1) + 1):
            copies = np.flatnonzero(kind == k)
            own = dofs[start[copies, None] + np.arange(size[copies[0]])]
            if touched is not None:
                last = touched[own].any(axis=0)  # eliminated last: see inverse_on_last
                own = np.take(own, np.argsort(last, kind="stable"), axis=1)
            starts, indices, values = block_of(*arrays, own[0], place)
            self.blocks.append(_Block(own, _factor(type(A)((values, indices, starts), shape=(len(own[0]), len(own[0]))))))
        self._refined = None if exact else A

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return A^-1 rhs for rhs (n,) or (n, k)."""
        x = self._solve(rhs)
        if self._refined is not None:
            x += self._solve(rhs - self._refined @ x)
        return x

    def _solve(self, rhs: FloatArray) -> FloatArray:
        columns = rhs.reshape(self.n, rhs.size // self.n if self.n else 0)
        x = np.empty_like(columns)
        x[self._single] = self._inverse_diagonal[:, None] * columns[self._single]
        for small in self._small:
            small.solve(columns, x)
        for block in self.blocks:
            copies, size = block.dofs.shape
            stacked = columns[block.dofs].transpose(0, 2, 1).reshape(-1, size).T  # (size, copies k) in LAPACK's order
            x[block.dofs] = block.factor.solve(stacked).T.reshape(copies, -1, size).transpose(0, 2, 1)
        return x.reshape(rhs.shape)

    def delassus(self, H: sp.sparray, dimension: int) -> Matrix:
        """Return W = H^T A^-1 H (m, m) for sparse H (n, m)."""
        H = H.tocsc()
        found = self._places(H, dimension)
        W = DelassusSum(H, found.body, found.column, found.count, dimension, rigid=not self.blocks)
        for begin, block, surface in found.blocks:
            copies = np.zeros(len(block.dofs), dtype=np.int64)
            W.add(begin, block.compliance(surface)[None], copies, symmetric=isinstance(block.factor, DenseCholesky))
        for begin, small in zip(found.begins, self._small, strict=True):
            W.add(begin, small.inverses, np.arange(len(small.inverses)))
        if len(self._single):
            W.add_diagonal(found.count - len(found.group) + 1, self._inverse_diagonal, found.group)
        return W.matrix()

    def shares(self, H: sp.sparray, dimension: int) -> Callable[[], BodyShares]:
        """What makes the bodies' shares of W = H^T A^-1 H; InputError by it where A is not symmetric."""

        def make() -> BodyShares:
            own = H.tocsc()
            found = self._places(own, dimension)
            runs: list[Run] = []
            for begin, block, surface in found.blocks:
                C = block.compliance(surface)
                if not isinstance(block.factor, DenseCholesky):
                    if not is_symmetric(C):
                        raise InputError(
                            "M: expected a symmetric matrix where W is split by bodies (linear='two-level'), got one that is not"
                        )
                    C = 0.5 * (C + C.T)
                runs.append((begin, C[None], np.zeros(len(block.dofs), dtype=np.int64)))
            for begin, small in zip(found.begins, self._small, strict=True):
                runs.append((begin, small.inverses, np.arange(len(small.inverses))))
            begin = found.count - len(found.group) + 1
            for k, (i, j) in enumerate(pairwise(found.group)):
                runs.append((begin + k, np.diag(self._inverse_diagonal[i:j])[None], np.zeros(1, dtype=np.int64)))
            return shares_of(own, found.body, found.column, found.count, dimension, tuple(runs))

        return make

    def _places(self, H: sp.csc_array, d: int) -> _Places:
        """Where the unknowns that H touches stand among the bodies."""
        touched = np.zeros(self.n, dtype=bool)
        touched[H.indices] = True
        body, column = np.empty(self.n, dtype=np.int64), np.empty(self.n, dtype=np.int64)  # where H touches them
        blocks, count = [], 0
        for block in self.blocks:
            copies, size = block.dofs.shape
            surface = np.flatnonzero(touched[block.dofs].any(axis=0))
            if len(surface):
                if isinstance(block.factor, DenseCholesky):
                    surface = np.arange(surface[0], size)
                body[block.dofs] = np.arange(count, count + copies)[:, None]
                column[block.dofs[:, surface]] = np.arange(len(surface))
                blocks.append((count, block, surface))
                count += copies
        begins = []
        for small in self._small:
            copies, size = small.unknowns.shape
            body[small.unknowns] = np.arange(count, count + copies)[:, None]
            column[small.unknowns] = np.arange(size)
            begins.append(count)
            count += copies
        # dofs that M couples to nothing are taken together where they touch the same contacts: a rigid body's
        group = alike_in_contacts(H.indptr, H.indices, self.n, self._single, d)
        sizes = np.diff(group)
        body[self._single] = count + np.repeat(np.arange(len(sizes)), sizes)
        column[self._single] = np.arange(len(self._single)) - np.repeat(group[:-1], sizes)
        return _Places(body, column, count + len(sizes), blocks, begins, group)


def _diagonal(A: sp.sparray, single: IntArray) -> FloatArray:
    """The diagonal of the matrix A (csr or csc) on unknowns that it couples to nothing; SingularMatrix where it is zero."""
    first = A.indptr[single]
    diagonal = A.data[first] if np.array_equal(A.indptr[single + 1], first + 1) else A.diagonal()[single]
    if np.any(diagonal == 0):
        raise SingularMatrix(f"M is singular: zero rows, the first is degree of freedom {int(single[diagonal == 0][0])}")
    return diagonal


class _Equilibrated:
    """The factor of S A S in the place of that of A where constraints stand beside masses of 1e-15 kg: A's pivots are round-off."""

    def __init__(self, A: sp.sparray) -> None:
        """S: of unknowns with a mass its root's inverse, of multipliers what makes their largest entry one; SingularMatrix."""
        own, entries = np.abs(A.diagonal()), abs(sp.coo_array(A))
        scale = 1 / np.sqrt(np.where(own > 0, own, 1.0))
        row, column = entries.coords
        largest = np.zeros(len(own))
        np.maximum.at(largest, row, entries.data * np.where(own > 0, scale, 0.0)[column])
        scale = np.where((own > 0) | (largest == 0), scale, 1 / np.where(largest > 0, largest, 1.0))
        self._scale = np.exp2(np.round(np.log2(scale)))
        scaled = type(A)(sp.diags_array(self._scale) @ A @ sp.diags_array(self._scale))
        self._factor = _fitting_factor(scaled)
        refuse_singular(scaled, self._factor)
        self.name = self._factor.name

    def solve(self, rhs: FloatArray) -> FloatArray:
        scale = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x: FloatArray = scale * self._factor.solve(scale * rhs)
        return x


def _factor(block: sp.sparray) -> Factor:
    """The block's factor; SingularMatrix where it has none in any units."""
    try:
        factor = _fitting_factor(block)
        refuse_singular(block, factor)
    except SingularMatrix as error:
        said = str(error)
        try:
            return _Equilibrated(block)
        except SingularMatrix:
            where = "" if said.startswith("M ") else f"M is singular in a block of {block.shape[0]} degrees of freedom: "
            raise SingularMatrix(where + said) from None
    return factor


def _fitting_factor(block: sp.sparray) -> Factor:
    if block.shape[0] > storage.BLOCK_UP_TO:
        return factorise(block)
    dense = block.toarray(order="C" if block.format == "csr" else "F")
    by_rows = dense if block.format == "csr" else dense.T
    if asymmetry(block.indptr, block.indices, block.data, by_rows) <= 1e-12:
        try:
            return DenseCholesky(by_rows.T, overwrite=True)
        except SingularMatrix:  # indefinite, as with equality constraints
            dense = block.toarray()
    return DenseLU(dense)
