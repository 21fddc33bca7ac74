"""The reduction to the local form against dense linear algebra on the whole matrices, and elimination of constraints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.linear import factors as linear
from fcsim.linear import storage as decisions
from fcsim.linear.factors import DenseCholesky, SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import BlockFactor, reduce, reduced


def spd(size: int, rng: np.random.Generator) -> np.ndarray:
    X = rng.standard_normal((size, size))
    return X @ X.T + size * np.eye(size)


def random_problem(seed: int, d: int = 3, p: int = 0, *, symmetric: bool = True) -> GlobalProblem:
    """Three equal blocks, one other, and six single dofs (a rigid body), in a random order of the degrees of freedom."""
    rng = np.random.default_rng(seed)
    twin = spd(7, rng)
    blocks = [twin, twin, spd(5, rng), twin, np.diag(rng.uniform(1, 3, 6))]
    if not symmetric:
        blocks[2] = blocks[2] + 0.5 * rng.standard_normal((5, 5))
    M = sla.block_diag(*blocks)
    n, nc = len(M), 5
    shuffle = rng.permutation(n)
    M = M[np.ix_(shuffle, shuffle)]
    H = rng.standard_normal((n, d * nc)) * (rng.random((n, d * nc)) < 0.3)
    G, b = (rng.standard_normal((n, p)), rng.standard_normal(p)) if p else (None, None)
    mu = np.full(nc, 0.3)
    return GlobalProblem(sp.csr_array(M), sp.csc_array(H), rng.standard_normal(n), rng.standard_normal(d * nc), mu, G, b, d)


def dense(matrix: Any) -> np.ndarray:
    return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)


@pytest.mark.parametrize("storage", ["dense", "block sparse"])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("symmetric", [True, False])
def test_delassus_operator_and_free_velocity(monkeypatch: pytest.MonkeyPatch, storage: str, d: int, symmetric: bool) -> None:
    if storage == "block sparse":
        monkeypatch.setattr(decisions, "SPARSE_FROM", 0)
        monkeypatch.setattr(decisions, "SUM_UP_TO", 0)
    p = random_problem(0, d, symmetric=symmetric)
    M, H = dense(p.M), dense(p.H)
    local = reduce(p).local
    assert sp.issparse(local.W) == (storage == "block sparse")
    assert_allclose(dense(local.W), H.T @ np.linalg.solve(M, H), rtol=1e-11, atol=1e-13)
    assert_allclose(local.q, p.w + H.T @ np.linalg.solve(M, p.f), rtol=1e-11, atol=1e-13)
    assert local.dimension == d
    expected = [dense(local.W)[d * a : d * a + d, d * a : d * a + d] for a in range(p.nc)]
    assert_allclose(reduce(p).diagonal_blocks, expected, rtol=1e-13)


@pytest.mark.parametrize("overwrite", [False, True])
def test_inverse_on_the_last_unknowns(overwrite: bool) -> None:
    rng = np.random.default_rng(3)
    A = spd(70, rng)
    inverse = np.linalg.inv(A)
    factor = DenseCholesky(A.copy(order="F"), overwrite)
    for count in (0, 1, 40, 70):
        assert_allclose(factor.inverse_on_last(count), inverse[70 - count :, 70 - count :], rtol=1e-11, atol=1e-15)
    for rhs in (rng.standard_normal(70), rng.standard_normal((70, 4))):
        assert_allclose(factor.solve(rhs), inverse @ rhs, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("kind", ["csr", "csc", "coo", "unsorted", "dense"])
@pytest.mark.parametrize("symmetric", [True, False])
def test_every_storage_of_m_and_h(kind: str, symmetric: bool) -> None:
    p = random_problem(11, symmetric=symmetric)
    M, H = dense(p.M), dense(p.H)
    if kind == "dense":
        given = GlobalProblem(M, H, p.f, p.w, p.mu)
    else:
        A = sp.csr_array(M).asformat("csr" if kind == "unsorted" else kind)
        if kind == "unsorted":
            backwards = np.concatenate([np.arange(A.indptr[i + 1] - 1, A.indptr[i] - 1, -1) for i in range(p.n)])
            A = sp.csr_array((A.data[backwards], A.indices[backwards], A.indptr), shape=A.shape)
            assert not A.has_sorted_indices
        given = GlobalProblem(A, sp.csr_array(H).asformat("csr" if kind == "unsorted" else kind), p.f, p.w, p.mu)
    reduced, r = reduce(given), np.arange(float(p.m))
    assert_allclose(dense(reduced.local.W), H.T @ np.linalg.solve(M, H), rtol=1e-11, atol=1e-13)
    assert_allclose(reduced.velocity(r)[0], np.linalg.solve(M, H @ r + p.f), rtol=1e-11, atol=1e-12)


def test_a_small_asymmetry_is_kept() -> None:
    """W of an M that is unsymmetric by 1e-9 is so too."""
    M = spd(6, np.random.default_rng(12))
    M[0, 5] += 1e-9 * M.max()
    p = GlobalProblem(sp.csr_array(M), np.eye(6), np.zeros(6), np.zeros(6), np.full(2, 0.3))
    assert_allclose(reduce(p).local.W, np.linalg.inv(M), rtol=0, atol=1e-15)


@pytest.mark.parametrize("d", [2, 3])
def test_rigid_bodies_of_diagonal_m(monkeypatch: pytest.MonkeyPatch, d: int) -> None:
    """Twenty bodies in a row of contacts, each between neighbours, and a few between distant ones."""
    monkeypatch.setattr(decisions, "SPARSE_FROM", 0)
    monkeypatch.setattr(decisions, "SUM_UP_TO", 0)
    rng, k, nb = np.random.default_rng(13), 3 * d - 3, 20
    pairs = [(b, b + 1) for b in range(nb - 1)] + [(0, 7), (3, 15), (3, 4)]
    H = np.zeros((nb * k, d * len(pairs)))
    for a, pair in enumerate(pairs):
        for b in pair:
            H[k * b : k * b + k, d * a : d * a + d] = rng.standard_normal((k, d))
    mass = rng.uniform(0.1, 10, nb * k)
    p = GlobalProblem(
        sp.diags_array(mass), sp.csc_array(H), np.ones(nb * k), np.zeros(d * len(pairs)), np.full(len(pairs), 0.3), dimension=d
    )
    W = reduce(p).local.W
    assert_allclose(W.toarray(), H.T @ (H / mass[:, None]), rtol=1e-12, atol=1e-13)
    neighbours = sum(len(set(first) & set(second)) > 0 for first in pairs for second in pairs)
    assert len(W.indices) == neighbours


def test_contacts_beyond_the_unknowns_that_were_announced() -> None:
    """W of an H that touches more than the factor was told of, or less."""
    p = random_problem(14)
    M, H = dense(p.M), dense(p.H)
    for told in (np.arange(p.n) < 10, np.zeros(p.n, dtype=bool), np.ones(p.n, dtype=bool), None):
        W = BlockFactor(p.M, told).delassus(p.H, p.dimension)
        assert_allclose(W, H.T @ np.linalg.solve(M, H), rtol=1e-11, atol=1e-13)


def test_equal_blocks_are_factored_once() -> None:
    twin = sp.csr_array(spd(8, np.random.default_rng(2)))
    A = sp.block_diag([twin, twin, 2 * twin, sp.csr_array([[5.0]]), twin])
    assert [block.dofs.shape for block in BlockFactor(A).blocks] == [(3, 8), (1, 8)]
    factor = BlockFactor(random_problem(1).M)  # shuffled: the twins' dofs come in different orders
    rhs = np.random.default_rng(3).standard_normal((32, 3))
    M = dense(random_problem(1).M)
    assert_allclose(factor.solve(rhs), np.linalg.solve(M, rhs), rtol=1e-11, atol=1e-13)
    assert_allclose(factor.solve(rhs[:, 0]), np.linalg.solve(M, rhs[:, 0]), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array])
def test_small_blocks_are_solved_with_all_at_once(kind: Any) -> None:
    """Blocks of two to six unknowns in any order; those that are not symmetric or indefinite go LAPACK's way."""
    rng = np.random.default_rng(17)
    others = [spd(3, rng) + np.triu(rng.standard_normal((3, 3)), 1), -spd(4, rng), spd(5, rng) * 1e-9, spd(6, rng) * 1e9]
    whole = sla.block_diag(*(spd(s, rng) for s in (2, 3, 4, 5, 6, 7, 3, 6)), *others)
    n = len(whole)
    shuffle = rng.permutation(n)
    A = whole[np.ix_(shuffle, shuffle)]
    factor = BlockFactor(kind(A))
    assert sorted(block.dofs.shape for block in factor.blocks) == [(1, 3), (1, 4), (1, 7)]
    for columns in (1, 4):
        x = rng.standard_normal((n, columns))
        assert_allclose(factor.solve(A @ x), x, rtol=0, atol=1e-12)
    H = sp.random_array((n, 12), density=0.2, rng=rng, format="csc")
    assert_allclose(dense(factor.delassus(H, 3)), H.T @ np.linalg.solve(A, H.toarray()), rtol=1e-11, atol=1e-12)


