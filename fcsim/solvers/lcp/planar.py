"""Methods for 2D problems: Gauss-Seidel, conjugated projected gradient, Lemke's and the enumerative method on the problem as an LCP.

Names are Siconos' (FRICTION_2D_...). In 2D the friction disk is a segment, so Coulomb's law is piecewise linear and the LCP is the
problem itself. Sources: Renouf and Alart, Comput. Methods Appl. Mech. Eng. 194, 2005 (CPG); Lemke 1965 and Murty 1988 as in `lcp`;
Glocker, Dynamik von Starrkörpersystemen mit Reibung und Stößen, 1995 (LCP of three pairs a contact).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.gauss_seidel.one_contact import OneContact
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, nsgs
from fcsim.solvers.lcp._planar_kernels import planar
from fcsim.solvers.lcp.coulomb_lcp import coulomb_lcp
from fcsim.solvers.lcp.lcp import LCPStatus, complementary_solutions, lemke

PLANAR = OneContact("PLANAR", planar, "split spectral norm", "FRICTION_2D_NSGS")


def planar_nsgs(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: GaussSeidelOptions) -> Iterate:
    """2D-NSGS: Gauss-Seidel where the one-contact solver "EXACT" is the four cases of the plane."""
    return nsgs(problem, r, monitor, options, PLANAR if options.one_contact == "EXACT" else None)


@dataclass(frozen=True, kw_only=True)
class ConjugateGradientOptions(Options):
    """preconditioner: "none" or "diagonal" (of W); stagnation_iterations: how many may pass without the error falling by a tenth."""

    max_iterations: int = 10_000
    preconditioner: str = "none"
    stagnation_iterations: int = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("preconditioner", self.preconditioner, ("none", "diagonal"))
        self.integers_from(stagnation_iterations=1)


def conjugated_projected_gradient(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: ConjugateGradientOptions) -> Iterate:
    """2D-CPG: conjugate gradients on W r + q over the friction segments |r_T| <= mu r_N of the current r_N.

    Iterates are projected on the segments, residuals and directions on what the contacts' states leave free: nothing leaves r_N = 0, and
    a sliding contact stays on its edge of the cone, (1, s mu). A contact slides towards s where r_T - u_T / W_TT is beyond that end of its
    segment. The numbers are the paper's steps.
    """
    mu, shape = problem.mu, (problem.nc, problem.dimension)
    diagonal = _positive(np.einsum("aii->ai", problem.diagonal_blocks))
    P = 1 / diagonal if options.preconditioner == "diagonal" else np.ones(shape)
    r_N = np.maximum(r[0::2], 0)
    r = np.column_stack([r_N, np.clip(r[1::2], -mu * r_N, mu * r_N)])
    u = problem.W @ r.ravel() + problem.q
    g = -u.reshape(shape)
    states = _States.of(r, g, mu, diagonal[:, 1])
    p = w = states.free(P * g)  # (0)
    least, last_progress = np.inf, monitor.iterations
    while True:
        error = monitor.record(r.ravel(), u)
        if error <= monitor.tol:
            return Iterate(r.ravel(), Status.SOLVED)
        if not np.isfinite(error):
            return Iterate(r.ravel(), Status.DIVERGED)
        if error < 0.9 * least:
            least, last_progress = error, monitor.iterations
        if monitor.iterations >= options.max_iterations:
            return Iterate(r.ravel(), Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            return Iterate(r.ravel(), Status.TIME_LIMIT)
        if monitor.iterations - last_progress >= options.stagnation_iterations:
            return Iterate(r.ravel(), Status.STAGNATED)
        Wp = problem.W @ p.ravel()
        curvature = float(p.ravel() @ Wp)
        descent = float(np.sum(states.free(g) * p))
        if not (curvature > 0 and descent > 0):  # conjugacy is lost where states change: begin again with the gradient
            if p is w:
                return Iterate(r.ravel(), Status.STAGNATED)
            p = w
            continue
        r = states.project(r + descent / curvature * p)  # (1) to (3)
        u = problem.W @ r.ravel() + problem.q  # (4)
        g = -u.reshape(shape)
        states = _States.of(r, g, mu, diagonal[:, 1])
        w = states.free(P * g)  # (5)
        z = states.free(p)  # (6)
        beta = -float(w.ravel() @ Wp) / curvature  # (7)
        p = w + beta * z  # (8)
        monitor.iterations += 1


def _positive(values: FloatArray) -> FloatArray:
    mean = float(values[values > 0].mean()) if np.any(values > 0) else 1.0
    return np.where(values > 0, values, mean)


@dataclass(frozen=True, eq=False)
class _States:
    """Which contacts are open, which slide, and to which side (nc,): what directions are free, where iterates are projected."""

    mu: FloatArray
    open: BoolArray
    slip: BoolArray
    side: FloatArray

    @classmethod
    def of(cls, r: FloatArray, g: FloatArray, mu: FloatArray, W_TT: FloatArray) -> _States:
        ahead = r[:, 1] + g[:, 1] / W_TT
        is_open = r[:, 0] <= 0
        return cls(mu, is_open, ~is_open & (np.abs(ahead) >= mu * r[:, 0]), np.sign(ahead))

    def free(self, z: FloatArray) -> FloatArray:
        """z (nc, 2) in the free directions."""
        z_N = np.where(self.open, np.maximum(z[:, 0], 0), z[:, 0])
        edge = self.mu * z_N
        z_T = np.where(self.open, np.clip(z[:, 1], -edge, edge), np.where(self.slip, self.side * edge, z[:, 1]))
        return np.column_stack([z_N, z_T])

    def project(self, r: FloatArray) -> FloatArray:
        """r_N to the half-line, then r_T to the segment, of a sliding contact to its end."""
        r_N = np.maximum(r[:, 0], 0)
        end = self.mu * r_N
        return np.column_stack([r_N, np.where(self.slip, self.side * end, np.clip(r[:, 1], -end, end))])


@dataclass(frozen=True, kw_only=True)
class LemkeOptions(Options):
    """max_iterations: pivots; warm_start: begin with the states of the starting point (open, stick, slip), not with z = 0."""

    max_iterations: int = 10_000
    warm_start: bool = True


def planar_lemke(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: LemkeOptions) -> Iterate:
    """2D-LEMKE: the LCP of `coulomb_lcp` with the two directions of the tangent, by Lemke's lexicographic method.

    The pivots work on a dense table of (4 nc)^2 numbers. A secondary ray, met where no solution exists, ends as STAGNATED.
    """
    u = problem.W @ r + problem.q
    if monitor.record(r, u) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    lcp = coulomb_lcp(problem, np.broadcast_to(np.array([[1.0], [-1.0]]), (problem.nc, 2, 1)))
    starts = [lcp.support(r, u), None] if options.warm_start and r.any() else [None]
    status = Status.STAGNATED
    for start in starts:
        left = options.max_iterations - monitor.iterations
        try:
            answer = lemke(lcp.M, lcp.q, start=start, max_pivots=max(left, 0), stop=monitor.out_of_time)
        except SingularMatrix:
            continue
        monitor.iterations += answer.pivots
        if answer.status is LCPStatus.SOLVED:
            r = lcp.reaction(answer.z)
            error = monitor.record(r, problem.W @ r + problem.q)
            if error <= monitor.tol:
                return Iterate(r, Status.SOLVED)
            status = Status.STAGNATED if np.isfinite(error) else Status.DIVERGED
        elif answer.status is LCPStatus.MAX_PIVOTS:
            return Iterate(r, Status.MAX_ITERATIONS)
        elif answer.status is LCPStatus.STOPPED:
            return Iterate(r, Status.TIME_LIMIT)
    return Iterate(r, status)


@dataclass(frozen=True, kw_only=True)
class EnumerationOptions(Options):
    """max_iterations: bases visited, of the 5^nc that can solve; guess_sweeps: Gauss-Seidel sweeps whose result tells the states of the
    contacts that are visited first (0: those of the starting point).
    """

    max_iterations: int = 1_000_000
    guess_sweeps: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        self.integers_from(guess_sweeps=0)


STATES = np.array([[0, 0, 0], [0, 0, 1], [1, 1, 0], [1, 0, 0], [1, 1, 1]], dtype=bool)
"""Supports of (r_N, mu r_N + r_T, u_T^-) of a contact that is open with u_T >= 0, open with u_T <= 0, sticks, slips to +, slips to -."""


def planar_enumeration(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: EnumerationOptions) -> Iterate:
    """2D-ENUM: visit the complementary bases of the LCP of three pairs a contact until one answers the problem.

    z = (r_N, r_R, u^-), w = (u_N, u^+, r_L) with r_R, r_L = mu r_N ± r_T and u_T = u^+ - u^-. For mu > 0 five of a contact's eight supports
    can be a state of it. Bases are visited by the number of contacts in which they differ from a guess, so a problem of many contacts
    is solved where the guess is good; all 5^nc bases are within reach for nc up to 8 or so.
    """
    if monitor.record(r, problem.W @ r + problem.q) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    if options.guess_sweeps:
        guess = monitor.inner(problem.q, monitor.tol)
        r = nsgs(problem, r, guess, GaussSeidelOptions(max_iterations=options.guess_sweeps), PLANAR).r
    first = monitor.iterations
    M, q, impulse = _three_pair_lcp(problem)
    visits = _bases_by_distance(_states(r, problem.W @ r + problem.q, problem.mu), options.max_iterations - first, monitor)
    for answer in complementary_solutions(M, q, visits):
        monitor.iterations = first + answer.pivots
        z = answer.z.reshape(3, problem.nc)
        r = impulse * np.column_stack([z[0], z[1] - problem.mu * z[0]]).ravel()
        if monitor.record(r, problem.W @ r + problem.q) <= monitor.tol:
            return Iterate(r, Status.SOLVED)
    if monitor.out_of_time():
        return Iterate(r, Status.TIME_LIMIT)
    everything = 5.0**problem.nc <= options.max_iterations - first
    monitor.iterations = first + (5**problem.nc if everything else options.max_iterations - first)
    return Iterate(r, Status.STAGNATED if everything else Status.MAX_ITERATIONS)


def _three_pair_lcp(problem: LocalProblem) -> tuple[FloatArray, FloatArray, float]:
    """M (3 nc, 3 nc) and q of Glocker's LCP, divided by the scales of velocity and impulse; and the latter."""
    nc, mu = problem.nc, problem.mu
    velocity = float(np.abs(problem.q).max(initial=0.0)) or 1.0
    compliance = float(np.abs(np.einsum("aii->a", problem.diagonal_blocks)).mean()) / 2 or 1.0
    normal = np.arange(nc) * 2
    # r from (r_N, r_R)
    values = np.concatenate([np.ones(nc), -mu, np.ones(nc)])
    R = sp.csr_array(
        (values, (np.concatenate([normal, normal + 1, normal + 1]), np.concatenate([np.arange(nc)] * 2 + [nc + np.arange(nc)])))
    )
    WR = problem.W @ R
    u = (WR.toarray() if sp.issparse(WR) else WR) / compliance
    identity, zero = np.eye(nc), np.zeros((nc, nc))
    M = np.block([[u[0::2], zero], [u[1::2], identity], [np.diag(2 * mu), -identity, zero]])
    q = np.concatenate([problem.q[0::2], problem.q[1::2], np.zeros(nc)]) / velocity
    return M, q, velocity / compliance


