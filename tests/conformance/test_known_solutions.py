"""Problems built from a solution that is known, near the border of having one: contacts that touch without a reaction (r = 0 = u_N, or
u = 0), lie on the cone's surface without sliding or open by round-off; W of full rank, of half of it, with normals opposite in pairs and
large self-stress, of bodies 1e12 apart in mass.

None is called infeasible, and SOLVED is said where the residual in longer arithmetic, by the projection's three cases, is small.
"""

from __future__ import annotations

import numpy as np

from fcsim.problem import LocalProblem
from fcsim.solvers import Status, solve

TOL = 1e-8


def known(seed: int, number: int) -> LocalProblem:
    """u = W r + q of (r, u) whose statuses are drawn; unit of mass from 1e-9 to 1e9, of velocity from 1e-6 to 1e3."""
    rng = np.random.default_rng((seed, number))
    d, nc, kind = int(rng.choice([2, 3])), int(rng.integers(1, 16)), rng.choice(["full", "half", "squeezed", "scaled"])
    rows = {"full": d * nc + 3, "half": (d * nc + 1) // 2, "squeezed": max(2, nc // 2 + 1), "scaled": d * nc}[kind]
    H = rng.standard_normal((rows, d * nc))
    if kind == "squeezed":
        H[:, d : d * (nc // 2 * 2) : 2 * d] = -H[:, 0 : d * (nc // 2 * 2) : 2 * d] * rng.uniform(0.5, 2, nc // 2)
    inverse = 10 ** rng.uniform(-6, 6, rows) if kind == "scaled" else np.ones(rows)
    W = H.T @ (inverse[:, None] * H)
    mu = rng.choice([0.0, 0.1, 0.5, 1.0, 3.0, 20.0], nc)
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    for a in range(nc):
        t = rng.standard_normal(d - 1)
        t /= np.linalg.norm(t)
        match rng.choice(["open", "barely open", "sticks", "edge", "slides", "grazes", "touches"]):
            case "open":
                u[a] = np.r_[rng.uniform(), rng.standard_normal(d - 1)]
            case "barely open":
                u[a] = np.r_[10 ** rng.uniform(-14, -6), rng.standard_normal(d - 1)]
            case "sticks":
                r[a] = np.r_[1.0, 0.9 * mu[a] * rng.uniform() * t] * rng.uniform()
            case "edge":
                r[a] = np.r_[1.0, mu[a] * t] * rng.uniform()
            case "slides":
                r[a], u[a, 1:] = np.r_[1.0, -mu[a] * t] * 10 ** rng.uniform(-6, 1), t * 10 ** rng.uniform(-8, 1)
            case "grazes":
                u[a, 1:] = t
    r /= np.diag(W).reshape(nc, d).mean(axis=1)[:, None]
    if kind == "squeezed":
        r *= 10 ** rng.uniform(0, 7)
    mass, velocity = 10 ** rng.uniform(-9, 9), 10 ** rng.uniform(-6, 3)
    return LocalProblem(W / mass, velocity * (u.ravel() - W @ r.ravel()), mu, dimension=d)


def residual(p: LocalProblem, r: np.ndarray) -> float:
    """||z - P_K(z - (u + g(u)))|| / ||q|| in longer arithmetic."""
    W, q, mu = (np.asarray(x).astype(np.longdouble) for x in (p.W, p.q, p.mu))
    u = (W @ r.astype(np.longdouble) + q).reshape(len(mu), -1)
    d = u.shape[1]
    u[:, 0] += mu * np.sqrt((u[:, 1:] ** 2).sum(axis=1))
    y = r.reshape(-1, d) * np.diag(W).reshape(-1, d).mean(axis=1)[:, None] - u
    length = np.sqrt((y[:, 1:] ** 2).sum(axis=1))
    normal = (y[:, 0] + mu * length) / (1 + mu**2)
    edge = np.column_stack([normal, (mu * normal / np.where(length > 0, length, 1))[:, None] * y[:, 1:]])
    P = np.where((length <= mu * y[:, 0])[:, None], y, np.where((mu * length <= -y[:, 0])[:, None], 0, edge))
    return float(np.sqrt(((u + y - P) ** 2).sum()) / (np.sqrt((q**2).sum()) or 1.0))


def test_none_is_called_infeasible_and_most_are_solved() -> None:
    solved, count = 0, 80
    for number in range(count):
        p = known(1, number)
        result = solve(p, "auto", tol=TOL)
        assert result.status is not Status.INFEASIBLE
        assert not result.solved or residual(p, result.r) <= 1.01 * TOL or "round-off" in result.message
        solved += result.solved
    assert solved >= 0.9 * count


def test_degenerate_solutions_that_other_stages_do_not_reach() -> None:
    """Proximal Newton from zero and Fischer and Burmeister's equations lead to some of them where reactions are not unique and several
    contacts are between two statuses; to which ones hangs on a processor's last bits. The interior point, which leads to one of them, is
    left out."""
    last, without, reached = ("interior point", "proximal Newton from zero", "Fischer-Burmeister"), 0, 0
    for number in (33, 56, 77, 157):
        p = known(1, number)
        without += solve(p, "auto", tol=TOL, without=last).solved
        result = solve(p, "auto", tol=TOL, without=("interior point",))
        assert not result.solved or residual(p, result.r) <= 1.01 * TOL
        reached += result.solved
    assert reached >= without + 2
