"""`auto` where ranks of MPI have W together: ADMM from zero until Newton is near, then Newton, both over ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.automatic.methods import COLD_RHO, NEWTON, SPLITTING_OF_JOINTS, WATCHED
from fcsim.solvers.automatic.pause import paused, tried
from fcsim.solvers.automatic.race import RaceOptions, ShareOfMonitor
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.iterations import newton
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.variational.admm import split_turns
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import ProblemWatch

NEAR, SPLITTINGS = 1e-3, 300
"""Error at which ADMM leaves to Newton, and iterations that it may take to get there."""


def newton_over_ranks(options: RaceOptions, *, warm: bool) -> NewtonOptions:
    """Newton's options, from reactions of an earlier step or from zero."""
    factor = 1.0 if warm else COLD_RHO
    return replace(NEWTON, rho_factor=factor, max_iterations=options.max_iterations, patience=options.patience)


def automatic_over_ranks(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: RaceOptions) -> Iterate:
    """Solve the problem from r (m,), or get as near as these two do: what goes on then is a race on all of W. Where Newton fails on one
    problem it is not tried on the next ones, see `Pause`."""
    if monitor.record(r, problem.delassus.affine(r, problem.q)) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    if paused(monitor):
        return Iterate(r, Status.STAGNATED)
    if not r.any() and options.splitting and "ADMM" not in options.without:
        iterate = _split(problem, monitor)
        if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
            return iterate
    begin = r if monitor.best_r is None else monitor.best_r
    if not options.patience or "Newton" in options.without:
        return Iterate(begin, Status.STAGNATED)
    iterate = newton(problem, begin, monitor, newton_over_ranks(options, warm=bool(r.any())))
    tried(monitor, iterate.status)
    return iterate


def _split(problem: LocalProblem, monitor: Monitor) -> Iterate:
    """ADMM from zero, which suits it better than another's iterate, until Newton is near."""
    share = ShareOfMonitor(monitor)
    vi = Inequality.coulomb(problem)
    turns = split_turns(vi, np.zeros(problem.m), ProblemWatch(vi.velocity, share, SPLITTINGS, period=WATCHED), SPLITTING_OF_JOINTS)
    while monitor.best > NEAR:
        try:
            next(turns)
        except StopIteration as stop:
            ended: Iterate = stop.value
            break
    else:
        ended = Iterate(share.best_r if share.best_r is not None else np.zeros(problem.m), Status.MAX_ITERATIONS)
    share.tell()
    return ended
