"""Patches of joints over ranks: which there are follows from all joints, as in one process; each is solved by one rank.

A round has as many patches for each rank, so that none waits for another one: as many in all as one process would take, and up to a
multiple of the ranks where there are more.

W of a patch's contacts is the sum of the shares of its bodies, h C h^T, each of which its body's rank makes: nobody needs others' C. A
patch whose bodies are all of one rank takes no exchange there; between ranks, or where another rank has less to do, the others send the
one that solves it what their bodies have on its contacts. Then all ranks have all reactions that have changed.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.distributed import DistributedDelassus
from fcsim.solvers.newton.systems.two_level.joints import numbers_of_pairs
from fcsim.solvers.newton.systems.two_level.over_ranks._patch_kernels import add_lower, add_part, lower, solvers_of_patches
from fcsim.solvers.newton.systems.two_level.patches import PATCH_UP_TO, SHARE, chosen, joints_beside, missed_by_joints, solved
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate
from fcsim.threads import pieces, side_by_side

MORE = 0.1
"""Share of the limit above which a joint is worth a patch that a rank solves while it would wait."""


class JointsOfAll:
    """The joints of all ranks, as `Joints` has those of one process: contacts of pairs of `count` bodies, `order` those of all contacts
    joint by joint, `cuts` their ends; bodies (nc, 2) by that order."""

    def __init__(self, bodies: IntArray, count: int) -> None:
        """bodies (nc, 2): by contacts, -1 for none."""
        self.count = count
        number, joint = np.unique(numbers_of_pairs(bodies, count), return_inverse=True)
        self.joint = joint.reshape(-1)  # of each contact (nc,)
        self.order = np.argsort(joint, kind="stable")
        self.cuts = np.searchsorted(joint[self.order], np.arange(len(number) + 1))
        self.bodies = bodies[self.order]

    @cached_property
    def beside(self) -> tuple[IntArray, IntArray]:
        """The joints that have a body in common with each joint, see `joints_beside`."""
        return joints_beside(self.bodies[self.cuts[:-1]], self.count)


def patched_over_ranks(joints: JointsOfAll, W: DistributedDelassus, at: ContactIterate, limit: float) -> tuple[FloatArray, bool] | None:
    """What r (nc, d) moves by in a round of patches, as `patched`, on all ranks, which have all arguments whole, and whether what
    is missed is at few joints, see `chosen_for_ranks`; None where there are none."""
    layout, d = W.layout, at.r.shape[1]
    world = layout.world
    patches, few = chosen_for_ranks(joints, missed_by_joints(joints, at), limit, world.size)
    if not patches:
        return None
    places = [[np.flatnonzero(known) for known in layout.known[:, own]] for own in patches]
    counts = np.array([[len(place) for place in of_ranks] for of_ranks in places])
    solver = solvers_of_patches(np.array([len(own) for own in patches]), counts)
    mine = np.flatnonzero(solver == world.number)
    sizes = d * counts * (d * counts + 1) // 2 * (solver[:, None] != np.arange(world.size))  # that are sent (patches, ranks): symmetric
    sent = np.flatnonzero(sizes[:, world.number])
    sent = sent[np.argsort(solver[sent], kind="stable")]

    def part(p: int) -> FloatArray:
        return W.own_part(patches[p][places[p][world.number]])

    def given_part(p: int) -> FloatArray:
        return lower(part(p))

    most = sizes.sum(axis=0).max() - sizes[:, world.number].sum()  # a rank that sends less makes parts of its own patches meanwhile
    early = np.count_nonzero(np.cumsum((d * counts[mine, world.number]) ** 2 // 2) <= most)
    with layout.together("patches of joints"):
        given = _joined(side_by_side([partial(given_part, p) for p in sent.tolist()]))
        parts = side_by_side([partial(part, p) for p in mine[:early].tolist()])
    with world.unasked("patches of joints"):
        lengths = sizes.T @ (solver[:, None] == np.arange(world.size))
        received = world.exchanged(given, lengths) if sizes.any() else given
        begins = np.cumsum(sizes[mine].T.ravel()).reshape(world.size, -1).T - sizes[mine]  # in what is received (own patches, ranks)
        answers: list[FloatArray] = [np.empty(0)] * len(mine)

        def solve(begin: int, end: int) -> None:
            for i in range(begin, end):
                p, own = mine[i], patches[mine[i]]
                shares = [received[first : first + size] for first, size in zip(begins[i], sizes[p], strict=True)]
                here = places[p][world.number]
                W_own = _summed(parts[i] if i < early else part(p), here, shares, places[p], len(own), d)
                answers[i] = solved(W_own, at.take(own)) - at.r[own]

        side_by_side([partial(solve, begin, end) for begin, end in pieces(len(mine), 1)])
        in_order = np.argsort(solver, kind="stable")
        counts = np.bincount(solver, [d * len(own) for own in patches], minlength=world.size).astype(np.int64)
        step = np.zeros_like(at.r)
        step[np.concatenate([patches[p] for p in in_order])] = world.gathered(_joined(answers), counts).reshape(-1, d)
    return step, few


def chosen_for_ranks(joints: JointsOfAll, missed: FloatArray, limit: float, ranks: int) -> tuple[list[IntArray], bool]:
    """The contacts of the patches that are chosen in one process, and up to a multiple of the ranks of those that follow: what is missed
    in these may be below `limit`, down to MORE of it. And whether no joint down to that was left where as many more were looked at."""
    nc = len(joints.order)
    most = SHARE * nc + ranks * PATCH_UP_TO
    patches = chosen(joints, missed, MORE * limit, most / nc)
    before = np.cumsum([0, *(len(own) for own in patches)])  # contacts of those before each
    middle = joints.joint[[own[0] for own in patches]]
    count = np.count_nonzero((before[:-1] < SHARE * nc) & (missed[middle] > limit))
    return patches[: count + -count % ranks], bool(before[-1] < most)


def _summed(own: FloatArray, own_places: IntArray, shares: list[FloatArray], places: list[IntArray], n: int, d: int) -> FloatArray:
    """W (n d, n d) of a patch from this rank's part of it at `own_places` of its contacts, and the others' shares, by rows up to the
    diagonal, empty: none."""
    W = own
    if len(own_places) < n:
        W = np.zeros((n * d, n * d))
        add_part(own, own_places, d, W)
    for share, at in zip(shares, places, strict=True):
        if len(share):
            add_lower(share, at, d, W)
    return W


def _joined(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate([np.empty(0), *(part.ravel() for part in parts)])
