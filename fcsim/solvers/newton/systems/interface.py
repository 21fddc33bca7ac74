"""What a Newton step's linear system A (W + D) + B is solved with: the interface of all its solvers.

A = du-derivative and B = dr-derivative of a formulation, block diagonal (nc, d, d); D = diag(shift), one number a contact, regularises
hyperstatic W in the proximal methods. A contact that opens has A = 0 and B = 1: its dr is known and leaves the system beforehand.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem import Delassus


class NewtonSystem(Protocol):
    """Solves (A (W + D) + B) dr = rhs (nc, d) for one operator and changing A, B."""

    @property
    def operator(self) -> Delassus: ...

    def solve(self, A: FloatArray, B: FloatArray, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dr and (W + D) dr (m,); raises SingularMatrix."""
        ...

    def shifted(self, shift: FloatArray) -> NewtonSystem:
        """The system of the same W with another shift (nc,), which shares what the shift leaves alone."""
        ...


def without_open(operator: Delassus, A: FloatArray, rhs: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the active contacts, their right-hand side and dr with the open contacts' part filled in."""
    d = A.shape[1]
    open_contact = ~np.any(A, axis=(1, 2))
    active = np.flatnonzero(~open_contact)
    dr = np.where(open_contact[:, None], rhs, 0.0)
    if np.any(dr):
        coupling = (operator @ dr.ravel()).reshape(-1, d)
        rhs = rhs - np.einsum("aij,aj->ai", A, coupling)
    return active, rhs[active], dr
