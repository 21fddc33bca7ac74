"""Multifrontal elimination on the graph of the joints against dense factorisations of the same matrices."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear.elimination_tree import joint_count, joints
from fcsim.linear.factors import SingularMatrix
from fcsim.linear.fronts import MultifrontalCholesky
from fcsim.linear.joints import BlockRows, joint_rows
from fcsim.linear.multifrontal.lu import Multifrontal
from fcsim.problem import Delassus
from fcsim.solvers.newton.systems.multifrontal import ACCURACY, MultifrontalSystem


def wall(rows: int, columns: int, points: int, d: int, seed: int) -> tuple[sp.bsr_array, np.ndarray]:
    """W of a grid of bodies with `points` contacts between neighbours, numbered at random, and the joint of each contact."""
    rng = np.random.default_rng(seed)
    number = np.arange(rows * columns).reshape(rows, columns)
    pairs = np.concatenate(
        [np.stack([number[:, :-1], number[:, 1:]], -1).reshape(-1, 2), np.stack([number[:-1], number[1:]], -1).reshape(-1, 2)]
    )
    joint = rng.permutation(np.repeat(np.arange(len(pairs)), points))
    nc = len(joint)
    blocks = np.zeros((nc, d, nc, d))
    for body in range(rows * columns):
        own = np.flatnonzero((pairs[joint] == body).any(axis=1))
        h = rng.standard_normal((d * len(own), d * len(own) + 3))
        blocks[np.ix_(own, range(d), own, range(d))] += (h @ h.T / len(own)).reshape(len(own), d, len(own), d)
    W = sp.bsr_array(blocks.reshape(nc * d, nc * d) + 0.1 * np.eye(nc * d), blocksize=(d, d))
    W.sort_indices()
    return W, joint


def linearisation(nc: int, d: int, rng: np.random.Generator, open_share: float) -> tuple[np.ndarray, np.ndarray]:
    A = 0.3 * rng.standard_normal((nc, d, d)) + 2 * np.eye(d)
    B = 0.3 * rng.standard_normal((nc, d, d)) + np.eye(d)
    zone = rng.random(nc)
    A[zone < open_share], B[zone < open_share] = 0, np.eye(d)
    B[(zone > 0.6) & (zone >= open_share)] = 0
    return A, B


@pytest.mark.parametrize("d", [2, 3])
def test_contacts_of_a_joint_are_found(d: int) -> None:
    W, expected = wall(3, 4, 7, d, 0)
    found, size = joints(W.indptr, W.indices)
    assert joint_count(W.indptr, W.indices) == expected.max() + 1 == len(size)
    assert len({(a, b) for a, b in zip(found, expected, strict=True)}) == expected.max() + 1
    assert_array_equal(size, np.bincount(found))


@pytest.mark.parametrize("seed", range(3))
def test_elimination_tree(seed: int) -> None:
    """Every contact is eliminated once, children come before parents, and a complement falls on rows that its parent has."""
    W, _ = wall(4, 3, 6, 3, seed)
    tree = BlockRows(W, 3).tree
    assert_array_equal(np.sort(tree.order), np.arange(W.shape[0] // 3))
    rank = np.argsort(tree.order)
    fronts = list(tree)
    for f, (_, border, parent) in enumerate(fronts):
        assert (parent == -1) == (len(border) == 0)
        assert np.all(np.diff(rank[border]) > 0)
        if parent >= 0:
            assert parent > f
            assert set(border) <= set(fronts[parent][0]) | set(fronts[parent][1])


@pytest.mark.each_value
@pytest.mark.parametrize("precision", [np.float64, np.float32])
@pytest.mark.parametrize("open_share", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("d", [2, 3])
def test_lu(d: int, open_share: float, precision: type) -> None:
    rng = np.random.default_rng(5)
    W, joint = wall(3, 3, 8, d, 1)
    A, B = linearisation(len(joint), d, rng, open_share)
    active = A.any(axis=(1, 2))
    factor = Multifrontal(BlockRows(W, d), (A, B), active, precision)
    assert_array_equal(np.sort(factor.contacts), np.flatnonzero(active))
    dofs = (d * factor.contacts[:, None] + np.arange(d)).ravel()
    J = (sla.block_diag(*A) @ W.toarray() + sla.block_diag(*B))[np.ix_(dofs, dofs)]
    rhs = rng.standard_normal((len(factor.contacts), d))
    residual = J @ factor.solve(rhs).ravel() - rhs.ravel()
    assert np.linalg.norm(residual) <= 1e3 * np.finfo(precision).eps * np.linalg.cond(J) ** 0.5 * np.linalg.norm(rhs)


@pytest.mark.parametrize("d", [2, 3, 12])
def test_lu_of_the_matrix_itself(d: int) -> None:
    """Blocks that are no longer symmetric, of contacts or of bodies' twelve motions: each front's rows, columns and complement differ."""
    rng = np.random.default_rng(9)
    pattern, joint = wall(3, 3, 8, 2, 1)
    n = len(joint)
    blocks = rng.standard_normal((len(pattern.indices), d, d))
    W = sp.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(n * d, n * d))
    W = sp.bsr_array(W + 20 * np.sqrt(n * d) * sp.eye_array(n * d), blocksize=(d, d))
    factor = Multifrontal(BlockRows(W, d), None, np.ones(n, dtype=bool))
    rhs = rng.standard_normal((n, d))
    x = np.empty((n, d))
    x[factor.contacts] = factor.solve(rhs[factor.contacts])
    assert_allclose(W @ x.ravel(), rhs.ravel(), rtol=0, atol=1e-12)


def test_fronts_below_which_nothing_changes_are_taken_over() -> None:
    """The factor of a changed matrix, of which most fronts are those before: its solutions are right, its bits those of a new factor, and
    the earlier factor still solves with the earlier matrix."""
    d, rng = 3, np.random.default_rng(4)
    pattern, joint = wall(6, 6, 3, 2, 1)
    n = len(joint)
    row = np.repeat(np.arange(n), np.diff(pattern.indptr))
    blocks = rng.standard_normal((len(pattern.indices), d, d))
    blocks[row == pattern.indices] += 8 * np.sqrt(n) * np.eye(d)
    every, rhs = np.ones(n, dtype=bool), rng.standard_normal((n, d))

    def rows(values: np.ndarray) -> BlockRows:
        return BlockRows(sp.bsr_array((values, pattern.indices, pattern.indptr), shape=(n * d, n * d)), d)

    def missed(factor: Multifrontal, values: np.ndarray) -> float:
        x = np.empty((n, d))
        x[factor.contacts] = factor.solve(rhs[factor.contacts])
        return float(np.abs(rows(values).W @ x.ravel() - rhs.ravel()).max())

    first = Multifrontal(rows(blocks), None, every, lasting=True)
    assert first.following(rows(blocks), np.empty(0, dtype=int)) is first
    factor, before = first, blocks
    for contact in (first.contacts[0], first.contacts[n // 2], first.contacts[-1]):
        entries = np.flatnonzero((row == contact) | (pattern.indices == contact))
        after = before.copy()
        after[entries] *= 1.5
        assert 0 < np.count_nonzero(factor._plan.with_others(pattern.indptr, pattern.indices, entries)) < len(factor._plan.fronts)
        following, anew = factor.following(rows(after), entries), Multifrontal(rows(after), None, every)
        assert missed(following, after) < 1e-13 < 1e-4 < missed(following, before)
        for own, new in zip(following._by_fronts, anew._by_fronts, strict=True):
            assert_array_equal(own, new)
        assert missed(factor, before) < 1e-13
        factor, before = following, after


@pytest.mark.each_value
@pytest.mark.parametrize("share", [0.1, 0.7, 1.0])
@pytest.mark.parametrize("d", [2, 3])
def test_cholesky(d: int, share: float) -> None:
    rng = np.random.default_rng(2)
    W, joint = wall(3, 3, 8, d, 3)
    held = rng.random(len(joint)) < share
    factor = MultifrontalCholesky(BlockRows(W, d), held)
    dofs = (d * factor.contacts[:, None] + np.arange(d)).ravel()
    S = W.toarray()[np.ix_(dofs, dofs)]
    X = W.toarray()[dofs][:, rng.choice(W.shape[0], 20, replace=False)]  # columns with zeros in some fronts
    P = factor.forward(X.copy())
    assert_allclose(P.T @ P, X.T @ np.linalg.solve(S, X), rtol=1e-10, atol=1e-12)
    rhs = rng.standard_normal(len(dofs))
    x = factor.backward(factor.forward(rhs[:, None].copy())[:, 0])
    assert_allclose(S @ x, rhs, rtol=0, atol=1e-11)


def test_indefinite_is_refused() -> None:
    W, joint = wall(3, 3, 8, 3, 3)
    with pytest.raises(SingularMatrix, match="not positive definite"):
        MultifrontalCholesky(
            BlockRows(sp.bsr_array(W - 50 * sp.eye_array(W.shape[0]), blocksize=(3, 3)), 3), np.ones(len(joint), dtype=bool)
        )


def test_unsymmetric_pattern_is_refused() -> None:
    W = sp.bsr_array(np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(3)), blocksize=(3, 3))
    with pytest.raises(SingularMatrix, match="pattern"):
        BlockRows(W, 3)


def test_joints_with_an_unsymmetric_pattern_have_no_fronts() -> None:
    """One joint's rows miss their blocks with another: the general methods take such a W."""
    W, joint = wall(6, 6, 8, 3, 0)
    blocks = W.toarray().reshape(len(joint), 3, len(joint), 3)
    a, b = joint[0], next(joint[k] for k in np.flatnonzero(blocks[0].any(axis=(0, 2))) if joint[k] != joint[0])
    blocks[np.ix_(joint == a, range(3), joint == b, range(3))] = 0
    assert joint_rows(sp.bsr_array(blocks.reshape(W.shape), blocksize=(3, 3)), 3) is None


