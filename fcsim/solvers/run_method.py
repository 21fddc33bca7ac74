"""A method run on a problem: whatever it does, what comes back is an iterate with a status, the best one where it did not arrive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem, Reduced
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Run, Status


def run_method(
    run: Run, problem: LocalProblem | LocalRollingProblem | Reduced, q: FloatArray, r: FloatArray, monitor: Monitor, options: Options
) -> Iterate:
    """Run a method from r (m,) on a problem whose velocities without reactions are q (m,); where it stops unsolved, hand back the best
    iterate seen. InputError where it returns something else."""
    zero = np.zeros_like(r)
    # r = 0 answers a problem without contacts, and one at rest up to round-off (see `floor`)
    if monitor.error(zero, q) <= monitor.tol:
        return Iterate(zero, Status.SOLVED)
    try:
        iterate: Iterate = run(problem, r, monitor, options)
    except SingularMatrix as singular:  # in a factorisation that the method takes for granted
        iterate = Iterate(r, Status.SINGULAR, str(singular))
    except (OverflowError, ZeroDivisionError, FloatingPointError, np.linalg.LinAlgError) as beyond:  # numbers that no float holds
        iterate = Iterate(r, Status.DIVERGED, f"{type(beyond).__name__}: {beyond}")
    if not isinstance(iterate, Iterate) or np.shape(iterate.r) != np.shape(q):
        got = f"r of shape {np.shape(iterate.r)}" if isinstance(iterate, Iterate) else f"a {type(iterate).__name__}"
        raise InputError(f"{run.__name__}: expected a method to return Iterate(r, status) with r of shape {np.shape(q)}, got {got}")
    if iterate.status.solved:
        return iterate
    if monitor.best_r is not None:
        return replace(iterate, r=monitor.best_r)
    return iterate if np.all(np.isfinite(iterate.r)) else replace(iterate, r=r)  # nowhere was the error a number
