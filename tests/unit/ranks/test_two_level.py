"""Newton's linear system that ranks solve together beside that of one process: the same products, preconditioner and solutions."""

from __future__ import annotations

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.linear.joints import BlockRows
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.systems.two_level import patches, system
from fcsim.solvers.newton.systems.two_level.joints import Joints
from fcsim.solvers.newton.systems.two_level.over_ranks import _patch_kernels as patch_kernels
from fcsim.solvers.newton.systems.two_level.over_ranks._coarse_kernels import separators
from fcsim.solvers.newton.systems.two_level.over_ranks._patch_kernels import add_lower, add_part, lower, solvers_of_patches
from fcsim.solvers.newton.systems.two_level.over_ranks.patches import JointsOfAll, chosen_for_ranks
from tests.unit.ranks.conftest import OnRanks
from tests.unit.ranks.two_level import WORST, blocks_of_all, unsolved
from tests.unit.ranks.walls import simulation
from tests.unit.solvers.newton.systems.test_two_level import linearisation, newton_matrix

PROGRAM = Path(__file__).with_name("two_level.py")
RANKS = (pytest.param(2, marks=pytest.mark.slow), 3)


@cache
def alone() -> tuple[sp.bsr_array, Joints]:
    """W and its joints in one process."""
    posed = iter(simulation("NSN-AC", 2)[0])
    next(posed)
    operator = next(posed).reduction.local.delassus
    assert operator.shares is not None
    shares = operator.shares.make()
    found = shares.bodies()
    assert found is not None
    rows = BlockRows(operator.W, 3)
    return sp.bsr_array(operator.W), Joints(rows, shares, *found)


