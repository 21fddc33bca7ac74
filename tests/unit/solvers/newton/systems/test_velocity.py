"""Newton's regularised system in the bodies' velocities: the same step as by the contacts, and where it is used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.bench.families import problems
from fcsim.linear import storage
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus, GlobalProblem
from fcsim.problem.motion import Motion
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve
from fcsim.solvers.newton.systems.choice import newton_system
from fcsim.solvers.newton.systems.direct import DenseSystem
from fcsim.solvers.newton.systems.velocity import Bodies, VelocitySystem, bodies_of

OPEN, STICK, SLIP = 0, 1, 2


def bodies(d: int, nc: int, n: int, seed: int, unit: float = 1.0) -> Delassus:
    """W = H^T M^-1 H of rank n < m, masses around `unit`, every contact on some of the unknowns; a shift for each contact."""
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((n, d * nc)) * np.repeat(rng.random((n, nc)) < 0.5, d, axis=1)
    M = sla.block_diag(*(x @ x.T + np.eye(2) for x in rng.standard_normal((n // 2, 2, 2)))) * unit
    W = H.T @ np.linalg.solve(M, H)
    motion = Motion(sp.csr_array(H.T), sp.csr_array(M), W)
    return Delassus(W, d, 1e-2 / unit * (1 + rng.random(nc)), motion)


def linearisation(nc: int, d: int, rng: np.random.Generator, unit: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A [impulse per velocity] and B as the formulations make them: open, sticking (B = 0), sliding."""
    zone = rng.choice(3, nc)
    A = unit * (0.2 * rng.standard_normal((nc, d, d)) + 2 * np.eye(d))
    B = 0.2 * rng.standard_normal((nc, d, d)) + np.eye(d)
    A[zone == OPEN], B[zone == OPEN] = 0, np.eye(d)
    B[zone == STICK] = 0
    return A, B


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_the_step_is_that_of_the_contacts(d: int, sparse: bool, unit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    if sparse:
        monkeypatch.setattr(storage, "DENSE_UP_TO", 0)
    nc, rng = 30, np.random.default_rng(1)
    operator = bodies(d, nc, 12, 2, unit)
    system = VelocitySystem(operator)
    for factor in (1.0, 1e-3):
        assert operator.shift is not None
        own = system.shifted(factor * operator.shift)
        A, B = linearisation(nc, d, rng, unit)
        rhs = rng.standard_normal((nc, d))
        dr, du = own.solve(A, B, rhs)
        shifted = operator.W + np.diag(np.repeat(factor * operator.shift, d))
        J = sla.block_diag(*A) @ shifted + sla.block_diag(*B)
        assert np.linalg.norm(J @ dr - rhs.ravel()) <= 1e-9 * np.linalg.norm(rhs)
        assert_allclose(du, shifted @ dr, rtol=0, atol=1e-9 * np.abs(du).max())
        assert_allclose(dr, DenseSystem(own.operator).solve(A, B, rhs)[0], rtol=0, atol=1e-7 * np.abs(dr).max())


def test_without_a_shift_it_is_singular() -> None:
    operator = bodies(3, 10, 6, 3)
    A, B = np.tile(np.eye(3), (10, 1, 1)), np.zeros((10, 3, 3))
    with pytest.raises(SingularMatrix):
        VelocitySystem(replace(operator, shift=np.zeros(10))).solve(A, B, np.ones((10, 3)))
    with pytest.raises(SingularMatrix):
        VelocitySystem(replace(operator, shift=None)).solve(A, B, np.ones((10, 3)))


@pytest.mark.parametrize("shift", [None, 1e-2])
def test_compliances_of_the_contacts_own_make_it_regular(shift: float | None) -> None:
    nc, d, rng = 30, 3, np.random.default_rng(6)
    rigid, own = bodies(d, nc, 12, 2), 1e-2 * (1 + rng.random(d * nc))
    assert rigid.motion is not None
    W = rigid.W + np.diag(own)
    operator = Delassus(W, d, None if shift is None else np.full(nc, shift), replace(rigid.motion, W=W, own=own))
    A, B = linearisation(nc, d, rng)
    rhs = rng.standard_normal((nc, d))
    dr, du = VelocitySystem(operator).solve(A, B, rhs)
    whole = W + (shift or 0.0) * np.eye(d * nc)
    assert np.linalg.norm((sla.block_diag(*A) @ whole + sla.block_diag(*B)) @ dr - rhs.ravel()) <= 1e-9 * np.linalg.norm(rhs)
    assert_allclose(du, whole @ dr, rtol=0, atol=1e-9 * np.abs(du).max())


def test_a_problem_with_springs_is_eliminated_in_the_velocities_of_its_bodies() -> None:
    """Springs are degrees of freedom that M couples to nothing and one contact unknown moves: W = H^T M^-1 H + diag(C) without them."""
    rng, m, n = np.random.default_rng(7), 300, 12
    H_bodies, C = rng.standard_normal((n, m)), 1e-2 * (1 + rng.random(m))
    M = sp.block_diag([sp.eye_array(n) * 2.0, sp.diags_array(1 / C)], format="csr")
    H = sp.vstack([sp.csr_array(H_bodies), sp.eye_array(m)], format="csr")
    problem = GlobalProblem(M, H, rng.standard_normal(n + m), np.zeros(m), np.full(m // 3, 0.5))
    local = reduce(problem).local
    motion = local.delassus.motion
    assert motion is not None and motion.own is not None and motion.regular
    assert motion.HT.shape == (m, n)
    assert_allclose(motion.own, C, rtol=1e-14)
    W = local.W if isinstance(local.W, np.ndarray) else local.W.toarray()
    assert_allclose(W, H_bodies.T @ H_bodies / 2 + np.diag(C), rtol=0, atol=1e-12 * np.abs(W).max())
    assert isinstance(newton_system(local.delassus, condensing=True, once=True), VelocitySystem), "regular without a shift"
    assert solve(problem, "PROX-NEWTON").solved


def test_it_serves_where_degrees_of_freedom_are_few_and_the_operator_is_regular() -> None:
    operator = bodies(3, 120, 12, 4)
    assert isinstance(newton_system(operator, condensing=True, once=True), VelocitySystem)
    for other in (replace(operator, motion=None), replace(operator, shift=None), replace(operator, shift=np.zeros(120))):
        assert not isinstance(newton_system(other, condensing=True, once=True), VelocitySystem)
    assert not isinstance(newton_system(operator, "dense", condensing=True), VelocitySystem), "a name is an order"


def test_a_reduction_knows_where_its_operator_comes_from() -> None:
    wall = problems("walls", 200, 1)
    assert isinstance(wall, GlobalProblem)
    local = reduce(wall).local
    assert local.motion is not None
    assert local.motion.of(local.W) is local.motion
    HT, W = local.motion.HT.toarray(), local.W.toarray() if sp.issparse(local.W) else local.W
    assert_allclose(HT @ np.linalg.solve(local.motion.M.toarray(), HT.T), W, rtol=0, atol=1e-12 * np.abs(W).max())
    other = replace(local, W=2 * W)
    assert other.motion is not None
    assert other.motion.of(other.W) is None, "another W in its place"
    assert other.motion.stored_as(other.W, other.W) is None
    for m, n, known in ((2997, 1798, True), (2997, 1799, False), (3000, 1500, True), (3000, 1501, False)):
        first = np.arange(m) * n // m
        H = sp.csr_array((np.ones(2 * m), (np.r_[first, (first + 1) % n], np.tile(np.arange(m), 2))), shape=(n, m))
        reduction = reduce(GlobalProblem(sp.eye_array(n, format="csr"), H, np.zeros(n), -np.ones(m), np.full(m // 3, 0.5)))
        assert (reduction.local.motion is not None) is known, "up to 0.6 velocities a contact unknown, of many unknowns up to a half"
    many = GlobalProblem(np.eye(9), np.eye(9), np.zeros(9), -np.ones(9), np.full(3, 0.5))
    assert reduce(many).local.motion is None, "as many degrees of freedom as contact unknowns"


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_the_answer_does_not_depend_on_the_elimination(seed: int) -> None:
    """Rigid walls on a tilted table: the sequences are the same up to round-off, and u is determined where r is not.

    By PPA-NSN-AC's few steps: over hundreds of iterations the round-off grows, and the wall of seed 2, which is left out, has
    solutions whose u differ by 2e-6 max |q|, each of an error of 1e-14."""
    wall = problems("walls", 200, seed)
    assert isinstance(wall, GlobalProblem)
    local = reduce(wall).local
    bodily, plain = (solve(p, "PPA-NSN-AC", tol=1e-11, error="scaled") for p in (local, replace(local, motion=None)))
    assert bodily.solved
    assert plain.solved
    scale = np.abs(local.q).max()
    assert_allclose(bodily.u, plain.u, rtol=0, atol=1e-6 * scale)


def test_a_replaced_operator_is_not_eliminated_by_the_old_bodies() -> None:
    wall = problems("walls", 200, 0)
    assert isinstance(wall, GlobalProblem)
    local = reduce(wall).local
    other = replace(local, W=3 * local.W)
    result = solve(other, "PROX-NEWTON", tol=1e-9)
    assert result.solved
    assert_allclose(result.u, solve(replace(other, motion=None), "PROX-NEWTON", tol=1e-9).u, rtol=0, atol=1e-6 * np.abs(local.q).max())


def test_bodies_that_no_contact_touches_do_not_count() -> None:
    """Blocks in flight beside a pile: the pile's W has the same rank as without them, and the step is the same."""
    wall = problems("walls", 200, 1)
    assert isinstance(wall, GlobalProblem)
    flying = 6 * 500
    n, M, H = wall.n, sp.csr_array(wall.M), sp.csr_array(wall.H)
    whole = GlobalProblem(
        sp.csc_array(sp.block_diag([M, 2 * sp.eye_array(flying)])),
        sp.csc_array(sp.vstack([H, sp.csr_array((flying, wall.m))])),
        np.concatenate([wall.f, np.ones(flying)]),
        wall.w,
        wall.mu,
        dimension=3,
    )
    local, alone = reduce(whole).local, reduce(wall).local
    assert local.motion is not None and local.motion.M.shape[0] == n + flying
    for solver in ("PROX-NEWTON", "auto"):
        result = solve(local, solver, tol=1e-9)
        assert result.solved
        assert_allclose(result.u, solve(alone, solver, tol=1e-9).u, rtol=0, atol=1e-6 * np.abs(alone.q).max())


@pytest.mark.parametrize("d", [2, 3])
def test_shares_in_the_rows_of_a_pattern(d: int) -> None:
    """M + H diag(K) H^T entry by entry; contacts of fewer unknowns than others, and open ones."""
    operator = bodies(d, 40, 20, 5)
    assert operator.motion is not None
    HT, M = operator.motion.HT, operator.motion.M
    K = np.random.default_rng(6).standard_normal((40, d, d))
    K[::5] = 0
    expected = M.toarray() + HT.T @ sla.block_diag(*K) @ HT
    right = np.ones(20)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(storage, "DENSE_UP_TO", 0)
        sparse = Bodies(operator.motion, d)
    assert sparse.mass is None
    for made in (sparse, Bodies(operator.motion, d)):
        assert_allclose(expected @ made.solve(K, right), right, rtol=0, atol=1e-8)


def test_shifts_share_their_bodies() -> None:
    operator = bodies(3, 20, 6, 3)
    whole = replace(operator, shift=None)
    assert bodies_of(whole) is bodies_of(whole.shifted(1.0)) is bodies_of(whole.shifted(1.0).shifted(2.0))
