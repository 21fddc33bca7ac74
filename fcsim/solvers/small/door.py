"""The small front door of `solve`: NSGS-AC, and `auto`, on problems of few contacts.

A call of the general way takes 0.1 ms and more around a method whose own time is some microseconds. What is answered here is answered as
there: the same sweeps, errors, checks and statuses; what is not (other options, a memory, a short limit of time, contacts without
compliance of their own) is left to the general way.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TypeGuard

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import Checks, LocalProblem
from fcsim.problem.cone import LEAST_SIZE
from fcsim.problem.infeasible import certificate
from fcsim.problem.judge import BLURRED, OUTWEIGHED, ROUND_OFF, blurred, outweighed, relative
from fcsim.solvers.automatic.stages import automatic
from fcsim.solvers.base import Method, Monitor, Result, Status
from fcsim.solvers.gauss_seidel.sweeps import FULL_AT_LEAST_EVERY, GaussSeidelOptions, nsgs
from fcsim.solvers.small import _automatic_kernels, _gauss_seidel_kernels

LEAST_LIMIT = 1.0
"""Limit of time [s] from which it need not be looked at: what the door takes at the most is a fifth of this."""
CONTACTS = 128
"""Contacts up to which the door is open: beyond, sparse storage and LAPACK take less than what stands here."""
AUTO_LOOK, AUTO_FIRST = 25, 10
"""Sweeps of `auto` after which the error is looked at, and Newton's iterations whose cost they spend before their rate is believed."""
AUTO_ALONE = 30, 40, 20
"""Newton's iterations from the sweeps' iterate, from zero, and from zero after an error left above 1e-3, before it must have got on."""
AUTO_NEWTON, AUTO_BUDGET = 150, 0.1
"""Newton's iterations from the sweeps' iterate, and from zero, and counted seconds of all, after which `auto` is left to its race."""
ROWS = 1000
"""Rows of the history that are kept."""
STATUSES = (Status.SOLVED, Status.MAX_ITERATIONS, Status.STAGNATED, Status.DIVERGED)
OPTIONS = GaussSeidelOptions()
SETTLED = (_gauss_seidel_kernels.NOT_HERE, _gauss_seidel_kernels.SOLVED)
"""Ends after which no proof is tried that there is no solution."""


@dataclass(frozen=True, eq=False)
class Left:
    """The best iterate r (m,) of a call that found no answer, from which `auto` goes on in the general way, its iterations, and whether a
    proof that there is no solution was tried."""

    r: FloatArray
    iterations: int
    unproven: bool

    def noted(self, monitor: Monitor, u: FloatArray) -> None:
        """Have it count as an iterate of the general way; u (m,): its velocities."""
        monitor.iterations += self.iterations
        monitor.passed, monitor.unproven = True, self.unproven
        monitor.record(self.r, u)


