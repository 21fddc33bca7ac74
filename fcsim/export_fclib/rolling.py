"""Problems with spinning friction as FCLIB's rolling problems, whose contacts have two moments in one disk."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.export_fclib.content import Solution
from fcsim.problem import LocalProblem
from fcsim.problem.problem import GlobalForm
from fcsim.problem.rolling import GlobalRollingProblem

Written = GlobalForm | LocalProblem


def two_moments(problem: Written, solutions: Iterable[Solution | None]) -> tuple[Written, tuple[Solution | None, ...]]:
    """Return a problem with spinning friction, and its solutions, with five unknowns a contact; all others as they are.

    Where mu_s > 0 the two moments are (S, nothing) in a disk of radius mu_s r_N, elsewhere (R1, R2) in one of mu_r r_N: the same problem
    where no contact has both. InputError where one has: FCLIB has no place for three moments.
    """
    solutions = tuple(solutions)
    if not (isinstance(problem, GlobalRollingProblem) and problem.mu_s is not None):
        return problem, solutions
    spins = problem.mu_s > 0
    both = np.flatnonzero(spins & (problem.mu_r > 0))
    if both.size:
        raise InputError(
            f"contact {int(both[0])}: has rolling and spinning resistance, as {len(both)} of {problem.nc} contacts; expected one of them: "
            "FCLIB's rolling problems have two moments a contact"
        )
    nc = problem.nc
    first = 6 * np.arange(nc)[:, None]
    columns = first + np.arange(5)
    columns[spins, 3], columns[spins, 4] = first[spins, 0] + 5, 6 * nc  # S, and what is nothing
    order = columns.ravel()

    def taken(vector: FloatArray) -> FloatArray:
        if np.shape(vector) != (problem.m,):
            raise InputError(f"solution: expected u and r of {problem.m} entries, got shape {np.shape(vector)}")
        return np.append(vector, 0.0)[order]

    H = sp.hstack([sp.csc_array(problem.H), sp.csc_array((problem.n, 1))], format="csc")[:, order]
    mu_r = np.where(spins, problem.mu_s, problem.mu_r)
    made = GlobalRollingProblem(problem.M, H, problem.f, taken(problem.w), problem.mu, mu_r, problem.G, problem.b)
    return made, tuple(None if s is None else replace(s, u=taken(s.u), r=taken(s.r)) for s in solutions)
