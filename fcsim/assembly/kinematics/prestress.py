"""The stiffness of the stress that a body bears, which its kinematics of small rotations knows nothing of: where it buckles.

A body under the stress sigma resists a displacement y by K + K_s in place of K,

    y . K_s y = integral of s : H^T H + p ((tr H)^2 - tr H^2),  H the gradient of y, s = sigma - p I, p = tr sigma / 3

Of a rotation that is sigma : H^T H; of strains it is no more than p leaves in a body that keeps its volume. Pressure takes of the
stiffness, tension adds to it: to first order y changes by -K^-1 K_s y. What bears lambda sigma buckles where K + lambda K_s is singular,
which is Euler's load of a column; at the share s = 1 / lambda of that, deflections across are too small by s / (1 - s).

Source: O. C. Zienkiewicz, R. L. Taylor, The finite element method for solid and structural mechanics, 2005, sections 5.2 and 11.4 (initial
stress stiffness, linear buckling).
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from fcsim.arrays import FloatArray
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.left_out import LeftOut, gradients
from fcsim.linear.factors import Factor, SingularMatrix, factorise, probes
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.law import PAIR

DENSE_UP_TO = 100
"""Unknowns up to which all eigenvalues are computed at once."""

PRECISE = 0.02
"""To which share the load that buckles is found."""

RESTARTS = 100
"""Of Lanczos' method, twenty vectors each."""

FIRM = 1e4
"""Stiffness of what holds a body beside its supports, of the largest on the diagonal of K: contacts do not give way."""


class Stress(NamedTuple):
    """At n points: what is beside the mean stress (n, d, d), along the world's axes, and that, of the stress in space, (n,) [Pa]."""

    beside: FloatArray
    mean: FloatArray

    @property
    def largest(self) -> float:
        """[Pa], at least |y . K_s y| over the integral of H : H."""
        principal = np.abs(np.linalg.eigvalsh(self.beside)).max(axis=1)
        return float((principal + (self.beside.shape[1] - 1) * np.abs(self.mean)).max())


