"""A force and a moment that turn with a set of nodes, spread over them, and their derivative.

Nodes with shares w_a of one (of a surface's area) and places X_a in the reference, x_a as they stand, both from their own centres
sum w_a X_a and c = sum w_a x_a. R is the rotation of the polar decomposition of A = sum_a w_a x_a X_a^T: of all rotations the one that
leaves the least sum w_a |x_a - R X_a|^2; nodes of a plane (in 2D of a line) have one too. With the generators G_s of the rotations,
[e_s x] in 3D and a quarter turn in 2D,

    F_a = w_a (R f + G(a) x_a),  G(a) = sum_s a_s G_s,  J a = R m,  J_st = sum_a w_a (G_s x_a) . (G_t x_a)

has the resultant R f, which acts at c, and the moment R m about it (2D: m). For changes dx_b of the nodes

    dR = R G(phi),  M phi = sum_b w_b (G_s X_b) . R^T dx_b,  M_st = -tr(G_s^T G_t^T R^T A)
    J da = dR m - sum_b w_b (G_s^T G(a) + G(a)^T G_s) x_b . dx_b
    dF_a = w_a (R G(phi) f + G(da) x_a + G(a) (dx_a - dc))

Source of the derivative of a polar rotation: B. Fraeijs de Veubeke, "The dynamics of flexible bodies", Int. J. Eng. Sci. 14, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.forms.rotations import polar_rotation

_QUARTER = np.array([[[0.0, -1.0], [1.0, 0.0]]])
_ABOUT = np.zeros((3, 3, 3))  # [e_s x]
_ABOUT[[0, 1, 2], [2, 0, 1], [1, 2, 0]], _ABOUT[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1, -1


@dataclass(frozen=True, eq=False)
class TurningForce:
    """share (k,) and place (k, d) [m] of the nodes in the reference; force (d,) [N] and moment (3,), in 2D (1,), [N m] there."""

    share: FloatArray
    place: FloatArray
    force: FloatArray
    moment: FloatArray

    def _at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """R (d, d), the arms X and x (k, d) from their centres, J (s, s), for nodes at x (k, d)."""
        G = generators(x.shape[1])
        X, arm = self.place - self.share @ self.place, x - self.share @ x
        (R,) = polar_rotation((arm.T @ (self.share[:, None] * X))[None])
        spun = np.einsum("sij,aj->asi", G, arm)
        return R, X, arm, np.einsum("a,asi,ati->st", self.share, spun, spun)

    def _turned(self, R: FloatArray) -> FloatArray:
        return R @ self.moment if len(R) == 3 else self.moment

    def forces(self, x: FloatArray) -> FloatArray:
        """F (k, d) [N] for nodes at x (k, d) [m]."""
        R, _, arm, J = self._at(x)
        about = np.einsum("s,sij->ij", np.linalg.solve(J, self._turned(R)), generators(len(R)))
        forces: FloatArray = self.share[:, None] * (R @ self.force + arm @ about.T)
        return forces

    def tangents(self, x: FloatArray) -> FloatArray:
        """Derivatives (k, k, d, d) [N/m] of `forces` (a, ., i, .) by the nodes' places (., b, ., k)."""
        w, (R, X, arm, J) = self.share, self._at(x)
        G, d = generators(len(R)), len(R)
        N = R.T @ (arm.T @ (w[:, None] * X))
        M = -np.einsum("sji,tkj,ki->st", G, G, N)
        phi = np.einsum("st,b,tij,bj,ki->bsk", np.linalg.inv(M), w, G, X, R, optimize=True)
        a = np.linalg.solve(J, self._turned(R))
        about = np.einsum("s,sij->ij", a, G)
        both = G.transpose(0, 2, 1) @ about + about.T @ G
        change = -np.einsum("b,sij,bj->bsi", w, both, arm)
        if d == 3:
            change = change + np.einsum("st,bti->bsi", (R @ (G @ self.moment).T), phi)
        spin = np.einsum("st,bti->bsi", np.linalg.inv(J), change)
        turned = np.einsum("ij,sjk,k,bsl->bil", R, G, self.force, phi, optimize=True) - w[:, None, None] * about
        tangents: FloatArray = turned[None] + np.einsum("sij,aj,bsl->abil", G, arm, spin, optimize=True)
        own = np.arange(len(w))
        tangents[own, own] += about
        return w[:, None, None, None] * tangents


def generators(d: int) -> FloatArray:
    """G_s (s, d, d)."""
    return _ABOUT if d == 3 else _QUARTER