def given(W: sp.bsr_array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and x as the ranks have them."""
    nc = W.shape[0] // 3
    return *linearisation(nc, float(W.diagonal().mean())), np.random.default_rng(2).standard_normal((nc, 3))


@pytest.mark.parametrize("ranks", RANKS)
def test_each_joint_is_one_rank_s_and_so_is_its_memory(on_ranks: OnRanks, ranks: int) -> None:
    _, joints = alone()
    answers = on_ranks("two_level", ranks)
    assert sorted(np.concatenate([answer["own"] for answer in answers])) == list(range(len(joints.order)))
    entries = [answer["entries"] for answer in answers]
    assert sum(entries) == len(joints.E)  # with the same neighbours each
    assert max(entries) <= 1.5 * len(joints.E) / ranks
    joint = np.empty(len(joints.order), dtype=int)
    joint[joints.order] = np.repeat(np.arange(len(joints.cuts) - 1), np.diff(joints.cuts))
    owners = [set(joint[answer["own"]]) for answer in answers]
    assert sum(map(len, owners)) == len(joints.cuts) - 1


@pytest.mark.parametrize("ranks", RANKS)
def test_joints_take_over_what_follows_from_where_h_has_entries(on_ranks: OnRanks, ranks: int) -> None:
    """Where it has them where it had them, and the blocks are those of joints without anything earlier. Where nothing need be compared for
    that h is made of a rank's own contacts and those around them alone."""
    for rank in on_ranks("two_level", ranks):
        assert rank["taken over"] == [True, True, False]
        assert rank["the same"] == [True, True, True]
        asked, around, every = rank["contacts of h"]
        assert asked == [around, every]
        assert around < every


@pytest.mark.parametrize("ranks", RANKS)
def test_products_are_those_of_W(on_ranks: OnRanks, ranks: int) -> None:
    W, _ = alone()
    _, _, x = given(W)
    for answer in on_ranks("two_level", ranks):
        assert np.linalg.norm(answer["product"] - W @ x.ravel()) <= 1e-13 * np.linalg.norm(W @ x.ravel())


@pytest.mark.parametrize("ranks", RANKS)
def test_copies_of_what_ranks_sum_have_the_bits_of_their_owners(on_ranks: OnRanks, ranks: int) -> None:
    """A W x + B x on each rank's own contacts and those around them, its length and other sums by the same exchange."""
    W, _ = alone()
    x = given(W)[2]
    A, B = blocks_of_all(len(x))
    image = np.einsum("aij,aj->ai", A, (W @ x.ravel()).reshape(-1, 3)) + np.einsum("aij,aj->ai", B, x)
    of_owners = np.full(image.shape, np.nan)
    answers = on_ranks("two_level", ranks)
    for answer in answers:
        of_owners[answer["own"]] = np.reshape(answer["joined"][0], (-1, 3))[: len(answer["own"])]
    for answer in answers:
        values, square, sums = answer["joined"]
        assert answer["halo"][: len(answer["own"])] == answer["own"] and len(answer["halo"]) > len(answer["own"])
        assert np.array_equal(np.reshape(values, (-1, 3)), of_owners[answer["halo"]])
        assert square == answers[0]["joined"][1] == pytest.approx(np.sum(image**2), rel=1e-13)
        assert sums == [ranks, ranks * (ranks - 1) / 2]
    assert np.linalg.norm(of_owners - image) <= 1e-13 * np.linalg.norm(image)


@pytest.mark.parametrize("ranks", RANKS)
def test_the_preconditioner_is_that_of_one_process(on_ranks: OnRanks, ranks: int) -> None:
    """To single precision, in which it is computed; from it one other follows, which then has its blocks."""
    W, joints = alone()
    A, B, x = given(W)
    P = system.Preconditioner(joints)
    P.update(A, B)
    first = P(x.ravel())
    A[::7], B[::7] = 0, np.eye(3)
    P.update(A, B)
    for answer in on_ranks("two_level", ranks):
        for name, expected in (("preconditioned", first), ("changed", P(x.ravel()))):
            assert np.linalg.norm(answer[name] - expected) <= 1e-4 * np.linalg.norm(expected)
        assert answer["given away"] == [True, True, False]
        assert answer["refused"]


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_have_the_preconditioner_s_answer_at_their_bodies_with_its_owner_s_bits(on_ranks: OnRanks, ranks: int) -> None:
    assert any(answer["of others"][0] for answer in on_ranks("two_level", ranks))
    for answer in on_ranks("two_level", ranks):
        contacts, first, changed = answer["of others"]
        assert not set(contacts) & set(answer["own"])
        for name, values in (("preconditioned", first), ("changed", changed)):
            assert np.array_equal(np.reshape(answer[name], (-1, 3))[contacts], np.reshape(values, (-1, 3)))


@pytest.mark.parametrize("ranks", RANKS)
def test_the_solution_is_one_of_the_whole_system(on_ranks: OnRanks, ranks: int) -> None:
    """Near a solution to the defect that is asked for, far from one to the accuracy of reactions; the same bits on all ranks."""
    W, _ = alone()
    A, B, x = given(W)
    J = newton_matrix(A, W.toarray(), B)
    exact = np.linalg.solve(J, x.ravel())
    answers = on_ranks("two_level", ranks)
    for (near, image), (far, _) in (answer["solved"] for answer in answers):
        assert np.linalg.norm(J @ near - x.ravel()) <= 2 * system.SAFETY * 0.2 * np.linalg.norm(x)
        assert np.linalg.norm(image - W @ near) <= 1e-13 * np.linalg.norm(np.abs(W) @ np.abs(near))
        assert np.linalg.norm(far - exact) <= 10 * system.ACCURACY * np.linalg.norm(exact)
    for answer in answers[1:]:
        assert answer["solved"] == answers[0]["solved"]
        assert answer["preconditioned"] == answers[0]["preconditioned"]


@pytest.mark.parametrize("ranks", RANKS)
def test_patches_are_those_of_one_process_and_solved_by_the_ranks(on_ranks: OnRanks, ranks: int) -> None:
    """Around all joints above the limit that have none in common, around one, and none: by W's entries; the same bits on all ranks."""
    W, joints = alone()
    nc = len(joints.order)
    given, limits = unsolved(W.diagonal().reshape(nc, 3))
    u, r, mu, rho, weight = given.u, given.r, given.mu, given.rho, given.weight
    answers = on_ranks("two_level", ranks)
    for answer in answers:
        assert answer["settled"] == answers[0]["settled"]
        assert answer["knows"] == [True, False] and answer["nowhere"] == [True, True]
    every, one, none = answers[0]["settled"]
    assert none is None
    of_one_process = patches.missed_by_joints(joints, given)
    counts = []
    for (dr, image), limit in ((every, limits[0]), (one, limits[1])):
        assert np.linalg.norm(image - W @ dr) <= 1e-13 * np.linalg.norm(np.abs(W) @ np.abs(dr))
        moved, some = np.reshape(dr, (nc, 3)), patches.chosen(joints, of_one_process, limit, 1.0)
        for own in some:
            dofs = (3 * own[:, None] + np.arange(3)).ravel()
            after = (W.tocsr()[dofs][:, dofs] @ moved[own].ravel()).reshape(-1, 3)
            before, left = (
                np.linalg.norm(weight[own, None] * alart_curnier(*at, mu[own], rho[own])[0])
                for at in ((u[own], r[own]), (after, r[own] + moved[own]))
            )
            assert left <= patches.FALLS * before
        assert not np.delete(moved, np.concatenate(some), axis=0).any()
        assert moved[WORST].any()
        counts.append(len(some))
    assert counts[0] >= ranks and counts[1] == 1


def solved_last(sizes: np.ndarray, known: np.ndarray, solver: tuple[int, ...]) -> float:
    """When the last rank has solved its patches: all wait for the parts that are sent."""
    ranks, p = range(known.shape[1]), range(len(sizes))
    sent = [sum((patch_kernels.PART + patch_kernels.SENT) * known[k, i] ** 2 for k in p if solver[k] != i) for i in ranks]
    own = [sum(patch_kernels.PART * known[k, i] ** 2 for k in p if solver[k] == i) for i in ranks]
    added = [sum(patch_kernels.ADDED * known[k, j] ** 2 for k in p if solver[k] == i for j in ranks if j != i) for i in ranks]
    solved = [sum(sizes[k] ** 3 for k in p if solver[k] == i) for i in ranks]
    return max(max(max(sent), sent[i] + own[i]) + added[i] + solved[i] for i in ranks)


def test_patches_go_where_the_last_rank_is_ready_first() -> None:
    """As in every other way of giving them to ranks, but for a sixth. A patch alone and small ones stay with who knows them, of two large
    ones one goes to the other rank."""
    rng, sizes = np.random.default_rng(0), np.array([202, 176, 160, 202])
    assert solvers_of_patches(sizes, sizes[:, None] * np.eye(2, dtype=np.int64)[[0, 1, 0, 1]]).tolist() == [0, 1, 0, 1]
    assert solvers_of_patches(np.array([150]), np.array([[0, 150]])).tolist() == [1]
    assert solvers_of_patches(np.array([10, 10]), np.array([[0, 10], [0, 10]])).tolist() == [1, 1]
    assert sorted(solvers_of_patches(np.array([200, 200]), np.array([[0, 200], [0, 200]])).tolist()) == [0, 1]
    for ranks in (2, 3):
        for _ in range(10):
            known = rng.integers(50, 200, (5, ranks)) * (rng.random((5, ranks)) < 0.5)
            sizes = np.maximum(known.sum(axis=1), 20)
            found = solvers_of_patches(sizes, known)
            best = min(solved_last(sizes, known, solver) for solver in product(range(ranks), repeat=5))
            assert solved_last(sizes, known, tuple(found.tolist())) <= 7 / 6 * best


@pytest.mark.parametrize("ranks", (2, 3))
def test_a_round_has_as_many_patches_for_each_rank(ranks: int) -> None:
    """Those of one process in its order, and up to a multiple of the ranks the next ones, from a tenth of the limit on; fewer where there
    are no more."""
    bodies = np.repeat(np.stack([np.arange(60), np.arange(1, 61)], axis=1), 10, axis=0)  # a row of bodies with ten contacts a joint
    joints = JointsOfAll(bodies, 61)
    missed = np.random.default_rng(1).uniform(0.5, 1.0, 60)
    alone, every = patches.chosen(joints, missed, 0.0), patches.chosen(joints, missed, 0.0, 1.0)
    assert len(alone) == 1 and len(every) > 2 * ranks
    found, _ = chosen_for_ranks(joints, missed, 0.0, ranks)
    assert len(found) == ranks
    for own, other in zip(found, every, strict=False):
        assert np.array_equal(own, other)
    others = np.argsort(missed)[:-1]
    missed[others] = 0.02
    assert len(chosen_for_ranks(joints, missed, 0.1, ranks)[0]) == ranks
    missed[others] = 0
    assert len(chosen_for_ranks(joints, missed, 0.1, ranks)[0]) == 1


def test_a_round_knows_whether_few_joints_are_left() -> None:
    """Down to a tenth of the limit: with more than a round looks at, the error is the wall's as a whole, and a system is due."""
    bodies = np.repeat(np.stack([np.arange(600), np.arange(1, 601)], axis=1), 10, axis=0)
    joints, missed = JointsOfAll(bodies, 601), np.zeros(600)
    missed[::3] = 0.5
    for limit, few in ((0.1, False), (1.0, False), (10.0, True)):
        assert chosen_for_ranks(joints, missed, limit, 2)[1] is few
    missed[30:] = 0
    assert chosen_for_ranks(joints, missed, 0.1, 2)[1] is True


@pytest.mark.parametrize("d", (2, 3))
def test_parts_of_a_patch_are_added_at_their_contacts(d: int) -> None:
    rng = np.random.default_rng(d)
    W, at = rng.standard_normal((5 * d, 5 * d)), np.array([3, 0, 4])
    part, before = rng.standard_normal((3 * d, 3 * d)), W.copy()
    chosen = np.zeros((5 * d, 3 * d))
    chosen[(d * at[:, None] + np.arange(d)).ravel(), np.arange(3 * d)] = 1
    add_part(part, at, d, W)
    assert np.allclose(W, before + chosen @ part @ chosen.T, rtol=0, atol=1e-15)


@pytest.mark.parametrize("d", (2, 3))
def test_a_symmetric_part_is_sent_by_half(d: int) -> None:
    rng, at = np.random.default_rng(d), np.array([3, 0, 4])
    whole, half, part = *np.repeat(rng.standard_normal((1, 5 * d, 5 * d)), 2, axis=0), rng.standard_normal((3 * d, 3 * d))
    part += part.T
    add_part(part, at, d, whole)
    packed = lower(part)
    add_lower(packed, at, d, half)
    assert len(packed) == 3 * d * (3 * d + 1) // 2 and np.array_equal(half, whole)


def test_one_body_beside_many_separates_ranks_in_their_place() -> None:
    """A platen on bricks of two ranks, of which two neighbours are next to each other; and any graph falls apart."""
    graph = np.zeros((11, 11), dtype=bool)
    graph[0, 1:] = True
    graph[5, 6] = True
    rank = np.array([1] + 5 * [0] + 5 * [1])
    graph |= graph.T
    nothing, of_graph = np.zeros(11, dtype=bool), (np.concatenate([[0], np.cumsum(graph.sum(axis=1))]), np.nonzero(graph)[1])
    assert np.flatnonzero(separators(*of_graph, rank, nothing)).tolist() == [0, 5]
    assert np.flatnonzero(separators(*of_graph, rank, np.arange(11) == 6)).tolist() == [0, 6]  # which leaves nothing to 5
    rng = np.random.default_rng(4)
    graph, rank = rng.random((60, 60)) < 0.05, rng.integers(0, 3, 60)
    graph = graph | graph.T | np.eye(60, dtype=bool)
    first = rng.random(60) < 0.1
    taken = separators(np.concatenate([[0], np.cumsum(graph.sum(axis=1))]), np.nonzero(graph)[1], rank, first)
    assert np.all(taken[first])
    row, column = np.nonzero(graph)
    assert 0 < taken.sum() < 60
    assert np.all((rank[row] == rank[column]) | taken[row] | taken[column])
