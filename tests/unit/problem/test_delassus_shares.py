"""W known by its bodies' shares against the dense H^T A^-1 H of the same matrices, before and after its entries are read."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.errors import InputError
from fcsim.linear import storage
from fcsim.linear.joints import joint_rows
from fcsim.linear.late.late_rows import LateRows, in_blocks
from fcsim.problem import Delassus, LocalProblem, delassus_sum
from fcsim.problem.bodies import late as late_module
from fcsim.problem.bodies import product as bodies_product
from fcsim.problem.bodies.late import late_sum, summed_late
from fcsim.problem.bodies.product import ShareProduct
from fcsim.problem.bodies.shares import BodyShares, Run
from fcsim.problem.delassus_sum import DelassusSum
from fcsim.solvers.newton.systems.held import dense_part

NC, SIZE, BODIES = 24, 9, 6


def chain(kinds: list[int], seed: int = 3, d: int = 3) -> tuple[DelassusSum, tuple[Run, ...], np.ndarray]:
    """Contacts between neighbours of a row of bodies: the sum, its shares in two groups, and W by dense products."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((max(kinds) + 1, SIZE, SIZE))
    C = A @ A.transpose(0, 2, 1)
    H = np.zeros((BODIES * SIZE, d * NC))
    for a in range(NC):
        for b in (a % (BODIES - 1), a % (BODIES - 1) + 1):
            rows = SIZE * b + rng.choice(SIZE, 5, replace=False)
            H[rows, d * a : d * a + d] = rng.standard_normal((5, d))
    W = DelassusSum(sp.csc_array(H), np.repeat(np.arange(BODIES), SIZE), np.tile(np.arange(SIZE), BODIES), BODIES, d)
    kind = np.array(kinds)
    shares = (0, C, kind[:4]), (4, C, kind[4:])
    return W, shares, H.T @ sp.block_diag([sp.coo_array(C[k]) for k in kinds]).toarray() @ H


@pytest.fixture(autouse=True)
def small_is_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "SPARSE_FROM", 0)
    monkeypatch.setattr(storage, "SUM_FILLED", 1.1)


def late(kinds: list[int]) -> tuple[LateRows, np.ndarray]:
    total, shares, expected = chain(kinds)
    W = summed_late(total, shares)
    assert isinstance(W, LateRows)
    return W, expected


@pytest.mark.parametrize("kinds", [[0] * BODIES, [0, 1, 1, 0, 1, 0], [0, 1, 2, 3, 0, 1]], ids=["one", "two", "as many as bodies"])
def test_products_blocks_and_parts_without_entries(kinds: list[int]) -> None:
    W, expected = late(kinds)
    size, x, q = np.abs(expected).max(), *np.random.default_rng(1).standard_normal((2, 3 * NC))
    x[:9] = 0
    rows, columns = np.array([5, 0, 17]), np.array([2, 6, 5, 11])
    unknowns = [(3 * part[:, None] + np.arange(3)).ravel() for part in (rows, columns)]
    operator, blocks = Delassus(W), expected.reshape(NC, 3, NC, 3)[np.arange(NC), :, np.arange(NC)]
    joined = in_blocks(W, 3)
    for found, dense in (
        (W @ x, expected @ x),
        (operator.affine(x, q), expected @ x + q),
        (operator @ x, expected @ x),
        (operator.shifted(2.0).affine(x, q), expected @ x + 2 * x + q),
        (operator.diagonal, expected.diagonal()),
        (operator.diagonal_blocks, blocks),
        (dense_part(joined, 3, rows, columns), expected[np.ix_(*unknowns)]),
    ):
        assert_allclose(found, dense, rtol=0, atol=1e-13 * size * NC)
    assert W._entries is None
    assert_allclose(W.toarray(), expected, rtol=0, atol=1e-13 * size)
    assert W._entries is not None


@pytest.mark.parametrize("cached", [0, 10**9], ids=["by columns", "by bodies"])
@pytest.mark.parametrize("d", [3, 2])
@pytest.mark.parametrize("kinds", [[0] * BODIES, [0, 1, 1, 0, 1, 0], [3, 0, 5, 1, 4, 2]], ids=["one", "two", "one for each"])
def test_products_however_they_are_cut(monkeypatch: pytest.MonkeyPatch, kinds: list[int], d: int, cached: int) -> None:
    """One run of all bodies, as of one part, of two, and of bodies with compliances of their own."""
    total, shares, expected = chain(kinds, d=d)
    run = (0, shares[0][1], np.array(kinds))
    x, q = np.random.default_rng(4).standard_normal((2, d * NC))
    for name in ("OPERATIONS_A_PIECE", "SHARED_A_PIECE", "WEIGHTS_A_PIECE", "CONTACTS_A_PIECE"):
        monkeypatch.setattr(bodies_product, name, 1)
    monkeypatch.setattr(bodies_product, "CACHED", cached)
    product, before = ShareProduct(BodyShares(*total.bodies, (run,), NC, d)), q.copy()
    assert_allclose(product.affine(x, q), expected @ x + q, rtol=0, atol=1e-13 * np.abs(expected).max() * NC)
    assert_array_equal(q, before)
    x[d:-d] = 0
    assert_allclose(product.of_few(x), expected @ x, rtol=0, atol=1e-13 * np.abs(expected).max() * NC)


