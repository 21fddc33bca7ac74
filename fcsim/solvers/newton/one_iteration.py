"""A single iteration of nonsmooth Newton from velocities and reactions that need not belong together: the contacts' share of a Newton's
method on something larger, whose equation of motion changes from one iteration to the next."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Method, Monitor, Status
from fcsim.solvers.newton.formulations import FORMULATIONS
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.scaling import RHO_RULES

type Run = Callable[[LocalProblem, FloatArray, Monitor, NewtonOptions], Iterate]


def one_iteration(u: FloatArray) -> Method:
    """The method that takes one step of Alart and Curnier's from (u, r), u (m,) the velocities there: r + dr with

    A du + B dr = -(F(u, r) + A (W r + q - u)),  du = W dr,  A = dF/du and B = dF/dr at (u, r).

    Its answer is handed back whatever its error; SOLVED says that this is below the tolerance."""
    run: Run = partial(_step, u)
    return Method(run, NewtonOptions(formulation="AC"), "Newton", "Alart, Curnier 1991")


def _step(expected: FloatArray, problem: LocalProblem, r: FloatArray, monitor: Monitor, options: NewtonOptions) -> Iterate:
    shape = problem.diagonal_blocks.shape[:2]
    system = newton_system(problem.delassus, condensing=True, memory=None, once=True)
    u, rho = expected.reshape(shape), RHO_RULES[options.rho](problem.diagonal_blocks)
    F, A, B = FORMULATIONS[options.formulation](u, r.reshape(shape), problem.mu, rho)
    now = (system.operator.affine(r, problem.q)).reshape(shape)
    dr = system.solve(A, B, -(F + np.einsum("aij,aj->ai", A, now - u)))[0]
    monitor.iterations += 1
    return Iterate(r + dr, Status.SOLVED)
