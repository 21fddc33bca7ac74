"""Where Newton's unknowns live: the linear part of a problem, which gives du for dr and keeps u of the iterate.

In `LocalSpace` r alone is unknown and u = (W + D) r + q; (v, r, l) of the global and (r, l) of the mixed form are in `kkt`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.sparse._vectors_kernels import weighted_sum
from fcsim.problem import Followed
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton.systems.condensed import CondensedSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.over_ranks import SystemOverRanks
from fcsim.solvers.newton.systems.two_level.alone import SystemByBodies
from fcsim.solvers.newton.systems.two_level.settling import NEAR, NEARLY, SMALL, STILL_WORTH, WORTH, ContactIterate, SettlesJoints


class NewtonSpace(Protocol):
    """The linear part of a problem: keeps u of the current iterate, solves for Newton's step and follows it."""

    u: FloatArray
    exact: bool
    """Whether u was computed from the unknowns themselves, not from the last u and the step: an answer is accepted on such a u alone."""

    needed: float
    """The factor by which the error has still to fall, of which an iterative solver of the step may make use."""

    foreseen: bool
    """Whether the step's equations have the statuses that the last solution had, of which most will hold."""

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (dr, du) with A du + B dr = -F; raises SingularMatrix."""
        ...

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the steepest descent (dr, du) of 0.5 ||F||^2 down to the minimum of its linear model."""
        ...

    def move(self, t: float) -> None:
        """Go t along the last step or gradient."""
        ...

    def recompute(self) -> None:
        """Compute u of the current iterate anew."""
        ...


RECOMPUTED = 8
"""Moves after which u is computed anew: its update is exact but for round-off, which must not grow."""
LENGTHS, FALLS = (1.0, 0.5, 0.25, 0.1), 0.95
"""Parts of Newton's step that are tried where it stalls, and what the error must fall below, relative to the one before, to take one."""


class LocalSpace:
    """u = (W + D) r + q, with the operator W + D of the linear system."""

    def __init__(self, system: NewtonSystem, q: FloatArray, r: FloatArray) -> None:
        self._system, self._q, self._r = system, q, r
        self._moves, self.needed, self.foreseen = 0, 0.0, False
        self.recompute()

    def recompute(self) -> None:
        self._Wr = self._system.operator.times(self._r)
        self.u = self._Wr + self._q
        self.exact = True

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        if isinstance(self._system, CondensedSystem | SystemOverRanks | SystemByBodies):
            self._system.needed, self._system.foreseen = self.needed, self.foreseen
        self._dr, self._Wdr = self._system.solve(A, B, -F)
        return self._dr, self._Wdr

    @property
    def knows_joints(self) -> bool:
        """Whether the system is one of a large W by joints and bodies."""
        return isinstance(self._system, SettlesJoints) and self._system.by_joints

    def length(self, monitor: Monitor, error: float) -> float:
        """How far to go along the last step, as a part of it: as far of LENGTHS as the error of all contacts is least, where the whole step
        raises it above `error`, that of the iterate. 1 far from a solution, where no length brings it down, and but of a large W by joints
        and bodies."""
        if not self.knows_joints or not error <= NEAR:
            return 1.0
        errors = [monitor.error(self._r + t * self._dr, self.u + t * self._Wdr) for t in LENGTHS]
        least = int(np.argmin(errors))
        return LENGTHS[least] if errors[0] > error and errors[least] < FALLS * error else 1.0

    def settle(self, mu: FloatArray, rho: FloatArray, monitor: Monitor) -> FloatArray | None:
        """Go on to where patches around joints that the last step left unsolved are solved, in rounds, on Alart and Curnier's
        equations with rho (nc, d); r (m,) there. None, and nowhere, where there are none or none are needed, the system does not
        know joints, or the error is no less there."""
        system, error = self._system, monitor.error(self._r, self.u)
        if not isinstance(system, SettlesJoints) or not system.by_joints or not monitor.tol < error <= NEAR:
            return None
        settled = None
        for _ in range(system.rounds.most):
            limit = max(SMALL * monitor.tol, system.rounds.part * error) * monitor.scale
            at = ContactIterate(self.u.reshape(rho.shape), self._r.reshape(rho.shape), mu, rho, monitor.compliance)
            found = system.settled(at, limit)
            if found is None:
                break
            self._dr, self._Wdr = found
            t, after = self._towards_settled(monitor, error)
            if after >= error:
                break
            self.move(t)
            settled = self._r
            if after <= monitor.tol or after > (STILL_WORTH if after <= NEARLY * monitor.tol else system.rounds.worth) * error:
                break
            error = after
        return settled

    def _towards_settled(self, monitor: Monitor, error: float) -> tuple[float, float]:
        """How far to go to where joints are solved, all the way or half, and the error there: what each gives off while all others are held
        may add up to more than it mends."""
        after = monitor.error(self._r + self._dr, self.u + self._Wdr)
        if after <= max(monitor.tol, WORTH * error):
            return 1.0, after
        half = monitor.error(weighted_sum(1.0, self._r, 0.5, self._dr), weighted_sum(1.0, self.u, 0.5, self._Wdr))
        return (0.5, half) if half < after else (1.0, after)

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        W = self._system.operator
        g = W.transposed_product(np.einsum("aij,ai->aj", A, F).ravel()) + np.einsum("aij,ai->aj", B, F).ravel()
        Wg = W @ g
        Jg = np.einsum("aij,aj->ai", A, Wg.reshape(F.shape)) + np.einsum("aij,aj->ai", B, g.reshape(F.shape))
        length = float(g @ g) / (float(np.sum(Jg * Jg)) or 1.0)
        self._dr, self._Wdr = -length * g, -length * Wg
        return self._dr, self._Wdr

    def move(self, t: float) -> None:
        self._r = weighted_sum(1.0, self._r, t, self._dr)
        self._moves += 1
        if self._moves % RECOMPUTED == 0:
            self.recompute()
            return
        self._Wr = weighted_sum(1.0, self._Wr, t, self._Wdr)
        self.u = self._Wr + self._q
        self.exact = False


