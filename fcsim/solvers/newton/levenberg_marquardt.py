"""Levenberg-Marquardt on s times the natural map with rho = 1 / s, whose norm is the error (s: the monitor's compliance of each contact).

For the neighbourhood of what other methods reached.

Where W is rank-deficient up to noise, Newton's matrix is singular up to noise, its full step is lost in self-stress, and a solution may
not exist at all. A step dr = D^(1/2) s, s = -(J^T J + lambda^2 I)^-1 J^T F, J = dF/dr D^(1/2) with D the contacts' stiffnesses, makes
the linearised error smaller without asking for a solution; as lambda falls it turns from the gradient to the least step that minimises
it. One singular value decomposition of J gives the steps of all lambda, and the error itself chooses among them.

Sources: D. Marquardt, J. Soc. Ind. Appl. Math. 11, 1963; J. Fan, Y. Yuan, Computing 74, 2005 (without nonsingularity).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.newton.formulations import natural_map
from fcsim.solvers.scaling import contact_compliance
from fcsim.solvers.turns import Turns, to_the_end

DAMPING = 10.0 ** np.arange(-3.0, -10.6, -0.5)
"""lambda over the largest singular value of J: from where the error's curvature rules to where round-off does."""
LARGEST = 1200
"""Unknowns of contacts that are not open up to which J is decomposed (some seconds)."""
GAIN = 0.998
"""Factor that an iteration takes off the error at least, or it is the last."""


def levenberg_marquardt(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: Options) -> Iterate:
    """Iterate from r (m,) as long as the error falls; max_iterations counts decompositions."""
    return to_the_end(levenberg_marquardt_turns(problem, r, monitor, options))


def levenberg_marquardt_turns(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: Options) -> Turns:
    """The same by turns of one decomposition each."""
    nc, d, s = problem.nc, problem.dimension, monitor.compliance
    W = sp.csr_array(problem.W) if sp.issparse(problem.W) else problem.W
    length = np.repeat(1 / np.sqrt(contact_compliance(problem)), d)
    u = W @ r + problem.q
    error = monitor.record(r, u)
    while not error <= monitor.tol:
        if (stopped := monitor.stopped(error, options.max_iterations)) is not None:
            return Iterate(r, stopped)
        F, A, B = natural_map(u.reshape(nc, d), r.reshape(nc, d), problem.mu, np.repeat(1 / s[:, None], d, axis=1))
        steps = _steps(W, F, A, B, length, s)
        if steps is None:
            return Iterate(r, Status.STAGNATED)
        monitor.iterations += 1
        velocities = W @ steps
        errors = np.array([monitor.error(r + dr, u + du) for dr, du in zip(steps.T, velocities.T, strict=True)])
        best = int(np.argmin(np.where(np.isnan(errors), np.inf, errors)))
        if not errors[best] <= max(GAIN * error, monitor.tol):
            monitor.record(r, u)
            return Iterate(r, Status.STAGNATED)
        r = r + steps[:, best]
        u = W @ r + problem.q
        before, error = error, monitor.record(r, u)
        if not error <= max(GAIN * before, monitor.tol):  # by u from the problem's own equations, which round-off keeps from W r + q
            return Iterate(r, Status.STAGNATED)
        yield
    return Iterate(r, Status.SOLVED)


def _steps(W: FloatArray, F: FloatArray, A: FloatArray, B: FloatArray, length: FloatArray, weight: FloatArray) -> FloatArray | None:
    """The steps (m, len(DAMPING)), None where J is zero or too large; an open contact (A = 0, B = 1) gives up its reaction.

    weight (nc,): of each contact's equations in the sum of squares.
    """
    nc, d = F.shape
    active = np.flatnonzero(A.any(axis=(1, 2)))
    k = len(active)
    if not 0 < k * d <= LARGEST:
        return None
    dofs = (active[:, None] * d + np.arange(d)).ravel()
    given = -F
    given[active] = 0.0
    weight = weight[active, None]
    rhs = -F[active] - np.einsum("aij,aj->ai", A[active], (W @ given.ravel()).reshape(nc, d)[active])
    own = W[dofs][:, dofs]
    J = (A[active] @ (own.toarray() if sp.issparse(own) else own).reshape(k, d, k * d)).reshape(k * d, k * d)
    J.reshape(k, d, k, d)[np.arange(k), :, np.arange(k), :] += B[active]
    rhs, J = weight * rhs, np.repeat(weight, d, axis=0) * J * length[dofs]
    if not np.all(np.isfinite(J)):
        return None
    try:
        left, values, right = sla.svd(J, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        return None
    if not values[0] > 0:
        return None
    damping = DAMPING * values[0]
    shares = (left.T @ rhs.ravel() * values)[:, None] / (values[:, None] ** 2 + damping**2)
    steps = np.repeat(given.ravel()[:, None], len(damping), axis=1)
    steps[dofs] = length[dofs, None] * (right.T @ shares)
    return steps
