"""Newton's linear system: dense, condensed, sparse and saddle-point elimination give the same step."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear import storage
from fcsim.linear.factors import SingularMatrix, SuperLU
from fcsim.problem import Delassus, GlobalProblem
from fcsim.solvers.newton.kkt import _SaddleMatrix
from fcsim.solvers.newton.systems import condensed as condensed_system
from fcsim.solvers.newton.systems.border import empty_border, extended
from fcsim.solvers.newton.systems.choice import OF_ENTRIES, newton_system
from fcsim.solvers.newton.systems.condensed import ACCURACY, FORCING
from fcsim.solvers.newton.systems.condensed import CondensedSystem as Condensed
from fcsim.solvers.newton.systems.direct import DenseSystem, SparseSystem
from fcsim.solvers.newton.systems.held import hold
from fcsim.solvers.newton.systems.interface import NewtonSystem

OPEN, STICK, SLIP = 0, 1, 2


def condensed(W: np.ndarray, d: int) -> Condensed:
    return Condensed(Delassus(W, d))


def delassus(nc: int, d: int, seed: int) -> np.ndarray:
    H = np.random.default_rng(seed).standard_normal((d * nc + 5, d * nc))
    return H.T @ H / nc + 0.1 * np.eye(d * nc)


def linearisation(zone: np.ndarray, d: int, rng: np.random.Generator, pure_share: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A and B as the formulations make them: open A = 0, B = 1; sticking A regular, B = 0; sliding both full, in a share of the
    contacts with the normal row (A_NN, 0, 0) and (0, 0, 0) of Alart and Curnier's."""
    nc = len(zone)
    A = 0.3 * rng.standard_normal((nc, d, d)) + 2 * np.eye(d)
    B = 0.3 * rng.standard_normal((nc, d, d)) + np.eye(d)
    A[zone == OPEN], B[zone == OPEN] = 0, np.eye(d)
    B[zone == STICK] = 0
    pure = (zone == SLIP) & (rng.random(nc) < pure_share)
    A[pure, 0, 1:] = 0
    B[pure, 0] = 0
    return A, B


