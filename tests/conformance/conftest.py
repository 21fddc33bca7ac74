"""Reference problems for every solver of the table, and the test's own verdict on an answer.

Nothing here calls fcsim's projections, error or checks: the law is written again in the few lines of `Verdict`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.optimize
import scipy.sparse as sp

from fcsim.problem import GlobalProblem, LocalProblem

GRAVITY, STEP, MASS = 9.81, 1e-3, 2.5


@dataclass(frozen=True)
class Reference:
    """A problem, its exact solution where there is one (u always unique, r where given), and whether its W has full rank."""

    problem: GlobalProblem | LocalProblem
    u: np.ndarray | None = None
    r: np.ndarray | None = None
    full_rank: bool = True


@dataclass(frozen=True)
class Verdict:
    """The law and the error recomputed from (r, u): violations relative to the largest |r|, the largest of |u| and |q|, their product."""

    cone: float
    dual_cone: float
    complementarity: float
    error: float

    @staticmethod
    def of(r: np.ndarray, u: np.ndarray, mu: np.ndarray, d: int, q: np.ndarray) -> Verdict:
        if not len(mu):
            return Verdict(0.0, 0.0, 0.0, 0.0)
        r, u = r.reshape(-1, d), u.reshape(-1, d).copy()
        sliding = np.sqrt((u[:, 1:] ** 2).sum(axis=1))
        u[:, 0] += mu * sliding
        r_T = np.sqrt((r[:, 1:] ** 2).sum(axis=1))
        R, U = np.abs(r).max() + 1e-300, max(np.abs(u).max(), np.abs(q).max()) + 1e-300
        # the projection of z by its three cases
        z = r - u
        P = np.zeros_like(z)
        for a, (m, z_N, z_T) in enumerate(zip(mu, z[:, 0], z[:, 1:], strict=True)):
            length = np.sqrt(z_T @ z_T)
            if m * length <= -z_N:
                continue
            if length <= m * z_N:
                P[a] = z[a]
            else:
                P[a, 0] = (z_N + m * length) / (1 + m * m)
                P[a, 1:] = m * P[a, 0] * z_T / length
        return Verdict(
            cone=max(0.0, float((r_T - mu * r[:, 0]).max()), float(-r[:, 0].min())) / R,
            dual_cone=max(0.0, float((mu * sliding - u[:, 0]).max())) / U,
            complementarity=float(np.abs((r * u).sum(axis=1)).max()) / (R * U),
            error=float(np.linalg.norm(r - P) / (np.linalg.norm(q) or 1.0)),
        )


def rotation(seed: int, d: int = 3) -> np.ndarray:
    Q, R = np.linalg.qr(np.random.default_rng(seed).standard_normal((d, d)))
    return Q * np.sign(np.diag(R))


def block_on_slope(angle: float, mu: float, d: int, lift: float = 0.0) -> Reference:
    """A point mass from rest on a slope, one implicit step: M v = H r + h m g; normal component first, tangents turned in the plane.

    Statics: it stays iff tan(angle) <= mu; dynamics: u_T = h g (sin - mu cos) downhill, r_T = mu r_N uphill, r_N = h m g cos.
    `lift` [N s] is an upward impulse normal to the slope; above h m g cos the mass takes off.
    """
    downhill = np.array([1.0]) if d == 2 else np.array([np.cos(0.7), np.sin(0.7)])
    weight = STEP * MASS * GRAVITY
    normal, along = weight * np.cos(angle), weight * np.sin(angle)
    in_contact_frame = np.r_[lift - normal, along * downhill]
    frame = rotation(5, d)  # rows N, T1[, T2] in some global axes
    problem = GlobalProblem(
        MASS * sp.eye_array(d), sp.csc_array(frame.T), frame.T @ in_contact_frame, np.zeros(d), np.array([mu]), dimension=d
    )
    if lift >= normal:
        return Reference(problem, in_contact_frame / MASS, np.zeros(d))
    friction = min(along, mu * (normal - lift))
    r = np.r_[normal - lift, -friction * downhill]
    return Reference(problem, np.r_[0, (along - friction) / MASS * downhill], r)


def random_local(seed: int, nc: int, d: int, mu: float = 0.5, extra: int = 10) -> LocalProblem:
    """Full-rank W = H^T H, a part of the contacts approaching and others leaving."""
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((d * nc + extra, d * nc)) / np.sqrt(d * nc)
    W = H.T @ H + 0.2 * np.eye(d * nc)
    q = rng.standard_normal((nc, d))
    q[:, 0] -= 0.5
    return LocalProblem(W, q.ravel(), rng.uniform(0.1, mu, nc), dimension=d)


def frictionless(seed: int, nc: int, d: int) -> Reference:
    """mu = 0: min 0.5 r_N W_NN r_N + q_N r_N over r_N >= 0, by SciPy's nonnegative least squares on the Cholesky factor."""
    p = random_local(seed, nc, d)
    W_NN, q_N = p.W[::d, ::d], p.q[::d]
    L = np.linalg.cholesky(W_NN)
    r = np.zeros(nc * d)
    r[::d] = scipy.optimize.nnls(L.T, -sla.solve_triangular(L, q_N, lower=True))[0]
    return Reference(LocalProblem(p.W, p.q, np.zeros(nc), dimension=d), p.W @ r + p.q, r)