def test_a_small_block_with_a_small_pivot_is_left_to_lapack() -> None:
    nearly = np.ones((3, 3)) + np.diag([0.0, 1.0, 1e-12])  # the last pivot is 1e-12 of its diagonal entry
    blocks = BlockFactor(sp.csr_array(sla.block_diag(nearly, np.eye(3) + 1))).blocks
    assert [block.dofs.tolist() for block in blocks] == [[[0, 1, 2]]]


def test_a_small_block_that_is_singular_is_refused() -> None:
    blocks = [np.eye(3) + 1, np.ones((3, 3)), np.eye(3) + 1]
    with pytest.raises(SingularMatrix, match="block of 3 degrees of freedom"):
        BlockFactor(sp.csr_array(sla.block_diag(*blocks)))


def test_blocks_that_differ_by_round_off_share_a_factor_and_are_solved_as_they_are() -> None:
    rng = np.random.default_rng(5)
    first = spd(40, rng)
    first[0, 39] = first[39, 0] = 1e-14 * np.abs(first).max()  # stored in one copy, dropped in the other
    noise = 1 + 5e-15 * rng.standard_normal(first.shape)
    second = first * (noise + noise.T) / 2
    second[0, 39] = second[39, 0] = 0
    other = first * (1 + 1e-9 * np.eye(40))
    A = sp.block_diag([sp.csr_array(first), sp.csr_array(second), sp.csr_array(other)], format="csr")
    factor = BlockFactor(A)
    assert [block.dofs.shape for block in factor.blocks] == [(2, 40), (1, 40)]
    rhs = rng.standard_normal((120, 2))
    assert np.abs(A @ factor.solve(rhs) - rhs).max() <= 1e-14 * np.abs(rhs).max()