@pytest.mark.parametrize("turned", [False, True], ids=["one frame a contact", "bodies' axes"])
@pytest.mark.parametrize("whole", [True, False], ids=["nodes alone", "and others"])
def test_products_by_nodes_and_frames(monkeypatch: pytest.MonkeyPatch, turned: bool, whole: bool) -> None:
    """Facets' shape values times frames, those of a body in its own axes or not, and beside them contacts whose entries are anything."""
    rng = np.random.default_rng(5)
    H = np.zeros((BODIES * SIZE, 3 * NC))
    axes = [np.linalg.qr(rng.standard_normal((3, 3)))[0] if turned else np.eye(3) for _ in range(BODIES)]
    for a in range(NC):
        frame, first = np.linalg.qr(rng.standard_normal((3, 3)))[0], a % (BODIES - 1)
        for b, shapes in ((first, [1.0]), (first + 1, [-0.3, -0.7, 0.0])):
            for node, shape in zip(rng.permutation(SIZE // 3), shapes, strict=False):
                rows = SIZE * b + 3 * node
                H[rows : rows + 3, 3 * a : 3 * a + 3] = shape * (axes[b] @ frame.T)
        if not whole and a % 4 == 1:
            H[SIZE * (first + 1) + 1, 3 * a + 1] += 1e-6
    C = rng.standard_normal((SIZE, SIZE))
    C = C @ C.T
    total = DelassusSum(sp.csc_array(H), np.repeat(np.arange(BODIES), SIZE), np.tile(np.arange(SIZE), BODIES), BODIES, 3)
    shares = BodyShares(*total.bodies, ((0, C[None], np.zeros(BODIES, dtype=np.int64)),), NC, 3)
    expected = H.T @ np.kron(np.eye(BODIES), C) @ H
    x, q = rng.standard_normal((2, 3 * NC))
    x[6:9] = 0
    monkeypatch.setattr(bodies_product, "CONTACTS_A_PIECE", 5)
    product = ShareProduct(shares)
    assert product._nodal is not None
    frame_of, contacts = product._nodal[1], total.bodies[1]
    assert np.count_nonzero(frame_of < 0) == (0 if whole else NC // 4)
    of_nodes = contacts % 4 != 1
    assert np.count_nonzero(frame_of[of_nodes] >= NC) == (np.count_nonzero(of_nodes) // 2 if turned else 0)
    monkeypatch.setattr(bodies_product, "NODAL", 2.0)
    plain = ShareProduct(shares)
    assert plain._nodal is None
    few = np.where(np.isin(np.arange(3 * NC) // 3, [4, 9, 11]), x, 0)
    for one in (product, plain):
        assert_allclose(one.of_few(few), expected @ few, rtol=0, atol=1e-14 * np.abs(expected).max() * NC)
        assert_allclose(one.affine(x, q), expected @ x + q, rtol=0, atol=1e-14 * np.abs(expected).max() * NC)


def test_entries_are_those_of_the_sum_and_do_not_change_products() -> None:
    """Bits: a run that reads W for a file goes on as one that does not."""
    W, _ = late([0, 1, 1, 0, 1, 0])
    total, shares, _ = chain([0, 1, 1, 0, 1, 0])
    for share in shares:
        total.add(*share)
    x = np.random.default_rng(2).standard_normal(3 * NC)
    before = W @ x
    assert_array_equal(W.data, total.matrix().data)
    assert_array_equal(W.indices, total.matrix().indices)
    assert_array_equal(W @ x, before)
    assert W.nnz == 9 * len(W.indices)


def test_derived_arrays_have_entries_alone() -> None:
    W, expected = late([0] * BODIES)
    tolerance = 1e-12 * np.abs(expected).max()
    for derived, dense in ((W.copy(), expected), (2 * W, 2 * expected), (W.T, expected.T), (W + W, 2 * expected), (W.tocsr(), expected)):
        assert getattr(derived, "source", None) is None
        assert_allclose(derived.toarray(), dense, rtol=0, atol=tolerance)
        assert_allclose(derived @ np.ones(3 * NC), dense @ np.ones(3 * NC), rtol=0, atol=10 * tolerance)
    W.data = np.zeros_like(W.data)
    assert not np.any(W @ np.ones(3 * NC))
    assert not np.any(Delassus(W).diagonal)


def test_a_part_asks_the_runs_of_its_bodies_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contacts 3 and 8 are between the bodies 3 and 4, of both runs, 0 and 10 between the first two, 4 and 9 between the last two, of one;
    a rank of a wall has some forty runs, and a patch's bodies are in few of them."""
    total, shares, expected = chain([0] * BODIES)
    asked, rows_of_shares = list[int](), late_module.rows_of_shares
    monkeypatch.setattr(late_module, "rows_of_shares", lambda *given: asked.append(given[5]) or rows_of_shares(*given))
    source = late_sum(total, shares)
    assert source is not None
    for contacts, runs in (((0, 10), [0]), ((3, 8), [0, 4]), ((4, 9), [4]), ((), [])):
        some = np.array(contacts, dtype=np.int64)
        unknowns = (3 * some[:, None] + np.arange(3)).ravel()
        asked.clear()
        assert_allclose(source.part(some, some), expected[np.ix_(unknowns, unknowns)], rtol=0, atol=1e-13 * np.abs(expected).max())
        assert asked == runs


def test_joints_are_found_without_entries() -> None:
    W, _ = late([0] * BODIES)
    plain = sp.bsr_array((W.copy().data, W.indices, W.indptr), shape=W.shape)
    assert (joint_rows(W, 3) is None) == (joint_rows(plain, 3) is None)


def test_the_pattern_serves_the_next_W_of_the_same_contacts() -> None:
    W, following = (late([0] * BODIES)[0] for _ in range(2))
    assert following.indices is W.indices
    assert W.indices.dtype == np.int32


def test_a_pattern_is_that_of_the_contacts_whatever_was_asked_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies of two contacts each, in turns with others and with one contact more, which touches neither; patterns by hand."""
    found, union = [], delassus_sum.union_of_neighbours
    monkeypatch.setattr(delassus_sum, "union_of_neighbours", lambda *given: found.append(1) or union(*given))
    patterns, first = delassus_sum._Patterns(), np.array([0, 2, 4])
    row, star = ([0, 1, 1, 2], [[0, 1], [0, 1, 2], [1, 2]]), ([0, 1, 0, 2], [[0, 1, 2], [0, 1], [0, 2]])
    kept = []
    for contacts, expected in (row, row, star, row, row):
        starts, columns = patterns.of(first, np.array(contacts), 3)
        assert [columns[i:j].tolist() for i, j in itertools.pairwise(starts)] == expected
        kept.append(columns)
    assert kept[1] is kept[0] and kept[4] is kept[3] and len(found) == 3
    assert len(patterns.of(first, np.array(row[0]), 4)[0]) == 5
    del kept, columns
    starts, columns = patterns.of(first, np.array(row[0]), 4)  # nobody has kept it
    assert len(found) == 5 and columns.tolist() == list(itertools.chain(*row[1]))


def test_entries_are_summed_at_once_where_bodies_cost_more(monkeypatch: pytest.MonkeyPatch) -> None:
    total, shares, expected = chain([0] * BODIES)
    wide = tuple((begin, np.pad(C, ((0, 0), (0, 300), (0, 300))), kind) for begin, C, kind in shares)
    W = summed_late(total, wide)
    assert not isinstance(W, LateRows)
    assert_allclose(W.toarray(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    total, shares, expected = chain([0] * BODIES, d=2)
    W = summed_late(total, shares)
    assert not isinstance(W, LateRows)
    assert_allclose(W.toarray(), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_a_problem_and_what_is_made_of_it_leave_entries_unmade() -> None:
    W, _ = late([0, 1, 1, 0, 1, 0])
    problem = LocalProblem(W, np.zeros(3 * NC), np.ones(NC))
    for one in (problem, replace(problem, q=np.ones(3 * NC))):
        assert one.W is W
        assert one.delassus.affine(np.ones(3 * NC), one.q).shape == (3 * NC,)
    assert W._entries is None


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_compliance_that_is_no_number_is_refused(bad: float) -> None:
    total, shares, _ = chain([0] * BODIES)
    shares[0][1][0, 2, 3] = bad
    with pytest.raises(InputError, match="W: expected finite numbers"):
        LocalProblem(summed_late(total, shares), np.zeros(3 * NC), np.ones(NC))