BEGINS = 1e-3
"""Error from which on q is linearised anew: before that the next iteration moves r by more than q is wrong by. On a wall 1e-2 saves no
iteration, 1e-4 costs one in thirty."""

SETTLES = 0.05
"""What a linearisation leaves of the change that it brought, as long as no second one has told."""


class FollowingSpace(LocalSpace):
    """u = W r + q(r) of a problem whose q follows its solution: linearised anew after each iteration until what that leaves is below the
    tolerance, and where Newton's method has arrived. An iteration with a wrong q ends where another one has to follow.
    """

    def __init__(self, problem: Followed, monitor: Monitor, system: NewtonSystem, q: FloatArray, r: FloatArray) -> None:
        super().__init__(system, q, r)
        self._problem, self._monitor = problem, monitor
        self._changed, self._left, self._rate = 1.0, 1.0, SETTLES
        self.exact = False

    def recompute(self) -> None:
        super().recompute()
        if self._moves:
            self.u = self._problem.answer(self._r).u
            self._q = self.u - self._Wr

    def settle(self, mu: FloatArray, rho: FloatArray, monitor: Monitor) -> FloatArray | None:
        """None: what q changes by along a step of few contacts says nothing about how far it has come."""
        return None

    def length(self, monitor: Monitor, error: float) -> float:
        """1: nor does what it changes by along a part of a step."""
        return 1.0

    def move(self, t: float) -> None:
        super().move(t)
        tol = self._monitor.tol
        if self._left <= 0.5 * tol or not tol < self._monitor.error(self._r, self.u) <= BEGINS:
            return
        before, self._q = self._q, self._problem.free(self._r)
        change = float(np.linalg.norm(self._q - before)) / self._monitor.scale
        if self._left < 1.0:
            self._rate = min(1.0, change / self._changed)
        self._changed, self._left = change, self._rate * change
        self.u = self._Wr + self._q