def test_blocks_above_the_dense_size(monkeypatch: pytest.MonkeyPatch) -> None:
    p = random_problem(4)
    expected = reduce(p).local.W
    monkeypatch.setattr(decisions, "BLOCK_UP_TO", 3)
    assert_allclose(reduce(p).local.W, expected, rtol=1e-11, atol=1e-13)


def test_velocity_satisfies_the_momentum_balance() -> None:
    p = random_problem(5)
    r = np.random.default_rng(6).standard_normal(p.m)
    reduced = reduce(p)
    v, multiplier = reduced.velocity(r)
    assert multiplier is None
    assert_allclose(p.M @ v, p.H @ r + p.f, atol=1e-11)
    assert_allclose(p.H.T @ v + p.w, reduced.local.W @ r + reduced.local.q, atol=1e-11)
    assert reduced.momentum_residual(r, v, None) < 1e-12
    assert_allclose(reduced.momentum_residual(r, v + 1, None), np.linalg.norm(p.M @ np.ones(p.n)) / np.linalg.norm(p.f))


@pytest.mark.parametrize("sparse", [True, False])
def test_equality_constraints_against_the_null_space(sparse: bool) -> None:
    """G^T v = -b by v = v0 + N y with N a basis of the null space of G^T: N^T M N y = N^T (H r + f - M v0)."""
    p = random_problem(7, p=4)
    if sparse:
        p = GlobalProblem(p.M, p.H, p.f, p.w, p.mu, sp.csc_array(p.G), p.b)
    assert p.b is not None
    M, H, G = dense(p.M), dense(p.H), dense(p.G)
    v0, N = np.linalg.lstsq(G.T, -p.b, rcond=None)[0], sla.null_space(G.T)
    reduced = reduce(p)

    def velocity(r: np.ndarray) -> np.ndarray:
        return v0 + N @ np.linalg.solve(N.T @ M @ N, N.T @ (H @ r + p.f - M @ v0))

    q = H.T @ velocity(np.zeros(p.m)) + p.w
    W = np.column_stack([H.T @ velocity(e) + p.w - q for e in np.eye(p.m)])
    assert_allclose(reduced.local.q, q, rtol=1e-10, atol=1e-12)
    assert_allclose(dense(reduced.local.W), W, rtol=1e-9, atol=1e-11)
    r = np.random.default_rng(8).standard_normal(p.m)
    v, multiplier = reduced.velocity(r)
    assert_allclose(v, velocity(r), rtol=1e-10, atol=1e-12)
    assert multiplier is not None
    assert_allclose(M @ v, H @ r + G @ multiplier + p.f, atol=1e-10)
    assert_allclose(G.T @ v + p.b, 0, atol=1e-11)
    assert reduced.momentum_residual(r, v, multiplier) < 1e-11


