"""`auto` where ranks of MPI have W together: Newton, and where that fails from zero once more from where ADMM leads, all over ranks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.automatic.methods import COLD_RHO, NEWTON, SPLITTING_OF_JOINTS, WATCHED
from fcsim.solvers.automatic.pause import FAILS, paused, tried
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
    """Solve the problem from r (m,), or get as near as these do: what goes on then is a race on all of W. Newton's systems need no factor
    of W, which ADMM makes. Where Newton fails on one problem it is not tried on the next ones, see `Pause`."""
    if monitor.record(r, problem.delassus.affine(r, problem.q)) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    if paused(monitor):
        return Iterate(r, Status.STAGNATED)
    ended, warm = Iterate(r, Status.STAGNATED), bool(r.any())
    by_newton = options.patience > 0 and "Newton" not in options.without
    if by_newton:
        ended = newton(problem, r, monitor, newton_over_ranks(options, warm=warm))
    afar = ended.status in FAILS and not warm and monitor.best > NEAR
    if afar and options.splitting and "splitting" not in options.without:
        ended = _split(problem, monitor)
        if ended.status not in (Status.SOLVED, Status.TIME_LIMIT) and by_newton:
            begin = r if monitor.best_r is None else monitor.best_r
            ended = newton(problem, begin, monitor, newton_over_ranks(options, warm=False))
    if by_newton:
        tried(monitor, ended.status)
    return ended


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
