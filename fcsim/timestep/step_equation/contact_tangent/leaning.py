"""Gaps that do not close along the normals of their forces, brought to the form M v = H r + f, u = H^T v + w.

Interpolated normals, and normals of surfaces that overlap, are not the gradient of their gap: near the iterate v_i it is

    u = H^T v + E^T (v - v_i) + w,   (A + B) v = H r + f                                                                     (1)

with E the gradient of the gap beyond H. With v' = v_i + T^-1 (v - v_i), T^-1 = I + H Y E^T and Y = (H^T H)^-1, H^T v' is the u of (1) and

    (A + B) T v' = H r + f + (A + B) (T - I) v_i,   T = I - H Z,  Z = ((H + E)^T H)^-1 E^T                                    (2)

a problem like any other with a matrix that is not symmetric. Where the iteration has converged v' = v = v_i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray

UP_TO = 1500
"""Contact unknowns up to which (2) is formed."""

_SINGULAR = 1e-5
"""Of the largest diagonal entry of the factor of H^T H."""


@dataclass(frozen=True, eq=False)
class Leaning:
    """H and E (n, m), sparse, on the bodies' unknowns; inverse (m, m): Y."""

    H: sp.csc_array
    E: sp.csc_array
    inverse: FloatArray

    @cached_property
    def to_straight(self) -> sp.csr_array:
        """Z (m, n)."""
        Z = np.linalg.solve(((self.H + self.E).T @ self.H).toarray(), self._columns.toarray())
        rows = np.repeat(np.arange(Z.shape[0]), Z.shape[1])
        columns = np.tile(self._used, Z.shape[0])
        return sp.csr_array((Z.ravel(), (rows, columns)), shape=self.E.T.shape)

    @cached_property
    def _used(self) -> np.ndarray:
        """Unknowns that E touches."""
        return np.flatnonzero(np.diff(sp.csr_array(self.E).indptr))

    @property
    def _columns(self) -> sp.csr_array:
        """E^T (m, k) on the unknowns that it touches."""
        return sp.csr_array(self.E)[self._used].T

    def lean(self, v: FloatArray) -> FloatArray:
        """T^-1 v (n,)."""
        leant: FloatArray = v + self.H @ (self.inverse @ (self.E.T @ v))
        return leant

    def straight(self, v: FloatArray) -> FloatArray:
        """T v (n,)."""
        straightened: FloatArray = v - self.H @ (self.to_straight @ v)
        return straightened


def leaning(H: sp.sparray, E: sp.sparray) -> Leaning | None:
    """Of H and E (n, m); None where E vanishes, or where contacts are too many for each other: H^T H is singular."""
    H, E = sp.csc_array(H), sp.csc_array(E)
    if not E.nnz or not 0 < H.shape[1] <= UP_TO:
        return None
    try:
        L = np.linalg.cholesky((H.T @ H).toarray())
    except np.linalg.LinAlgError:
        return None
    if L.diagonal().min() <= _SINGULAR * L.diagonal().max():
        return None
    half = np.linalg.inv(L)
    inverse: FloatArray = half.T @ half
    return Leaning(H, E, inverse)
