"""The operator as solvers see it: every derived quantity against dense NumPy, for every storage."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose
from scipy.sparse.linalg import aslinearoperator

from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus, LocalProblem

STORAGES: dict[str, Any] = {
    "dense": lambda W, d: W,
    "csr": lambda W, d: sp.csr_array(W),
    "csc": lambda W, d: sp.csc_array(W),
    "bsr": lambda W, d: sp.bsr_array(W, blocksize=(d, d)),
}


def operator(storage: str, d: int, nc: int = 8, symmetric: bool = True) -> tuple[Delassus, np.ndarray]:
    rng = np.random.default_rng(nc + d)
    pattern = np.kron(rng.random((nc, nc)) < 0.4, np.ones((d, d)))
    H = rng.standard_normal((nc * d, nc * d)) * pattern
    W = H.T @ H + (0.0 if symmetric else 1.0) * np.triu(pattern, 1)
    W[:d] = 0  # a contact without compliance of its own
    W[:, :d] = 0
    return Delassus(STORAGES[storage](W, d), d), W


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("symmetric", [True, False])
def test_against_numpy(storage: str, d: int, symmetric: bool) -> None:
    op, W = operator(storage, d, symmetric=symmetric)
    nc, x, q = op.nc, np.arange(float(len(W))), np.ones(len(W))
    assert (op.size, op.nc) == (len(W), 8)
    assert_allclose(op @ x, W @ x, rtol=1e-12)
    assert_allclose(op.affine(x, q), W @ x + q, rtol=1e-12)
    assert_allclose(op.diagonal, np.diag(W))
    assert_allclose(op.diagonal_blocks, np.array([W[a * d : a * d + d, a * d : a * d + d] for a in range(nc)]))
    assert op.entries == np.count_nonzero(W)
    assert op.symmetric is symmetric
    assert op.norm == pytest.approx(np.linalg.norm(W, 2), rel=0.05)
    assert_allclose(np.asarray(op.symmetric_part @ np.eye(len(W))), (W + W.T) / 2, atol=1e-12)
    compliance = op.compliance
    assert compliance[0] == pytest.approx(compliance[1:].mean())
    assert compliance[1] == pytest.approx(np.trace(W[d : 2 * d, d : 2 * d]) / d)
    indptr, column, blocks = op.blocks
    again = sp.bsr_array((blocks, column, indptr), shape=W.shape)
    assert_allclose(again.toarray(), W, atol=0)
    assert_allclose(op.stored @ x, W @ x, rtol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", STORAGES)
def test_shifted_and_its_factor(storage: str, d: int) -> None:
    op, W = operator(storage, d)
    shift = np.arange(1.0, 9.0)
    moved = op.shifted(shift)
    assert_allclose(moved @ np.eye(len(W)), W + np.diag(np.repeat(shift, d)), atol=1e-12)
    assert moved.is_sparse is op.is_sparse
    assert not moved.is_sparse or moved.matrix.blocksize == (d, d)
    assert_allclose(op @ np.eye(len(W)), W, atol=0)  # the operator itself is as it was
    x = np.random.default_rng(0).standard_normal((len(W), 2))
    written = W + np.diag(np.repeat(shift, d))
    assert_allclose(moved.transposed_product(x), written.T @ x, atol=1e-12)
    assert_allclose(moved.affine(x[:, 0], x[:, 1]), written @ x[:, 0] + x[:, 1], atol=1e-12)
    assert_allclose(moved.shifted(2.0) @ x, W @ x + 2 * x, atol=1e-12)  # in the place of its own shift
    assert_allclose(moved.diagonal, np.diag(written))
    assert_allclose(moved.diagonal_blocks, [written[a * d : a * d + d, a * d : a * d + d] for a in range(8)])
    assert_allclose(moved.stored @ x, written @ x, atol=1e-12)
    b = np.ones(len(W))
    for symmetric in (True, False):
        assert_allclose(op.factor(0.5, symmetric=symmetric).solve(b), np.linalg.solve(W + 0.5 * np.eye(len(W)), b), rtol=1e-9)


def test_singular_is_said() -> None:
    op, _ = operator("dense", 3)
    with pytest.raises(SingularMatrix):
        op.factor(0.0, symmetric=True)


def test_one_decision_how_to_eliminate() -> None:
    def of(nc: int, band: int, dense: bool) -> Delassus:
        W = sp.kron(sp.diags_array([np.ones(nc - abs(k)) for k in range(-band, band + 1)], offsets=range(-band, band + 1)), np.ones((3, 3)))
        return Delassus(W.toarray() if dense else sp.csr_array(W), 3)

    for dense in (True, False):
        assert of(20, 1, dense).elimination == "dense"  # small
        assert of(300, 1, dense).elimination == "sparse"
        assert of(300, 100, dense).elimination == "dense"  # filled
    assert of(300, 1, True).stored.is_sparse
    assert not of(300, 100, False).stored.is_sparse
    stored = of(300, 1, True).stored
    assert stored.stored is stored


def test_derived_once() -> None:
    calls: list[int] = []

    def make(op: Delassus, k: int) -> int:
        calls.append(k)
        return op.size + k

    problem = LocalProblem(np.eye(3), np.zeros(3), np.zeros(1))
    assert problem.delassus is problem.delassus
    assert [problem.delassus.derived(make, k) for k in (1, 1, 2)] == [4, 4, 5]
    assert calls == [1, 2]


@pytest.mark.parametrize("storage", STORAGES)
def test_it_is_gone_with_its_last_name(storage: str) -> None:
    """What it derives of itself and keeps must not be itself: a run would leave the W of each of its steps to the collector of cycles."""
    op, _ = operator(storage, 3)
    gone = weakref.ref(op.stored.stored)
    assert op.stored.symmetric_part is not None
    assert op.symmetric_part is not None
    seen = weakref.ref(op)
    gc.disable()
    try:
        del op
        assert seen() is None and gone() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("storage", STORAGES)
def test_complete_rows_of_any_storage(storage: str) -> None:
    """Every diagonal block and every mirror image, sorted, W unchanged; duplicates of the caller's are summed up."""
    _, W = operator(storage, 2)
    W[2:4, 4:6], W[4:6, 2:4] = 1.0, 0.0
    given = STORAGES[storage](W, 2)
    rows, analysis = Delassus(given, 2).analysis
    assert_allclose(rows.toarray(), W, atol=0)
    row = np.repeat(np.arange(8), np.diff(rows.indptr))
    places = set(zip(row.tolist(), rows.indices.tolist(), strict=True))
    assert all((a, a) in places for a in range(8)) and all((b, a) in places for a, b in places)
    assert rows.has_sorted_indices and len(places) == len(rows.indices) == analysis.indptr[-1]
    twice = sp.bsr_array((np.ones((3, 2, 2)), [1, 0, 0], [0, 2, 3]), shape=(4, 4))
    twice.indices[1] = 1
    assert_allclose(Delassus(twice, 2).analysis[0].toarray(), twice.toarray(), atol=0)