def reference_step(W: np.ndarray, A: np.ndarray, B: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    return np.linalg.solve(sla.block_diag(*A) @ W + sla.block_diag(*B), rhs.ravel())


ZONES: dict[str, list[float]] = {
    "all open": [1, 0, 0],
    "all stick": [0, 1, 0],
    "all slip": [0, 0, 1],
    "no open": [0, 0.5, 0.5],
    "no stick": [0.5, 0, 0.5],
    "no slip": [0.5, 0.5, 0],
    "mixed": [0.3, 0.4, 0.3],
}


@pytest.mark.parametrize("zones", ZONES)
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", OF_ENTRIES)
def test_one_step(name: str, d: int, zones: str) -> None:
    rng = np.random.default_rng(1)
    W = delassus(12, d, 2)
    A, B = linearisation(rng.choice(3, 12, p=ZONES[zones]), d, rng)
    rhs = rng.standard_normal((12, d))
    before = W.copy(), A.copy(), B.copy(), rhs.copy()
    system = newton_system(Delassus(sp.bsr_array(W, blocksize=(d, d)) if name == "sparse" else W, d), name, condensing=True)
    tolerance = 1e-3 if name == "multifrontal" else 1e-9  # an inexact step, see test_multifrontal
    assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=tolerance, atol=1e-2 * tolerance)
    for mine, given in zip((W, A, B, rhs), before, strict=True):
        assert_allclose(mine, given, atol=0)


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("changes", [1, 4, 40])
@pytest.mark.parametrize("seed", range(4))
def test_changing_sets(seed: int, changes: int, d: int) -> None:
    """The condensed system keeps a factor and a border between calls: every step of a long sequence is exact."""
    rng = np.random.default_rng(seed)
    nc = 60
    W = delassus(nc, d, seed)
    systems: list[NewtonSystem] = [condensed(W, d), DenseSystem(Delassus(W, d)), SparseSystem(Delassus(W, d))]
    zone = rng.choice(3, nc, p=[0.2, 0.6, 0.2])
    for _ in range(25):
        moved = rng.choice(nc, changes, replace=False)
        zone[moved] = rng.choice(3, changes)
        A, B = linearisation(zone, d, rng)
        rhs = rng.standard_normal((nc, d))
        expected = reference_step(W, A, B, rhs)
        for system in systems:
            assert_allclose(system.solve(A, B, rhs)[0], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("change", [1e-6, 1e-2, 0.3, 10.0])
@pytest.mark.parametrize("seed", range(3))
def test_following_a_changing_operator(seed: int, change: float) -> None:
    """With the factor of an earlier W the defect of the true system stays below the forcing term, whatever W has become."""
    rng = np.random.default_rng(seed)
    nc, d = 60, 3
    W = delassus(nc, d, seed)
    system = condensed(W, d)
    zone = rng.choice(3, nc, p=[0.2, 0.6, 0.2])
    for _ in range(10):
        for _ in range(3):
            zone[rng.choice(nc, 3, replace=False)] = rng.choice(3, 3)
            A, B = linearisation(zone, d, rng)
            rhs = rng.standard_normal((nc, d))
            dr, Wdr = system.solve(A, B, rhs)
            assert_allclose(Wdr, W @ dr, rtol=1e-10, atol=1e-10 * np.abs(Wdr).max())
            defect = rhs - np.einsum("aij,aj->ai", A, (W @ dr).reshape(nc, d)) - np.einsum("aij,aj->ai", B, dr.reshape(nc, d))
            assert np.linalg.norm(defect) <= 1.01 * FORCING * np.linalg.norm(rhs)
        root = np.eye(len(W)) + change * rng.standard_normal(W.shape) / len(W)
        W = root @ W @ root.T
        system = Condensed(Delassus(W, d), system.left(np.arange(nc)))


def test_borders_that_grow_from_one_keep_their_columns_apart() -> None:
    """Two ways on from one border: what the second adds does not appear in the first."""
    W = delassus(12, 3, 6)
    held = hold(W, None, 3, np.arange(12) < 9, with_sliding=True, dtype=np.float64, conditioning=0.0)
    assert held is not None
    first = extended(empty_border(held, 3, held.dtype), held, W, np.array([2, 10]))
    one = extended(first, held, W, np.array([4]))
    before = one.PT.copy(), one.response.copy()
    other = extended(first, held, W, np.array([7, 11]))
    for mine, kept in zip((one.PT, one.response), before, strict=True):
        assert_array_equal(mine, kept)
    whole = extended(empty_border(held, 3, held.dtype), held, W, np.array([2, 10, 7, 11]))
    assert_allclose(other.response, whole.response, atol=1e-13)
    assert_array_equal(np.flatnonzero(one.column >= 0), [2, 4, 10])


@pytest.mark.parametrize(("least", "precisions"), [(1e-3, (np.float32, np.float32)), (1e-8, (np.float64, np.float32))])
def test_columns_in_single_precision_by_a_factor_in_double(
    least: float, precisions: tuple[type, type], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where some reactions of ten contacts that stick are resisted so little that single precision does not see it, the factor is in double
    precision and the columns in single; the defect of the true system is the one that was asked for."""
    monkeypatch.setattr(condensed_system, "SINGLE_FROM", 0)
    rng = np.random.default_rng(3)
    nc, d, few = 60, 3, 10
    Q = np.linalg.qr(rng.standard_normal((few * d, few * d)))[0]
    soft = Q @ np.diag(np.r_[np.full(5, least), rng.uniform(0.5, 2.0, few * d - 5)]) @ Q.T
    X = 0.3 * rng.standard_normal((few * d, (nc - few) * d))
    W = np.block([[soft, soft @ X], [X.T @ soft, delassus(nc - few, d, 3) + X.T @ soft @ X]])
    W = 0.5 * (W + W.T)
    system = condensed(W, d)
    zone = np.r_[np.full(few, STICK), rng.choice(3, nc - few, p=[0.2, 0.6, 0.2])]
    for _ in range(15):
        zone[few + rng.choice(nc - few, 4, replace=False)] = rng.choice(3, 4)
        A, B = linearisation(zone, d, rng, pure_share=1.0)
        rhs = rng.standard_normal((nc, d))
        dr, Wdr = system.solve(A, B, rhs)
        assert_allclose(Wdr, W @ dr, rtol=0, atol=1e-12 * np.abs(dr).max())
        defect = rhs - np.einsum("aij,aj->ai", A, (W @ dr).reshape(nc, d)) - np.einsum("aij,aj->ai", B, dr.reshape(nc, d))
        assert np.linalg.norm(defect) <= 1.01 * ACCURACY * np.linalg.norm(rhs)
        assert system._condensation is not None
        assert (system._condensation.held.dtype, system._condensation.border.dtype) == precisions


@pytest.mark.parametrize("name", OF_ENTRIES)
@pytest.mark.parametrize("d", [2, 3])
def test_a_shift_is_part_of_the_operator(name: str, d: int) -> None:
    """(A (W + D) + B) dr = rhs and (W + D) dr, for a shift given at once or later, which leaves the first system as it was."""
    rng = np.random.default_rng(15)
    W, nc = delassus(12, d, 3), 12
    A, B = linearisation(rng.choice(3, nc), d, rng)
    rhs, shift = rng.standard_normal((nc, d)), rng.random(nc)
    stored = sp.bsr_array(W, blocksize=(d, d)) if name == "sparse" else W
    system = newton_system(Delassus(stored, d), name, condensing=True)
    tolerance = 1e-3 if name == "multifrontal" else 1e-9
    shifted = W + np.diag(np.repeat(shift, d))
    for own in (
        system.shifted(shift),
        newton_system(Delassus(stored, d, shift), name, condensing=True),
        system.shifted(9 * shift).shifted(shift),
    ):
        dr, du = own.solve(A, B, rhs)
        assert_allclose(dr, reference_step(shifted, A, B, rhs), rtol=tolerance, atol=1e-2 * tolerance)
        assert_allclose(du, shifted @ dr, rtol=0, atol=1e-10 * np.abs(du).max())
    assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=tolerance, atol=1e-2 * tolerance)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_single_precision(seed: int, d: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Factor and border in single precision, corrected on the true system: a defect of at most ACCURACY ||rhs||."""
    monkeypatch.setattr(condensed_system, "SINGLE_FROM", 0)
    rng = np.random.default_rng(seed)
    nc = 60
    W = delassus(nc, d, seed)
    system = condensed(W, d)
    zone = rng.choice(3, nc, p=[0.2, 0.6, 0.2])
    for _ in range(25):
        zone[rng.choice(nc, 4, replace=False)] = rng.choice(3, 4)
        A, B = linearisation(zone, d, rng)
        rhs = rng.standard_normal((nc, d))
        dr, Wdr = system.solve(A, B, rhs)
        defect = rhs.ravel() - sla.block_diag(*A) @ (W @ dr) - sla.block_diag(*B) @ dr
        assert np.linalg.norm(defect) <= 1.01 * ACCURACY * np.linalg.norm(rhs)
        assert_allclose(Wdr, W @ dr, rtol=0, atol=1e-10 * np.abs(Wdr).max())


def test_double_precision_where_single_is_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compliances over seven orders of magnitude: the factor in single precision does not precondition, that in double does."""
    monkeypatch.setattr(condensed_system, "SINGLE_FROM", 0)
    monkeypatch.setattr(Condensed, "_whole", property(lambda _: pytest.fail("the condensed factor in double precision is enough")))
    rng = np.random.default_rng(3)
    nc, d = 20, 3
    Q = np.linalg.qr(rng.standard_normal((nc * d, nc * d)))[0]
    W = Q @ np.diag(np.logspace(0, -7.5, nc * d)) @ Q.T
    W = 0.5 * (W + W.T)
    system = condensed(W, d)
    A, B = linearisation(np.full(nc, STICK), d, rng)
    rhs = rng.standard_normal((nc, d))
    dr, _ = system.solve(A, B, rhs)
    assert np.linalg.norm(rhs.ravel() - sla.block_diag(*A) @ (W @ dr)) <= 1.01 * ACCURACY * np.linalg.norm(rhs)


def test_a_border_that_is_too_large_is_not_carried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(condensed_system, "BORDER_UP_TO", 0)
    monkeypatch.setattr(Condensed, "_hold", lambda *_: pytest.fail("no factor is to be held"))
    rng = np.random.default_rng(5)
    W = delassus(20, 3, 5)
    A, B = linearisation(np.repeat([STICK, SLIP], 10), 3, rng)
    rhs = rng.standard_normal((20, 3))
    assert_allclose(condensed(W, 3).solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-9, atol=1e-11)


def test_sets_that_empty_and_fill_again() -> None:
    rng = np.random.default_rng(7)
    W = delassus(50, 3, 8)
    system = condensed(W, 3)
    for kind in (STICK, OPEN, SLIP, STICK, OPEN, STICK, SLIP, SLIP, OPEN):
        for share in (1.0, 0.7):
            zone = np.where(rng.random(50) <= share, kind, rng.choice(3, 50))
            A, B = linearisation(zone, 3, rng)
            rhs = rng.standard_normal((50, 3))
            assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-8, atol=1e-10)


def test_condensed_system_takes_an_unsymmetric_operator() -> None:
    rng = np.random.default_rng(9)
    W = delassus(10, 3, 10) + 0.05 * rng.standard_normal((30, 30))
    system = condensed(W, 3)
    for _ in range(3):
        A, B = linearisation(rng.choice(3, 10), 3, rng)
        rhs = rng.standard_normal((10, 3))
        assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-9, atol=1e-11)


def test_condensed_system_takes_an_operator_that_is_not_positive_definite() -> None:
    """W_SS semi-definite on the sticking contacts, A W + B regular: the dense elimination goes on, at once and later."""
    rng = np.random.default_rng(11)
    H = rng.standard_normal((20, 36))
    W = H.T @ H  # rank 20: 6 sticking contacts fit, 12 do not
    system = condensed(W, 3)
    for count in (5, 6, 4, 6):
        zone = np.full(12, SLIP)
        zone[:count] = STICK
        A, B = linearisation(zone, 3, rng, pure_share=0)
        rhs = rng.standard_normal((12, 3))
        assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-7, atol=1e-8)
    W = delassus(12, 3, 12)
    W[:3, :3] -= 40 * np.eye(3)  # indefinite, regular
    system = condensed(W, 3)
    for _ in range(3):
        A, B = linearisation(np.r_[STICK, STICK, rng.choice(3, 10)], 3, rng)
        rhs = rng.standard_normal((12, 3))
        assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("name", OF_ENTRIES)
def test_singular_system_is_refused(name: str) -> None:
    """Two sticking contacts at the same point of one body: equal rows, the same number of pivots short."""
    W = np.kron(np.ones((2, 2)), np.diag([1.0, 2.0, 3.0]))
    A, B = np.stack([np.eye(3)] * 2), np.zeros((2, 3, 3))
    with pytest.raises(SingularMatrix):
        newton_system(Delassus(W, 3), name, condensing=True).solve(A, B, np.ones((2, 3)))


def test_sparse_system_by_the_sparse_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "BLOCK_UP_TO", 5)
    rng = np.random.default_rng(13)
    W = sla.block_diag(*(delassus(4, 3, seed) for seed in range(5)))
    system = SparseSystem(Delassus(sp.bsr_array(W, blocksize=(3, 3)), 3))
    for _ in range(3):
        A, B = linearisation(rng.choice(3, 20), 3, rng)
        rhs = rng.standard_normal((20, 3))
        assert_allclose(system.solve(A, B, rhs)[0], reference_step(W, A, B, rhs), rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("constraints", [0, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_saddle_point_matrix(d: int, constraints: int) -> None:
    """[[M, -H, -G], [A H^T, B, 0], [G^T, 0, 0]] entry by entry, and its step is that of A W + B."""
    rng = np.random.default_rng(14)
    nc, n = 6, 25
    X = rng.standard_normal((n, n))
    M = X @ X.T + n * np.eye(n)
    H = rng.standard_normal((n, d * nc)) * (rng.random((n, d * nc)) < 0.4)
    G = rng.standard_normal((n, constraints)) if constraints else None
    b = np.zeros(constraints) if constraints else None
    p = GlobalProblem(sp.csc_array(M), sp.csc_array(H), np.zeros(n), np.zeros(d * nc), np.full(nc, 0.3), G, b, d)
    saddle = _SaddleMatrix(p)
    H_, M_ = H, M
    if G is not None:
        M_ = np.block([[M, -G], [G.T, np.zeros((constraints, constraints))]])
        H_ = np.vstack([H, np.zeros((constraints, d * nc))])
    W = H_.T @ np.linalg.solve(M_, H_)
    for _ in range(2):
        A, B = linearisation(rng.choice(3, nc), d, rng)
        AHT = sla.block_diag(*A) @ H.T
        rows = [[M, -H], [AHT, sla.block_diag(*B)]]
        if G is not None:
            zero = np.zeros((constraints, d * nc))
            rows = [[*rows[0], -G], [*rows[1], zero.T], [G.T, zero, np.zeros((constraints, constraints))]]
        matrix = saddle(A, B)
        assert_allclose(matrix.toarray(), np.block(rows), atol=1e-14)
        rhs = rng.standard_normal((nc, d))
        full = np.concatenate([np.zeros(n), rhs.ravel(), np.zeros(constraints)])
        step = SuperLU(matrix).solve(full)[n : n + d * nc]
        assert_allclose(step, reference_step(W, A, B, rhs), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_rows_exchanged_between_contacts(d: int) -> None:
    """Two contacts whose own blocks are singular and whose coupling is not: block LU has no pivot inside them, or a tiny one."""
    rng = np.random.default_rng(d)
    nc = 30
    W = np.kron(np.eye(nc, k=1) + np.eye(nc, k=-1), rng.standard_normal((d, d)))
    A, B, rhs = np.stack([np.eye(d)] * nc), np.zeros((nc, d, d)), rng.standard_normal((nc, d))
    for small in (0.0, 1e-20):
        given = W + small * np.eye(nc * d)
        system = SparseSystem(Delassus(sp.bsr_array(given, blocksize=(d, d)), d))
        assert_allclose(W @ system.solve(A, B, rhs)[0], rhs.ravel(), rtol=0, atol=1e-9)