def random_global(seed: int, d: int, constraints: int = 0) -> Reference:
    """Four bodies of 9 dofs, contacts between them, optionally tied by equality constraints."""
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((4, 9, 9))
    M = sla.block_diag(*(x @ x.T + 9 * np.eye(9) for x in X))
    nc = 24 // d if constraints == 0 else 18 // d
    H = rng.standard_normal((36, nc * d))
    f = -H.reshape(36, nc, d)[:, :, 0].sum(axis=1) + rng.standard_normal(36)
    G, b = (rng.standard_normal((36, constraints)), 0.1 * rng.standard_normal(constraints)) if constraints else (None, None)
    return Reference(GlobalProblem(sp.csc_array(M), sp.csc_array(H), f, np.zeros(nc * d), rng.uniform(0.1, 0.5, nc), G, b, d))


def with_local_constraints(seed: int) -> Reference:
    p = random_local(seed, 6, 3)
    rng = np.random.default_rng(seed)
    V = 0.3 * rng.standard_normal((18, 2))
    return Reference(LocalProblem(p.W, p.q, p.mu, V, -2 * np.eye(2), rng.standard_normal(2)))


def unsymmetric(seed: int) -> Reference:
    p = random_local(seed, 8, 3, mu=0.3)
    W = p.W + 0.01 * np.random.default_rng(seed).standard_normal(p.W.shape)
    return Reference(LocalProblem(W, p.q, p.mu))


def no_contact() -> Reference:
    problem = GlobalProblem(2 * sp.eye_array(3), sp.csc_array((3, 0)), np.ones(3), np.zeros(0), np.zeros(0))
    return Reference(problem, np.zeros(0), np.zeros(0))


def rigid_block_on_its_corners(corners: int) -> Reference:
    """A rigid block dropped flat on `corners` > 2 points of a circle: 6 dofs, 3 corners contact unknowns. Pushed inside the friction
    cone and above its base, it comes to rest: u = 0, while r is not unique.
    """
    angle = 2 * np.pi * np.arange(corners) / corners
    place = np.column_stack([np.cos(angle), np.sin(angle), np.full(corners, -0.5)])
    H = np.zeros((6, 3 * corners))
    for a, p in enumerate(place):
        for k, direction in enumerate(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])):
            H[:, 3 * a + k] = np.r_[direction, np.cross(p, direction)]
    M = sp.diags_array([2.0, 2, 2, 0.8, 0.8, 0.9])
    f = np.r_[0.2, -0.1, -3.0, np.zeros(3)]
    return Reference(GlobalProblem(M, H, f, np.zeros(3 * corners), np.full(corners, 0.6)), u=np.zeros(3 * corners), full_rank=False)


REGULAR: dict[str, Callable[[], Reference]] = {
    "sliding block": lambda: block_on_slope(np.pi / 6, 0.3, 3),
    "sliding block, 2D": lambda: block_on_slope(np.pi / 6, 0.3, 2),
    "sticking block": lambda: block_on_slope(np.pi / 18, 0.3, 3),
    "sticking block, 2D": lambda: block_on_slope(np.pi / 18, 0.3, 2),
    "nearly sliding block": lambda: block_on_slope(np.arctan(0.2999), 0.3, 3),
    "barely sliding block": lambda: block_on_slope(np.arctan(0.3001), 0.3, 3),
    "frictionless block": lambda: block_on_slope(np.pi / 6, 0.0, 3),
    "take-off": lambda: block_on_slope(np.pi / 6, 0.3, 3, lift=0.03),
    "take-off, 2D": lambda: block_on_slope(np.pi / 6, 0.3, 2, lift=0.03),
    "lightened block": lambda: block_on_slope(np.pi / 6, 0.3, 3, lift=0.01),
    "no contact": no_contact,
    "frictionless": lambda: frictionless(1, 12, 3),
    "frictionless, 2D": lambda: frictionless(2, 15, 2),
    "random": lambda: Reference(random_local(3, 12, 3)),
    "random, 2D": lambda: Reference(random_local(4, 20, 2)),
    "random, sparse": lambda: Reference(
        LocalProblem(sp.bsr_array(random_local(3, 12, 3).W, blocksize=(3, 3)), *_rest(random_local(3, 12, 3)))
    ),
    "random global": lambda: random_global(5, 3),
    "random global, 2D": lambda: random_global(6, 2),
    "equality constraints": lambda: random_global(7, 3, constraints=3),
    "equality constraints, 2D": lambda: random_global(8, 2, constraints=2),
    "local equality constraints": lambda: with_local_constraints(9),
    "slightly unsymmetric": lambda: unsymmetric(10),
}
HYPERSTATIC: dict[str, Callable[[], Reference]] = {
    "rigid block on three points": lambda: rigid_block_on_its_corners(3),
    "rigid block on four points": lambda: rigid_block_on_its_corners(4),
    "rigid block on six points": lambda: rigid_block_on_its_corners(6),
    "random, rank 20 of 36": lambda: rank_deficient(11),
}


def _rest(p: LocalProblem) -> tuple[np.ndarray, np.ndarray]:
    return p.q, p.mu


def rank_deficient(seed: int) -> Reference:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((20, 36))
    H[:, ::3] = np.abs(H[:, ::3])  # all normals push f away: a solution exists
    return Reference(GlobalProblem(sp.eye_array(20), H, -np.abs(rng.standard_normal(20)), np.zeros(36), np.full(12, 0.3)), full_rank=False)


@pytest.fixture
def verdict() -> Callable[..., Verdict]:
    return Verdict.of


@pytest.fixture
def random_problem() -> Callable[..., LocalProblem]:
    return random_local


@pytest.fixture
def random_global_problem() -> GlobalProblem:
    problem = random_global(5, 3).problem
    assert isinstance(problem, GlobalProblem)
    return problem
