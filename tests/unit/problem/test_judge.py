"""The judge: errors, checks and status of hand-made answers, whose numbers follow from the definitions."""

import math

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.arrays import FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem._judge_kernels import diagonal_blocks_of_rows, squared_natural_residual, violations
from fcsim.problem.judge import (
    OPEN,
    SLIP,
    STICK,
    Judge,
    check,
    contact_status,
    error,
    natural_map_residual,
    outweighed,
    relative,
    scaled_error,
)
from fcsim.solvers import solve


def projected(z: FloatArray, mu: float) -> FloatArray:
    """The nearest point of ||z_T|| <= mu z_N, zone by zone."""
    N, t = z[0], float(np.linalg.norm(z[1:]))
    if t <= mu * N:
        return z
    if mu * t <= -N:
        return np.zeros_like(z)
    s = (N + mu * t) / (1 + mu**2)
    return np.concatenate([[s], mu * s * z[1:] / t])


def residual(r: FloatArray, u: FloatArray, mu: FloatArray, d: int, s: FloatArray) -> float:
    """||s r - P_K(s r - (u + g(u)))||, contact by contact from its definition."""
    total = 0.0
    for a, m in enumerate(mu):
        z, v = s[a] * r[a * d : a * d + d], u[a * d : a * d + d].copy()
        v[0] += m * np.linalg.norm(v[1:])
        total += float(np.sum((z - projected(z - v, m)) ** 2))
    return math.sqrt(total)


@pytest.mark.parametrize("d", [2, 3])
def test_residual_is_its_definition(d: int) -> None:
    rng = np.random.default_rng(d)
    for nc in (1, 2, 7):
        for _ in range(30):
            r, u, mu, s = rng.standard_normal(nc * d), rng.standard_normal(nc * d), rng.uniform(0, 2, nc), rng.uniform(0.1, 9, nc)
            expected = residual(r, u, mu, d, s)
            assert_allclose(natural_map_residual(r, u, mu, d, s), expected, rtol=1e-12)
            assert_allclose(squared_natural_residual(r, u, mu, s, d), expected**2, rtol=1e-12)
            assert_allclose(natural_map_residual(r, u, mu, d), residual(r, u, mu, d, np.ones(nc)), rtol=1e-12)


def test_dimension_three_is_the_default() -> None:
    r, u, mu = np.array([1.0, 0.2, 0.1]), np.array([0.3, -0.4, 0.2]), np.array([0.5])
    assert_allclose(natural_map_residual(r, u, mu), residual(r, u, mu, 3, np.ones(1)), rtol=1e-12)
    assert contact_status(r, mu).tolist() == [STICK] and check(r, u, mu).cone == 0


@pytest.mark.parametrize(
    ("number", "scale", "expected"), [(0.0, 0.0, 0.0), (1.0, 0.0, math.inf), (3.0, 2.0, 1.5), (0.0, 5.0, 0.0), (1e-9, 0.5, 2e-9)]
)
def test_relative(number: float, scale: float, expected: float) -> None:
    assert relative(number, scale) == expected


@pytest.mark.parametrize("scale", [math.nan, math.inf])
def test_relative_to_no_number(scale: float) -> None:
    assert math.isnan(relative(0.0, scale)) and math.isnan(relative(1.0, scale)) and math.isnan(relative(math.nan, 1.0))


def sliding(d: int = 3) -> tuple[LocalProblem, FloatArray]:
    """W = 2 I, q = (-4, 3, 0), mu = 0.5: r_N = 2, r_T = -1, u = (0, 1, 0)."""
    return LocalProblem(2 * np.eye(d), np.array([-4.0, 3.0, 0.0][:d]), np.array([0.5]), dimension=d), np.array([2.0, -1.0, 0.0][:d])