def test_an_equal_pattern_keeps_its_tree() -> None:
    W, _ = wall(6, 6, 8, 3, 0)
    first = joint_rows(W, 3)
    assert first is not None
    again = joint_rows(sp.bsr_array(2 * W), 3, first.pattern)
    assert again is not None
    assert again.tree is first.tree
    assert_allclose(again.blocks, 2 * first.blocks, atol=0)


@pytest.mark.parametrize("open_share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("d", [2, 3])
def test_step_has_a_small_defect(d: int, open_share: float) -> None:
    rng = np.random.default_rng(7)
    W, joint = wall(3, 3, 8, d, 4)
    A, B = linearisation(len(joint), d, rng, open_share)
    rhs = rng.standard_normal((len(joint), d))
    dr, Wdr = MultifrontalSystem(Delassus(W, d)).solve(A, B, rhs)
    defect = sla.block_diag(*A) @ (W @ dr) + sla.block_diag(*B) @ dr - rhs.ravel()
    assert np.linalg.norm(defect) <= 2 * ACCURACY * np.linalg.norm(rhs)
    assert_allclose(Wdr, W @ dr, rtol=1e-12, atol=1e-12)


def test_double_precision_and_pivoting_take_over() -> None:
    """A matrix of condition 1e10 is beyond single precision; one with a zero block on the diagonal beyond fronts without pivoting."""
    rng = np.random.default_rng(8)
    W, joint = wall(3, 3, 8, 3, 4)
    stiff = sp.bsr_array(W - (np.linalg.eigvalsh(W.toarray())[0] * (1 - 1e-10)) * sp.eye_array(W.shape[0]), blocksize=(3, 3))
    A, B = np.tile(np.eye(3), (len(joint), 1, 1)), np.zeros((len(joint), 3, 3))
    rhs = rng.standard_normal((len(joint), 3))
    dr, _ = MultifrontalSystem(Delassus(stiff, 3)).solve(A, B, rhs)
    assert np.linalg.norm(stiff @ dr - rhs.ravel()) <= 2 * ACCURACY * np.linalg.norm(rhs)
    own = W.toarray().reshape(len(joint), 3, len(joint), 3)[np.arange(len(joint)), :, np.arange(len(joint))]
    dr, _ = MultifrontalSystem(Delassus(W, 3)).solve(A, -own, rhs)
    defect = W @ dr - np.einsum("aij,aj->ai", own, dr.reshape(rhs.shape)).ravel() - rhs.ravel()
    assert np.linalg.norm(defect) <= 2 * ACCURACY * np.linalg.norm(rhs)


def test_scattered_contacts_have_no_fronts() -> None:
    W, _ = wall(6, 6, 8, 3, 0)
    assert joint_rows(W, 3) is not None
    single, _ = wall(16, 16, 1, 3, 0)
    assert joint_rows(single, 3) is None
    dense = sp.bsr_array(np.ones((900, 900)), blocksize=(3, 3))
    assert joint_rows(dense, 3) is None


def test_what_is_left_has_the_complement_of_the_rest() -> None:
    W, joint = wall(4, 3, 5, 3, 2)
    left = np.isin(joint, [3, 8, 9])
    shift = 0.7
    factor = MultifrontalCholesky(BlockRows(W, 3, last=left), np.ones(len(left), dtype=bool), shift=shift, left=left)
    inner, border = ((3 * contacts[:, None] + np.arange(3)).ravel() for contacts in (factor.contacts, factor.left))
    A = W.toarray()
    E = A[np.ix_(inner, inner)] + shift * np.eye(len(inner))
    expected = A[np.ix_(border, border)] - A[np.ix_(border, inner)] @ np.linalg.solve(E, A[np.ix_(inner, border)])
    assert_allclose(np.triu(factor.complement), np.triu(expected), atol=1e-12 * np.abs(A).max())
    b = np.random.default_rng(0).standard_normal(len(A))
    x = np.concatenate([b[inner], np.zeros(len(border))])[:, None]
    x = factor.forward(x)[:, 0]  # what the rest brings to what is left, in its place
    assert_allclose(x[len(inner) :], -A[np.ix_(border, inner)] @ np.linalg.solve(E, b[inner]), atol=1e-11)
    x[len(inner) :] = b[border]
    assert_allclose(factor.backward(x)[: len(inner)], np.linalg.solve(E, b[inner] - A[np.ix_(inner, border)] @ b[border]), atol=1e-11)
