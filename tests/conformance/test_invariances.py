"""What must not change an answer: the order of the contacts, units, tangent frames, global axes, contacts that stay open.

The problems are well conditioned and of moderate friction, so that their solution is unique and every method here finds it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import SOLVERS, Result, solve

WANTED = (
    *("NSN-AC", "NSN-JM", "NSN-NM", "NSN-FB", "NSN-AC-GP", "NSN-AC-TEST", "NSN-AC-HYBRID", "NSN-AC-PLI-LOOP"),
    *("NSGS-AC", "NSGS-JM", "NSGS-FP-DS", "NSGS-EXACT", "NSGSV", "PPA-NSN-AC", "ADMM", "ACLM", "EG-VI-UPK", "auto"),
    *("PATH", "2D-NSGS", "2D-CPG", "2D-LEMKE", "2D-ENUM"),
)
NAMES = [name for name in WANTED if name in SOLVERS]
EXAMPLES = settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
SEEDS, SIZES = st.integers(0, 10_000), st.integers(2, 6)


def local_problem(seed: int, nc: int, d: int) -> LocalProblem:
    rng = np.random.default_rng(seed)
    m = d * nc
    H = rng.standard_normal((m + 6, m)) / np.sqrt(m)
    q = rng.standard_normal((nc, d))
    q[:, 0] -= 0.5
    return LocalProblem(H.T @ H + 0.5 * np.eye(m), q.ravel(), rng.uniform(0.05, 0.4, nc), dimension=d)


def dimension(name: str, seed: int) -> int:
    known = SOLVERS[name].dimensions
    return known[seed % len(known)]


def answer(problem: GlobalProblem | LocalProblem, name: str, tol: float = 1e-10, **options: Any) -> Result:
    result = solve(problem, name, tol=tol, **options)
    assert result.solved, (name, result.status, result.error)
    return result


def assert_same(problem: LocalProblem, r: np.ndarray, expected: Result, atol: float = 1e-7) -> None:
    assert_allclose(r, expected.r, atol=atol)
    assert_allclose(problem.W @ r + problem.q, expected.u, atol=atol)


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS, nc=SIZES)
def test_order_of_the_contacts(name: str, seed: int, nc: int) -> None:
    d = dimension(name, seed)
    p = local_problem(seed, nc, d)
    order = np.random.default_rng(seed + 1).permutation(nc)
    dofs = (order[:, None] * d + np.arange(d)).ravel()
    permuted = LocalProblem(p.W[np.ix_(dofs, dofs)], p.q[dofs], p.mu[order], dimension=d)
    r = np.empty_like(p.q)
    r[dofs] = answer(permuted, name).r
    assert_same(p, r, answer(p, name))


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS, nc=SIZES, velocity=st.floats(-3, 3), impulse=st.floats(-3, 3))
def test_units(name: str, seed: int, nc: int, velocity: float, impulse: float) -> None:
    """u in units of 10^-velocity, r of 10^-impulse: W and q scale along; the error adds r to u, so the tolerance does with their ratio."""
    a, b = 10**velocity, 10 ** np.clip(impulse, velocity - 2, velocity + 2)
    p = local_problem(seed, nc, dimension(name, seed))
    scaled = replace(p, W=a / b * p.W, q=a * p.q)
    result = answer(scaled, name, tol=1e-10 * min(1.0, b / a))
    assert_same(p, result.r / b, answer(p, name), atol=1e-7 * max(1.0, b / a, a / b))


@pytest.mark.parametrize("name", ["NSN-AC", "NSN-JM", "NSN-NM", "NSN-FB"])
@EXAMPLES
@given(seed=SEEDS, nc=SIZES, power=st.integers(-10, 10), rho=st.sampled_from(["spectral norm", "split spectral norm", "adaptive"]))
def test_rho_that_follows_W_makes_newton_blind_to_units(name: str, seed: int, nc: int, power: int, rho: str) -> None:
    """r in units of 4^-power: floating point scales exactly, Cholesky's square roots too, so the iterates do, one by one."""
    p = local_problem(seed, nc, dimension(name, seed))
    b = 4.0**power
    scaled = replace(p, W=p.W / b)
    for steps in (1, 2, 3):
        first = solve(p, name, tol=1e-300, rho=rho, max_iterations=steps)
        second = solve(scaled, name, tol=1e-300, rho=rho, max_iterations=steps)
        if not first.history:  # r = 0 solves it
            assert not second.history
        elif np.argmin([row[2] for row in first.history]) == np.argmin([row[2] for row in second.history]):  # which iterate is handed back
            assert_allclose(second.r / b, first.r, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS, nc=SIZES, mirror=st.booleans())