@pytest.mark.parametrize("d", [2, 3])
def test_errors_of_a_sliding_block(d: int) -> None:
    p, r = sliding(d)
    assert error(p, r) < 1e-15 and scaled_error(p, r) < 1e-15 and Judge(p).error(r) < 1e-15 and Judge(p).scaled_error(r) < 1e-15
    wrong = r + 0.1
    u = 2 * wrong + p.q
    for found, s in ((error, 1.0), (scaled_error, 2.0)):  # the compliance is tr(W_aa) / d = 2
        expected = residual(wrong, u, p.mu, d, np.array([s])) / 5.0  # ||q|| = 5
        assert_allclose(found(p, wrong), expected, rtol=1e-12)
        assert_allclose(found(p, wrong, u), expected, rtol=1e-12)
        assert_allclose(found(p, wrong, floor=50.0), 0.1 * expected, rtol=1e-12)
        assert_allclose(found(p, wrong, floor=0.5), expected, rtol=1e-12)
        assert_allclose(found(p, wrong, u + 1.0), residual(wrong, u + 1.0, p.mu, d, np.array([s])) / 5.0, rtol=1e-12)
    assert_allclose(Judge(p).error(wrong, floor=50.0), 0.1 * error(p, wrong), rtol=1e-12)
    assert_allclose(Judge(p).scaled_error(wrong, floor=50.0), 0.1 * scaled_error(p, wrong), rtol=1e-12)
    assert_allclose(Judge(p).scaled_error(wrong), scaled_error(p, wrong), rtol=1e-12)


@pytest.mark.parametrize("constrained", [False, True])
def test_the_judge_of_a_global_problem_solves_its_equations(constrained: bool) -> None:
    """u, v of the whole system by dense algebra: M v = H r + f + G l, G^T v + b = 0, u = H^T v + w."""
    rng = np.random.default_rng(4)
    n, m = 7, 6
    A = rng.standard_normal((n, n))
    M, H, f, w, r = A @ A.T + np.eye(n), rng.standard_normal((n, m)), rng.standard_normal(n), rng.standard_normal(m), rng.standard_normal(m)
    G, b = rng.standard_normal((n, 2)), rng.standard_normal(2)
    mu = np.array([0.3, 0.6])
    if constrained:
        whole = np.block([[M, -G], [-G.T, np.zeros((2, 2))]])
        v = np.linalg.solve(whole, np.concatenate([H @ r + f, b]))[:n]
        at_zero = np.linalg.solve(whole, np.concatenate([f, b]))[:n]
        p = GlobalProblem(M, H, f, w, mu, G, b)
    else:
        v, at_zero = np.linalg.solve(M, H @ r + f), np.linalg.solve(M, f)
        p = GlobalProblem(M, H, f, w, mu)
    judge = Judge(p)
    assert_allclose(judge.velocity(r), H.T @ v + w, rtol=1e-9)
    scale = float(np.linalg.norm(H.T @ at_zero + w))
    assert_allclose(judge.scale, scale, rtol=1e-9)
    assert_allclose(judge.error(r), residual(r, H.T @ v + w, mu, 3, np.ones(2)) / scale, rtol=1e-8)
    assert_allclose(judge.scaled_error(r), residual(r, H.T @ v + w, mu, 3, judge.compliance) / scale, rtol=1e-8)
    if not constrained:
        W = H.T @ np.linalg.solve(M, H)
        assert_allclose(judge.compliance, [np.trace(W[:3, :3]) / 3, np.trace(W[3:, 3:]) / 3], rtol=1e-9)


def test_the_judge_of_a_mixed_problem_eliminates_its_multiplier() -> None:
    """u = W r + V l + q with V^T r + R l + s = 0."""
    rng = np.random.default_rng(5)
    A = rng.standard_normal((3, 3))
    W, V, R, q, s, r = A @ A.T, rng.standard_normal((3, 2)), -2 * np.eye(2), rng.standard_normal(3), rng.standard_normal(2), np.ones(3)
    p = LocalProblem(W, q, np.array([0.4]), V, R, s)
    l = np.linalg.solve(R, -(V.T @ r + s))
    assert_allclose(Judge(p).velocity(r), W @ r + V @ l + q, rtol=1e-10)


