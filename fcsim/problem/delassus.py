"""The Delassus operator W as solvers see it: one object for its products and for what is derived from it once.

How W is stored for elimination and how it is factored is decided here and nowhere else: `elimination` names the way (by the costs of
`fcsim.linear.storage`), `stored` is W in the storage that goes with it, `factor` is the factor of W + rho I. Proximal methods work on
W + D with one number a contact: `shifted`, which leaves W alone. A problem has its operator as `LocalProblem.delassus`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, cast

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.linear.block_factors.analysis import Analysis
from fcsim.linear.block_rows import BLOCKS_A_PIECE, compressed_blocks, product_by_rows
from fcsim.linear.factors import Factor, SingularMatrix, is_symmetric
from fcsim.linear.joints import BlockRows, Pattern, joint_rows
from fcsim.linear.late.late_rows import LateRows, source_of
from fcsim.linear.storage import eliminated_dense
from fcsim.problem._judge_kernels import diagonal_blocks_of_rows
from fcsim.problem.bodies.shares import KnownShares
from fcsim.problem.distributed import DistributedDelassus
from fcsim.problem.motion import Motion
from fcsim.problem.shifted_factor import complete_rows, plus_diagonal, shifted_factor

Elimination = Literal["dense", "fronts", "sparse"]


@dataclass(frozen=True, eq=False)
class Delassus:
    """W + diag(shift), W (m, m) dense or sparse of m = d nc contact unknowns; in dynamics [velocity per impulse], else [displacement per
    force]. shift (nc,): one number a contact, None for W alone; motion: W = H^T M^-1 H where few degrees of freedom are behind it;
    unshifted: the operator of W alone, with which this one shares what W or its pattern decides; shares: W as a sum over bodies, where
    that is known.

    What is asked for is computed once and kept as long as this object; factors are not kept, since they are large: who uses one again
    keeps it (see `Memory` for what serves the next problem). A LinearOperator has products alone; InputError where it is to be
    eliminated, or where W is nothing of these. A `DistributedDelassus` has what that names.
    """

    W: Matrix
    dimension: int = 3
    shift: FloatArray | None = None
    motion: Motion | None = None
    unshifted: Delassus | None = None
    shares: KnownShares | None = None
    _made: dict[Hashable, object] = field(default_factory=dict, init=False, repr=False)
    _last: list[tuple[FloatArray, FloatArray]] = field(default_factory=list, init=False, repr=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        if not isinstance(self.W, np.ndarray | LinearOperator) and not sp.issparse(self.W):
            raise InputError(f"W: expected a NumPy array, a SciPy sparse array or a LinearOperator, got a {type(self.W).__name__}")

    @property
    def size(self) -> int:
        """m, the number of contact unknowns."""
        return int(self.W.shape[0])

    @property
    def nc(self) -> int:
        """The number of contacts."""
        return self.size // self.dimension

    @property
    def is_sparse(self) -> bool:
        return not isinstance(self.W, np.ndarray)

    def shifted(self, shift: FloatArray | float) -> Delassus:
        """The operator of the same W with diag(shift), one number a contact (nc,) or one for all, in the place of its own."""
        unshifted = self if self.shift is None else self.unshifted
        return Delassus(self.W, self.dimension, np.broadcast_to(shift, self.nc), self.motion, unshifted, self.shares)

    @cached_property
    def by_unknown(self) -> FloatArray:
        """The shift of each contact unknown (m,)."""
        return np.zeros(self.size) if self.shift is None else np.repeat(self.shift, self.dimension)

    @cached_property
    def matrix(self) -> Matrix:
        """W + diag(shift), formed in W's own storage: dense for a dense W, else by block rows; W itself where nothing is shifted."""
        return self.W if self.shift is None else plus_diagonal(self.W, self.shift, self.dimension)

    def __matmul__(self, x: FloatArray) -> FloatArray:
        """(W + diag(shift)) x for x (m,) or (m, k)."""
        if isinstance(self.W, LateRows) and x.ndim == 1 and x.dtype == np.float64:
            return self.affine(x, np.zeros(self.size))
        image = self._product(x) if self.unshifted is None else self.unshifted._product(x)
        return image if self.shift is None else image + (self.by_unknown * x.T).T

    def _product(self, x: FloatArray) -> FloatArray:
        """W x for x (m,) or (m, k); that of the last vector is kept: a proximal step's inner problem begins with the product that the step
        before has ended with."""
        W, of_one = self.W, x.ndim == 1 and x.dtype == np.float64
        for last, product in self._last:
            if of_one and np.array_equal(last, x):
                return product.copy()
        image: FloatArray = product_by_rows(W, np.zeros(self.size), x) if of_one and self._in_pieces else W @ x
        if of_one:
            self._last[:] = [(x.copy(), image.copy())]
        return image

    @property
    def _in_pieces(self) -> bool:
        """Whether products with a vector are by pieces of block rows, from whatever they are asked for: where there are several, and of
        rigid bodies, whose proximal steps make two or three in ten iterations: SciPy's takes 0.15 ms of 660 contacts, that 0.05."""
        W = self.W
        return isinstance(W, sp.bsr_array) and W.blocksize == (3, 3) and (self.motion is not None or len(W.indices) >= 2 * BLOCKS_A_PIECE)

    def times(self, x: FloatArray) -> FloatArray:
        """(W + diag(shift)) x for x (m,), with the bits of `affine` without q; that of the last vector is kept where these are `@`'s."""
        return self @ x if self._in_pieces and x.dtype == np.float64 else self.affine(x, np.zeros_like(x))

    def transposed_product(self, x: FloatArray) -> FloatArray:
        """(W + diag(shift))^T x for x (m,) or (m, k)."""
        image: FloatArray = self.W.T @ x
        return image if self.shift is None else image + (self.by_unknown * x.T).T

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """(W + diag(shift)) x + q (m,)."""
        W = self.W
        if self.shift is not None:
            shifted: FloatArray = self.by_unknown * x + q
            return W.affine(x, shifted) if isinstance(W, LateRows) else self @ x + q
        if isinstance(W, LateRows):
            return W.affine(x, q)
        if isinstance(W, sp.bsr_array) and W.blocksize == (3, 3) and x.dtype == q.dtype == np.float64:
            return product_by_rows(W, q, x)
        return W @ x + q

    @cached_property
    def entries(self) -> int:
        """Entries of W that are not zero."""
        if isinstance(self.W, DistributedDelassus):
            return self.W.entries
        return int(np.count_nonzero(self.W if isinstance(self.W, np.ndarray) else self.W.data))

    @property
    def density(self) -> float:
        """Share of the entries that are not zero, 1 for no contacts."""
        return self.entries / (self.size**2 or 1)

    @cached_property
    def diagonal(self) -> FloatArray:
        """The diagonal of W (m,)."""
        return np.asarray(self.W.diagonal()) + self.by_unknown

    @cached_property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        if self.shift is None:
            return diagonal_blocks(self.W, self.dimension)
        own = diagonal_blocks(self.W, self.dimension) if self.unshifted is None else self.unshifted.diagonal_blocks
        return own + self.shift[:, None, None] * np.eye(self.dimension)

    @cached_property
    def compliance(self) -> FloatArray:
        """tr(W_aa) / d (nc,), one positive number a contact; where it is not positive (both bodies held), the mean of the others."""
        return own_compliance(np.einsum("ai->a", self.diagonal.reshape(-1, self.dimension)) / self.dimension)

    @cached_property
    def symmetric(self) -> bool:
        """Whether W equals its transpose up to round-off."""
        return is_symmetric(self.W)

    @property
    def symmetric_part(self) -> Delassus:
        """(W + W^T) / 2; not kept where it is this object: one that holds itself is freed by the collector of cycles only, and until then
        each of a run's steps leaves its W behind."""
        return self if self.symmetric else self._mean

    @cached_property
    def _mean(self) -> Delassus:
        return replace(self, W=0.5 * (self.W + self.W.T), motion=None, unshifted=None, shares=None)

    @cached_property
    def norm(self) -> float:
        """||W||_2 by power iterations on W, or on W^T W where that differs, from below within a few percent; 1 for W = 0."""
        zero = np.zeros(self.size)
        if self.symmetric:
            return power_norm(lambda x: self.affine(x, zero), self.size) or 1.0
        return float(np.sqrt(power_norm(lambda x: self.transposed_product(self.affine(x, zero)), self.size))) or 1.0

    @cached_property
    def least_singular_value(self) -> float:
        """The least singular value of W by inverse iteration, or 1e-6 ||W|| where that is larger."""
        floor = 1e-6 * self.norm
        inverse = power_norm(self.factor(floor, symmetric=self.symmetric).solve, self.size)
        return max(1 / (inverse or 1.0) - floor, floor)

    @cached_property
    def blocks(self) -> tuple[IntArray, IntArray, FloatArray]:
        """The matrix by block rows: indptr (nc + 1,), block columns, blocks (nnz, d, d); not copied where W is so stored."""
        return compressed_blocks(self.matrix, self.dimension)

    @cached_property
    def rows(self) -> sp.bsr_array:
        """The matrix by block rows (bsr), itself where it is so stored."""
        matrix, d = self.matrix, self.dimension
        if not isinstance(matrix, np.ndarray) and matrix.format == "bsr" and matrix.blocksize == (d, d):
            return matrix
        indptr, column, blocks = self.blocks
        return sp.bsr_array((blocks, column.astype(np.int32), indptr.astype(np.int32)), shape=self.W.shape)

    @cached_property
    def joints(self) -> BlockRows | None:
        """A sparse W by block rows where its contacts come in joints that leave most of a dense elimination's work out, else None."""
        if not self.is_sparse or self.unshifted is None:
            return joint_rows(self.rows, self.dimension) if self.is_sparse else None
        joined = self.unshifted.joints
        return None if joined is None else joint_rows(self.rows, self.dimension, joined.pattern)

    def joints_like(self, earlier: Pattern | None) -> BlockRows | None:
        """`joints`; where W has the pattern of an earlier one it is not analysed again."""
        if earlier is not None and self.is_sparse and earlier.is_that_of(self.rows):
            self.__dict__.setdefault("joints", joint_rows(self.rows, self.dimension, earlier))
        return self.joints

    @cached_property
    def elimination(self) -> Elimination:
        """How a matrix with W's pattern is eliminated: dense, by fronts of whole joints, or by sparse elimination of single contacts."""
        if isinstance(self.W, LinearOperator):
            raise InputError(
                f"W: expected a NumPy array or a SciPy sparse array to eliminate, got a {type(self.W).__name__} without entries"
            )
        if self.unshifted is not None:
            return self.unshifted.elimination
        if self.joints is not None:
            return "fronts"
        return "dense" if eliminated_dense(self.size, self.entries) else "sparse"

    @property
    def stored(self) -> Delassus:
        """W in the storage of its elimination: dense, or by sorted block rows; this object where it is so stored (and then not kept, as
        with `symmetric_part`)."""
        return self if self._is_so_stored else self._restored

    @cached_property
    def _is_so_stored(self) -> bool:
        W, d = self.W, self.dimension
        if isinstance(W, np.ndarray) or self.elimination == "dense":
            return isinstance(W, np.ndarray) and self.elimination == "dense"
        return bool(W.format == "bsr" and W.blocksize == (d, d) and W.has_sorted_indices)

    @cached_property
    def _restored(self) -> Delassus:
        """W in another storage than it has."""
        if self.unshifted is not None and self.shift is not None:
            return self.unshifted.stored.shifted(self.shift)
        if not isinstance(self.W, np.ndarray) and self.elimination == "dense":
            return self._of(self.W.toarray())
        rows = self.rows if self.shift is None else Delassus(self.W, self.dimension).rows
        if not rows.has_sorted_indices:
            # a copy even of block rows: sorting the caller's in place would change the last bits of later products
            rows = rows.copy()
            rows.sort_indices()
        return self._of(rows)

    def _of(self, W: Matrix) -> Delassus:
        """The operator with the same W in another storage."""
        motion = None if self.motion is None else self.motion.stored_as(self.W, W)
        shares = None if self.shares is None else self.shares.stored_as(self.W, W)
        return Delassus(W, self.dimension, self.shift, motion, shares=shares)

    def factor(self, rho: float, *, symmetric: bool) -> Factor:
        """The factor of W + rho I: Cholesky where symmetric and positive definite, else LU; SingularMatrix where that fails, and over
        ranks where W + rho I is not symmetric positive definite."""
        if isinstance(self.W, DistributedDelassus) and self.shift is None:
            if not symmetric:
                raise SingularMatrix("W + rho I over ranks: expected a symmetric W to factor")
            return self.W.factor(rho)
        return shifted_factor(self.matrix, self.dimension, rho, symmetric, lambda: self.analysis)

    @cached_property
    def analysis(self) -> tuple[sp.bsr_array, Analysis]:
        """A sparse matrix by sorted block rows with every diagonal block, and with each block its mirror image, and what their pattern
        alone decides of its factors."""
        if self.unshifted is not None and self.shift is not None:
            rows, analysis = self.unshifted.analysis
            return plus_diagonal(rows, self.shift, self.dimension), analysis
        rows = complete_rows(self.matrix, self.dimension)
        return rows, Analysis(rows)

    def derived[T](self, make: Callable[..., T], *arguments: Hashable) -> T:
        """What make(self, *arguments) derives from this operator, made once."""
        key = (make, *arguments)
        if key not in self._made:
            self._made[key] = make(self, *arguments)
        return cast(T, self._made[key])