@pytest.mark.parametrize("storage", STORAGES)
def test_a_shift_shares_what_W_decides(storage: str) -> None:
    op, W = operator(storage, 3)
    moved = op.shifted(np.arange(1.0, 9.0)).shifted(2.0)
    assert moved.unshifted is op and moved.elimination == op.elimination
    assert moved.stored.elimination == op.stored.elimination and type(moved.stored.W) is type(op.stored.W)
    rows, analysis = moved.analysis
    assert analysis is op.analysis[1]
    assert_allclose(rows.toarray(), W + 2 * np.eye(len(W)), atol=1e-12)
    assert moved.symmetric_part.unshifted is None or moved.symmetric


def test_what_has_products_alone_is_not_eliminated() -> None:
    op = Delassus(aslinearoperator(2 * np.eye(3)), 3)  # as ACLM's compliance on the global form
    assert_allclose(op.W @ np.ones(3), 2 * np.ones(3))
    for ask in ("elimination", "stored"):
        with pytest.raises(InputError, match=r"W: expected a NumPy array or a SciPy sparse array to eliminate, got a _?\w*Operator"):
            getattr(op, ask)
    with pytest.raises(InputError, match="W: expected a NumPy array, a SciPy sparse array or a LinearOperator, got a list"):
        Delassus([[1.0]], 1)  # type: ignore[arg-type]


@pytest.mark.parametrize("storage", STORAGES)
def test_a_product_that_is_kept_is_that_of_its_vector(storage: str) -> None:
    """Vectors and images that their owners change, and shifts that share W."""
    made, W = operator(storage, 3)
    x = np.random.default_rng(1).standard_normal(len(W))
    shifted, D = made.shifted(np.arange(1.0, 9.0)), np.diag(np.repeat(np.arange(1.0, 9.0), 3))
    for _ in range(2):
        for asked, matrix in ((made, W), (shifted, W + D), (made, W)):
            image = asked @ x
            assert_allclose(image, matrix @ x, atol=1e-12)
            image[:] = np.nan
        x *= -2.0
        x[0] = 7.0