def test_a_singular_system_has_no_judge() -> None:
    M = sp.csc_array(np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(SingularMatrix):
        Judge(GlobalProblem(M, np.eye(3), np.ones(3), np.zeros(3), np.array([0.3])))


def test_reactions_that_are_no_numbers() -> None:
    p, r = sliding()
    for number in (math.nan, math.inf):
        assert Judge(p).error(np.array([number, 0, 0])) == math.inf == Judge(p).scaled_error(np.array([r[0], number, 0]))


@pytest.mark.parametrize("d", [2, 3])
def test_checks_are_their_definitions(d: int) -> None:
    rng = np.random.default_rng(10 + d)
    for nc in (1, 2, 5):
        for _ in range(20):
            r, u, q, mu = rng.standard_normal(nc * d), rng.standard_normal(nc * d), 2 * rng.standard_normal(nc * d), rng.uniform(0, 1, nc)
            R, U = r.reshape(nc, d), u.reshape(nc, d)
            slip = np.linalg.norm(U[:, 1:], axis=1)
            modified = U.copy()
            modified[:, 0] += mu * slip
            cone = max(0.0, float((np.linalg.norm(R[:, 1:], axis=1) - mu * R[:, 0]).max()))
            dual = max(0.0, float((mu * slip - modified[:, 0]).max()))
            largest = max(np.abs(u).max(), np.abs(q).max())
            size = np.linalg.norm(r) * max(np.linalg.norm(u), np.linalg.norm(q))
            found = check(r, u, mu, d, 0.25, q)
            assert_allclose(found.cone, cone / np.abs(r).max(), rtol=1e-12)
            assert_allclose(found.dual_cone, dual / largest, rtol=1e-12)
            assert_allclose(found.complementarity, abs(float(np.sum(R * modified))) / size, rtol=1e-10)
            assert_allclose(found.penetration, max(0.0, -float(U[:, 0].min())), rtol=1e-12)
            assert found.momentum == 0.25
            alone = check(r, u, mu, d)
            assert alone.momentum is None
            assert_allclose(alone.dual_cone, dual / np.abs(u).max(), rtol=1e-12)
            numbers = violations(r, u, q, mu, d)
            assert_allclose(numbers[4:], (np.abs(r).max(), largest, np.linalg.norm(r), size / np.linalg.norm(r)), rtol=1e-12)


def test_checks_without_contacts_and_of_zeros() -> None:
    empty = check(np.zeros(0), np.zeros(0), np.zeros(0), 3, 0.5)
    assert (empty.cone, empty.dual_cone, empty.complementarity, empty.penetration, empty.momentum) == (0, 0, 0, 0, 0.5)
    still = check(np.zeros(3), np.zeros(3), np.array([0.5]))
    assert (still.cone, still.dual_cone, still.complementarity, still.penetration, still.momentum) == (0, 0, 0, 0, None)


def test_checks_hand_on_what_is_no_number() -> None:
    for r, u in (([math.nan, 0, 0], [1.0, 0, 0]), ([1.0, 0, 0], [math.nan, 0, 0])):
        assert math.isnan(check(np.array(r), np.array(u), np.array([0.5])).complementarity)


def test_status_of_contacts() -> None:
    """Open below tolerance times the largest reaction, slipping from 1 - tolerance of the cone's edge on."""
    mu = np.array([0.5, 0.5, 0.5, 0.5, 0.5])
    r = np.array([[1e-7, 0, 0], [1.0, 0.3, 0.4], [1.0, 0.3, 0.39], [1.0, 0.3, -0.4], [0.0, 0.0, 0.0]]).ravel()
    assert contact_status(r, mu).tolist() == [OPEN, SLIP, STICK, SLIP, OPEN]
    assert contact_status(r, mu, tolerance=0.1).tolist() == [OPEN, SLIP, SLIP, SLIP, OPEN]
    assert contact_status(r, mu, tolerance=1e-8).tolist() == [STICK, SLIP, STICK, SLIP, OPEN]
    assert contact_status(1e9 * r, mu).tolist() == [OPEN, SLIP, STICK, SLIP, OPEN]
    assert contact_status(np.array([1.0, -0.5, 1.0, 0.2]), np.array([0.5, 0.5]), 2).tolist() == [SLIP, STICK]
    assert contact_status(np.zeros(0), np.zeros(0)).tolist() == [] and len({OPEN, STICK, SLIP}) == 3


@pytest.mark.parametrize("d", [2, 3])
def test_blocks_on_the_diagonal(d: int) -> None:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4 * d, 4 * d)) * (rng.random((4 * d, 4 * d)) < 0.6)
    rows = sp.csr_array(A)
    found = diagonal_blocks_of_rows(rows.indptr, rows.indices, rows.data, d)
    assert_allclose(found, [A[a * d : a * d + d, a * d : a * d + d] for a in range(4)])
    doubled = diagonal_blocks_of_rows(2 * rows.indptr, np.repeat(rows.indices, 2), np.repeat(rows.data, 2), d)
    assert_allclose(doubled, 2 * found)


