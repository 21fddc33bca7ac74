"""What a Newton step's linear system A (W + D) + B is solved with: the operator W + D and the interface of all its solvers.

A = du-derivative and B = dr-derivative of a formulation, block diagonal (nc, d, d); D = diag(shift), one number a contact, regularises
hyperstatic W in the proximal methods. A contact that opens has A = 0 and B = 1: its dr is known and leaves the system beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.problem import diagonal_blocks
from fcsim.problem.motion import Motion
from fcsim.problem.shifted_factor import plus_diagonal


@dataclass(frozen=True, eq=False)
class Shifted:
    """W + diag(shift) for W (m, m) dense or sparse, shift (nc,) one number a contact or None; W itself is never changed.

    motion: W = H^T M^-1 H where few degrees of freedom are behind it, else None.
    """

    W: Matrix
    dimension: int
    shift: FloatArray | None = None
    motion: Motion | None = None

    @property
    def nc(self) -> int:
        return int(self.W.shape[0]) // self.dimension

    @cached_property
    def by_unknown(self) -> FloatArray:
        """The shift of each contact unknown (m,)."""
        return np.zeros(self.W.shape[0]) if self.shift is None else np.repeat(self.shift, self.dimension)

    @cached_property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks (nc, d, d)."""
        own = diagonal_blocks(self.W, self.dimension)
        return own if self.shift is None else own + self.shift[:, None, None] * np.eye(self.dimension)

    @cached_property
    def matrix(self) -> Matrix:
        """W + diag(shift), formed in W's own storage."""
        if self.shift is None:
            return self.W
        return plus_diagonal(self.W, self.shift, self.dimension)

    def product(self, x: FloatArray) -> FloatArray:
        """(W + diag(shift)) x (m,)."""
        Wx: FloatArray = self.W @ x
        return Wx if self.shift is None else Wx + self.by_unknown * x

    def transposed_product(self, x: FloatArray) -> FloatArray:
        """(W + diag(shift))^T x (m,)."""
        Wx: FloatArray = self.W.T @ x
        return Wx if self.shift is None else Wx + self.by_unknown * x


class NewtonSystem(Protocol):
    """Solves (A (W + D) + B) dr = rhs (nc, d) for one operator and changing A, B."""

    @property
    def operator(self) -> Shifted: ...

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dr and (W + D) dr (m,); raises SingularMatrix."""
        ...

    def shifted(self, shift: FloatArray) -> NewtonSystem:
        """The system of the same W with another shift (nc,), which shares what the shift leaves alone."""
        ...


def without_open(operator: Shifted, A: FloatArray, rhs: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the active contacts, their right-hand side and dr with the open contacts' part filled in."""
    d = A.shape[1]
    open_contact = ~np.any(A, axis=(1, 2))
    active = np.flatnonzero(~open_contact)
    dr = np.where(open_contact[:, None], rhs, 0.0)
    if np.any(dr):
        coupling = operator.product(dr.ravel()).reshape(-1, d)
        rhs = rhs - np.einsum("aij,aj->ai", A, coupling)
    return active, rhs[active], dr
