"""Newton's linear system preconditioned by joints and by the bodies' motions: shares of W, exact cases, sizes, threads, and fallbacks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim import GlobalProblem, InputError, SolverSettings
from fcsim.linear.joints import BlockRows
from fcsim.problem.bodies.product import ShareProduct
from fcsim.problem.bodies.shares import BodyShares, KnownShares, compliant_motions, shares_of
from fcsim.problem.reduction import reduce
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers import solve
from fcsim.solvers.newton.systems import condensed
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels
from fcsim.solvers.newton.systems.two_level import alone
from fcsim.solvers.newton.systems.two_level import system as two_level
from fcsim.solvers.newton.systems.two_level.joints import Joints
from fcsim.solvers.newton.systems.two_level.system import TwoLevelSystem
from fcsim.timestep.step import Step

CASE = Path(__file__).resolve().parents[5] / "cases" / "masonry_wall"
SHORT = {"steps": "4", "gravity_last": "2"}
"""The whole weight within step 2: contacts slide."""


def walls(tol: float = 1e-9, options: Mapping[str, object] = MappingProxyType({}), **given: str) -> Iterator[Step]:
    """Steps of a wall by NSN-AC with these options."""
    script = load_case(CASE)
    case = script.build(parse_parameters(script, {**SHORT, **given}))
    return iter(replace(case.simulation, solver=SolverSettings(name="NSN-AC", tol=tol, options=options, fallback=())))


@cache
def step_of(courses: str, blocks: str) -> Step:
    """Step 2 of a wall."""
    steps = walls(courses=courses, blocks=blocks)
    next(steps)
    return next(steps)


def shares_and_rows(step: Step) -> tuple[BodyShares, BlockRows, KnownShares]:
    operator = step.reduction.local.delassus
    assert operator.shares is not None
    rows = BlockRows(sp.bsr_array(operator.W, blocksize=(3, 3)), 3)
    return operator.shares.make(), rows, operator.shares


def linearisation(nc: int, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B of Alart and Curnier's form: most stick, a tenth slide with friction 0.5, a few are open."""
    rng = np.random.default_rng(1)
    A, B = np.tile(np.eye(3) / scale, (nc, 1, 1)), np.zeros((nc, 3, 3))
    kind = rng.random(nc)
    slides, is_open = kind < 0.1, kind > 0.98
    angle = rng.uniform(0, 2 * np.pi, nc)
    along = np.stack([np.cos(angle), np.sin(angle)], -1)
    A[slides, 1:] = 0
    A[slides, 1:, 0] = 0.5 * along[slides] / scale
    B[slides, 1:, 1:] = np.eye(2)
    B[slides, 1:, 0] = -0.5 * along[slides]
    A[is_open], B[is_open] = 0, np.eye(3)
    return A, B


