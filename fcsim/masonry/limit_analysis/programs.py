"""The programs of limit analysis: linear in 2D (HiGHS), with second-order cones in 3D (Clarabel)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # whose optimize is loaded where it is used
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.masonry.limit_analysis.canonical import DIGITS, canonical
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem
from fcsim.solvers.variational.conic import clarabel_module

_ALIKE = 1e3
"""Numbers of one order: their quotient is not beyond this."""
_ROUGH = 1e3
"""Friction beyond it (an angle of 89.94 degrees) counts as this, so that numbers stay near 1."""
_NEAR_NONE = 1e-6  # of a natural multiplier: where a mechanism goes at none, forces that belong to it may lie beside it
_STILL = {2: 1e-7, 3: 1e-4}  # of the largest contact velocity; interior points are rounder than corners
_OPENS = 1.001  # of the dilatancy, which is met to the digits of a program
ASTRAY = {2: (0.0,), 3: (1e-7, 1e-4)}
"""Shares of mu r_N, one after the other, by which friction may differ from what the slip asks: in space its direction is known to some
digits alone, and where it decides all forces none would meet it exactly."""


@dataclass(frozen=True, eq=False)
class Slip:
    """What a mechanism asks of contact forces: none where it opens, friction -mu r_N t along the slip t (nc, d - 1) where it slides, in
    space to a share `astray` of mu r_N."""

    opens: BoolArray
    slides: BoolArray
    along: FloatArray
    astray: float = 0.0


def slip_of(program: Program, v: FloatArray, dilatancy: float = 0.0) -> Slip:
    """What the program's mechanism v (n,) asks of contact forces; a contact far slower than the fastest one is at rest, and one that
    parts no faster than dilatancy mu times its slip slides."""
    d = program.form.dimension
    u = (program.form.H.T @ v).reshape(-1, d)
    none = _STILL[d] * max(float(np.abs(u).max()), 1e-300)
    speed = np.linalg.norm(u[:, 1:], axis=1)
    opens = u[:, 0] > none + _OPENS * dilatancy * program.mu * speed
    slides = ~opens & (speed > none)
    return Slip(opens, slides, u[:, 1:] / np.where(slides, speed, 1.0)[:, None])


@dataclass(frozen=True, eq=False)
class Answer:
    """A program's optimum: the multiplier lambda, contact forces r (m,) and the mechanism v (n,), the dual, both in the program's form."""

    multiplier: float
    r: FloatArray
    v: FloatArray


class Program:
    """max lambda subject to H r + dead + lambda live = 0 and friction, in the form of `canonical`: its numbers are near 1 whatever the
    units and however unlike the loads, since the tolerances of the programs' solvers are absolute.

    Multipliers are in units of `natural`, which is 1 where both kinds of loads are of one order.
    """

    def __init__(self, problem: LimitProblem, dead: FloatArray, live: FloatArray, digits: int = DIGITS) -> None:
        form = canonical(problem, dead, live, digits)
        self.mu = np.minimum(form.mu, _ROUGH)
        self.form = form
        stays, grows = float(np.abs(form.dead).max(initial=0.0)), float(np.abs(form.live).max(initial=0.0))
        alike = not (stays and grows) or 1 / _ALIKE < grows / stays < _ALIKE
        self.natural = 1.0 if alike else stays / grows
        self.live = form.live * self.natural
        self.balance = sp.hstack([form.H, sp.csc_array(self.live[:, None])], format="csc")

    def solve(
        self,
        *,
        given: FloatArray | None = None,
        share: float = 0.0,
        slip: Slip | None = None,
        at_least: float = 0.0,
        at_most: float = np.inf,
        sign: float = 1.0,
    ) -> Answer | None:
        """The largest lambda <= at_most, or with sign = -1 the least >= at_least; None where the program has no answer.

        given (nc,): the normal forces of Tresca's disks in place of Coulomb's cones, of which a `share` stays: friction is
        mu ((1 - share) given + share r_N); slip: the mechanism to which forces are to belong.
        """
        low = at_least / self.natural if slip is None else -_NEAR_NONE
        bounds = low, at_most / self.natural
        found = (self._linear if self.form.dimension == 2 else self._conic)(given, share, slip, bounds, sign)
        if found is None:
            return None
        multiplier, r, dual = found
        v = np.zeros(len(self.live))
        dual = dual[: len(self.live)]
        power = float(self.live @ dual) / self.natural
        if power != 0:
            v = dual / (power * self.form.force)
        multiplier = max(multiplier, low if slip is None else 0.0)  # interior points come to bounds from either side
        return Answer(multiplier * self.natural + 0.0, r, v)  # + 0.0: none, not -0

    def _equal(self, rows: sp.csc_array | None) -> tuple[sp.csc_array, FloatArray]:
        """Equilibrium, and rows whose product with (r, lambda) is zero."""
        if rows is None:
            return self.balance, -self.form.dead
        return sp.vstack([self.balance, rows], format="csc"), np.append(-self.form.dead, np.zeros(rows.shape[0]))

    def _none(self, slip: Slip) -> sp.csc_array:
        """Rows whose product with (r, lambda) are the forces where the mechanism opens."""
        d, size = self.form.dimension, self.form.H.shape[1] + 1
        none = (d * np.flatnonzero(slip.opens)[:, None] + np.arange(d)).ravel()
        return sp.csc_array((np.ones(len(none)), (np.arange(len(none)), none)), shape=(len(none), size))

    def _friction_off(self, slip: Slip) -> sp.csc_array:
        """Rows whose product with (r, lambda) is r_T + mu r_N t at every contact that slides."""
        d, mu = self.form.dimension, self.mu
        sliding = np.flatnonzero(slip.slides)
        count = (d - 1) * len(sliding)
        tangents = (d * sliding[:, None] + np.arange(1, d)).ravel()
        against = (mu[sliding, None] * slip.along[sliding]).ravel()
        columns = np.concatenate([tangents, np.repeat(d * sliding, d - 1)])
        values = np.concatenate([np.ones(count), against])
        return sp.csc_array((values, (np.tile(np.arange(count), 2), columns)), shape=(count, self.form.H.shape[1] + 1))

    def _linear(
        self, given: FloatArray | None, share: float, slip: Slip | None, bounds: tuple[float, float], sign: float
    ) -> tuple[float, FloatArray, FloatArray] | None:
        equal, right = self._equal(None if slip is None else sp.vstack([self._none(slip), self._friction_off(slip)], format="csc"))
        mu, nc = self.mu, len(self.mu)
        a = np.arange(nc)
        cone = mu if given is None else share * mu
        values = np.concatenate([np.ones(nc), -cone, -np.ones(nc), -cone])
        rows = np.concatenate([a, a, nc + a, nc + a])
        columns = np.concatenate([2 * a + 1, 2 * a, 2 * a + 1, 2 * a])
        friction = sp.csc_array((values, (rows, columns)), shape=(2 * nc, 2 * nc + 1))
        most = np.zeros(2 * nc) if given is None else np.tile((1 - share) * mu * given, 2)
        limits = np.stack([np.append(np.tile([0.0, -np.inf], nc), bounds[0]), np.append(np.full(2 * nc, np.inf), bounds[1])], axis=1)
        cost = np.zeros(2 * nc + 1)
        cost[-1] = -sign
        # Tresca's fixed point ends lowest from the corners that the dual simplex method finds; elsewhere interior points are quicker
        way = "highs-ipm" if given is None else "highs-ds"
        answer = scipy.optimize.linprog(cost, A_ub=friction, b_ub=most, A_eq=equal, b_eq=right, bounds=limits, method=way)
        if answer.status != 0:
            return None
        return float(answer.x[-1]), answer.x[:-1], np.asarray(answer.eqlin.marginals)

    def _conic(
        self, given: FloatArray | None, share: float, slip: Slip | None, bounds: tuple[float, float], sign: float
    ) -> tuple[float, FloatArray, FloatArray] | None:
        clarabel = clarabel_module()
        equal, right = self._equal(None if slip is None else self._none(slip))
        mu, nc, d = self.mu, len(self.mu), self.form.dimension
        size = d * nc + 1
        normal = d * np.arange(nc)
        tangents = (normal[:, None] + np.arange(1, d)).ravel()
        push = sp.csc_array((-np.ones(nc), (np.arange(nc), normal)), shape=(nc, size))
        rows, sides = [equal, push], [right, np.zeros(nc)]
        for bound, direction in zip(bounds, (-1.0, 1.0), strict=True):
            if np.isfinite(bound):
                rows.append(sp.csc_array((np.array([direction]), ([0], [size - 1])), shape=(1, size)))
                sides.append(np.array([direction * bound]))
        lines = sum(len(side) for side in sides[1:])
        weight, heads = mu if given is None else share * mu, np.zeros(d * nc)
        if given is not None:
            heads[normal] = (1 - share) * mu * given
        entries = np.concatenate([normal, tangents])
        rows.append(sp.csc_array((np.concatenate([-weight, -np.ones(len(tangents))]), (entries, entries)), shape=(d * nc, size)))
        count = nc
        if slip is not None:  # |r_T + mu r_N t| <= a small part of mu r_N where it slides
            sliding = np.flatnonzero(slip.slides)
            count += len(sliding)
            near = sp.csc_array((slip.astray * mu[sliding], (np.arange(len(sliding)), d * sliding)), shape=(len(sliding), size))
            rows.append(-sp.vstack([near, self._friction_off(slip)], format="csr")[_heads_first(len(sliding), d)])
            heads = np.append(heads, np.zeros(d * len(sliding)))
        cones = [clarabel.ZeroConeT(len(right)), clarabel.NonnegativeConeT(lines), *[clarabel.SecondOrderConeT(d)] * count]
        cost = np.zeros(size)
        cost[-1] = -sign
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        A = sp.csc_matrix(sp.vstack(rows))
        answer = clarabel.DefaultSolver(sp.csc_matrix((size, size)), cost, A, np.concatenate([*sides, heads]), cones, settings).solve()
        if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        x = np.array(answer.x)
        return float(x[-1]), x[:-1], np.array(answer.z)[: len(right)]


def _heads_first(count: int, d: int) -> IntArray:
    """The order in which rows of `count` heads, then of d - 1 entries of each, become cones one after the other."""
    each = np.arange(count)[:, None]
    return np.hstack([each, count + (d - 1) * each + np.arange(d - 1)]).ravel()
