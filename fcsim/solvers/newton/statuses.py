"""The status of contacts from one linearisation of Newton's method to the next: changes that count for nothing are left out.

Alart and Curnier's F(u, r) is made of three pieces, those of an open, a sliding and a sticking contact, each smooth beyond where it holds.
A contact whose y = r - rho u has come to another piece, but so little that its own old equation differs from the new one by less than what
the tolerance would notice, keeps the old one: with all that are kept

    ||s (F_before - F)|| <= LEAST tol scale        (s: the contacts' compliances, scale: what the error divides by)

so that what they leave of the error is below the tolerance. Where a wall's contacts slip by less than the tolerance, a linear system's
defect decides on which side of stick and slip they are. Made to stick where their equation was missed by 1e-8 they carry what makes the
error thousands of times as large, to be released again by the next system; kept sliding they have nearly the right reaction as it is.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.solvers.newton.formulations import Linearisation
from fcsim.solvers.newton.systems._condensed_kernels import roles

LEAST = 0.3
"""Share of the tolerance that the contacts which keep their status may leave."""
OPEN, SLIDING, STICKING = 0, 1, 2


class Statuses:
    """Those of the last linearisation."""

    def __init__(self) -> None:
        self._before: IntArray | None = None

    def kept(
        self, given: Linearisation, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, weight: FloatArray, limit: float
    ) -> Linearisation:
        """F, A, B `given` at u, r (nc, d) with the equations of before for contacts that may keep them, weight (nc,) and limit: s and the
        bound above; F, A, B are written to."""
        F, A, B = given
        closed, sticking = roles(A, B)
        now = closed + sticking.astype(np.int64)
        before, self._before = self._before, now
        if before is None:
            return given
        changed = np.flatnonzero(now != before)
        if not len(changed):
            return given
        old = equations(u[changed], r[changed], mu[changed], rho[changed], before[changed])
        missed = weight[changed] * np.linalg.norm(old[0] - F[changed], axis=1)
        order = np.argsort(missed, kind="stable")
        keep = order[np.cumsum(missed[order] ** 2) <= limit**2]
        own = changed[keep]
        F[own], A[own], B[own] = (x[keep] for x in old)
        now[own] = before[own]
        return F, A, B


def made_to_slide(given: Linearisation, slides: BoolArray, u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray) -> Linearisation:
    """F, A, B `given` at u, r (nc, d) with the equations of sliding for those sticking contacts that are to slide (nc,); they are written
    to."""
    F, A, B = given
    few = np.flatnonzero(slides)
    own = few[roles(A[few], B[few])[1]]
    F[own], A[own], B[own] = equations(u[own], r[own], mu[own], rho[own], np.full(len(own), SLIDING))
    return F, A, B


def equations(u: FloatArray, r: FloatArray, mu: FloatArray, rho: FloatArray, status: IntArray) -> Linearisation:
    """F, A, B of Alart and Curnier's equations, see `formulations`, on the pieces that `status` (k,) names, wherever y is."""
    y, d = r - rho * u, u.shape[1]
    F, A, B = r.copy(), np.zeros((len(u), d, d)), np.zeros((len(u), d, d))
    is_open, slides, sticks = (status == which for which in (OPEN, SLIDING, STICKING))
    B[is_open] = np.eye(d)
    F[~is_open, 0] = (rho * u)[~is_open, 0]
    A[~is_open, 0, 0] = rho[~is_open, 0]
    F[sticks] = (rho * u)[sticks]
    A[sticks] = rho[sticks, :, None] * np.eye(d)
    length, radius = np.linalg.norm(y[:, 1:], axis=1), mu * y[:, 0]
    n = y[:, 1:] / np.where(length > 0, length, 1.0)[:, None]
    ratio = np.clip(radius / np.where(length > 0, length, 1.0), 0.0, 1.0)
    P = ratio[:, None, None] * (np.eye(d - 1) - n[:, :, None] * n[:, None, :])
    F[slides, 1:] = (r[:, 1:] - radius[:, None] * n)[slides]
    A[slides, 1:, 0] = (mu * rho[:, 0])[slides, None] * n[slides]
    B[slides, 1:, 0] = -mu[slides, None] * n[slides]
    A[slides, 1:, 1:] = P[slides] * rho[slides, None, 1:]
    B[slides, 1:, 1:] = np.eye(d - 1) - P[slides]
    return F, A, B
