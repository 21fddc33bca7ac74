"""From a solution to its derivative: whether it solves the problem, how exactly, and what that lets count as zero."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem, scaled_error
from fcsim.problem.elimination import Elimination
from fcsim.problem.reduction import Reduction, reduced
from fcsim.solvers.derivative.bodies import GlobalDerivative
from fcsim.solvers.derivative.contacts import LocalDerivative, local_derivative
from fcsim.solvers.derivative.statuses import strict_statuses

LOOSEST = 1e-6
"""Scaled error above which a solution is not exact enough to know its statuses."""
MARGIN, LEAST_MARGIN = 100.0, 1e-10
"""Times the scaled error, and the least number, below which a part of a contact's reaction or velocity counts as zero, over ||q||."""


def derivative(
    problem: GlobalProblem | LocalProblem | Reduction, r: FloatArray, margin: float | None = None
) -> LocalDerivative | GlobalDerivative:
    """The derivative of the problem's solution at the reactions r (m,); margin: see `Result.derivative`.

    InputError where r does not solve the problem to 1e-6, contacts are on the border between two statuses, or reactions are not unique.
    """
    given = reduced(problem)
    if isinstance(given, Elimination):
        raise InputError("derivative: expected a global problem or a local one without V, R and s, got a mixed local problem")
    local = given.local.whole
    r = np.asarray(r, dtype=np.float64)
    if r.shape != local.q.shape:
        raise InputError(f"r: expected reactions of shape {local.q.shape}, got {r.shape}: is this the problem that was solved?")
    answer = given.answer(r)
    error = scaled_error(local, r)
    if not error <= LOOSEST:
        raise InputError(
            f"derivative: expected a solution of this problem, got reactions of scaled error {error:.1e}: at most {LOOSEST:g} will do "
            "(solve with a smaller tol, as 1e-12)"
        )
    if margin is None:
        margin = max(MARGIN * error, LEAST_MARGIN)
    elif not (isinstance(margin, int | float | np.number) and error <= margin < 1):
        raise InputError(f"margin: expected a number from the solution's scaled error {error:.1e} to 1, got {margin}")
    small = margin * float(np.linalg.norm(local.q))
    shape = local.nc, local.dimension
    y = local.compliance[:, None] * r.reshape(shape)
    status = strict_statuses(y, answer.u.reshape(shape), local.mu, small)
    contacts = local_derivative(local, r, answer.u, status)
    if isinstance(given, Reduction):
        assert answer.v is not None
        return GlobalDerivative(given, contacts, answer.v)
    return contacts
