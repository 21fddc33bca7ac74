"""Kernels of the two-level system over ranks beside NumPy and the joints of one process; ranks themselves are in tests/unit/ranks."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear.elimination_tree import elimination_tree
from fcsim.linear.joints import BlockRows
from fcsim.linear.late.late_rows import source_of
from fcsim.linear.over_ranks._krylov_kernels import less_combination
from fcsim.linear.over_ranks.krylov import gmres_over_ranks
from fcsim.problem.bodies.shares import compliant_motions
from fcsim.solvers.newton.systems.two_level import _body_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import MOTIONS, Joints
from fcsim.solvers.newton.systems.two_level.over_ranks import _coarse_kernels as coarse
from tests.unit.solvers.newton.systems.test_two_level import shares_and_rows, step_of, walls


def test_blocks_and_motions_of_joints_from_bodies_are_those_from_W() -> None:
    """E = W - G G^T on each joint, by h (C - L L^T) h^T, to the single precision in which it is kept; G to the last digits."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    found = shares.bodies()
    assert found is not None
    joints = Joints(rows, shares, *found)
    pairs = np.full((shares.nc, 2), -1)
    pairs[shares.contacts, found[1]] = np.arange(len(found[1]))
    matrices, kind = [], np.empty(shares.count, dtype=np.int64)
    for begin, C, of_bodies in shares.runs:
        kind[begin : begin + len(of_bodies)] = len(matrices) + of_bodies
        matrices += list(C)
    motions = [compliant_motions(C, MOTIONS) for C in matrices]
    rest = [C - L @ L.T for C, L in zip(matrices, motions, strict=True)]
    sizes = np.array([len(C) for C in matrices])
    ends = np.concatenate([[0], np.cumsum(sizes**2)])
    own, bodies, h = pairs[joints.order], joints.bodies, (shares.begins, shares.unknowns, shares.weights)
    G = np.zeros((shares.nc, 3, 2 * MOTIONS))
    L, places = np.concatenate([x.ravel() for x in motions]), np.concatenate([[0], np.cumsum(MOTIONS * sizes)])[kind]
    kernels.modes_of_contacts(own, bodies, *h, L, places, G)
    assert_allclose(G, joints.modes[0], atol=1e-13 * np.abs(G).max())
    E = np.empty_like(joints.E)
    compliances = (np.concatenate([x.ravel() for x in rest]), ends[kind], sizes[kind])
    listing = (joints.body_begins, joints.listed)
    last = len(joints.cuts) - 1
    kernels.joint_blocks_of_bodies(own, bodies, h, compliances, (joints.begins, joints.wide), listing, joints.starts, 3, 0, last, E)
    assert_allclose(E, joints.E, atol=1e-6 * np.abs(joints.E).max())


def test_joints_of_a_late_sum_are_those_from_its_entries() -> None:
    """Where W is made of bodies' shares E and G come from these, to the single precision in which E is kept, and the same joints."""
    operator = next(walls(courses="4", blocks="3.5")).reduction.local.delassus
    assert operator.shares is not None and source_of(operator.W) is not None
    shares = operator.shares.make()
    found = shares.bodies()
    assert found is not None
    by_bodies = Joints(BlockRows(operator.W, 3), shares, *found)
    by_entries = Joints(BlockRows(sp.bsr_array(operator.W.toarray(), blocksize=(3, 3)), 3), shares, *found)
    assert_array_equal(by_bodies.wide, by_entries.wide)
    assert_allclose(by_bodies.modes[0], by_entries.modes[0], atol=1e-13 * np.abs(by_entries.modes[0]).max())
    assert_allclose(by_bodies.E, by_entries.E, atol=1e-6 * np.abs(by_entries.E).max())
    assert by_bodies.shift == pytest.approx(by_entries.shift, rel=1e-9)