def _states(r: FloatArray, u: FloatArray, mu: FloatArray) -> NDArray[np.int64]:
    """The row of STATES (nc,) that suits each contact of (r, u)."""
    r_N, r_T, u_T = r[0::2], r[1::2], u[1::2]
    closed = r_N > 1e-10 * np.abs(r).max(initial=0.0)
    slips = np.abs(r_T) >= mu * r_N * (1 - 1e-8)
    return np.where(closed, np.where(slips, np.where(np.where(mu > 0, -r_T, u_T) >= 0, 3, 4), 2), np.where(u_T >= 0, 0, 1))


def _bases_by_distance(guess: NDArray[np.int64], limit: int, monitor: Monitor) -> Iterator[BoolArray]:
    """Supports (k, 3 nc) of all states, those first that differ from the guess in the fewest contacts; ends at the limit or out of time."""
    nc = len(guess)
    visited = 0
    chunk = max(1, min(4096, 4_000_000 // (9 * nc * nc + 1)))
    by_distance = (
        (changed, others)
        for distance in range(nc + 1)
        for changed in itertools.combinations(range(nc), distance)
        for others in itertools.product(range(1, 5), repeat=distance)
    )
    while visited < limit and not monitor.out_of_time():
        batch = list(itertools.islice(by_distance, min(chunk, limit - visited, 4 * visited + 1)))
        if not batch:
            return
        states = np.tile(guess, (len(batch), 1))
        for row, (changed, others) in zip(states, batch, strict=True):
            row[list(changed)] = (row[list(changed)] + np.array(others, dtype=np.int64)) % 5
        visited += len(batch)
        yield STATES[states].transpose(0, 2, 1).reshape(len(batch), 3 * nc)
