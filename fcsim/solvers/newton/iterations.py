"""Nonsmooth Newton on F(u, r) = 0: (A du + B dr) = -F, where du follows from dr by the problem's linear part.

`newton_iterations` is the method; where its unknowns live is a `NewtonSpace` (`spaces`, `kkt`), and what solves for a step a
`NewtonSystem` (`systems`). Sources: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991; Acary, Brémond, Huber 2018
(formulations, rho and line searches); De Luca, Facchinei, Kanzow, Math. Program. 75, 1996 (merit function, gradient steps: NSN-AC-TEST).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Followed, LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.expected import LastVelocities, with_velocities
from fcsim.solvers.newton.formulations import FORMULATIONS, Formulation
from fcsim.solvers.newton.line_search import LINE_SEARCHES, REFERENCES, Merit
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import FollowingSpace, LocalSpace, NewtonSpace
from fcsim.solvers.newton.statuses import LEAST, Statuses, made_to_slide
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.newton.systems.condensed import CondensedSystem, KeptCondensation
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.over_ranks import KeptPreconditioner, SystemOverRanks
from fcsim.solvers.newton.systems.two_level.alone import KeptTwoLevel, SystemByBodies
from fcsim.solvers.scaling import RHO_RULES, adapt_rho, adaptive_range
from fcsim.solvers.turns import Turns, to_the_end

FALLS, STALLED = 0.7, 3
"""Iterations since the error last fell below FALLS of its least: with each of them half as much may be left to statuses that are kept, and
after STALLED of them joints are not solved one by one, and steps are shortened where that brings the error down, until it falls again.
Kept statuses and joints may lead Newton's method in a circle; so do contacts that open one by one along a joint and close again."""

_KEEPS: dict[type[NewtonSystem], type[Kept]] = {
    CondensedSystem: KeptCondensation,
    SystemOverRanks: KeptPreconditioner,
    SystemByBodies: KeptTwoLevel,
}
"""What systems leave for the next problem."""


@dataclass(frozen=True, eq=False)
class AdaptedRho(Kept):
    """rho (nc, d) on the way back from where a solution left it."""

    rho: FloatArray


def _rho(first: FloatArray, memory: Memory | None) -> FloatArray:
    """Where an adapting rho begins: near what led to a solution for contacts known from there, else at `first` (nc, d)."""
    earlier = None if memory is None else memory.earlier(AdaptedRho)
    if memory is None or earlier is None or earlier.rho.shape[1] != first.shape[1]:
        return first
    if np.array_equal(earlier.identity, memory.identity):
        return np.clip(earlier.rho, *adaptive_range(first))
    place, rho = earlier.places(memory.identity), first.copy()
    rho[place >= 0] = earlier.rho[place[place >= 0]]
    return np.clip(rho, *adaptive_range(first))


def _expected(u: FloatArray, r: FloatArray, memory: Memory | None, options: NewtonOptions) -> tuple[FloatArray, BoolArray] | None:
    """The velocities (nc, d) at which the first step is linearised, and which contacts slide there (nc,), see `expected`; u (nc, d): of the
    start. None where nothing is known, r begins at zero, or a line search would measure F at u."""
    earlier = None if memory is None else memory.earlier(LastVelocities)
    if memory is None or earlier is None or earlier.u.shape[1] != u.shape[1]:
        return None
    if options.line_search != "none" or options.safeguard or not r.any():
        return None
    return earlier.at(u, memory.identity)


def newton(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: NewtonOptions, *, once: bool = False) -> Iterate:
    """Nonsmooth Newton from the starting point r (m,); once: as in `newton_system`."""
    return to_the_end(local_turns(problem, r, monitor, options, once=once))


