"""Coulomb's law with a faceted cone as a linear complementarity problem: exact in 2D, an approximation from inside in 3D.

With the unit generators D_j, j = 1 ... f, of the friction polygon of each contact, r_T = sum_j beta_j D_j, the unknowns are
z = (r_N, beta, lambda) and

    0 <= r_N    ⊥ u_N >= 0
    0 <= beta_j ⊥ D_j . u_T + lambda >= 0
    0 <= lambda ⊥ mu r_N - sum_j beta_j >= 0.

M is copositive where W is positive semidefinite, so Lemke's method ends with a solution or shows that there is none. Sources: Klarbring,
Ing. Arch. 56, 1986 (facets); Stewart and Trinkle, Int. J. Numer. Methods Eng. 39, 1996; Anitescu and Potra, Nonlinear Dyn. 14, 1997.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem

LARGEST = 12_000
"""Unknowns of the largest LCP: its dense table takes 1.2 GB, and pivoting a few such tables."""


@dataclass(frozen=True, eq=False)
class CoulombLCP:
    """M (k, k), q (k,) with k = (2 + f) nc, in units that make their entries of the order of one: u / velocity, r / impulse."""

    M: FloatArray
    q: FloatArray
    generators: FloatArray
    mu: FloatArray
    velocity: float
    impulse: float

    def reaction(self, z: FloatArray) -> FloatArray:
        """Return r (m,) of a solution z."""
        nc, f, _ = self.generators.shape
        r_T = np.einsum("aj,ajt->at", z[nc : nc + nc * f].reshape(nc, f), self.generators)
        return self.impulse * np.column_stack([z[:nc], r_T]).ravel()

    def support(self, r: FloatArray, u: FloatArray) -> BoolArray:
        """Return a complementary basis that suits (r, u), both (m,): as a start for a method that pivots.

        Open: lambda and the generator against u_T; stick: r_N and the generators on either side of r_T; slip: r_N, lambda and the
        generators on either side of r_T, of which one is enough where r_T is on it.
        """
        nc, f, tangents = self.generators.shape
        D, own = self.generators, np.arange(nc)
        r2, u_T = r.reshape(nc, 1 + tangents), u.reshape(nc, 1 + tangents)[:, 1:]
        r_N, r_T = r2[:, 0], r2[:, 1:]
        closed = r_N > 1e-12 * np.abs(r).max(initial=0.0)
        along = np.einsum("ajt,at->aj", D, np.where(closed[:, None], r_T, -u_T))
        first = np.argmax(along, axis=1)
        beta = np.zeros((nc, f), dtype=bool)
        beta[own, first] = True
        total = along[own, first]
        if tangents == 2:
            # r_T = b_0 g_0 + b_1 g_1 with g_1 the nearest generator on r_T's other side, by Cramer's rule
            g_0 = D[own, first]
            side = _cross(g_0, r_T)
            opposite = np.where(_cross(D, r_T[:, None]) * side[:, None] < 0, along, -np.inf)
            second = np.argmax(opposite, axis=1)
            g_1 = D[own, second]
            two = closed & (np.abs(side) > 1e-9 * total) & np.isfinite(opposite[own, second])
            beta[own[two], second[two]] = True
            determinant = np.where(two, _cross(g_0, g_1), 1)
            total = np.where(two, (_cross(r_T, g_1) + side) / determinant, total)
        slip = ~closed | (total >= self.mu * r_N * (1 - 1e-9))
        return np.concatenate([closed, beta.ravel(), slip])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def coulomb_lcp(problem: LocalProblem, generators: FloatArray) -> CoulombLCP:
    """Return the problem of a dense or sparse W with the generators (nc, f, d - 1)."""
    nc, d = problem.nc, problem.dimension
    f = generators.shape[1]
    size = nc * (2 + f)
    if size > LARGEST:
        raise InputError(
            f"{nc} contacts with {f} friction directions: an LCP of {size} unknowns, solved on a dense table, may have up to {LARGEST}"
        )
    velocity = float(np.abs(problem.q).max(initial=0.0)) or 1.0
    compliance = float(np.abs(np.einsum("aii->a", problem.diagonal_blocks)).mean()) / d or 1.0
    # the columns of P give r from (r_N, beta)
    normal = np.arange(nc) * d
    beta = nc + np.arange(nc * f)
    rows = [normal, *(np.repeat(normal + 1 + t, f) for t in range(d - 1))]
    P = sp.csr_array(
        (
            np.concatenate([np.ones(nc), *generators.reshape(-1, d - 1).T]),
            (np.concatenate(rows), np.concatenate([np.arange(nc), *[beta] * (d - 1)])),
        ),
        shape=(problem.m, nc * (1 + f)),
    )
    PWP = P.T @ (problem.W @ P)
    M = np.zeros((size, size))
    M[: nc * (1 + f), : nc * (1 + f)] = (PWP.toarray() if sp.issparse(PWP) else PWP) / compliance
    E = np.kron(np.eye(nc), np.ones((f, 1)))
    M[nc : nc * (1 + f), nc * (1 + f) :] = E
    M[nc * (1 + f) :, nc : nc * (1 + f)] = -E.T
    M[nc * (1 + f) :, :nc] = np.diag(problem.mu)
    q = np.zeros(size)
    q[: nc * (1 + f)] = P.T @ problem.q / velocity
    return CoulombLCP(M, q, generators, problem.mu, velocity, velocity / compliance)
