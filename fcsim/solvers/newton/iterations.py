"""Nonsmooth Newton on F(u, r) = 0: (A du + B dr) = -F, where du follows from dr by the problem's linear part.

`newton_iterations` is the method; where its unknowns live is a `NewtonSpace`: r alone with u = W r + q here, (v, r, l) and (r, l) in
`newton_global`. Sources: Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991; Acary, Brémond, Huber 2018 (formulations, rho and
line searches); De Luca, Facchinei, Kanzow, Math. Program. 75, 1996 (merit function, gradient steps: NSN-AC-TEST).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.joints import joint_rows
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.memory import Kept, Memory
from fcsim.solvers.newton.formulations import FORMULATIONS, Formulation
from fcsim.solvers.newton.line_search import LINE_SEARCHES, REFERENCES, Merit
from fcsim.solvers.newton.systems.condensed import CondensedSystem
from fcsim.solvers.newton.systems.direct import DenseSystem, NewtonSystem, SparseSystem
from fcsim.solvers.newton.systems.multifrontal import MultifrontalSystem
from fcsim.solvers.scaling import RHO_RULES, adapt_rho, adaptive_range
from fcsim.solvers.turns import Turns, to_the_end

SYSTEMS: dict[str, type[NewtonSystem]] = {
    "dense": DenseSystem,
    "condensed": CondensedSystem,
    "multifrontal": MultifrontalSystem,
    "sparse": SparseSystem,
}


@dataclass(frozen=True, kw_only=True)
class NewtonOptions(Options):
    """formulation: AC, JM, NM, FB; rho: rule of `scaling`, times rho_factor; line_search: none (NLS), Goldstein-Price, Goldstein, Armijo,
    with at most line_search_iterations trials; reference: what the merit must fall below, "none" (monotone) or its maximum, mean or
    Zhang and Hager's weighted mean over `window` iterations; safeguard: a gradient step where Newton's direction does not exist or does
    not descend; divergence: factor of the best error beyond which the iterates are called diverged; patience: iterations that must bring
    the best error below 0.7 of what it was, else the iterates are called stagnated (0: any number); linear: how the linear system is
    solved ("auto" chooses from size and density; "kkt" keeps the global or mixed form, see newton_global).
    """

    formulation: str = "AC"
    rho: str = "split spectral norm"
    rho_factor: float = 1.0
    line_search: str = "none"
    line_search_iterations: int = 100
    reference: str = "none"
    window: int = 10
    safeguard: bool = False
    divergence: float = float("inf")
    patience: int = 0
    linear: str = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("formulation", self.formulation, FORMULATIONS)
        choice("rho", self.rho, RHO_RULES)
        choice("line_search", self.line_search, LINE_SEARCHES)
        choice("reference", self.reference, REFERENCES)
        choice("linear", self.linear, ("auto", "kkt", *SYSTEMS))
        if not self.rho_factor > 0:
            raise InputError(f"option rho_factor: expected a number > 0, got {self.rho_factor}")
        if not self.divergence > 1:
            raise InputError(f"option divergence: expected a number > 1, got {self.divergence}")
        for name, least in (("line_search_iterations", 1), ("window", 1), ("patience", 0)):
            if getattr(self, name) < least:
                raise InputError(f"option {name}: expected an integer >= {least}, got {getattr(self, name)}")


CONDENSED_UP_TO = 12_000
"""Contact unknowns up to which the dense factor of a sparse W is affordable (1.1 GB)."""
DENSE_UP_TO = 3000
"""Contact unknowns up to which a sparse W is made dense for an LU (72 MB)."""
SMALL = 150
"""Contact unknowns up to which dense linear algebra is cheapest whatever the density."""
FILLED = 0.05
"""Density of a sparse W from which its factor counts as dense."""


class NewtonSpace(Protocol):
    """The linear part of a problem: keeps u of the current iterate, solves for Newton's step and follows it."""

    u: FloatArray

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (dr, du) with A du + B dr = -F; raises SingularMatrix."""
        ...

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the steepest descent (dr, du) of 0.5 ||F||^2 down to the minimum of its linear model."""
        ...

    def move(self, t: float) -> None:
        """Go t along the last step or gradient."""
        ...


