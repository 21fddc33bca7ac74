"""One regularised problem, by Newton's method or along a path whose end is its solution.

With the centre c and rho_a = 1 / (alpha D_a) a contact's reaction follows from its velocity alone: r = P(z), z = c - rho u, where P is
zero for z_N <= 0, z inside the friction cone, and (z_N, mu z_N z_T / ||z_T||) beside it. What is left is

    F(r) = P(c - rho (W r + q)) - r = 0,    (1 + K W) dr = F,  K = rho dP/dz,

piecewise smooth: a piece has the contacts' statuses. Newton's method jumps from piece to piece and may do so for ever. The path does not:
w (m,) is what u would have to change by for the start to be a solution, and along

    P(c - rho (W r + q + (1 - t) w)) = r,    t from 0 to 1,

one contact after the other changes its status. Which way t goes in a piece is said by the sign of det(1 + K W): where that turns, the path
folds and t falls. So it ends where the determinant is positive, as it is at the one solution of a large alpha. In a piece z is taken for
linear in t; what that leaves, P(z) - r, is carried along as a part of w: it vanishes towards t = 1, and turns with the path where t falls.

Sources: J. Katzenelson, Bell Syst. Tech. J. 44, 1965 (piecewise linear equations along their pieces); M. Kojima, R. Saigal, Math. Program.
21, 1981 (determinants); R. T. Rockafellar, SIAM J. Control Optim. 14, 1976 (regularisation). Its use for friction is our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.linear.factors import SingularMatrix
from fcsim.solvers.base import Monitor
from fcsim.solvers.proximal import _path_kernels as kernels
from fcsim.solvers.proximal._following_kernels import ARRIVED, SHORT, follow_in_velocities
from fcsim.solvers.proximal._inner_kernels import FOUND, newton_on_pieces
from fcsim.solvers.proximal.pieces import InVelocities, Pieces

TURN = 1.0
"""Tangent of the angle that a sliding contact's z_T may turn by in a step."""
BACK = -0.5
"""t below which a path is given up."""
RUNAWAY = 1e4
"""Growth of what Newton's method leaves at which it is given up."""
LEAST_REST = 1e-3
"""Least 1 - t by which the rest is divided: what is left of the path is not that short."""
ROOM = 36
"""Changes of low rank before the bodies' matrix is factored anew: an elimination costs what some thirty solutions with its factor do."""
AGAIN = 4
"""Paths that are followed for one problem: from the end of each, where Newton's method does not arrive from there."""
ACCURACY = 1e-3
"""What the equations of motion may be left with on the way over w as a momentum, both by their norms."""


PERIOD = 3
"""Pieces after which what a path's equations are left with is looked at. 35 hard steps of rigid masonry took 136 000 eliminations with 1
and 3, 168 000 with 4, 175 000 with 8 (chance is as large), and with 3 0.88 of the time of 1."""


def in_space(vectors: FloatArray) -> FloatArray:
    """Of vectors (nc, d) three numbers each, in 2D the last is zero."""
    if vectors.shape[1] == 3:
        return vectors
    return np.column_stack([vectors, np.zeros(len(vectors))])