@pytest.mark.parametrize("mu", [20.0, 1e3, 1e8, 1e100, 1e300])
def test_penetration_counts_whatever_the_friction(mu: float) -> None:
    """u_N = -1 beside |u_T| = 1 without a reaction: the natural map alone is 1 / sqrt(1 + mu^2), which no tolerance would see."""
    problem = LocalProblem(np.eye(3), np.array([-1.0, 1.0, 0.0]), np.array([mu]))
    r = np.zeros(3)
    assert scaled_error(problem, r) >= 1 / np.sqrt(101) / np.sqrt(2)
    for name in ("auto", "NSGS-AC", "NSN-AC", "PROX-NEWTON"):
        result = solve(problem, name, tol=1e-8)
        assert not result.solved or result.u[0] > -1e-6
    exact = np.array([1.0, -1.0, 0.0])  # it sticks
    assert scaled_error(problem, exact) == 0


def test_the_published_error_is_as_published_whatever_the_friction() -> None:
    mu = np.array([40.0])
    r, u = np.array([0.3, -2.0, 1.0]), np.array([-1.0, 0.5, 2.0])
    assert_allclose(natural_map_residual(r, u, mu), residual(r, u, mu, 3, np.ones(1)), rtol=1e-12)
    problem = LocalProblem(np.eye(3), u, mu)
    result = solve(problem, "NSGS-AC", max_iterations=1)
    assert_allclose(result.published_error, error(problem, result.r), rtol=1e-9)


@pytest.mark.parametrize("name", ["auto", "NSGS-AC", "NSN-AC"])
@pytest.mark.parametrize("nc", [2, 140])
def test_contacts_that_part_do_not_hide_others_without_a_word(name: str, nc: int) -> None:
    """Two unit masses, one 1e9 m/s from closing, one that falls: r = 0 is within 1e-8 ||q||, and of the second within 100 %."""
    q = np.zeros(3 * nc)
    q[0], q[3:6] = 1e9, (-1.0, 0.1, 0.0)
    result = solve(LocalProblem(np.eye(3 * nc), q, np.full(nc, 0.5)), name, tol=1e-8)
    assert result.solved and "outweigh" in result.message
    q[0] = 1e3
    result = solve(LocalProblem(np.eye(3 * nc), q, np.full(nc, 0.5)), name, tol=1e-8)
    assert result.solved and not result.message and result.r[3] == pytest.approx(1, abs=1e-4)
    q[0], q[3] = 1e9, -1e-17  # at rest up to round-off
    q[4] = 0.0
    assert not solve(LocalProblem(np.eye(3 * nc), q, np.full(nc, 0.5)), name, tol=1e-8).message


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("closing", [0.0, 1.0])
def test_a_thousandth_of_the_velocities_of_contacts_that_do_not_part_is_said(d: int, closing: float) -> None:
    """On both sides of the bound, with contacts that would close without reactions and others that have some."""
    rng = np.random.default_rng(d)
    q, u, r = rng.standard_normal((30, d)), np.abs(rng.standard_normal((30, d))), np.zeros((30, d))
    q[:, 0] = np.abs(q[:, 0])
    q[:5, 0] *= -closing
    r[3:9, -1] = 1.0
    u[7:12, 0] *= -1
    counted = np.linalg.norm(q[:12] if closing else q[3:12])
    for share, said in ((1.001e-3, True), (0.999e-3, False), (1e-5, False)):
        assert bool(outweighed(r.ravel(), u.ravel(), q.ravel(), d, share * counted, 10 * counted, 0.0)) == said


def test_penetration_is_not_lost_beside_a_velocity_of_any_size() -> None:
    """u_N = -0.05 beside u_T = 1e150, where u_N + mu |u_T| is mu |u_T| to the last digit."""
    u, mu = np.array([-0.05, 0.0, 1e150]), np.array([0.7])
    assert natural_map_residual(np.zeros(3), u, mu, 3, np.ones(1)) >= 0.05 / np.sqrt(1 + 0.7**2) * (1 - 1e-12)
    W = np.diag([1e-2, 0.1, 1e-3])
    W[0, 2], W[2, 0] = 1e308, -1e308
    for name in ("auto", "NSGS-AC", "NSN-AC"):
        result = solve(LocalProblem(W, np.array([-0.05, -0.2, -0.1]), mu), name)
        assert not result.solved or result.u[0] > -1e-8