class LocalSpace:
    """u = W r + q."""

    def __init__(self, problem: LocalProblem, r: FloatArray, system: NewtonSystem) -> None:
        self._problem, self._r = problem, r
        self._system = system
        self._moves = 0
        self._Wr = problem.W @ r
        self.u = self._Wr + problem.q

    def step(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        self._dr, self._Wdr = self._system.solve(A, B, -F)
        return self._dr, self._Wdr

    def gradient(self, A: FloatArray, B: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray]:
        g = self._problem.W.T @ np.einsum("aij,ai->aj", A, F).ravel() + np.einsum("aij,ai->aj", B, F).ravel()
        Wg = self._problem.W @ g
        Jg = np.einsum("aij,aj->ai", A, Wg.reshape(F.shape)) + np.einsum("aij,aj->ai", B, g.reshape(F.shape))
        length = float(g @ g) / (float(np.sum(Jg * Jg)) or 1.0)
        self._dr, self._Wdr = -length * g, -length * Wg
        return self._dr, self._Wdr

    def move(self, t: float) -> None:
        self._r = self._r + t * self._dr
        self._moves += 1
        # W r is recomputed now and then only: the update is exact up to round-off, which the final error would show
        self._Wr = self._problem.W @ self._r if self._moves % 8 == 0 else self._Wr + t * self._Wdr
        self.u = self._Wr + self._problem.q


@dataclass(frozen=True, eq=False)
class KeptSystem(Kept):
    """The linear algebra of an earlier problem, which may follow to a W near its own."""

    system: NewtonSystem


@dataclass(frozen=True, eq=False)
class AdaptedRho(Kept):
    """rho (nc, d) on the way back from where a solution left it."""

    rho: FloatArray


def _system(problem: LocalProblem, linear: str, W: Any, monitor: Monitor) -> NewtonSystem:
    """The linear algebra of this problem: the previous problem's where it was kept and can serve, else new."""
    memory, kind = monitor.memory, SYSTEMS[linear]
    earlier = None if memory is None else memory.of_same_contacts(KeptSystem)
    if earlier is not None and isinstance(earlier.system, kind) and earlier.system.follow(W):
        return earlier.system
    system = kind(W, problem.dimension)
    if memory is not None and linear == "condensed":  # the others have nothing that would serve another W
        monitor.memory = memory.having(KeptSystem(memory.identity, system))
    return system


def _rho(first: FloatArray, memory: Memory | None) -> FloatArray:
    """Where an adapting rho begins: near what led to a solution for contacts known from there, else at `first` (nc, d)."""
    earlier = None if memory is None else memory.earlier(AdaptedRho)
    if memory is None or earlier is None or earlier.rho.shape[1] != first.shape[1]:
        return first
    place, rho = earlier.places(memory.identity), first.copy()
    rho[place >= 0] = earlier.rho[place[place >= 0]]
    return np.clip(rho, *adaptive_range(first))


def newton(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    """Nonsmooth Newton from the starting point r (m,)."""
    space = LocalSpace(problem, r, _system(problem, *_linear(problem, options, monitor.memory), monitor))
    return newton_iterations(space, r, problem.diagonal_blocks, problem.mu, monitor, options)


def newton_iterations(
    space: NewtonSpace, r: FloatArray, diagonal_blocks: FloatArray, mu: FloatArray, monitor: Monitor, options: NewtonOptions
) -> Iterate:
    """Newton's method in any space, see `newton_turns`."""
    return to_the_end(newton_turns(space, r, diagonal_blocks, mu, monitor, options))


def newton_turns(
    space: NewtonSpace, r: FloatArray, diagonal_blocks: FloatArray, mu: FloatArray, monitor: Monitor, options: NewtonOptions
) -> Turns:
    """Newton's method by turns of one iteration each; the steps' numbers are those of De Luca, Facchinei, Kanzow 1996.

    Where an adapted rho led to a solution, the next solve with this memory begins near it."""
    shape = diagonal_blocks.shape[:2]
    first_rho = rho = RHO_RULES[options.rho](diagonal_blocks) * options.rho_factor
    adaptive = options.rho == "adaptive"
    if adaptive and monitor.memory is not None:
        rho = _rho(first_rho, monitor.memory)
        monitor.memory = monitor.memory.without(AdaptedRho)  # which counts only where it leads to a solution again
    formulation = FORMULATIONS[options.formulation]
    line_search = LINE_SEARCHES[options.line_search]
    merits: deque[float] = deque(maxlen=options.window)
    watched, before = monitor.iterations, np.inf
    while True:
        error = monitor.record(r, space.u)  # (S.1)
        before = min(before, error) if monitor.iterations == watched else before
        if error <= monitor.tol:
            if adaptive and monitor.memory is not None:  # half the way back: the tiny last steps drive rho to its bounds
                monitor.memory = monitor.memory.having(AdaptedRho(monitor.memory.identity, np.sqrt(rho * first_rho)))
            return Iterate(r, Status.SOLVED)
        if not np.isfinite(error) or error > options.divergence * monitor.best:
            return Iterate(r, Status.DIVERGED)
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            return Iterate(r, Status.TIME_LIMIT)
        if options.patience and monitor.iterations - watched >= options.patience:
            if monitor.best >= 0.7 * before:
                return Iterate(r, Status.STAGNATED)
            watched, before = monitor.iterations, monitor.best
        F, A, B = formulation(space.u.reshape(shape), r.reshape(shape), mu, rho)
        value = 0.5 * float(np.sum(F * F))
        try:
            dr, du, slope = _direction(space, F, A, B, options.safeguard)  # (S.2)
        except SingularMatrix:
            return Iterate(r, Status.SINGULAR)
        t = 1.0
        if options.line_search != "none":
            merits.append(value)
            reference = max(value, REFERENCES[options.reference](merits))
            merit = _merit(formulation, space.u, du, r, dr, mu, rho)
            t = line_search(merit, value, slope, options.line_search_iterations, reference)  # (S.3)
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


def _linear(problem: LocalProblem, options: NewtonOptions, memory: Memory | None) -> tuple[str, Any]:
    """The name of the linear algebra, and W as it wants it; the choice behind "auto":

    A small sparse W is made dense. Multifrontal LU where contacts come in joints and that saves most of the work, unless a simulation keeps
    what condensed elimination leaves for the next steps (which uses the joints too). Else condensed elimination for AC and JM, dense LU
    for the others, on a dense W and on a sparse one whose factor would be dense and is affordable; else sparse LU.
    """
    W, condensing, linear = problem.W, options.formulation in ("AC", "JM"), options.linear
    if linear in ("auto", "kkt"):
        if sp.issparse(W) and problem.m <= SMALL:
            W = W.toarray()
        if sp.issparse(W):
            keeping = condensing and memory is not None
            present = memory.of_same_contacts(KeptSystem) if condensing and memory is not None else None
            if present is not None and isinstance(present.system, CondensedSystem) and present.system.by_joints:
                return "condensed", W  # which looks for the joints of this W itself
            rows = joint_rows(W, problem.dimension)
            if rows is not None:
                return ("condensed", W) if keeping else ("multifrontal", rows)
        affordable = problem.m <= (CONDENSED_UP_TO if condensing else DENSE_UP_TO)
        if sp.issparse(W) and not (affordable and W.nnz >= FILLED * problem.m**2):
            linear = "sparse"
        else:
            linear = "condensed" if condensing else "dense"
    return linear, W.toarray() if linear == "dense" and sp.issparse(W) else W