@pytest.mark.parametrize("sparse", [True, False])
def test_local_equality_constraints_against_the_mixed_system(sparse: bool) -> None:
    """u = W r + V l + q, V^T r + R l + s = 0 solved for (u, l) together, for given r."""
    rng = np.random.default_rng(9)
    W, V, R, q, s = spd(6, rng), rng.standard_normal((6, 2)), -spd(2, rng), rng.standard_normal(6), rng.standard_normal(2)
    kind: Any = sp.csc_array if sparse else np.asarray
    eliminated = reduced(LocalProblem(kind(W), q, np.full(2, 0.3), kind(V), kind(R), s)).local
    assert eliminated.V is None
    for r in rng.standard_normal((3, 6)):
        mixed = np.block([[np.eye(6), -V], [np.zeros((2, 6)), R]])
        u = np.linalg.solve(mixed, np.concatenate([W @ r + q, -V.T @ r - s]))[:6]
        assert_allclose(eliminated.W @ r + eliminated.q, u, rtol=1e-11, atol=1e-12)


def test_local_problem_without_constraints_stays() -> None:
    problem = LocalProblem(np.eye(3), np.zeros(3), np.full(1, 0.3))
    assert reduced(problem) is problem


def test_constraints_of_a_body_without_supports() -> None:
    """M singular, [[M, -G], [-G^T, 0]] not: a floating bar held by one constraint."""
    M = np.array([[1.0, -1.0], [-1.0, 1.0]])
    p = GlobalProblem(M, np.eye(2), np.array([1.0, 0.0]), np.zeros(2), np.zeros(1), np.array([[0.0], [1.0]]), np.zeros(1), dimension=2)
    v, multiplier = reduce(p).velocity(np.zeros(2))
    assert multiplier is not None
    assert_allclose(v, [1, 0], atol=1e-12)
    assert_allclose(multiplier, [-1], atol=1e-12)


def floating_bars(count: int) -> sp.csr_array:
    """Stiffness of springs in a row of unequal stiffness, without supports: singular, but for round-off."""
    k = np.random.default_rng(0).uniform(0.1, 3, count - 1)
    return sp.csr_array(sp.diags_array([np.r_[k, 0] + np.r_[0, k], -k, -k], offsets=[0, 1, -1]))


@pytest.mark.parametrize(
    "M",
    [np.diag([1.0, 0.0, 1.0]), floating_bars(3), floating_bars(40), 1e9 * floating_bars(300), sp.block_diag([floating_bars(9), np.eye(2)])],
    ids=["zero row", "3", "40", "300, stiff", "beside others"],
)
def test_singular_mass_is_refused(M: sp.sparray | np.ndarray) -> None:
    n = M.shape[0]
    p = GlobalProblem(M, np.eye(n)[:, :3], np.ones(n), np.zeros(3), np.full(1, 0.3))
    with pytest.raises(SingularMatrix, match="singular"):
        _ = reduce(p).local