@pytest.mark.parametrize("name", ["auto", "NSN-AC"])
@pytest.mark.parametrize("nc", [2, 140])
def test_reactions_whose_round_off_is_the_error_are_named(name: str, nc: int) -> None:
    """Two contacts of one mass between jaws of a compliance c: r_N = 1 / c, and 2.2e-16 / c of ||q|| is lost in W r."""
    for c, told in ((1e-9, True), (1e-4, False)):
        W = np.eye(3 * nc)
        W[0, 3] = W[3, 0] = -1.0
        W[[0, 3], [0, 3]] = 1.0 + c
        q = np.zeros(3 * nc)
        q[[0, 3]] = -1.0
        result = solve(LocalProblem(W, q, np.full(nc, 0.5)), name, tol=1e-8)
        assert not result.solved or ("by round-off the error is known" in result.message) is told
        assert result.solved or told
        assert result.r[0] == pytest.approx(1 / c, rel=1e-5)


@pytest.mark.parametrize("name", ["auto", "LM", "NSN-AC", "ADMM"])
def test_free_velocities_that_cancel_are_named_and_end(name: str) -> None:
    """w = -H^T M^-1 f but for round-off, which is all that is left of q: methods end (auto went on for ever), and the floor is named."""
    rng = np.random.default_rng(288)
    H, M, f = rng.standard_normal((9, 6)) * 30, np.diag(rng.uniform(0.1, 10, 9)), rng.standard_normal(9)
    q = np.array([-2.0, 0.7, -0.3, -1.0, 0.5, 0.4])
    w = -H.T @ (f / np.diag(M)) + 1e-15 * q
    problem = GlobalProblem(M, H, f, w, np.array([0.3, 0.0]))
    result = solve(problem, name, tol=1e-8)
    assert "cancel" in result.message and "floor" in result.message
    assert solve(problem, name, tol=1e-8, floor=1e-3).solved
    assert "cancel" not in solve(GlobalProblem(M, H, f, w + q, problem.mu), name, tol=1e-8).message


def in_longer_arithmetic(p: LocalProblem, r: FloatArray) -> float:
    """The scaled error of p with 64 bits of mantissa, by its definition."""
    W, q, r, mu = (np.asarray(x, dtype=np.longdouble) for x in (p.W, p.q, r, p.mu))
    d, total = p.dimension, np.longdouble(0)
    for a, u in enumerate((W @ r + q).reshape(-1, d)):
        own = slice(d * a, d * a + d)
        z, m, least = np.trace(W[own, own]) / d * r[own], mu[a], max(-u[0], 0) / np.sqrt(1 + min(mu[a], 10) ** 2)
        y = z - u
        y[0] -= m * np.sqrt(u[1:] @ u[1:])
        t = np.sqrt(y[1:] @ y[1:])
        if m * t <= -y[0]:
            y[:] = 0
        elif t > m * y[0]:
            normal = (y[0] + m * t) / (1 + m * m)
            y[:] = np.concatenate([[normal], m * normal * y[1:] / t])
        total += max((z - y) @ (z - y), least**2)
    return float(np.sqrt(total / (q @ q)))


def test_large_friction_says_where_it_hides_the_error() -> None:
    """g(u) = mu ||u_T|| multiplies the round-off of u_T: where longer arithmetic finds another error by a tenth of the tolerance the
    message says so, and with ordinary friction it says nothing."""
    rng, told, off = np.random.default_rng(1), 0, 0
    for mu in np.repeat([0.8, 1e6, 1e8], 30):
        G, t = rng.standard_normal((6, 6)), rng.standard_normal((2, 2))
        r = np.column_stack([[1.0, 1.0], 0.6 * mu * t / np.linalg.norm(t, axis=1)[:, None]])
        p = LocalProblem(G @ G.T, -(G @ G.T) @ r.ravel(), np.full(2, mu))
        for name in ("NSGS-AC", "NSN-AC"):
            result = solve(p, name, tol=1e-8, max_iterations=100)
            if result.solved:
                said = "multiplies the round-off of sliding" in result.message
                differs = abs(in_longer_arithmetic(p, result.r) - result.error) > 1e-9
                assert said or not differs
                assert not said or mu > 1
                told, off = told + said, off + differs
    assert told >= off > 10