def small(
    problem: object, chosen: Method, overridden: bool, solver: str, r: FloatArray | None, tol: float, error: str, floor: float
) -> Result | Left | None:
    """The answer by one compiled call, else what `auto` leaves to the general way; None where that is to be gone from the beginning.

    overridden: whether options differ from the table's; the other arguments are those of `solve`, checked.
    """
    if overridden or not _fits(problem, chosen, r):
        return None
    automatically, certified, far = chosen.run is automatic, None, False
    q = problem.q
    begun = time.perf_counter()
    start = np.zeros(len(q)) if r is None else r
    if start.shape != q.shape or start.dtype != np.float64 or not np.isfinite(start).all():
        return None  # which says what is wrong
    rows = np.empty((ROWS, 2))
    W = problem.W if isinstance(problem.W, np.ndarray) else problem.W.toarray()
    arguments = (
        *(np.ascontiguousarray(x) for x in (W, q, problem.mu, start)),  # others would be compiled for anew
        *(problem.dimension, error == "published", float(floor), float(tol)),
    )
    solving = (OPTIONS.local_tolerance, OPTIONS.local_iterations)
    if automatically:
        velocities = len(q) if problem.motion is None else problem.motion.M.shape[0]
        rules = AUTO_LOOK, AUTO_FIRST, AUTO_ALONE, AUTO_NEWTON, AUTO_BUDGET, velocities
        out = _automatic_kernels.solve_automatically(*arguments, *solving, *rules, 0, rows)
        far = out[0] not in SETTLED and out[2] > 0 and bool(rows[: out[2], 1].min() > _automatic_kernels.FAR)
        certified = certificate(problem) if far else None
        if out[0] == _automatic_kernels.NO_ANSWER_YET and certified is None:
            noted, arguments = out[2], (*arguments[:3], out[3], *arguments[4:])
            out = _automatic_kernels.solve_automatically(*arguments, *solving, *rules, out[1], rows[noted:])
            out = (*out[:2], noted + out[2], *out[3:])
    else:
        out = _gauss_seidel_kernels.solve_by_sweeps(*arguments, OPTIONS.max_iterations, *solving, FULL_AT_LEAST_EVERY, rows)
    ended, sweeps, noted, answer, u, scale, scaled, plain, found = out
    if automatically and ended != _gauss_seidel_kernels.SOLVED and certified is None:
        return Left(answer, sweeps, far) if answer.any() and np.isfinite(answer).all() else None
    if ended == _gauss_seidel_kernels.NOT_HERE:
        return None
    errors = relative(scaled, scale), relative(plain, scale)
    deciding, status = errors[error == "published"], STATUSES[ended] if certified is None else Status.INFEASIBLE
    if (deciding <= tol) != status.solved or (scale < LEAST_SIZE and q.any()):  # round-off, or squares are lost: the general way decides
        return None
    cone, dual_cone, penetration, product, r_max, u_max, r_size, u_size = found
    checks = Checks(cone / (r_max or 1.0), dual_cone / (u_max or 1.0), abs(product) / ((r_size * u_size) or 1.0), penetration)
    remarks = []
    if status.solved and (r is not None or not noted or rows[0, 1] * OUTWEIGHED <= tol):  # else r = 0 has an error that counts
        remarks.append(outweighed(answer, u, q, problem.dimension, plain if error == "published" else scaled, scale, floor, tol))
    if status.solved and ROUND_OFF * r_size * W.diagonal().max() * max(1.0, problem.mu.max()) > BLURRED * tol * scale:
        remarks.append(_blurred(problem, answer, scale, tol))
    spent = time.perf_counter() - begun
    # a clock does not reach into compiled code: the seconds of the history are the sweeps' share
    history = [(int(at), spent * at / max(sweeps, 1), size) for at, size in rows[:noted].tolist()]
    seconds = {"reduction": 0.0, "solve": spent}
    message = "; ".join(filter(None, remarks))
    found = Result(answer, u, None, status, deciding, *errors, sweeps, seconds, history, checks, solver, message=message)
    return found if certified is None else replace(found, message=certified.message, certificate=certified)


def _fits(problem: object, chosen: Method, r: object) -> TypeGuard[LocalProblem]:
    """Whether a problem is of those that are answered here, by this method from r."""
    if not isinstance(problem, LocalProblem) or problem.V is not None or not 0 < len(problem.mu) <= CONTACTS:
        return False
    if problem.dimension not in chosen.dimensions or not (r is None or isinstance(r, np.ndarray)):
        return False
    return chosen.run is automatic or (chosen.run is nsgs and chosen.options == OPTIONS)


def _blurred(problem: LocalProblem, r: FloatArray, scale: float, tol: float) -> str:
    """What `blurred` says of reactions r (m,)."""
    z = float(np.linalg.norm(np.repeat(problem.compliance, problem.dimension) * r))
    return blurred(z, 0.0, scale, tol, float(problem.mu[r[:: problem.dimension] > 0].max(initial=0.0)))
