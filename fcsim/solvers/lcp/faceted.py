"""The faceted-cone method (row PATH of the table): friction cones as polyhedra, an LCP solved exactly, facets adapted to the answer.

An LCP of `coulomb_lcp` with f generators a contact is solved by Lemke's method, or by PATH (Dirkse and Ferris, Optim. Methods Softw. 5,
1995) where the user has it (see `path`). Its answer is exact for the polyhedra only: with f facets the friction force is up to a factor
cos(pi / f) too small and the sliding direction up to pi / f off. The facets are therefore turned and gathered where the answer touches
them, and the LCP is solved again, until the error of the true cone is below the tolerance; the status is that error's, never the LCP's.
In 2D the cone has two facets and the first answer is exact.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, nsgs
from fcsim.solvers.lcp.coulomb_lcp import CoulombLCP, coulomb_lcp
from fcsim.solvers.lcp.lcp import LCPStatus, lemke
from fcsim.solvers.lcp.path import solve_by_path
from fcsim.solvers.scaling import split_spectral_norm

ENGINES = ("Lemke", "PATH")
MOST_FACETS = 10_000
"""The LCP has as many unknowns a contact; its friction force is then right to 5e-8."""


@dataclass(frozen=True, kw_only=True)
class FacetedOptions(Options):
    """max_iterations  LCPs solved: 1 leaves the regular polygons
    facets          generators of each friction polygon in 3D, at least 4
    engine          "Lemke" (our own) or "PATH" (the user's `pathampl`)
    max_pivots      of Lemke's method on one LCP, as a multiple of the LCP's unknowns
    window          of the Anderson acceleration of the sliding directions, in LCPs
    crash_sweeps    Gauss-Seidel sweeps that suggest the first basis and directions, as PATH's crash does (0 = none)
    """

    max_iterations: int = 100
    facets: int = 8
    engine: str = "Lemke"
    max_pivots: int = 10
    window: int = 10
    crash_sweeps: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("engine", self.engine, ENGINES)
        self.integers_from(facets=4)
        if self.facets > MOST_FACETS:
            raise InputError(f"option facets: expected an integer <= {MOST_FACETS}, got {self.facets}")
        self.integers_from(window=1, max_pivots=1, crash_sweeps=0)


def faceted_cone(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: FacetedOptions) -> Iterate:
    """Solve LCPs with adapted facets until the error of the true cone is below the tolerance."""
    u = problem.W @ r + problem.q
    if monitor.record(r, u) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    if options.crash_sweeps:
        crash = monitor.inner(problem.q, monitor.tol)
        r = nsgs(problem, r, crash, GaussSeidelOptions(max_iterations=options.crash_sweeps)).r
        u = problem.W @ r + problem.q
    polygons = Polygons(problem, options)
    polygons.adapt(r, u)
    warm = bool(r.any())
    least, last_progress = np.inf, monitor.iterations
    while monitor.iterations < options.max_iterations:
        if monitor.out_of_time():
            return Iterate(r, Status.TIME_LIMIT)
        lcp = coulomb_lcp(problem, polygons.generators)
        solution, message = _solve(lcp, lcp.support(r, u) if warm else None, monitor, options)
        monitor.iterations += 1
        if solution is None:
            if monitor.out_of_time():
                return Iterate(r, Status.TIME_LIMIT, message)
            if not polygons.relax():
                return Iterate(r, Status.STAGNATED, message)
            continue
        r, warm = lcp.reaction(solution), True
        u = problem.W @ r + problem.q
        error = monitor.record(r, u)
        if error <= monitor.tol:
            return Iterate(r, Status.SOLVED)
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        if error < 0.9 * least:
            least, last_progress = error, monitor.iterations
        elif monitor.iterations - last_progress >= 2 * options.window:
            return Iterate(r, Status.STAGNATED)
        if problem.dimension == 2:
            return Iterate(r, Status.STAGNATED)
        polygons.adapt(r, u)
    return Iterate(r, Status.MAX_ITERATIONS)


def _solve(lcp: CoulombLCP, start: BoolArray | None, monitor: Monitor, options: FacetedOptions) -> tuple[FloatArray | None, str]:
    """z of the LCP or None, and why; from the basis `start` first, from z = 0 where that leads nowhere."""
    if options.engine == "PATH":
        answered = solve_by_path(lcp.M, lcp.q, time_limit=monitor.start + monitor.time_limit - time.perf_counter())
        return answered.z, answered.message
    message = "Lemke: singular basis"
    for basis in ([start] if start is not None else []) + [None]:
        try:
            answer = lemke(lcp.M, lcp.q, start=basis, max_pivots=options.max_pivots * len(lcp.q), stop=monitor.out_of_time)
        except SingularMatrix:
            continue
        message = f"Lemke: {answer.status.value}"
        if answer.status is LCPStatus.SOLVED:
            return answer.z, message
    return None, message


class Polygons:
    """The friction polygons: of each contact a centre angle, where a generator lies, and the angle to its neighbours.

    The generators at centre ± spread, ... grow further apart away from the centre, up to a regular polygon's on the far side. A contact
    that sticks has a regular polygon with a generator along its friction force. For one that slides, the LCP tells which sliding
    direction psi belongs to a friction direction phi; the true cone asks for psi = phi, a fixed point that Anderson's acceleration (J. ACM
    12, 1965) finds over all sliding contacts together, while the neighbours close in. psi is the direction of r_T - rho u_T, which the
    projection of Alart and Curnier would take.
    """

    CLOSEST = 0.05  # generators closer together bring bases close to singular ones; at the fixed point one generator is enough

    def __init__(self, problem: LocalProblem, options: FacetedOptions) -> None:
        self._nc, self._tangents = problem.nc, problem.dimension - 1
        self._facets, self._memory = options.facets, options.window
        self._rho_T = split_spectral_norm(problem.diagonal_blocks)[:, 1]
        self._mu = problem.mu
        self.centre = np.zeros(problem.nc)
        self.spread = np.full(problem.nc, 2 * np.pi / options.facets)
        self._pairs: list[tuple[FloatArray, FloatArray]] = []
        self._sliding = np.zeros(problem.nc, dtype=bool)

    @property
    def generators(self) -> FloatArray:
        """Unit generators (nc, f, d - 1)."""
        if self._tangents == 1:
            return np.broadcast_to(np.array([[1.0], [-1.0]]), (self._nc, 2, 1))
        regular, f = 2 * np.pi / self._facets, self._facets
        pairs = (f - 1) // 2
        k = np.arange(1, pairs + 1)
        closing = (1 - (k - 1) / max(pairs - 1, 1)) if pairs > 1 else np.ones(1)
        offset = k * regular * (self.spread[:, None] / regular) ** closing
        angles = [np.zeros((self._nc, 1)), offset, -offset]
        if f % 2 == 0:
            angles.append(np.full((self._nc, 1), np.pi))
        angle = self.centre[:, None] + np.concatenate(angles, axis=1)
        return np.stack([np.cos(angle), np.sin(angle)], axis=2)

    def adapt(self, r: FloatArray, u: FloatArray) -> None:
        """Turn and gather the generators for the answer r, u (m,) of the last LCP."""
        if self._tangents == 1:
            return
        r2, u_T = r.reshape(self._nc, 3), u.reshape(self._nc, 3)[:, 1:]
        r_T = r2[:, 1:]
        y = r_T - self._rho_T[:, None] * u_T
        friction = np.sqrt(np.einsum("at,at->a", r_T, r_T))
        sliding = (friction > 0) & (friction >= self._mu * r2[:, 0] * np.cos(np.pi / self._facets) * (1 - 1e-9))
        some = np.any(y != 0, axis=1)
        phi = np.where(friction > 0, np.arctan2(r_T[:, 1], r_T[:, 0]), self.centre)
        psi = np.where(some, np.arctan2(y[:, 1], y[:, 0]), self.centre)
        turn = _wrap(psi - phi)
        if not np.array_equal(sliding, self._sliding):
            self._pairs, self._sliding = [], sliding
        phi_s, turn_s = phi[sliding], turn[sliding]
        if self._pairs:  # angles continue those of the last pair, without jumps of 2 pi
            phi_s = self._pairs[-1][0] + _wrap(phi_s - self._pairs[-1][0])
        self._pairs = [*self._pairs[-self._memory :], (phi_s, turn_s)]
        self.centre = psi.copy()
        self.centre[sliding] = phi_s + self._accelerated_turn()
        regular = 2 * np.pi / self._facets
        self.spread = np.where(sliding, np.clip(4 * np.abs(turn), self.CLOSEST, regular), regular)

    def relax(self) -> bool:
        """Spread the generators for an LCP that could not be solved, to round-off, with them so close; False where they are regular."""
        regular = 2 * np.pi / self._facets
        if self._tangents == 1 or np.all(self.spread >= regular):
            return False
        self.spread = np.minimum(10 * self.spread, regular)
        return True

    def _accelerated_turn(self) -> FloatArray:
        """Anderson's step from the pairs (phi, turn): the turn left over where their linear model turns by zero."""
        turn = self._pairs[-1][1]
        if len(self._pairs) == 1 or not len(turn):
            return turn
        d_phi = np.column_stack([b[0] - a[0] for a, b in zip(self._pairs, self._pairs[1:], strict=False)])
        d_turn = np.column_stack([b[1] - a[1] for a, b in zip(self._pairs, self._pairs[1:], strict=False)])
        weights = np.linalg.lstsq(d_turn, turn, rcond=1e-10)[0]
        step = turn - (d_phi + d_turn) @ weights
        return np.clip(step, -0.5, 0.5)


def _wrap(angle: FloatArray) -> FloatArray:
    return (angle + np.pi) % (2 * np.pi) - np.pi