def test_tangent_frames(name: str, seed: int, nc: int, mirror: bool) -> None:
    """Each contact's tangents turned by an angle of its own, or mirrored; in 2D the tangent can only be turned round."""
    d, rng = dimension(name, seed), np.random.default_rng(seed + 2)
    p = local_problem(seed, nc, d)
    blocks = []
    for angle in rng.uniform(0, 2 * np.pi, nc):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s], [s, c]]) if d == 3 else np.array([[np.sign(c)]])
        blocks.append(np.eye(d))
        blocks[-1][1:, 1:] = turn
        if mirror:
            blocks[-1][1] *= -1
    Q = sla.block_diag(*blocks)
    turned = LocalProblem(Q @ p.W @ Q.T, Q @ p.q, p.mu, dimension=d)
    assert_same(p, Q.T @ answer(turned, name).r, answer(p, name))


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS, nc=st.integers(1, 4))
def test_contacts_that_stay_open(name: str, seed: int, nc: int) -> None:
    """A contact that leaves fast, coupled to the others, has no reaction and changes nothing."""
    d = dimension(name, seed)
    whole = local_problem(seed, nc + 1, d)
    q = whole.q.copy()
    q[d * nc] = 1e3
    whole = replace(whole, q=q)
    part = LocalProblem(whole.W[: d * nc, : d * nc], q[: d * nc], whole.mu[:nc], dimension=d)
    result = answer(whole, name, tol=1e-13 if name in ("NSN-AC", "NSN-JM") else 1e-12)
    assert_allclose(result.r[d * nc :], 0, atol=1e-8)
    assert_same(part, result.r[: d * nc], answer(part, name), atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS)
def test_global_axes(name: str, seed: int) -> None:
    """Degrees of freedom in other axes: M, H, f, G turned by one orthogonal matrix leave r as it is and turn v."""
    d, rng = dimension(name, seed), np.random.default_rng(seed)
    X, H = rng.standard_normal((16, 16)), rng.standard_normal((16, 3 * d))
    f = -H.reshape(16, 3, d)[:, :, 0].sum(axis=1) + 0.3 * rng.standard_normal(16)
    p = GlobalProblem(X @ X.T / 16 + np.eye(16), H, f, np.zeros(3 * d), rng.uniform(0.05, 0.4, 3), np.eye(16)[:, :2], np.ones(2), d)
    Q, _ = np.linalg.qr(rng.standard_normal((16, 16)))
    assert p.G is not None
    turned = replace(p, M=Q @ p.M @ Q.T, H=Q @ p.H, f=Q @ p.f, G=Q @ p.G)
    first, second = answer(p, name), answer(turned, name)
    assert first.v is not None and second.v is not None and first.multiplier is not None
    assert_allclose(second.r, first.r, atol=1e-6)
    assert_allclose(second.v, Q @ first.v, atol=1e-6)
    assert_allclose(second.multiplier, first.multiplier, atol=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(seed=SEEDS, nc=SIZES)
def test_storage(name: str, seed: int, nc: int) -> None:
    """A dense W and the same block by block or in rows are one problem."""
    p = local_problem(seed, nc, dimension(name, seed))
    expected = answer(p, name)
    for W in (sp.bsr_array(p.W, blocksize=(p.dimension, p.dimension)), sp.csr_array(p.W), np.asfortranarray(p.W)):
        assert_same(p, answer(replace(p, W=W), name).r, expected)
