"""Bodies and contacts in one loop of Newton's method: each linearisation of the bodies with one iteration of the contacts.

With R(v, r) = 0 the equation of motion of `newton` and F(u, r) = 0 that of the contacts, u = H^T v + w, each iteration solves

    A_i dv - H dr = -R(v_i, r_i),   dF/du H^T dv + dF/dr dr = -F(u_i, r_i)

at once, by W_i = H^T A_i^-1 H: semismooth Newton on everything, of second order near an answer. It begins where the first friction problem
is solved to `BEGINS`, since bodies that pass through each other on the way would have no contacts there. The sequence has fewer
linearisations of the bodies, this loop fewer iterations of the contacts. After `ITERATIONS` a step goes on by the sequence.
Source: P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991.
"""

from __future__ import annotations

from fcsim.arrays import FloatArray
from fcsim.problem.reduction import Reduction
from fcsim.solvers import Result
from fcsim.solvers.base import Criterion
from fcsim.solvers.newton.one_iteration import one_iteration
from fcsim.solvers.solve import solve_by
from fcsim.timestep.chain import Attempt, SolverSettings
from fcsim.timestep.step_equation.equation import Equation

ITERATIONS = 20
"""How many iterations the loop has."""


BEGINS = 1e-2
"""Error of the first friction problem."""


def looped(settings: SolverSettings, equation: Equation, done: int, allowed: float) -> tuple[bool, float]:
    """Whether a step's next problem, after `done` ones, is one iteration of the loop, and the error to which it is solved, else `allowed`;
    contacts with a compliance of their own go by the sequence."""
    if settings.loop != "one" or done > ITERATIONS or equation.met.compliance is not None or not len(equation.met.contacts):
        return False, allowed
    return done > 0, allowed if done else max(allowed, BEGINS)


def contacts_once(reduction: Reduction, equation: Equation, v: FloatArray, r: FloatArray, settings: SolverSettings, tol: float) -> Result:
    """One iteration of the contacts from the iterate v (n_dofs,), r (m,), with the bodies as they are linearised there."""
    u = equation.met.scaled_H.T @ v + equation.met.w
    return solve_by(one_iteration(u), reduction, "one loop", r, Criterion(tol, floor=settings.least_motion))


def looped_attempt(result: Result, done: int, share: float, tol: float) -> Attempt:
    """The note of a loop that has arrived after `done` iterations."""
    return Attempt(result.method, "previous steps", result.status.value, result.error, done, share, tol)
