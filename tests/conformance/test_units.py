"""Whether a result is SOLVED does not depend on the units of mass, length and time, for any method of the table.

A problem in other units is the same problem: with the unit of mass divided by a, of length by b, W becomes W / a and q becomes b q, and the
answer a b r. The verdict is compared with the scaled error computed here, by the projection's three cases.
"""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.problem import GlobalProblem, LocalProblem, scaled_error
from fcsim.solvers import SOLVERS, solve

MASSES, VELOCITIES = (1e-9, 1.0, 1e9), (1e-6, 1.0, 1e3)
TOL = 1e-8


def base(d: int, nc: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(d)
    m = d * nc
    H = rng.standard_normal((m + 4, m))
    return H.T @ H / m + 0.1 * np.eye(m), rng.standard_normal(m) - 0.3, rng.uniform(0.1, 0.8, nc)


def judged(W: np.ndarray, q: np.ndarray, mu: np.ndarray, r: np.ndarray) -> float:
    """||z - P_K(z - (u + g(u)))|| / ||q|| with z = r tr(W_aa) / d."""
    d = len(q) // len(mu)
    u = (W @ r + q).reshape(-1, d)
    u[:, 0] += mu * np.linalg.norm(u[:, 1:], axis=1)
    z = r.reshape(-1, d) * np.diag(W).reshape(-1, d).mean(axis=1)[:, None]
    y = z - u
    length = np.linalg.norm(y[:, 1:], axis=1)
    normal = (y[:, 0] + mu * length) / (1 + mu**2)
    edge = np.column_stack([normal, (mu * normal / np.where(length > 0, length, 1))[:, None] * y[:, 1:]])
    P = np.where((length <= mu * y[:, 0])[:, None], y, np.where((mu * length <= -y[:, 0])[:, None], 0.0, edge))
    return float(np.linalg.norm(z - P) / np.linalg.norm(q))


@pytest.mark.parametrize("name", [name for name, method in SOLVERS.items() if min(method.dimensions) <= 3])
def test_verdicts_do_not_depend_on_units(name: str) -> None:
    method = SOLVERS[name]
    W, q, mu = base(method.dimensions[-1])
    statuses = set()
    for mass in MASSES:
        for velocity in VELOCITIES:
            p = LocalProblem(W / mass, velocity * q, mu, dimension=method.dimensions[-1])
            result = solve(p, name, tol=TOL)
            error = judged(W / mass, velocity * q, mu, result.r)
            assert result.scaled_error == pytest.approx(error, rel=1e-6, abs=1e-14)
            assert result.solved is (result.scaled_error <= TOL)
            statuses.add(result.status)
    assert len(statuses) == 1
    assert result.solved or method.limits


@pytest.mark.parametrize("name", ["NSN-AC", "ADMM", "ACLM"])
@pytest.mark.parametrize("linear", ["auto", "kkt"])
def test_global_form(name: str, linear: str) -> None:
    W, q, mu = base(3)
    L = np.linalg.cholesky(W)  # W = H^T M^-1 H with H = L^T and M = 1
    for mass in MASSES:
        p = GlobalProblem(mass * np.eye(len(q)), L.T, np.zeros(len(q)), q, mu)
        result = solve(p, name, tol=TOL, linear=linear)
        assert result.solved
        assert judged(W / mass, q, mu, result.r) <= 1.01 * TOL


def test_the_published_error_depends_on_the_unit_of_mass() -> None:
    """Why it does not decide: with masses of 1e-9 it lets r = 0 pass for a solution, within 1e-8, of a problem of falling bodies."""
    W, q, mu = base(3)
    light = LocalProblem(W / 1e-9, q, mu)
    exact = solve(light, "NSN-AC", tol=1e-12).r
    wrong = exact.copy()
    wrong[1::3] += 0.05 * np.abs(exact).max()  # a cone violation of 5 %, of whose change in u nothing is said
    u = light.W @ exact + q
    assert np.linalg.norm(wrong - exact) / np.linalg.norm(q) < 1e-8
    assert scaled_error(light, wrong, u) > 1e-3


def test_on_request_the_published_error_decides() -> None:
    W, q, mu = base(3)
    result = solve(LocalProblem(W / 1e3, q, mu), "NSN-AC", tol=1e-10, error="published")
    assert result.solved
    assert result.error == result.published_error <= 1e-10
    assert result.scaled_error != result.published_error
