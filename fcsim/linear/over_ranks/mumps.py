"""The factor of a symmetric positive definite matrix over ranks, by MUMPS on their communicator: each has a share of the fronts."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.factors import Factor, factorise, mumps_solver
from fcsim.linear.over_ranks.rows import RowLayout, RowsOverRanks

ORDERING = 7
"""MUMPS' choice."""
MORE_SPACE = 10
"""[%] over MUMPS' estimate: what each rank gets of the fronts is decided as they are factored."""
COLUMNS = 32
"""Right-hand sides that are solved for together."""


class MumpsOverRanks:
    """L L^T of A (n, n); see `Factor`. `solve` is asked for on all ranks at the same time, with the same right-hand sides, and gives all of
    the solution on each; a rank that computes alone factors the whole matrix for itself.

    Solutions have the same bits on all ranks, and agree with those of another number of ranks to round-off.
    """

    name = "MUMPS over ranks (PETSc)"

    def __init__(self, A: RowsOverRanks) -> None:
        """SingularMatrix, on all ranks, where A is not positive definite."""
        self._layout: RowLayout = A.layout
        self._make_whole = A.make_whole
        with A.layout.world.together("rows of a factor over ranks"):
            upper = _upper(A)
        with A.layout.world.collective("factor over ranks") as communicator:
            PETSc = runtime.petsc()
            PETSc.garbage_cleanup(communicator)  # factors that nobody has any more: ranks let go of them at times of their own
            self._communicator = communicator
            local = len(A.layout.own), A.shape[0]
            matrix = PETSc.Mat().createSBAIJ((local, local), 1, csr=upper, comm=communicator)
            del upper
            runtime.release_freed_memory()
            matrix.setOption(PETSc.Mat.Option.SPD, True)
            self._solver = mumps_solver(matrix, True, {"icntl_7": ORDERING, "icntl_14": MORE_SPACE})

    @cached_property
    def _alone(self) -> Factor:
        return factorise(self._make_whole(), positive_definite=True)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """A^-1 rhs, (n,) or (n, k)."""
        if not self._layout.computes_together:
            return self._alone.solve(rhs)
        if rhs.ndim == 2:
            columns = [self.solve(column) for column in np.ascontiguousarray(rhs.T)]
            return np.stack(columns, axis=1) if columns else rhs.copy()
        PETSc, layout = runtime.petsc(), self._layout
        with layout.world.collective("solution over ranks"):
            b = PETSc.Vec().createWithArray(rhs[layout.own], comm=self._communicator)
            x = b.duplicate()
            self._solver.apply(b, x)
            own = x.getArray().copy()
            b.destroy()
            x.destroy()
        return layout.gathered(own)

    def inverse_on(self, unknowns: IntArray, *, keep: bool) -> FloatArray | None:
        """The rows and columns `unknowns` (k,) of A^-1 (k, k); None on ranks that do not `keep` it."""
        PETSc, layout, size = runtime.petsc(), self._layout, len(self._layout.rank)
        inverse = np.empty((len(unknowns), len(unknowns))) if keep else None
        mine = np.flatnonzero(layout.rank[unknowns] == layout.world.number)
        rows = np.searchsorted(layout.own, unknowns[mine])
        here = layout.of(unknowns)
        host, local = layout.world.number == 0, len(layout.own)
        for first in range(0, len(unknowns), COLUMNS):
            units = layout.number[unknowns[first : first + COLUMNS]].astype(PETSc.IntType)
            count = len(units)
            given = units if host else units[:0]
            with layout.world.collective("compliance over ranks"):
                # MUMPS takes sparse right sides from rank 0, transposed, and leaves out what is zero in the forward solve
                starts = np.arange(len(given) + 1, dtype=PETSc.IntType)
                transposed = PETSc.Mat().createAIJ(
                    ((len(given), count), (size if host else 0, size)), csr=(starts, given, np.ones(len(given))), comm=self._communicator
                )
                B = PETSc.Mat().createTranspose(transposed)
                X = PETSc.Mat().createDense(((local, size), (len(given), count)), comm=self._communicator)
                X.setUp()
                X.assemble()
                self._solver.getFactorMatrix().matSolve(B, X)
                own = X.getDenseArray()[rows].copy()
                for matrix in (X, B, transposed):
                    matrix.destroy()
            part = here.gathered(own)
            if inverse is not None:
                inverse[:, first : first + count] = part
        return inverse


def _upper(A: RowsOverRanks) -> tuple[IntArray, IntArray, FloatArray]:
    """Row starts, columns and values of the upper triangle of this rank's rows, numbered rank after rank, in PETSc's types."""
    integer, layout = runtime.petsc().IntType, A.layout
    number = layout.number.astype(integer)
    rows = A.rows
    row = np.repeat(number[layout.own], np.diff(rows.indptr))
    column = number[rows.indices]
    kept = column >= row
    starts = np.concatenate(
        [[0], np.cumsum(np.bincount(row[kept] - (number[layout.own[0]] if len(layout.own) else 0), minlength=len(layout.own)))]
    )
    order = np.lexsort((column[kept], row[kept]))
    return starts.astype(integer), column[kept][order], rows.data[kept][order]