def diagonal_blocks(W: Matrix, d: int) -> FloatArray:
    """The blocks W_aa (nc, d, d) of W (m, m), dense, sparse or over ranks."""
    if isinstance(W, DistributedDelassus):
        return W.diagonal_blocks()
    if (source := source_of(W)) is not None:
        return source.diagonal_blocks()
    nc = W.shape[0] // d
    index = np.arange(nc)
    if isinstance(W, np.ndarray):
        return W.reshape(nc, d, nc, d)[index, :, index, :]
    if W.format == "bsr" and W.blocksize == (d, d):
        row = np.repeat(index, np.diff(W.indptr))
        own = np.flatnonzero(row == W.indices)
        if np.array_equal(row[own], index):  # each stored once
            return W.data[own]
        blocks = np.zeros((nc, d, d))
        np.add.at(blocks, row[own], W.data[own])
        return blocks
    W = W if W.format in ("csr", "csc") else sp.csr_array(W)
    blocks = diagonal_blocks_of_rows(W.indptr, W.indices, W.data, d)
    return blocks if W.format == "csr" else blocks.transpose(0, 2, 1)


def own_compliance(own: FloatArray) -> FloatArray:
    """tr(W_aa) / d (nc,) where it is positive, elsewhere (both bodies held) the mean of the others; 1 where there is none."""
    positive = own > 0
    if positive.all():
        return own
    return np.where(positive, own, own[positive].mean() if positive.any() else 1.0)


def power_norm(apply: Callable[[FloatArray], FloatArray], size: int) -> float:
    """The largest eigenvalue in magnitude of x -> apply(x) on R^size by the power method, from below within a few percent."""
    if not size:
        return 0.0
    x = np.random.default_rng(0).standard_normal(size)
    length, norm = math.sqrt(x @ x), 0.0
    for _ in range(30):
        x = apply(x / (length or 1.0))
        length = math.sqrt(x @ x)
        if abs(length - norm) <= 1e-3 * length:
            break
        norm = length
    return length
