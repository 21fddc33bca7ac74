"""Factorisations behind one small interface: `factorise(A).solve(rhs)` for vectors and for many right-hand sides.

Small matrices are factored dense (LAPACK), larger ones by MUMPS where petsc4py is there, by SuperLU (SciPy) otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import count as counted
from types import ModuleType
from typing import Protocol

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numba import njit
from numpy.typing import DTypeLike, NDArray

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.errors import FcsimError
from fcsim.linear import storage

SOLVED_AT_ONCE = 8_000_000
"""Numbers of right-hand sides that are solved for together (64 MB, of which a factor's solution takes a few copies)."""


class SingularMatrix(FcsimError, ArithmeticError):
    """A matrix that cannot be factored."""


class Factor(Protocol):
    """A factored matrix: `solve(rhs)` for rhs (n,) or (n, k), and the name of the method for reports."""

    name: str

    def solve(self, rhs: FloatArray) -> FloatArray: ...


class DenseCholesky:
    """Cholesky factorisation L L^T of a dense symmetric positive definite matrix; conditioning: the least pivot over the largest."""

    name = "dense Cholesky (LAPACK)"

    def __init__(self, A: FloatArray, overwrite: bool = False, dtype: DTypeLike | None = None) -> None:
        """overwrite: a Fortran-ordered A is factored in place; dtype: the precision in which L is kept, that of A where not given."""
        potrf = sla.lapack.get_lapack_funcs("potrf", (A,))
        L, info = potrf(A, lower=True, clean=False, overwrite_a=overwrite)
        if info != 0:
            raise SingularMatrix(f"matrix of size {len(A)} is not positive definite: pivot {info}")
        pivots = L.diagonal()
        self.conditioning = float(np.min(pivots, initial=np.inf) / np.max(pivots, initial=0.0)) ** 2 if len(A) else 1.0
        self._factor = L if dtype is None else L.astype(dtype, copy=False)
        self._potrs = sla.lapack.get_lapack_funcs("potrs", (self._factor,))
        self._trsm, self._trsv = sla.blas.get_blas_funcs(("trsm", "trsv"), (self._factor,))

    def solve(self, rhs: FloatArray) -> FloatArray:
        if not rhs.size:  # LAPACK's wrapper takes no empty arrays
            return rhs.copy()
        solution: FloatArray = self._potrs(self._factor, rhs, lower=True)[0]
        return solution

    def forward(self, X: FloatArray) -> FloatArray:
        """Overwrite X (n, k), in C order, with L^-1 X and return it."""
        solution: FloatArray = self._trsm(1.0, self._factor, X.T, side=1, lower=True, trans_a=True, overwrite_b=True).T
        return solution

    def backward(self, z: FloatArray) -> FloatArray:
        """Return L^-T z for z (n,)."""
        solution: FloatArray = self._trsv(self._factor, z, lower=True, trans=True)
        return solution

    def inverse_on_last(self, count: int) -> FloatArray:
        """The rows and columns of A^-1 of the last unknowns: (L_ll L_ll^T)^-1 of the factor's last block, whatever comes before it."""
        if not count:
            return np.empty((0, 0))
        lower = sla.lapack.dpotri(self._factor[-count:, -count:], lower=True)[0]
        inverse: FloatArray = lower.T  # C-ordered
        mirror(inverse)
        return inverse


@njit(cache=True)
def mirror(A: FloatArray) -> None:
    """Copy the upper triangle of A (n, n) to the lower one, in place."""
    step = 32  # rows that stay in the cache while they are written as columns
    for begin in range(0, len(A), step):
        for p in range(begin, len(A)):
            for q in range(begin, min(begin + step, p)):
                A[p, q] = A[q, p]


class DenseLU:
    """LU factorisation with partial pivoting of a dense matrix, in its precision: single for a preconditioner takes half the time."""

    name = "dense LU (LAPACK)"

    def __init__(self, A: NDArray[np.floating], overwrite: bool = False) -> None:
        getrf, self._getrs = sla.lapack.get_lapack_funcs(("getrf", "getrs"), (A,))
        if A.size:
            self._lu, self._pivots, info = getrf(A, overwrite_a=overwrite)
        else:  # LAPACK complains on the terminal
            self._lu, self._pivots, info = A, np.empty(0, dtype=np.int32), 0
        if info != 0:
            raise SingularMatrix(f"matrix of size {len(A)} is singular: zero pivot {info}")

    @property
    def sign(self) -> int:
        """Of the determinant: 1 or -1."""
        turned = np.count_nonzero(self._lu.diagonal() < 0) + np.count_nonzero(self._pivots != np.arange(len(self._pivots)))
        return -1 if turned % 2 else 1

    def solve(self, rhs: FloatArray) -> FloatArray:
        solution: FloatArray = self._getrs(self._lu, self._pivots, rhs)[0] if self._lu.size else rhs.copy()
        return solution

    def solve_transposed(self, rhs: FloatArray) -> FloatArray:
        """Return A^-T rhs: with DenseLU(J.T, overwrite=True) a C-ordered J is factored in place, and this solves J x = rhs."""
        solution: FloatArray = self._getrs(self._lu, self._pivots, rhs, trans=1)[0] if self._lu.size else rhs.copy()
        return solution


MUMPS_FROM = 300_000
"""Entries of a contact problem's matrix above which MUMPS' analysis pays off against SuperLU."""


class SuperLU:
    """Sparse LU factorisation by SuperLU (SciPy)."""

    name = "SuperLU (SciPy)"

    def __init__(self, A: sp.sparray, symmetric_pattern: bool = False) -> None:
        """symmetric_pattern: order on the graph of A + A^T and prefer the diagonal as pivot, for matrices like a stiffness or W."""
        pattern = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
        try:
            self._factor = spla.splu(sp.csc_matrix(A), **(pattern if symmetric_pattern else {}))
        except RuntimeError as error:
            raise SingularMatrix(f"matrix of size {A.shape[0]} is singular: {error}") from None

    def solve(self, rhs: FloatArray) -> FloatArray:
        return self._factor.solve(np.ascontiguousarray(rhs))

    def solve_transposed(self, rhs: FloatArray) -> FloatArray:
        """Return A^-T rhs: with SuperLU(J.T) of a J by rows nothing is converted, and this solves J x = rhs."""
        return self._factor.solve(np.ascontiguousarray(rhs), trans="T")


_PREFIXES = counted(1)


class PetscMatrix(Protocol):
    """What is asked of a matrix of PETSc, or of its factor by MUMPS."""

    def getComm(self) -> object: ...

    def getSize(self) -> tuple[int, int]: ...

    def getMumpsInfog(self, number: int) -> int: ...

    def matSolve(self, rhs: object, solution: object) -> None: ...


class PetscSolver(Protocol):
    """A PC of PETSc that solves by a factor."""

    def setOperators(self, matrix: object) -> None: ...

    def setUp(self) -> None: ...

    def getFactorMatrix(self) -> PetscMatrix: ...

    def apply(self, rhs: object, solution: object) -> None: ...


def mumps_solver(matrix: PetscMatrix, positive_definite: bool, chosen: Mapping[str, float]) -> PetscSolver:
    """The factor of a matrix of PETSc by MUMPS, on the matrix's communicator, as PETSc's PC; chosen: MUMPS' own options by their names in
    PETSc, which are set under a prefix of this factor's own and removed once read. SingularMatrix where MUMPS cannot factor it."""
    PETSc = runtime.petsc()
    solver, options = PETSc.PC().create(comm=matrix.getComm()), PETSc.Options()
    prefix = f"fcsim_mumps_{next(_PREFIXES)}_"
    solver.setOptionsPrefix(prefix)
    solver.setType("cholesky" if positive_definite else "lu")
    solver.setFactorSolverType("mumps")
    for key, value in chosen.items():
        options[f"{prefix}mat_mumps_{key}"] = value
    try:
        solver.setOperators(matrix)
        solver.setFromOptions()
        _set_up(solver, PETSc, matrix.getSize()[0], positive_definite=positive_definite)
    finally:
        for key in chosen:
            options.delValue(f"{prefix}mat_mumps_{key}")
    return solver


def _set_up(solver: PetscSolver, PETSc: ModuleType, size: int, *, positive_definite: bool) -> None:
    """Factor; SingularMatrix where MUMPS cannot."""
    try:
        solver.setUp()
    except PETSc.Error as error:
        raise SingularMatrix(f"MUMPS could not factor a matrix of size {size}: PETSc error {error.ierr}") from None
    factor = solver.getFactorMatrix()
    if factor.getMumpsInfog(1) != 0:
        raise SingularMatrix(
            f"MUMPS could not factor a matrix of size {size}: INFOG(1) = {factor.getMumpsInfog(1)}, INFOG(2) = {factor.getMumpsInfog(2)}"
        )
    if positive_definite and factor.getMumpsInfog(12) > 0:  # MUMPS itself goes on
        raise SingularMatrix(f"matrix of size {size} is not positive definite: {factor.getMumpsInfog(12)} negative pivots")


class Mumps:
    """Sparse LU factorisation by MUMPS through petsc4py, Cholesky for a symmetric positive definite matrix: half the work and memory.

    Of a symmetric matrix the upper triangle alone is read; given by square blocks (bsr) it is handed over so. `compression` > 0 keeps
    the factors of large fronts as products of low rank to that relative accuracy (block low rank: P. Amestoy, A. Buttari, J.-Y.
    L'Excellent, T. Mary, ACM Trans. Math. Softw. 45, 2019): less work and memory, and solutions of about that accuracy.
    `refactor` takes new values on the same pattern and keeps the symbolic analysis.
    """

    name = "MUMPS (PETSc)"

    def __init__(self, A: sp.sparray, ordering: int = 7, *, positive_definite: bool = False, compression: float = 0.0) -> None:
        PETSc = runtime.petsc()
        self._shape, self._positive_definite = A.shape, positive_definite
        rows, block = self._rows(A)
        if positive_definite:
            self._matrix = PETSc.Mat().createSBAIJ(A.shape, block, csr=rows, comm=PETSc.COMM_SELF)
            self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        else:
            self._matrix = PETSc.Mat().createAIJ(A.shape, csr=rows, comm=PETSc.COMM_SELF)
        del rows  # PETSc has its own copy
        more_space = 5 if positive_definite else 50  # [%] over MUMPS' estimate; pivoting makes the estimate of an LU a guess
        chosen: dict[str, float] = {"icntl_7": ordering, "icntl_14": more_space}
        if compression:
            chosen |= {"icntl_35": 2, "cntl_7": compression}
        self._solver = mumps_solver(self._matrix, positive_definite, chosen)

    def _rows(self, A: sp.sparray) -> tuple[tuple[NDArray[np.integer], NDArray[np.integer], FloatArray], int]:
        """Row starts, columns, values in PETSc's types, and the size of their blocks."""
        integer = runtime.petsc().IntType
        if self._positive_definite and getattr(A, "format", "") == "bsr" and A.blocksize[0] == A.blocksize[1]:
            row = np.repeat(np.arange(len(A.indptr) - 1, dtype=A.indices.dtype), np.diff(A.indptr))
            upper = np.flatnonzero(A.indices >= row)
            starts = np.searchsorted(row[upper], np.arange(len(A.indptr)))
            return (starts.astype(integer), A.indices[upper].astype(integer), A.data[upper].ravel()), A.blocksize[0]
        A = sp.csr_array(sp.triu(A) if self._positive_definite else A)
        A.sort_indices()
        return (A.indptr.astype(integer), A.indices.astype(integer), A.data), 1

    def refactor(self, A: sp.sparray) -> None:
        """Factor new values on the pattern given at construction."""
        PETSc = runtime.petsc()
        rows, _ = self._rows(A)
        if self._positive_definite:
            self._matrix.setPreallocationCSR(rows)  # setValuesCSR knows no blocks
        else:
            self._matrix.setValuesCSR(*rows)
        self._matrix.assemble()
        self._solver.setOperators(self._matrix)
        _set_up(self._solver, PETSc, self._shape[0], positive_definite=self._positive_definite)

    def solve(self, rhs: FloatArray) -> FloatArray:
        PETSc = runtime.petsc()
        rhs = np.asarray(rhs, dtype=np.float64)
        if rhs.ndim == 1:
            b = PETSc.Vec().createWithArray(np.ascontiguousarray(rhs), comm=PETSc.COMM_SELF)
            x = b.duplicate()
            self._solver.apply(b, x)
            solution = x.getArray().copy()
            b.destroy()
            x.destroy()
            return solution
        dense = np.asfortranarray(rhs)
        B = PETSc.Mat().createDense(dense.shape, array=dense.ravel(order="F").copy(), comm=PETSc.COMM_SELF)
        X = PETSc.Mat().createDense(dense.shape, comm=PETSc.COMM_SELF)
        X.setUp()
        for matrix in (B, X):
            matrix.assemble()
        self._solver.getFactorMatrix().matSolve(B, X)
        solution = X.getDenseArray().copy()
        B.destroy()
        X.destroy()
        return solution

    def __del__(self) -> None:
        for name in ("_solver", "_matrix"):
            handle = self.__dict__.pop(name, None)
            if handle is not None:
                handle.destroy()


def factorise(A: Matrix, *, positive_definite: bool = False) -> Factor:
    """Factor a square matrix A (sparse or dense) by the method that fits its size; `SingularMatrix` where that fails."""
    n = A.shape[0]
    if n <= storage.BLOCK_UP_TO or isinstance(A, np.ndarray):
        dense = A if isinstance(A, np.ndarray) else A.toarray()
        return DenseCholesky(dense) if positive_definite else DenseLU(dense)
    return Mumps(A, positive_definite=positive_definite) if runtime.has_petsc() else SuperLU(A)


def inverse_on(unknowns: IntArray, factor: Factor, size: int) -> FloatArray:
    """The rows and columns `unknowns` (k,) of A^-1 (k, k), A of that size, a few columns at a time: all would be k size numbers."""
    inverse = np.empty((len(unknowns), len(unknowns)))
    count = max(1, SOLVED_AT_ONCE // max(size, 1))
    for first in range(0, len(unknowns), count):
        own = unknowns[first : first + count]
        units = np.zeros((size, len(own)))
        units[own, np.arange(len(own))] = 1
        inverse[:, first : first + count] = factor.solve(units)[unknowns]
    return inverse


@lru_cache(maxsize=4)
def probes(size: int) -> FloatArray:
    """Two random vectors (2, size)."""
    return np.random.default_rng(0).standard_normal((2, size))


def is_symmetric(W: Matrix) -> bool:
    """Whether y.W x = x.W y for random x and y, to round-off: an asymmetry would have to be orthogonal to both to hide."""
    x, y = probes(W.shape[0])
    Wx, Wy = W @ x, W @ y  # no product with W^T, for which block rows would be transposed
    return abs(float(y @ Wx - x @ Wy)) <= 1e-10 * float(max(np.linalg.norm(Wx), np.linalg.norm(Wy)))