def newton_matrix(A: np.ndarray, W: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A W + B with blocks A, B (nc, 3, 3) and a dense W (3 nc, 3 nc): A's rows block by block, a thousandth of a dense product's work."""
    return np.matmul(A, W.reshape(len(A), 3, -1)).reshape(W.shape) + sla.block_diag(*B)


def test_the_shares_are_those_of_W() -> None:
    """h C h^T x body by body against W's own entries, summed by other code; deformable bricks of several kinds and a rigid platen."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    x = np.random.default_rng(0).standard_normal(rows.W.shape[0])
    found = shares.bodies()
    assert found is not None
    Wx = rows.W @ x
    assert_allclose(ShareProduct(shares).affine(x, np.zeros_like(x)), Wx, atol=1e-13 * np.abs(Wx).max())


def test_by_its_name_it_finds_the_bodies_in_M(monkeypatch: pytest.MonkeyPatch) -> None:
    """The global problem of a wall as a file has it: its bodies' shares, from the blocks of M, sum to W, and Newton's method with these
    alone arrives where it does without; what is asked for by name is not left to another system."""
    p = step_of("3", "3.5").reduction.problem
    assert isinstance(p, GlobalProblem)
    local = reduce(p).local
    known = local.delassus.shares
    assert known is not None
    shares = known.make()
    assert shares.bodies() is not None
    x = np.random.default_rng(0).standard_normal(p.m)
    Wx = local.W @ x
    assert_allclose(ShareProduct(shares).affine(x, np.zeros_like(x)), Wx, atol=1e-13 * np.abs(Wx).max())
    monkeypatch.setattr(alone.SystemByBodies, "solve", without_another)
    found, reference = (solve(p, "NSN-AC", tol=1e-11, linear=linear) for linear in ("two-level", "kkt"))
    assert found.solved and reference.solved
    assert_allclose(found.u, reference.u, atol=1e-6 * np.abs(reference.u).max())


def test_by_its_name_it_says_where_another_system_has_worked() -> None:
    """A body on 151 contacts, one more than a joint may have: the answer is r = -(W^-1 q), whose contacts stick, in one iteration."""
    n = 3 * 151
    M = np.eye(n) + np.full((n, n), 1e-3)
    p = GlobalProblem(sp.csr_array(M), sp.eye_array(n, format="csc"), np.zeros(n), np.tile([-1.0, 0.0, 0.0], n // 3), np.full(n // 3, 2.0))
    by_name, other = (solve(p, "NSN-AC", linear=linear) for linear in ("two-level", "dense"))
    assert_allclose(by_name.r, -M @ p.w, rtol=1e-9, atol=1e-9)
    assert by_name.message == "linear='two-level' did not get there in 1 of 1 iterations, whose systems another one has solved"
    assert not other.message


def without_another(system: alone.SystemByBodies, A: np.ndarray, B: np.ndarray, rhs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`SystemByBodies.solve`, which must not go on by another system."""
    assert system._two_level is not None
    found = system._two_level.solve(A, B, rhs, system.needed, system.foreseen)
    assert found is not None
    return found


@pytest.mark.parametrize("d", [2, 3])
def test_bodies_of_all_kinds_in_M(d: int) -> None:
    """Blocks that LAPACK factors, small ones, unknowns that M couples to nothing, and a body that no contact touches; what is not symmetric
    is refused."""
    rng = np.random.default_rng(d)
    sizes = (9, 9, 3, 5, 1, 1, 1, 8)
    blocks = [np.eye(n) + 0.1 * (Y := rng.standard_normal((n, n))) @ Y.T for n in sizes]
    M = sla.block_diag(*blocks)
    first = np.concatenate([[0], np.cumsum(sizes)])
    H = np.zeros((len(M), 6 * d))
    for a, (i, j) in enumerate([(0, 1), (1, 2), (2, 3), (3, 4), (4, 6), (5, 0)]):
        for b in (i, j):
            H[first[b] : first[b + 1], d * a : d * a + d] = rng.standard_normal((sizes[b], d))
    given = (sp.csc_array(H), np.ones(len(M)), np.zeros(6 * d), np.full(6, 0.3))
    known = reduce(GlobalProblem(sp.csr_array(M), *given, dimension=d)).local.delassus.shares
    assert known is not None
    shares, x = known.make(), rng.standard_normal(6 * d)
    W = H.T @ np.linalg.solve(M, H)
    assert_allclose(ShareProduct(shares).affine(x, x), W @ x + x, atol=1e-12)
    M[0, 3] += 0.3
    turned = GlobalProblem(sp.csr_array(M), *given, dimension=d)
    with pytest.raises(InputError, match="M: expected a symmetric matrix"):
        solve(turned, "NSN-AC", linear="two-level")


def test_what_is_left_beside_the_compliant_motions_is_small_and_positive_semidefinite() -> None:
    """The best rank-12 approximation leaves the 13th eigenvalue (Eckart, Young); Nystrom's a little more, and nothing negative."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    values = {len(C): np.linalg.eigvalsh(C)[::-1] for _, every, _ in shares.runs for C in every}
    assert {6, 360} <= set(values)
    for _, every, _ in shares.runs:
        for C in every:
            L = compliant_motions(C, 12)
            left, exact = np.linalg.eigvalsh(C - L @ L.T), np.linalg.eigvalsh(C)[::-1]
            assert left[0] >= -1e-12 * exact[0]
            assert left[-1] <= 1e-12 * exact[0] + (1.5 * exact[12] if len(C) > 12 else 0)
    found = shares.bodies()
    assert found is not None
    bodies, side = found
    G = shares.modes(12, side)
    whole = np.zeros((rows.W.shape[0], 12 * shares.count))
    for a, (pair, own) in enumerate(zip(bodies, G, strict=True)):
        for s in range(2):
            if pair[s] >= 0:
                whole[3 * a : 3 * a + 3, 12 * pair[s] : 12 * pair[s] + 12] = own[:, 12 * s : 12 * s + 12]
    E = rows.W.toarray() - whole @ whole.T
    assert np.linalg.eigvalsh(E)[0] >= -1e-10 * np.abs(rows.W.diagonal()).max()
    assert np.abs(E).max() < 0.05 * np.abs(rows.W.diagonal()).max()


def test_of_a_compliance_without_rank_nothing_is_made_up() -> None:
    rng = np.random.default_rng(0)
    Y = rng.standard_normal((40, 3))
    L = compliant_motions(Y @ Y.T, 12)
    assert_allclose(L @ L.T, Y @ Y.T, atol=1e-10)
    assert_array_equal(compliant_motions(np.zeros((6, 6)), 12), np.zeros((6, 12)))


def test_one_joint_is_solved_by_the_preconditioner_itself() -> None:
    """Two bodies: the joint's block is all of E, and P is A W + B but for single precision and the shift."""
    rng = np.random.default_rng(0)
    n, nc = 30, 8
    bodies = []
    for _ in range(2):
        Y = rng.standard_normal((n, n))
        bodies.append(Y @ Y.T / n + 0.5 * np.eye(n) + 100 * np.outer(Y[0], Y[0]))
    H = sp.csc_array(sp.random_array((2 * n, 3 * nc), density=0.4, rng=rng))
    body, column = np.repeat(np.arange(2), n), np.tile(np.arange(n), 2)
    shares = shares_of(H, body, column, 2, 3, ((0, np.array(bodies), np.arange(2)),))
    W = H.T.toarray() @ sla.block_diag(*bodies) @ H.toarray()
    found = shares.bodies()
    assert found is not None
    scale = float(np.diag(W).mean())
    A, B = linearisation(nc, scale)
    P = two_level.Preconditioner(Joints(BlockRows(W, 3), shares, *found))
    P.update(A, B)
    x = rng.standard_normal(3 * nc)
    J = sla.block_diag(*A) @ W + sla.block_diag(*B)
    assert np.linalg.norm(P(J @ x) - x) <= 1e-3 * np.linalg.norm(x)


def test_the_preconditioner_is_the_formula_that_it_is_given_by() -> None:
    """Q - Q A G (I + G^T Q A G)^-1 G^T Q with dense matrices, joint by joint with its neighbours; single precision."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    found = shares.bodies()
    assert found is not None
    joints, W = Joints(rows, shares, *found), rows.W.toarray()
    A, B = linearisation(len(joints.order), float(rows.W.diagonal().mean()))
    dofs = (3 * joints.order[:, None] + np.arange(3)).ravel()  # in the order of the joints
    own_A, own_B, W = A[joints.order], B[joints.order], W[np.ix_(dofs, dofs)]
    A_whole = sla.block_diag(*own_A)
    G = np.zeros((len(dofs), 12 * shares.count))
    for a, (pair, own) in enumerate(zip(joints.bodies, joints.modes[0], strict=True)):
        for side in range(2):
            if pair[side] >= 0:
                G[3 * a : 3 * a + 3, 12 * pair[side] : 12 * pair[side] + 12] = own[:, 12 * side : 12 * side + 12]
    local = newton_matrix(own_A, W - G @ G.T + joints.shift * np.eye(len(W)), own_B)
    Q = np.zeros_like(W)
    for k in range(len(joints.cuts) - 1):
        wide = (3 * joints.wide[joints.begins[k] : joints.begins[k + 1], None] + np.arange(3)).ravel()
        inner = slice(3 * joints.cuts[k], 3 * joints.cuts[k + 1])
        Q[inner, wide] = np.linalg.inv(local[np.ix_(wide, wide)])[: inner.stop - inner.start]
    x = np.random.default_rng(0).standard_normal(len(dofs))
    c = np.linalg.solve(np.eye(G.shape[1]) + G.T @ Q @ A_whole @ G, G.T @ Q @ x)
    expected = Q @ (x - A_whole @ G @ c)
    P, given = two_level.Preconditioner(joints), np.empty_like(x)
    P.update(A, B)
    given[dofs] = x
    assert np.linalg.norm(P(given)[dofs] - expected) <= 1e-3 * np.linalg.norm(expected)


def test_of_changed_contacts_the_joints_with_them_are_computed_anew() -> None:
    """After A and B of some contacts changed the preconditioner is bit for bit the one made for them; small changes change no bit."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    found = shares.bodies()
    assert found is not None
    joints, scale = Joints(rows, shares, *found), float(rows.W.diagonal().mean())
    nc = len(joints.order)
    A, B = linearisation(nc, 1.0)
    A /= scale
    x = np.random.default_rng(0).standard_normal(3 * nc)
    P, anew = two_level.Preconditioner(joints), two_level.Preconditioner(joints)
    P.update(A, B)
    first = P(x)
    P.update(A * (1 + 0.5 * two_level.CHANGED), B)
    assert_array_equal(P(x), first)
    P.update(A * (1 + 0.5 * two_level.CHANGED), B, two_level.FIRST_CHANGED)  # as in a step's first system
    anew.update(A * (1 + 0.5 * two_level.CHANGED), B)
    assert_array_equal(P(x), anew(x))
    P.update(A, B)
    assert_array_equal(P(x), anew(x))
    P, anew = two_level.Preconditioner(joints), two_level.Preconditioner(joints)
    P.update(A, B)
    own = joints.order[joints.cuts[1] : joints.cuts[1] + 2]  # of the second joint
    A[own], B[own] = 0, np.eye(3)
    P.update(A, B)
    anew.update(A, B)
    assert np.any(P(x) != first)
    assert_array_equal(P(x), anew(x))


def test_a_steps_first_system_goes_by_smaller_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc, asked = len(rows.indptr) - 1, list[float]()
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    update = two_level.Preconditioner.update

    def noted(self: two_level.Preconditioner, A: np.ndarray, B: np.ndarray, changed_by: float) -> None:
        asked.append(changed_by)
        update(self, A, B, changed_by)

    monkeypatch.setattr(two_level.Preconditioner, "update", noted)
    system, rhs = TwoLevelSystem(rows, known), np.random.default_rng(2).standard_normal((nc, 3))
    for foreseen in (True, False):
        assert system.solve(A, B, rhs, foreseen=foreseen) is not None
    assert asked == [two_level.FIRST_CHANGED, two_level.CHANGED]


def test_what_is_kept_serves_the_next_W_and_only_a_near_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kept: nothing is made anew, the answer is that of the new W; not of a W with other diagonals, nor for ever."""
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc = len(rows.indptr) - 1
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    first = TwoLevelSystem(rows, known)
    assert first.left is None
    assert first.solve(A, B, rhs) is not None
    kept = first.left
    assert kept is not None
    before = kept(rhs.ravel())

    def scaled(factor: float) -> tuple[BlockRows, KnownShares]:
        """The same wall of other compliances."""
        s = known.make()
        other = BlockRows(sp.bsr_array(rows.W * factor), 3)
        runs = tuple((begin, factor * C, kind) for begin, C, kind in s.runs)
        return other, KnownShares(other.W, lambda: replace(s, runs=runs))

    made: list[int] = []
    anew = two_level.Joints

    def counted(*arguments: object) -> Joints:
        made.append(1)
        return anew(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(two_level, "Joints", counted)
    for factor, times in ((1.02, 0), (2.0, 1)):
        near, of_near = scaled(factor)
        following = TwoLevelSystem(near, of_near, kept)
        A2, B2 = linearisation(nc, float(near.W.diagonal().mean()))
        A2[:5], B2[:5] = 0, np.eye(3)  # other statuses
        found = following.solve(A2, B2, rhs, foreseen=True)
        assert found is not None
        assert len(made) == times
        J = newton_matrix(A2, near.W.toarray(), B2)
        assert np.linalg.norm(J @ found[0] - rhs.ravel()) <= 20 * two_level.FORESEEN * np.linalg.norm(rhs)
        assert_array_equal(kept(rhs.ravel()), before)  # what is in a memory is not changed
    own = (known.make(), known.make().bodies()[0], rows.W.diagonal().reshape(nc, 3))  # type: ignore[index]
    later = kept
    for _ in range(two_level.LASTS):
        assert (later := later.following(*own)) is not None  # type: ignore[assignment]
    assert later.following(*own) is None


@pytest.mark.parametrize("needed", [0.2, 1.0])
def test_near_a_solution_the_defect_is_one_of_the_residual(needed: float) -> None:
    """With rows of one size, to SAFETY times what is needed, whatever rho has made of the rows."""
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc, compliance = len(rows.indptr) - 1, rows.W.diagonal().reshape(-1, 3).mean(1)
    A, B = linearisation(nc, 1.0)
    A /= compliance[:, None, None]
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    rho = np.where(B.any((1, 2)), 1.0, np.random.default_rng(3).uniform(0.01, 100, nc))  # of contacts that stick
    found = TwoLevelSystem(rows, known).solve(A * rho[:, None, None], B, rhs * rho[:, None], needed)
    assert found is not None
    defect = np.einsum("aij,aj->ai", A, (rows.W @ found[0]).reshape(nc, 3)) + np.einsum("aij,aj->ai", B, found[0].reshape(nc, 3)) - rhs
    assert np.linalg.norm(defect) <= 1.5 * two_level.SAFETY * needed * np.linalg.norm(rhs)


@pytest.mark.parametrize(("accuracy", "near"), [(two_level.ACCURACY, 0.1), (1e-6, 1e-3)])
def test_the_step_is_that_of_a_dense_solve(accuracy: float, near: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the defect asked for; as reactions, of which some move hardly anything, less nearly."""
    monkeypatch.setattr(two_level, "ACCURACY", accuracy)
    monkeypatch.setattr(two_level, "PLATEAU", 0.0)
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc = len(rows.indptr) - 1
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    found = TwoLevelSystem(rows, known).solve(A, B, rhs)
    assert found is not None
    J = newton_matrix(A, rows.W.toarray(), B)
    assert np.linalg.norm(J @ found[0] - rhs.ravel()) <= 2 * accuracy * np.linalg.norm(rhs)
    exact = np.linalg.solve(J, rhs.ravel())
    assert np.linalg.norm(found[0] - exact) <= near * np.linalg.norm(exact)
    assert_allclose(found[1], rows.W @ found[0], atol=1e-10 * np.abs(found[1]).max())


@pytest.mark.parametrize("d", [2, 3])
def test_rows_of_contacts_are_those_of_the_inverse_and_do_not_depend_on_rho(d: int) -> None:
    """(A c + B)^-1 [A, B, rhs] as NumPy has it; rows multiplied by anything regular before give the same; singular ones stay."""
    rng = np.random.default_rng(4)
    A, B, rhs, c = rng.standard_normal((20, d, d)), rng.standard_normal((20, d, d)), rng.standard_normal((20, d)), rng.uniform(1, 2, 20)
    A[0], B[1] = 0, 0
    A[2, 0, 0] = B[2, 0, 0] = 0  # a pivot that is zero
    A[3], B[3] = np.eye(d), -c[3] * np.eye(d)
    found = kernels.normalised(A, B, rhs, c)
    inverse = np.linalg.inv((A * c[:, None, None] + B)[np.arange(20) != 3])
    for own, given in zip(found, (A, B, rhs[:, :, None]), strict=True):
        assert_array_equal(own[3], given[3].reshape(own[3].shape))
        others = np.delete(given, 3, axis=0)
        assert_allclose(np.delete(own, 3, axis=0).reshape(others.shape), inverse @ others, rtol=1e-9, atol=1e-9)
    T = rng.standard_normal((20, d, d)) + 3 * np.eye(d)
    T[3] = np.eye(d)
    for own, other in zip(found, kernels.normalised(T @ A, T @ B, np.einsum("aij,aj->ai", T, rhs), c), strict=True):
        assert_allclose(other, own, rtol=1e-8, atol=1e-8)


def test_iterations_do_not_grow_with_the_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    """12 and 35 bricks: the same right-hand side, a push on one contact in forty. Without motions they grow several times over."""
    counts = []
    counted: list[int] = []
    solve = two_level.gmres

    def counting(product: object, *arguments: object) -> object:
        counted.append(0)

        def one(x: np.ndarray) -> np.ndarray:
            counted[-1] += 1
            return product(x)  # type: ignore[operator,no-any-return]

        return solve(one, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(two_level, "gmres", counting)
    monkeypatch.setattr(two_level, "PLATEAU", 0.0)  # where it would end on the larger wall, too
    for courses, blocks in (("3", "3.5"), ("5", "6.5")):
        _, rows, known = shares_and_rows(step_of(courses, blocks))
        nc = len(rows.indptr) - 1
        A, B = linearisation(nc, float(rows.W.diagonal().mean()))
        rhs = np.zeros((nc, 3))
        rhs[::40, 0] = 1.0
        assert TwoLevelSystem(rows, known).solve(A, B, rhs) is not None
        counts.append(counted[-1])
    assert counts[1] <= 1.3 * counts[0] + 1
    assert counts[1] <= 60


def test_where_the_residual_does_not_fall_every_other_system_goes_on_beyond_a_plateau(monkeypatch: pytest.MonkeyPatch) -> None:
    """And each one ends on it while the residual falls."""
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc = len(rows.indptr) - 1
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    given: list[float] = []
    solve = two_level.gmres

    def watched(*arguments: object) -> object:
        given.append(arguments[-1])  # type: ignore[arg-type]
        return solve(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(two_level, "gmres", watched)
    system = TwoLevelSystem(rows, known)
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    for needed in (1e-3, 2e-3, 2.1e-3, 1e-3, 2.5e-3, 4e-3, 1e-2):
        assert system.solve(A, B, rhs, needed) is not None
    assert [plateau > 0 for plateau in given] == [True, True, False, True, False, True, True]


def test_the_bits_do_not_depend_on_the_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc = len(rows.indptr) - 1
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    answers = []
    for threads in ("1", "3"):
        monkeypatch.setenv("FCSIM_THREADS", threads)
        answers.append(TwoLevelSystem(rows, known).solve(A, B, rhs))
    assert answers[0] is not None
    assert answers[1] is not None
    assert_array_equal(answers[0][0], answers[1][0])


def test_where_it_does_not_get_there_it_says_so_and_leaves_the_rest_to_others(monkeypatch: pytest.MonkeyPatch) -> None:
    _, rows, known = shares_and_rows(step_of("3", "3.5"))
    nc = len(rows.indptr) - 1
    A, B = linearisation(nc, float(rows.W.diagonal().mean()))
    rhs = np.random.default_rng(2).standard_normal((nc, 3))
    monkeypatch.setattr(two_level, "JOINT_UP_TO", 5)
    assert TwoLevelSystem(rows, known).solve(A, B, rhs) is None
    monkeypatch.setattr(two_level, "JOINT_UP_TO", 150)
    monkeypatch.setattr(two_level, "ITERATIONS", 1)
    monkeypatch.setattr(two_level, "ENOUGH", 0.0)
    system = TwoLevelSystem(rows, known)
    assert system.solve(A, B, rhs) is None
    assert not system.pays


STEPS = """
import hashlib, sys
sys.path.insert(0, sys.argv[1])
from fcsim.runtime import limited_threads
from fcsim.solvers.newton.systems import choice, condensed
from fcsim.solvers.newton.systems.two_level import joints, system
from test_two_level import walls
condensed.TWO_LEVEL_FROM = choice.TWO_LEVEL_FROM = 1
system.ENTRIES_A_PIECE = joints.WORK_A_PIECE = 8_000
with limited_threads():  # as in a run: what stands between steps is made by BLAS too
    for step in walls(1e-6, courses="4", blocks="5.5", steps="3"):
        print(hashlib.sha256(step.result.r.tobytes()).hexdigest(), step.result.iterations)
"""


@pytest.mark.parametrize("threads", ["3", pytest.param("2", marks=pytest.mark.slow)])
def test_whole_steps_have_the_same_bits_on_any_number_of_threads(threads: str) -> None:
    """A wall of 24 bricks, its work cut finely, all of Newton's systems by this way: reactions of every step, in processes of their own."""

    def begun(threads: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", STEPS, str(Path(__file__).parent)]
        return subprocess.Popen(command, env={**os.environ, "FCSIM_THREADS": threads}, stdout=subprocess.PIPE, text=True)

    def end(run: subprocess.Popen[str]) -> str:
        said = run.communicate(timeout=300)[0]
        assert run.returncode == 0
        return said

    said = end(begun("1"))  # alone: what it compiles, the other finds
    assert len(said.splitlines()) == 3
    assert end(begun(threads)) == said


def test_a_run_whose_systems_this_way_does_not_solve_goes_on_by_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """GMRES that gives up at once: the steps are those of the ways that are left, to the tolerance."""
    reactions = []
    monkeypatch.setattr(two_level, "ITERATIONS", 1)
    monkeypatch.setattr(two_level, "ENOUGH", 0.0)
    failed = []
    solve = TwoLevelSystem.solve

    def watched(system: TwoLevelSystem, *arguments: object) -> object:
        found = solve(system, *arguments)  # type: ignore[arg-type]
        failed.append(found is None)
        return found

    monkeypatch.setattr(TwoLevelSystem, "solve", watched)
    for least in (10**9, 1):
        monkeypatch.setattr(condensed, "TWO_LEVEL_FROM", least)
        steps = list(walls(1e-8))
        assert all(step.result.error <= 1e-8 for step in steps)
        reactions.append([step.result.r for step in steps])
    assert any(failed)
    for one, other in zip(*reactions, strict=True):
        assert np.linalg.norm(one - other) <= 1e-4 * np.linalg.norm(one) + 1e-12


def test_steps_of_a_wall_are_those_with_a_border(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reactions of deformable blocks are unique: two ways to solve Newton's systems meet in them. What carries the wall is its weight."""
    reactions = []
    for least in (10**9, 1):
        monkeypatch.setattr(condensed, "TWO_LEVEL_FROM", least)
        steps = list(walls())
        assert all(step.result.error <= 1e-9 for step in steps)
        reactions.append(steps[-1].result.r)
    assert np.linalg.norm(reactions[1] - reactions[0]) <= 1e-4 * np.linalg.norm(reactions[0])
    assert np.any(reactions[1] != reactions[0])


def test_the_shares_in_the_plane() -> None:
    """Three bodies of ten unknowns, contacts of two rows, one of them with a single body."""
    rng = np.random.default_rng(0)
    C = np.array([Y @ Y.T for Y in rng.standard_normal((3, 10, 10))])
    pair = [(0, 1), (0, 1), (1, 2), (2,), (0, 2)]
    H = np.zeros((30, 10))
    for a, own in enumerate(pair):
        for b in own:
            H[10 * b + rng.choice(10, 4, replace=False), 2 * a : 2 * a + 2] = rng.standard_normal((4, 2))
    shares = shares_of(sp.csc_array(H), np.repeat(np.arange(3), 10), np.tile(np.arange(10), 3), 3, 2, ((0, C, np.arange(3)),))
    found = shares.bodies()
    assert found is not None
    assert_array_equal(found[0], [(own[0], own[1] if len(own) > 1 else -1) for own in pair])
    x = rng.standard_normal(10)
    W = H.T @ sla.block_diag(*C) @ H
    assert_allclose(ShareProduct(shares).affine(x, 2 * x), W @ x + 2 * x, atol=1e-12 * np.abs(W).max())
    G = shares.modes(12, found[1])
    assert_allclose(
        np.einsum("aij,akj->aik", G, G), [W[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] for a in range(5)], atol=1e-10 * np.abs(W).max()
    )