def newton_followed(problem: Followed, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Nonsmooth Newton from r (m,) where q follows the solution: one loop for both, see `FollowingSpace`."""
    if options.linear == "kkt":
        raise InputError("option linear: expected 'auto' for a problem whose q follows its solution, got 'kkt'")
    return to_the_end(local_turns(problem.local, r, monitor, options, space_of=partial(FollowingSpace, problem, monitor)))


def local_turns(
    problem: LocalProblem,
    r: FloatArray,
    monitor: Monitor,
    options: NewtonOptions,
    *,
    once: bool = False,
    space_of: Callable[[NewtonSystem, FloatArray, FloatArray], LocalSpace] = LocalSpace,
) -> Turns:
    """`newton` by turns of one iteration each; space_of: the space from the linear system, q and r."""
    linear = "auto" if options.linear == "kkt" else options.linear
    system = newton_system(problem.delassus, linear, condensing=options.formulation in ("AC", "JM"), memory=monitor.memory, once=once)
    space, shape = space_of(system, problem.q, r), problem.diagonal_blocks.shape[:2]
    expected = None if once else _expected(space.u.reshape(shape), r, monitor.memory, options)
    iterate = yield from newton_turns(space, r, problem.diagonal_blocks, problem.mu, monitor, options, expected)
    if iterate.status is Status.SOLVED and monitor.memory is not None and not once:
        known = (space.u.reshape(shape), iterate.r.reshape(shape), problem.mu, monitor.compliance)
        monitor.memory = with_velocities(monitor.memory, *known)
    if monitor.memory is not None and isinstance(system, CondensedSystem | SystemOverRanks | SystemByBodies):
        left, memory = system.left(monitor.memory.identity), monitor.memory.without(_KEEPS[type(system)])
        monitor.memory = memory if left is None else memory.having(left)
    return replace(iterate, message=system.said) if isinstance(system, SystemByBodies) else iterate


class _Progress:
    """Why Newton's iterations stop: asked before each of them."""

    def __init__(self, monitor: Monitor, options: NewtonOptions) -> None:
        self._monitor, self._options = monitor, options
        self._watched, self._before = monitor.iterations, np.inf
        self.error = np.inf  # of the last iterate that was looked at
        self._least, self.stalled = np.inf, 0  # the error that no later one was well below, and iterations since then

    def verdict(self, r: FloatArray, space: NewtonSpace) -> Status | None:
        """Why to stop at r (m,), None to go on."""
        monitor, options = self._monitor, self._options
        error = monitor.record(r, space.u) if monitor.checks else self._recorded(r, space)  # (S.1)
        if error > monitor.tol and not space.exact and monitor.error(r, space.u) <= monitor.tol:
            space.recompute()  # it has drifted: what follows goes on from what r gives
        self.error = error
        self._least, self.stalled = (error, 0) if error < FALLS * self._least else (self._least, self.stalled + 1)
        self._before = min(self._before, error) if monitor.iterations == self._watched else self._before
        if error <= monitor.tol:
            return Status.SOLVED
        if error > options.divergence * monitor.best:
            return Status.DIVERGED
        if (stopped := monitor.stopped(error, options.max_iterations)) is not None:
            return stopped
        if options.patience and monitor.iterations - self._watched >= options.patience:
            if monitor.best >= 0.7 * self._before:
                return Status.STAGNATED
            self._watched, self._before = monitor.iterations, monitor.best
        return None

    def _recorded(self, r: FloatArray, space: NewtonSpace) -> float:
        """The error of a monitor that takes u as it comes: not one that was carried along."""
        if not space.exact and self._monitor.error(r, space.u) <= self._monitor.tol:
            space.recompute()
        return self._monitor.record(r, space.u)


def newton_iterations(
    space: NewtonSpace,
    r: FloatArray,
    diagonal_blocks: FloatArray,
    mu: FloatArray,
    monitor: Monitor,
    options: NewtonOptions,
    formulation: Formulation | None = None,
) -> Iterate:
    """Newton's method in any space, see `newton_turns`."""
    return to_the_end(newton_turns(space, r, diagonal_blocks, mu, monitor, options, formulation=formulation))


def newton_turns(
    space: NewtonSpace,
    r: FloatArray,
    diagonal_blocks: FloatArray,
    mu: FloatArray,
    monitor: Monitor,
    options: NewtonOptions,
    expected: tuple[FloatArray, BoolArray] | None = None,
    formulation: Formulation | None = None,
) -> Turns:
    """Newton's method by turns of one iteration each; the steps' numbers are those of De Luca, Facchinei, Kanzow 1996.

    formulation: the equations of another cone than Coulomb's, in the place of the option's.

    Where an adapted rho led to a solution, the next solve with this memory begins near it. With velocities u_e that are
    `expected` (nc, d) the first step is Newton's in (u, r) from there, where u_e need not be W r + q, with the equations of sliding for the
    contacts (nc,) that are to slide:
    A du + B dr = -(F(u_e, r) + A (u - u_e)),  A and B those of (u_e, r).
    Long because it is one iteration from its verdict to the next.
    """
    shape = diagonal_blocks.shape[:2]
    first_rho = rho = RHO_RULES[options.rho](diagonal_blocks) * options.rho_factor
    adaptive = options.rho == "adaptive"
    if adaptive and monitor.memory is not None:
        rho = _rho(first_rho, monitor.memory)
        monitor.memory = monitor.memory.without(AdaptedRho)  # which counts only where it leads to a solution again
    formulation = formulation or FORMULATIONS[options.formulation]
    line_search = LINE_SEARCHES[options.line_search]
    merits: deque[float] = deque(maxlen=options.window)
    progress = _Progress(monitor, options)
    settles = formulation is FORMULATIONS["AC"] and options.line_search == "none" and not options.safeguard
    joined = space if settles and isinstance(space, LocalSpace) else None  # of joints that may be solved one by one
    statuses = Statuses()
    while True:
        status = progress.verdict(r, space)
        if status is not None:
            if status is Status.SOLVED and adaptive and monitor.memory is not None:
                # half the way back: the tiny last steps drive rho to its bounds
                monitor.memory = monitor.memory.having(AdaptedRho(monitor.memory.identity, np.sqrt(rho * first_rho)))
            return Iterate(r, status)
        u = space.u.reshape(shape)
        at, slides = (u, None) if expected is None else expected
        F, A, B = formulation(at, r.reshape(shape), mu, rho)
        if slides is not None and formulation is FORMULATIONS["AC"]:
            F, A, B = made_to_slide((F, A, B), slides, at, r.reshape(shape), mu, rho)
        if joined is not None and joined.knows_joints:
            allowed = LEAST * 0.5**progress.stalled * monitor.tol * monitor.scale
            F, A, B = statuses.kept((F, A, B), at, r.reshape(shape), mu, rho, monitor.compliance, allowed)
        space.foreseen = expected is not None
        if expected is not None:
            F, expected = F + np.einsum("aij,aj->ai", A, u - at), None
        value = 0.5 * float(np.sum(F * F))
        space.needed = monitor.tol / progress.error
        try:
            dr, du, slope = _direction(space, F, A, B, options.safeguard)  # (S.2)
        except SingularMatrix:
            return Iterate(r, Status.SINGULAR)
        if np.vdot(dr, dr) > 2 * options.longest**2 * value:  # along what W does not resist: a self-stress of any size
            return Iterate(r, Status.SINGULAR)
        t = 1.0
        if options.line_search != "none":
            merits.append(value)
            reference = max(value, REFERENCES[options.reference](merits))
            merit = _merit(formulation, space.u, du, r, dr, mu, rho)
            t = line_search(merit, value, slope, options.line_search_iterations, reference)  # (S.3)
        elif joined is not None and progress.stalled > STALLED:
            t = joined.length(monitor, progress.error)
        space.move(t)  # (S.4)
        following = r + t * dr
        monitor.iterations += 1
        if np.array_equal(following, r):
            return Iterate(r, Status.STAGNATED)
        r = following
        if adaptive:
            split = options.formulation in ("AC", "JM")  # the cone's formulations have one rho a contact
            rho = adapt_rho(rho, first_rho, (t * du).reshape(shape), (t * dr).reshape(shape), split)
            merits.clear()  # another rho, another merit function
        settled = joined.settle(mu, rho, monitor) if joined is not None and progress.stalled <= STALLED else None
        r = r if settled is None else settled
        yield


def _direction(space: NewtonSpace, F: FloatArray, A: FloatArray, B: FloatArray, safeguard: bool) -> tuple[FloatArray, FloatArray, float]:
    """Newton's (dr, du) with the slope -||F||^2 of 0.5 ||F||^2, or the gradient's where the safeguard asks for it."""
    size = float(np.sum(F * F))
    try:
        dr, du = space.step(A, B, F)
    except SingularMatrix:
        if not safeguard:
            raise
    else:
        if not safeguard:
            return dr, du, -size
        slope = _slope(F, A, B, dr, du)
        if slope <= -0.5 * size:  # exact arithmetic gives -size: an inexact solve of a nearly singular system shows here
            return dr, du, slope
    dr, du = space.gradient(A, B, F)
    return dr, du, _slope(F, A, B, dr, du)


def _slope(F: FloatArray, A: FloatArray, B: FloatArray, dr: FloatArray, du: FloatArray) -> float:
    """F . (A du + B dr)."""
    shape = F.shape
    return float(np.sum(F * (np.einsum("aij,aj->ai", A, du.reshape(shape)) + np.einsum("aij,aj->ai", B, dr.reshape(shape)))))


def _merit(
    formulation: Formulation, u: FloatArray, du: FloatArray, r: FloatArray, dr: FloatArray, mu: FloatArray, rho: FloatArray
) -> Merit:
    shape = rho.shape

    def merit(t: float) -> float:
        F = formulation((u + t * du).reshape(shape), (r + t * dr).reshape(shape), mu, rho)[0]
        return 0.5 * float(np.sum(F * F))

    return merit