class Prestress:
    """Of bodies of one group of small strain that supports hold, each by displacements x (nn, d) [m] along the world's axes. K of laws of
    points is that at their beginning."""

    def __init__(self, group: Group) -> None:
        self._group, cell = group, CELL_TYPES[group.part.cell_type]
        self._gradient = gradients(cell, cell.inside, group.part.points @ group.rotation.T, group.part.cells)
        self._material = LeftOut(group, self._gradient)

    def stress(self, x: FloatArray) -> Stress:
        """At the points `CellType.inside` of all cells."""
        d = x.shape[1]
        H = (self._gradient @ x).reshape(-1, d, d).transpose(0, 2, 1)
        strain = 0.5 * (H + H.transpose(0, 2, 1))
        mean = self._material.mean_stress(strain)
        return Stress(self._material.stress(strain) - mean[:, None, None] * np.eye(d), mean)

    def of_cells(self, stress: FloatArray) -> Stress:
        """At the same points, from what a law of points gives for each cell (nc, 6) [Pa] in the part's axes: xx, yy, zz, xy, yz, zx."""
        R, d = self._group.rotation, len(self._group.rotation)
        mean = stress[:, :3].sum(axis=1) / 3
        own = stress[:, PAIR][:, :d, :d]
        beside = np.einsum("ik,nkl,jl->nij", R, own, R) - mean[:, None, None] * np.eye(d)
        times = len(self._material.volume) // len(stress)
        return Stress(np.tile(beside, (times, 1, 1)), np.tile(mean, times))

    @cached_property
    def bears(self) -> float:
        """What `Stress.largest` must exceed [Pa] for K_s to be as large as K anywhere, by supports alone."""
        d = self._group.part.dimension
        n = len(self._material.volume)
        all_around = Stress(np.broadcast_to(np.eye(d), (n, d, d)), np.zeros(n))
        return 1 / max(_largest(self._stiffness(all_around), self._K, self._factor), 1e-300)

    def share(self, stress: Stress, least: float, held: sp.csr_array | None = None) -> float:
        """Which share of the load that buckles the body a stress is, 0 where that is less than `least`; held (n_part, m):
        directions, along the supports' axes, in which the body does not give way."""
        more, (K, factor) = self._stiffness(stress), self._held(held)
        if positive_definite(sp.csr_array(K + more / least)):  # told apart at once: where nothing buckles, iterations do not end
            return 0.0
        return _largest(-more, K, factor)

    def straightened(self, stress: Stress, x: FloatArray, held: sp.csr_array | None = None) -> float:
        """By which share of themselves the displacements x (nn, d) are too large under a stress that holds the body straight, 0
        where it does not; held: as in `share`."""
        T, free = self._group.axes_matrix, ~self._group.driven
        own = (x.ravel() if T is None else T @ x.ravel())[free]
        less = np.zeros(len(free))
        less[free] = self._held(held)[1].solve(self._stiffness(stress) @ own)
        if not less[free] @ own > 0:
            return 0.0
        of_nodes = (less if T is None else T.T @ less).reshape(x.shape)
        return float(np.ptp(of_nodes, axis=0).max() / np.ptp(x, axis=0).max())

    def _held(self, held: sp.csr_array | None) -> tuple[sp.csr_array, Factor]:
        """K of the free unknowns and its factor, with the directions `held` as firm as contacts are."""
        if held is None or not held.shape[1]:
            return self._K, self._factor
        rows = sp.csr_array(held[~self._group.driven])
        K = sp.csr_array(self._K + FIRM * self._K.diagonal().max() * (rows @ rows.T))
        return K, factorise(K, positive_definite=True)

    def _stiffness(self, stress: Stress) -> sp.csr_array:
        """K_s of the free unknowns along the supports' axes."""
        n, d = stress.beside.shape[:2]
        volume = self._material.volume
        blocks = sp.bsr_array((stress.beside * volume[:, None, None], np.arange(n), np.arange(n + 1)), shape=(n * d, n * d))
        whole = sp.kron(self._gradient.T @ (blocks @ self._gradient), sp.eye_array(d), format="csr")
        weight = sp.diags_array(stress.mean * volume)
        for i, j in ((0, 1), (1, 2), (0, 2))[: 2 * d - 3]:
            one, other = self._gradient[i::d], self._gradient[j::d]
            turning = one.T @ (weight @ other)
            turning = sp.csr_array(turning - turning.T)
            unit = np.zeros((d, d))
            unit[i, j], unit[j, i] = 1.0, -1.0
            whole = whole + sp.kron(turning, unit, format="csr")
        T, free = self._group.axes_matrix, ~self._group.driven
        whole = whole if T is None else T @ whole @ T.T
        return sp.csr_array(sp.csr_array(whole)[free][:, free])

    @cached_property
    def _K(self) -> sp.csr_array:
        T, K, free = self._group.axes_matrix, self._group.K, ~self._group.driven
        assert isinstance(K, sp.csr_array)
        return sp.csr_array(sp.csr_array(K if T is None else T @ K @ T.T)[free][:, free])

    @cached_property
    def _factor(self) -> Factor:
        return factorise(self._K, positive_definite=True)


def positive_definite(A: sp.csr_array) -> bool:
    """Whether a symmetric matrix is positive definite."""
    try:
        factorise(A, positive_definite=True)
    except SingularMatrix:
        return False
    return True


def _largest(B: sp.csr_array, K: sp.csr_array, factor: Factor) -> float:
    """The largest eigenvalue of B y = theta K y with the factor of K; 0 where it is not positive."""
    n = K.shape[0]
    if n <= DENSE_UP_TO:
        return max(0.0, float(scipy.linalg.eigh(B.toarray(), K.toarray(), eigvals_only=True)[-1]))
    inverse = LinearOperator((n, n), matvec=factor.solve, dtype=float)
    try:
        found = eigsh(B, 1, K, which="LA", Minv=inverse, tol=PRECISE, v0=probes(n)[0], maxiter=RESTARTS, return_eigenvectors=False)
    except ArpackNoConvergence:
        return float("inf")
    return max(0.0, float(found[0]))