@dataclass(frozen=True)
class Regularised:
    """The problem of one centre and alpha: z = c - rho (W r + q); all (nc, d) but rho, mu (nc,)."""

    pieces: Pieces
    q: FloatArray
    mu: FloatArray
    rho: FloatArray
    monitor: Monitor

    def rest(self, F: FloatArray) -> float:
        """||W F|| relative to what the error divides by: the velocities that F stands for."""
        return float(np.linalg.norm(self.pieces.product(F))) / (self.monitor.scale or 1.0)

    def newton(self, z: FloatArray, r: FloatArray, target: float, most: int) -> FloatArray | None:
        """P(z) of the solution to a rest of target, by Newton's method from z = c - rho (W r + q); None after so many iterations. Compiled
        in the bodies' velocities, where r may be given as H r (n,)."""
        if not isinstance(self.pieces, InVelocities):
            return self.newton_by_pieces(z, r, target, most)
        if self.monitor.out_of_time():
            return None
        least, p = target * (self.monitor.scale or 1.0), self.pieces.impulses(r) if r.ndim > 1 else r
        order = self.pieces.order
        given = *self.pieces.arrays, self.pieces.mass, in_space(z)[order], p
        ended, count, found = newton_on_pieces(*given, self.mu[order], self.rho[order], least, RUNAWAY, most)
        self.monitor.iterations += count
        return self.pieces.ordered(found)[:, : z.shape[1]] if ended == FOUND else None

    def newton_by_pieces(self, z: FloatArray, r: FloatArray, target: float, most: int) -> FloatArray | None:
        """`newton` by the pieces, whatever they are."""
        first = np.inf
        for k in range(most + 1):
            found, K = kernels.law(z, self.mu, self.rho, kernels.statuses(z, self.mu))
            rest = self.rest(found - r)
            if rest <= target:
                return found
            first = min(first, rest)
            if k == most or not rest < RUNAWAY * first or self.monitor.out_of_time():
                return None
            try:
                self.pieces.factor(K)
            except SingularMatrix:
                return None
            dr, du = self.pieces.solve(found - r)
            r, z = r + dr, z - self.rho[:, None] * du  # not from u anew, of which a last bit is many of z
            self.monitor.iterations += 1
        return None

    def end(self, z: FloatArray, status: IntArray, target: float, newton: int, least: int, most: int, budget: int) -> FloatArray | None:
        """P(z) of the solution to a rest of target, along a path from z (nc, d) with these statuses and then by at most so many of Newton's
        iterations; where these do not arrive, again from there. least, most: pieces of a path; budget: of all that is counted."""
        start, _ = kernels.law(z, self.mu, self.rho, status)
        centre, until = start, self.monitor.iterations + budget
        for _ in range(AGAIN):
            w = (centre - z) / self.rho[:, None] - (self.pieces.product(start) + self.q)
            left = until - self.monitor.iterations
            end = self.follow(z, status, w, min(least, left), min(most, left)) if left > 0 else None
            if end is None:
                return None
            z, r, status = end
            found = self.newton(z, r, target, max(0, min(newton, until - self.monitor.iterations)))
            if found is not None:
                return found
            start, _ = kernels.law(z, self.mu, self.rho, status)
        return None

    def follow(
        self, z: FloatArray, status: IntArray, w: FloatArray, least: int, most: int
    ) -> tuple[FloatArray, FloatArray, IntArray] | None:
        """(z, r, statuses) at the end of the path from a solution for q + w, with z there and its statuses; None where that is not met
        within `least` pieces, `most` where the path is on its way (`on_its_way`), or is lost. Compiled in the bodies' velocities, where
        H r (n,) stands for r."""
        pieces = self.pieces
        if not isinstance(pieces, InVelocities):
            return self.along(z, status, w, least, most)
        accuracy = ACCURACY * pieces.mean_mass * float(np.linalg.norm(w))
        limits = least, most, TURN, BACK, LEAST_REST, ROOM, accuracy, PERIOD
        order = pieces.order
        given = in_space(z)[order], status[order], in_space(w)[order], self.mu[order], self.rho[order], z.shape[1]
        ended, count, end, p, status = follow_in_velocities(*pieces.arrays, *given, *limits)
        self.monitor.iterations += count
        return (pieces.ordered(end)[:, : z.shape[1]], p, pieces.ordered(status)) if ended == ARRIVED else None

    def along(
        self, z: FloatArray, status: IntArray, w: FloatArray, least: int, most: int
    ) -> tuple[FloatArray, FloatArray, IntArray] | None:
        """`follow` by the pieces, whatever they are."""
        pieces, mu, rho, status, t = self.pieces, self.mu, self.rho, status.copy(), 0.0
        found, K = kernels.law(z, mu, rho, status)
        r, contact, count, short = found, -1, 0, 0
        reached = [0.0]
        while kernels.on_its_way(count, least, most, t, short, reached[count // 2]):
            try:
                if contact < 0:
                    pieces.factor(K)
                else:
                    pieces.change(contact, K)
            except SingularMatrix:
                return None
            self.monitor.iterations += 1
            count, way = count + 1, pieces.sign
            right = way * (np.einsum("aij,aj->ai", pieces.K, w) + (found - r) / max(1.0 - t, LEAST_REST))
            dr, du = pieces.solve(right)
            dz = -rho[:, None] * (du - way * w)
            length, contact, to = kernels.end_of_piece(z, dz, mu, status, TURN)
            if way > 0 and t + length >= 1:
                return z + (1 - t) * dz, r + (1 - t) * dr, status
            t += way * length
            reached.append(t)
            short += length < SHORT
            if not BACK < t < np.inf or self.monitor.out_of_time():
                return None
            r, z = r + length * dr, z + length * dz
            if contact >= 0:
                status[contact] = to
            found, K = kernels.law(z, mu, rho, status)
        return None
