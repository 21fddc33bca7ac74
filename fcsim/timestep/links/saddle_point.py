"""The saddle point of links by one factorisation of all of it, where the Schur complement on its rows would lose what it is made of.

With [[M, -G], [-G^T, -C]] (v, l) = (f, b) the rows' Schur complement G^T M^-1 G + C holds the compliance of bodies that nothing but a link
holds, in statics h^2 / (eta m), beside that of what they are linked to: from a ratio of 1e8 on the latter is lost in round-off, although
the saddle point itself is as well conditioned as the linked bodies are. Rows that others say already, by G alone and whatever M is, are
left out by an orthogonal basis of G's range.

Source: M. Benzi, G. H. Golub, J. Liesen, "Numerical solution of saddle point problems", Acta Numerica 14, 2005, sections 3 and 5.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear._equilibration_kernels import equilibrating_scale
from fcsim.linear.factors import SOLVED_AT_ONCE, Factor, factorise

SAME_ROW = 1e-12
"""Eigenvalues of the scaled G^T G below this share of the largest are rows that others say already."""

PASSES = 8
"""Of the equilibration: masses, stiffnesses and arms have units of their own."""


class SaddlePoint:
    """The factor of [[M, -G], [-G^T, -C]]; M (n, n), G (n, p), C = diag(compliance) with compliance (p,), 0 where a row is kept exactly.

    Raises SingularMatrix where rows and M leave a motion free."""

    def __init__(self, M: sp.csr_array, G: sp.csr_array, compliance: FloatArray) -> None:
        self._n = M.shape[0]
        self._basis = _basis(G, compliance)
        rows = sp.csr_array(G @ self._basis)
        soft = self._basis.T @ sp.diags_array(compliance) @ self._basis
        self._matrix = sp.csr_array(sp.block_array([[M, -rows], [-rows.T, -soft]]))
        scale = equilibrating_scale(self._matrix.indptr, self._matrix.indices, self._matrix.data, PASSES)
        D = sp.diags_array(scale)
        self._scale: FloatArray = scale
        self._factor: Factor = factorise(sp.csr_array(D @ self._matrix @ D))

    @property
    def rank(self) -> int:
        """Number of rows that say something of their own."""
        return int(self._basis.shape[1])

    def solve(self, f: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(v, l) for f (n,), b (p,), or (n, k), (p, k); once refined."""
        rhs = np.concatenate([f, self._basis.T @ b])
        x = self._once(rhs)
        x = x + self._once(rhs - self._matrix @ x)
        return x[: self._n], self._basis @ x[self._n :]

    def _once(self, rhs: FloatArray) -> FloatArray:
        scale = self._scale if rhs.ndim == 1 else self._scale[:, None]
        solved: FloatArray = scale * self._factor.solve(scale * rhs)
        return solved

    def delassus(self, H: sp.sparray) -> FloatArray:
        """H^T v (m, m) of the motions v under the forces H (n, m), the rows kept: some columns at a time."""
        m = H.shape[1]
        H = sp.csc_array(H)
        W, count = np.empty((m, m)), max(1, SOLVED_AT_ONCE // max(self._matrix.shape[0], 1))
        for first in range(0, m, count):
            forces = H[:, first : first + count].toarray()
            W[:, first : first + count] = H.T @ self.solve(forces, np.zeros((self._basis.shape[0], forces.shape[1])))[0]
        return 0.5 * (W + W.T)


def _basis(G: sp.csr_array, compliance: FloatArray) -> sp.csr_array:
    """(p, k): the rows themselves where they are independent; else compliant rows, and a basis of what those that are kept say."""
    p = G.shape[1]
    both = sp.csr_array(sp.block_array([[None, G], [G.T, None]]))  # moments' arms have a unit of their own: in um they are 1e6 of forces
    of_dofs = equilibrating_scale(both.indptr, both.indices, both.data, PASSES)[: G.shape[0]]
    G = sp.csr_array(sp.diags_array(of_dofs) @ G)
    lengths = np.sqrt(np.asarray(G.multiply(G).sum(axis=0)).ravel())
    unit = sp.csr_array(G @ sp.diags_array(1 / np.where(lengths > 0, lengths, 1.0)))
    kept, soft = np.flatnonzero(compliance == 0), np.flatnonzero(compliance)
    values, vectors = np.linalg.eigh((unit.T @ unit).toarray()[np.ix_(kept, kept)])
    own = values > SAME_ROW * max(float(values.max(initial=0.0)), 1.0)
    if own.all():
        return sp.csr_array(sp.eye_array(p))
    scaled = vectors[:, own] / np.where(lengths[kept] > 0, lengths[kept], np.inf)[:, None]
    rows, columns = np.repeat(kept, scaled.shape[1]), np.tile(np.arange(scaled.shape[1]), len(kept))
    places = np.concatenate([rows, soft]), np.concatenate([columns, scaled.shape[1] + np.arange(len(soft))])
    return sp.csr_array((np.concatenate([scaled.ravel(), np.ones(len(soft))]), places), shape=(p, scaled.shape[1] + len(soft)))
