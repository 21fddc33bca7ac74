"""`auto` as a method: every real problem at 1e-8, hyperstatic piles that plain Newton cannot solve, warm starts, exact repetition."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.spatial import cKDTree

from fcsim.export_fclib import GlobalRollingProblem, read_fclib
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import Status, solve

FOLDER = Path(__file__).parents[3] / "shared" / "fclib"
FILES = sorted(path.name for path in FOLDER.glob("*.hdf5")) if FOLDER.is_dir() else []


@pytest.mark.skipif(not FILES, reason="the folder of real FCLIB problems, ../shared/fclib, is absent")
@pytest.mark.parametrize("name", FILES or ["absent"])
def test_every_real_problem(name: str, verdict: Callable[..., Any]) -> None:
    """Status and error, with u recomputed from r by SciPy alone."""
    problem = read_fclib(FOLDER / name).problem
    result = solve(problem, "auto", tol=1e-8)
    assert result.status is Status.SOLVED
    if isinstance(problem, GlobalProblem | GlobalRollingProblem):
        assert problem.G is None
        M = sp.csc_matrix(problem.M)
        factor = spla.splu(M, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

        def velocity(r: np.ndarray) -> np.ndarray:
            rhs = problem.H @ r + problem.f
            v = factor.solve(rhs)
            return problem.H.T @ (v + factor.solve(rhs - M @ v)) + problem.w

        u, q = velocity(result.r), velocity(np.zeros(problem.m))
    else:
        u, q = problem.W @ result.r + problem.q, problem.q
    if isinstance(problem, GlobalRollingProblem):
        assert off_the_rolling_law(problem, result.r.reshape(-1, 5), u.reshape(-1, 5)) <= 1e-7
    else:
        assert verdict(result.r, u, problem.mu, problem.dimension, q).error <= 1.01e-8


def off_the_rolling_law(problem: GlobalRollingProblem, r: np.ndarray, u: np.ndarray) -> float:
    """The largest part of the law that (r, u) (nc, 5) break, of max |r|, max |u| or their product.

    Bodies are not pulled and do not meet; friction and moment are within their disks and dissipate all that these allow,
    mu r_N |u_T| = -r_T u_T and mu_r r_N |w| = -m w.
    """
    R, U = np.abs(r).max(), np.abs(u).max()
    parts = [-r[:, 0] / R, -u[:, 0] / U, np.abs(r[:, 0] * u[:, 0]) / (R * U)]
    for mu, some in ((problem.mu, slice(1, 3)), (problem.mu_r, slice(3, 5))):
        force, motion = r[:, some], u[:, some]
        parts.append((np.linalg.norm(force, axis=1) - mu * r[:, 0]) / R)
        parts.append((mu * r[:, 0] * np.linalg.norm(motion, axis=1) + np.sum(force * motion, axis=1)) / (R * U))
    return float(np.max(parts))


def pile(bodies: int, seed: int, asymmetry: float, gyroscopic: float = 0.0) -> LocalProblem:
    """Rigid bodies in a cube, masses from 1 to 100, each touching its neighbours at two points, the lowest held, all falling.

    Twice as many contact unknowns as degrees of freedom and more: W is rank-deficient; `asymmetry` perturbs its entries.
    `gyroscopic` makes W = H^T A H unsymmetric as real files of rigid bodies are: by a skew part of the bodies' A, which leaves W monotone.
    """
    rng = np.random.default_rng(seed)
    x = rng.random((bodies, 3))
    first, second = np.repeat(cKDTree(x).query_pairs(1.3 * bodies ** (-1 / 3), output_type="ndarray"), 2, axis=0).T
    nc = len(first)
    normal = x[second] - x[first]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True) + 0.1 * rng.standard_normal((nc, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tangent = np.cross(normal, [0.3, 0.5, 0.8])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([normal, tangent, np.cross(normal, tangent)], axis=1)
    point = 0.5 * (x[first] + x[second]) + 0.02 * rng.standard_normal((nc, 3))
    H = np.zeros((bodies, 6, nc, 3))
    contact = np.arange(nc)
    for body, sign in ((second, 1.0), (first, -1.0)):
        arm = point - x[body]
        H[body, :3, contact] += sign * frame.transpose(0, 2, 1)
        H[body, 3:, contact] += sign * np.cross(arm[:, None], frame).transpose(0, 2, 1)
    H = H.reshape(6 * bodies, 3 * nc)
    compliance = np.repeat(10 ** -rng.uniform(0, 2, bodies), 6).reshape(bodies, 6)
    compliance[:, 3:] *= 100
    held = x[:, 2] < 0.15
    compliance[held] = 0
    v = np.zeros((bodies, 6))
    v[~held, 2] = -9.81e-2
    W = sp.csr_array(sp.csr_array(H.T * compliance.ravel()) @ sp.csr_array(H))
    W.data *= 1 + asymmetry * rng.standard_normal(W.nnz)
    if gyroscopic:
        turn = gyroscopic * compliance[:, 3, None, None] * np.cross(np.eye(3), rng.standard_normal((bodies, 1, 3)))
        blocks = [sp.coo_array(np.pad(skew, ((3, 0), (3, 0)))) for skew in turn]
        W = sp.csr_array(W + sp.csr_array(H.T) @ sp.block_diag(blocks, format="csr") @ sp.csr_array(H))
    return LocalProblem(W, H.T @ v.ravel(), np.full(nc, 0.7))


@pytest.mark.parametrize(
    ("bodies", "seed", "asymmetry", "gyroscopic"),
    [
        (20, 0, 0.0, 0.0),
        pytest.param(30, 0, 0.0, 0.0, marks=pytest.mark.slow),
        (30, 5, 1e-6, 0.0),
        pytest.param(40, 6, 1e-5, 0.0, marks=pytest.mark.slow),
        (40, 1408, 1e-4, 0.0),
        pytest.param(70, 1068, 1e-12, 0.0, marks=pytest.mark.slow),
        (60, 2, 0.0, 1e-2),
    ],
)
def test_hyperstatic_piles(bodies: int, seed: int, asymmetry: float, gyroscopic: float, verdict: Callable[..., Any]) -> None:
    problem = pile(bodies, seed, asymmetry, gyroscopic)
    asymmetric = float(spla.norm(problem.W - problem.W.T) / spla.norm(problem.W))
    assert asymmetric > 1e-2 * (asymmetry + gyroscopic) or asymmetry + gyroscopic == 0
    assert np.linalg.matrix_rank(pile(bodies, seed, 0.0).W.toarray()) < 0.8 * problem.m
    result = solve(problem, "auto", tol=1e-8)
    assert result.status is Status.SOLVED
    assert verdict(result.r, problem.W @ result.r + problem.q, problem.mu, 3, problem.q).error <= 1.01e-8
    again = solve(problem, "auto", tol=1e-8)
    assert np.array_equal(again.r, result.r), "no decision may depend on the clock"


def test_noise_that_leaves_no_solution(verdict: Callable[..., Any]) -> None:
    """The least error of this pile is 0.072 times the noise on W, whatever that is: a tenth of it is met, and nothing below is claimed."""
    problem = pile(20, 120, 1e-6)
    near = solve(problem, "auto", tol=1e-7)
    assert near.status is Status.SOLVED
    assert verdict(near.r, problem.W @ near.r + problem.q, problem.mu, 3, problem.q).error <= 1.01e-7
    assert np.array_equal(solve(problem, "auto", tol=1e-7).r, near.r), "starts near the best iterate are repeatable"
    beyond = solve(problem, "auto", near.r, tol=1e-9, time_limit=0.5)
    assert not beyond.solved
    assert beyond.error <= near.error


def test_plain_newton_cannot() -> None:
    """Which shows that the piles are what auto's proximal stage is for."""
    assert not solve(pile(30, 0, 0.0), "NSN-AC", tol=1e-8).solved


def test_warm_start_is_used(random_problem: Callable[..., LocalProblem]) -> None:
    problem = random_problem(3, 20, 3)
    cold = solve(problem, "auto", tol=1e-10)
    warm = solve(problem, "auto", cold.r + 1e-6 * np.random.default_rng(0).standard_normal(problem.m), tol=1e-10)
    assert cold.solved and warm.solved
    assert warm.iterations <= 0.6 * cold.iterations  # sweeps, which gain digits at one rate: 4 of the 10 are left


def test_time_limit_is_honest() -> None:
    problem = pile(40, 6, 1e-5)
    result = solve(problem, "auto", tol=1e-14, time_limit=0.05)
    assert result.status is not Status.SOLVED
    assert np.isfinite(result.error)