def grid(rng: np.random.Generator, side: int, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Begins, columns and blocks (k, k) of an unsymmetric matrix on a grid of side x side, each with what is one step away."""
    at = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
    near = np.abs(at[:, None] - at).sum(axis=2) <= 1
    columns = np.flatnonzero(near.ravel()) % len(at)
    begins = np.concatenate([[0], np.cumsum(near.sum(axis=1))])
    S = rng.standard_normal((len(columns), k, k))
    S[np.repeat(np.arange(len(at)), np.diff(begins)) == columns] += 10 * np.eye(k)
    return begins, columns, S


def test_fronts_and_what_they_leave_solve_the_matrix() -> None:
    """Two halves of a grid, each eliminated for itself, and T on the column between: together a dense solution."""
    rng, side, k = np.random.default_rng(0), 7, 4
    begins, columns, S = grid(rng, side, k)
    n = side * side
    row = np.repeat(np.arange(n), np.diff(begins))
    dense = np.zeros((n, k, n, k))
    dense[row, :, columns] = S
    dense = dense.reshape(n * k, n * k)
    mirror = np.searchsorted(row * n + columns, columns * n + row)
    between = np.arange(n) // side == 3
    tree = elimination_tree(begins, columns, 0.15, last=between)
    of_top = np.logical_or.reduceat(between[tree.order], tree.first[:-1])
    places = np.flatnonzero(np.repeat(of_top, np.diff(tree.first)))
    top = np.full(n, -1)
    top[places] = np.arange(len(places))
    on_top = (places[:, None] * k + np.arange(k)).ravel()
    order = (tree.order[:, None] * k + np.arange(k)).ravel()
    T = dense[np.ix_(order[on_top], order[on_top])].copy()
    c = rng.standard_normal(n * k)
    x = c[order].copy()
    halves = []
    for low in (True, False):
        mine = (tree.order[tree.first[:-1]] // side < 3) == low
        which = np.flatnonzero(mine & ~of_top)
        own, border = k * np.diff(tree.first)[which], k * np.diff(tree.starts)[which]
        values = np.empty(np.sum(own * (own + 2 * border)))
        given = (tree.order, tree.first, tree.starts, tree.rows)
        changed, complements = np.ones(len(S), dtype=bool), np.empty(np.sum(border**2))
        coarse.eliminate(given, which, begins, columns, mirror, S, changed, top, values, complements, T)
        borders = np.concatenate([tree.rows[tree.starts[f] : tree.starts[f + 1]] for f in which])
        fronts = values, np.stack([own, border], axis=1), k * tree.first[which], (borders[:, None] * k + np.arange(k)).ravel()
        coarse.forward(*fronts, x)
        halves.append(fronts)
    x[on_top] = np.linalg.solve(T, x[on_top])
    for fronts in halves:
        coarse.backward(*fronts, x)
    solution = np.empty_like(x)
    solution[order] = x
    assert_allclose(dense @ solution, c, atol=1e-11)


@pytest.mark.parametrize("others", [(), (0,), (3, 40), (24,)])
def test_fronts_of_what_has_not_changed_stay_with_the_bits_of_all_made_anew(others: tuple[int, ...]) -> None:
    """Blocks of some rows are others: fronts in whose subtrees none is are not touched, and what they leave counts as before."""
    rng, side, k = np.random.default_rng(1), 7, 4
    begins, columns, S = grid(rng, side, k)
    n = side * side
    row = np.repeat(np.arange(n), np.diff(begins))
    mirror, between = np.searchsorted(row * n + columns, columns * n + row), np.arange(n) // side == 6
    tree = elimination_tree(begins, columns, 0.15, last=between)
    which = np.flatnonzero(~np.logical_or.reduceat(between[tree.order], tree.first[:-1]))
    places = np.arange(tree.first[which[-1] + 1], n)
    top = np.full(n, -1)
    top[places] = np.arange(len(places))
    own, border = k * np.diff(tree.first)[which], k * np.diff(tree.starts)[which]
    sizes = own * (own + 2 * border)

    def eliminated(S: np.ndarray, changed: np.ndarray, kept: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        T = np.zeros((k * len(places), k * len(places)))
        coarse.eliminate((tree.order, tree.first, tree.starts, tree.rows), which, begins, columns, mirror, S, changed, top, *kept, T)
        return T

    kept, fresh = ((np.empty(sizes.sum()), np.empty(np.sum(border**2))) for _ in range(2))
    every = np.ones(len(S), dtype=bool)
    eliminated(S, every, kept)
    other, changed = S.copy(), np.isin(row, others)
    other[changed] *= 1.5
    expected = eliminated(other, every, fresh)
    left = kept[0].copy()
    assert np.array_equal(eliminated(other, changed, kept), expected)
    assert np.array_equal(kept[0], fresh[0])
    assert np.array_equal(kept[1], fresh[1])
    if others:  # what is marked is what is made anew: unmarked changes are not seen
        stale, unmarked = (left.copy(), fresh[1].copy()), np.zeros(len(S), dtype=bool)
        eliminated(other, unmarked, stale)
        assert np.array_equal(stale[0], left)
        assert not np.array_equal(left, fresh[0])


@pytest.mark.parametrize("count", [1, 4, 7])
def test_entries_of_a_combination_have_the_same_bits_wherever_they_stand(count: int) -> None:
    rng = np.random.default_rng(count)
    V, y, w = rng.standard_normal((9, 2500)).astype(np.float32), rng.standard_normal(count), rng.standard_normal(2500)
    expected, whole = w - V[:count].astype(float).T @ y, w.copy()
    less_combination(V[:count], y, whole)
    assert_allclose(whole, expected, rtol=0, atol=1e-14 * count * np.abs(V).max())
    some = np.array([3, 1022, 1023, 1024, 2048, 17])
    own = w[some]
    less_combination(np.ascontiguousarray(V[:count, some]), y, own)
    assert np.array_equal(own, whole[some])


class OneRank:
    """Vectors of n numbers that one rank has alone."""

    def __init__(self, n: int) -> None:
        self.own = self.shared = n

    def joined(self, share: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        return share, float(share @ share), numbers

    def summed(self, numbers: np.ndarray) -> np.ndarray:
        return numbers


@pytest.mark.parametrize("accuracy", [1e-2, 1e-5])
def test_gmres_gets_to_the_accuracy(accuracy: float) -> None:
    """Of one rank, whose sums are its own; of several see tests/unit/ranks."""
    rng = np.random.default_rng(1)
    A = np.eye(60) + 0.1 * rng.standard_normal((60, 60))
    b = rng.standard_normal(60)
    steps: list[np.ndarray] = []
    found = gmres_over_ranks(lambda y: A @ y, lambda y: steps.append(y.copy()) or y, b, OneRank(60), accuracy, 0.0, 60, 0.0)
    assert found is not None
    x, y = found
    assert_allclose(np.array(steps).T @ y, x, rtol=1e-6)
    assert np.linalg.norm(A @ x - b) <= 1.001 * accuracy * np.linalg.norm(b)


def test_gmres_gives_up_and_takes_what_is_enough() -> None:
    A, b = np.diag(np.arange(1.0, 41.0)), np.ones(40)
    arguments = (lambda y: A @ y, lambda y: y, b, OneRank(40), 1e-5, 0.0, 5)
    assert gmres_over_ranks(*arguments, 0.0) is None
    found = gmres_over_ranks(*arguments, 0.5)
    assert found is not None
    assert np.linalg.norm(A @ found[0] - b) <= 0.5 * np.linalg.norm(b)
    nothing = gmres_over_ranks(*arguments[:2], np.zeros(40), *arguments[3:], 0.0)
    assert nothing is not None
    assert_allclose(nothing[0], np.zeros(40))


def test_gmres_ends_on_a_plateau() -> None:
    """One eigenvalue of 1e-4 among those near 1 holds the defect up."""
    values = np.r_[1e-4, np.linspace(0.9, 1.1, 59)]
    A, b, products = np.diag(values), np.r_[0.1, np.ones(59)], []
    for plateau in (0.0, 0.1):
        products.append(0)

        def product(y: np.ndarray) -> np.ndarray:
            products[-1] += 1
            return A @ y

        found = gmres_over_ranks(product, lambda y: y, b, OneRank(60), 1e-4, plateau, 60, 0.0)
        assert found is not None
        assert np.linalg.norm(A @ found[0] - b) <= 1.01 * max(1e-4, plateau) * np.linalg.norm(b)
    assert products[1] < products[0]