@pytest.mark.skipif(not linear.runtime.has_petsc(), reason="petsc4py is not installed")
def test_singular_mass_is_refused_by_the_sparse_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decisions, "BLOCK_UP_TO", 3)
    with pytest.raises(SingularMatrix):
        BlockFactor(floating_bars(200))


def test_badly_scaled_but_regular_matrices_are_taken() -> None:
    """Stiffness in N/mm beside unit constraints, and translations beside rotations: no reason to refuse."""
    M = 1e12 * sp.csr_array(np.array([[2.0, -1.0], [-1.0, 2.0]]))
    p = GlobalProblem(M, np.eye(2), np.array([1e12, 0.0]), np.zeros(2), np.zeros(1), np.array([[0.0], [1.0]]), np.zeros(1), dimension=2)
    v, multiplier = reduce(p).velocity(np.zeros(2))
    assert multiplier is not None
    assert_allclose(v, [0.5, 0], atol=1e-12)
    assert_allclose(multiplier, [-0.5e12], rtol=1e-12)
    for unit in (1e-20, 1e-14):  # [kg] of grains of some micrometres, with constraints
        p = replace(p, M=unit * sp.csr_array(np.array([[2.0, -1.0], [-1.0, 2.0]])), f=np.array([unit, 0.0]))
        v, multiplier = reduce(p).velocity(np.zeros(2))
        assert multiplier is not None
        assert_allclose(v, [0.5, 0], atol=1e-12)
        assert_allclose(multiplier, [-0.5 * unit], rtol=1e-12)
        assert_allclose(dense(reduce(p).local.W), np.diag([0.5 / unit, 0]), atol=1e-12 / unit)
    A = np.array([[1e9, 3.0], [3.0, 1e-8]])
    assert_allclose(BlockFactor(A).solve(A @ [1.0, 1e8]), [1, 1e8], rtol=1e-9)


def test_no_contact_at_all() -> None:
    p = GlobalProblem(2 * np.eye(3), np.zeros((3, 0)), np.ones(3), np.zeros(0), np.zeros(0))
    reduced = reduce(p)
    assert reduced.local.W.shape == (0, 0)
    assert_allclose(reduced.velocity(np.zeros(0))[0], [0.5] * 3)


@pytest.mark.parametrize("k", [6, 9])
def test_delassus_operator_of_a_chain_is_sparse_where_its_bodies_are_rigid(k: int) -> None:
    """201 bodies of k unknowns, each in contact with the next one: of 200 contacts each has blocks with its neighbours alone."""
    rng, nc = np.random.default_rng(3), 200
    H = sp.lil_array((k * (nc + 1), 3 * nc))
    for a in range(nc):
        H[k * a : k * (a + 2), 3 * a : 3 * a + 3] = rng.standard_normal((2 * k, 3))
    mass = spd(k, rng)
    M = sp.csr_array(sp.kron(sp.eye_array(nc + 1), mass))
    W = reduce(GlobalProblem(M, sp.csc_array(H), np.ones(k * (nc + 1)), np.zeros(3 * nc), np.full(nc, 0.3))).local.W
    assert sp.issparse(W) == (k == 6)
    assert_allclose(dense(W), H.T @ np.linalg.solve(M.toarray(), H.toarray()), rtol=1e-9, atol=1e-12)


def test_contact_that_touches_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both bodies held: H has zero columns there, W zero blocks."""
    H = np.zeros((3, 6))
    H[:, 3:] = np.eye(3)
    p = GlobalProblem(2 * np.eye(3), H, np.ones(3), np.arange(6.0), np.full(2, 0.3))
    expected = np.diag([0, 0, 0, 0.5, 0.5, 0.5])
    assert_allclose(dense(reduce(p).local.W), expected)
    monkeypatch.setattr(decisions, "SPARSE_FROM", 0)
    monkeypatch.setattr(decisions, "SUM_UP_TO", 0)
    assert_allclose(dense(reduce(p).local.W), expected)
    assert_allclose(reduce(p).local.q, [0, 1, 2, 3.5, 4.5, 5.5])
