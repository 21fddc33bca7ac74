"""Patches of joints over ranks: which there are follows from all joints, as in one process; each is solved by one rank.

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
from fcsim.solvers.newton.systems.two_level.patches import chosen, joints_beside, missed_by_joints, solved
from fcsim.threads import pieces, side_by_side

SHARE = 0.02
"""Of all contacts that a round's patches have about, at the most: of a wall of 192 bricks two patches, one for each of two ranks."""


class JointsOfAll:
    """The joints of all ranks, as `Joints` has those of one process: contacts of pairs of `count` bodies, `order` those of all contacts
    joint by joint, `cuts` their ends; bodies (nc, 2) by that order."""

    def __init__(self, bodies: IntArray, count: int) -> None:
        """bodies (nc, 2): by contacts, -1 for none."""
        self.count = count
        number, joint = np.unique(numbers_of_pairs(bodies, count), return_inverse=True)
        self.order = np.argsort(joint, kind="stable")
        self.cuts = np.searchsorted(joint[self.order], np.arange(len(number) + 1))
        self.bodies = bodies[self.order]

    @cached_property
    def beside(self) -> tuple[IntArray, IntArray]:
        """The joints that have a body in common with each joint, see `joints_beside`."""
        return joints_beside(self.bodies[self.cuts[:-1]], self.count)


def patched_over_ranks(
    joints: JointsOfAll,
    W: DistributedDelassus,
    u: FloatArray,
    r: FloatArray,
    mu: FloatArray,
    rho: FloatArray,
    weight: FloatArray,
    limit: float,
) -> FloatArray | None:
    """What r (nc, d) moves by in a round of patches, as `patched`, on all ranks, which have all arguments; None where there are none."""
    layout, d = W.layout, r.shape[1]
    world = layout.world
    patches = chosen(joints, missed_by_joints(joints, u, r, mu, rho, weight), limit, SHARE)
    if not patches:
        return None
    places = [[np.flatnonzero(known) for known in layout.known[:, own]] for own in patches]
    solver = solvers_of(patches, np.array([[len(at) for at in of_ranks] for of_ranks in places]))
    mine = np.flatnonzero(solver == world.number)
    with layout.together("patches of joints"):
        blocks = [W.own_part(own[at[world.number]]) for own, at in zip(patches, places, strict=True)]
    with world.unasked("patches of joints"):
        sent = solver[:, None] != np.arange(world.size)  # (patches, ranks)
        sizes = np.array([[(d * len(at)) ** 2 for at in of_ranks] for of_ranks in places]) * sent
        given = _joined([block for block, other in zip(blocks, sent[:, world.number], strict=True) if other])
        received = [np.empty(0)] * sizes.size
        if sizes.any():
            received = np.split(world.gathered(given, sizes.sum(axis=0)), np.cumsum(sizes.T.ravel())[:-1])
        shares = [[blocks[p] if k == world.number else received[k * len(patches) + p] for k in range(world.size)] for p in mine]
        del blocks, received
        answers: list[FloatArray] = [np.empty(0)] * len(mine)

        def solve(begin: int, end: int) -> None:
            for i in range(begin, end):
                own, W_own = patches[mine[i]], _summed(shares[i], places[mine[i]], len(patches[mine[i]]), d)
                answers[i] = solved(W_own, u[own], r[own], mu[own], rho[own], weight[own]) - r[own]

        side_by_side([partial(solve, begin, end) for begin, end in pieces(len(mine), 1)])
        in_order = np.argsort(solver, kind="stable")
        counts = np.bincount(solver, [d * len(own) for own in patches], minlength=world.size).astype(np.int64)
        step = np.zeros_like(r)
        step[np.concatenate([patches[p] for p in in_order])] = world.gathered(_joined(answers), counts).reshape(-1, d)
    return step


def solvers_of(patches: list[IntArray], known: IntArray) -> IntArray:
    """The rank (patches,) that solves each: the one that has least to do so far, of several the one that knows most of its contacts, of
    which each rank knows known (patches, ranks)."""
    work, solver = np.zeros(known.shape[1]), np.empty(len(patches), dtype=np.int64)
    for p, own in enumerate(patches):
        free = np.flatnonzero(work <= work.min() + 0.5 * len(own) ** 3)  # half a patch is no reason to send one
        solver[p] = free[np.argmax(known[p, free])]
        work[solver[p]] += len(own) ** 3
    return solver


def _summed(shares: list[FloatArray], places: list[IntArray], n: int, d: int) -> FloatArray:
    """W (n d, n d) of a patch from what ranks have of it at `places` of its contacts."""
    if len(places[0]) == n and not any(len(at) for at in places[1:]):
        return shares[0].reshape(n * d, n * d)
    W = np.zeros((n, d, n, d))
    for own, at in zip(shares, places, strict=True):
        W[at[:, None], :, at] += own.reshape(len(at), d, len(at), d).transpose(0, 2, 1, 3)
    return W.reshape(n * d, n * d)


def _joined(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate([np.empty(0), *(part.ravel() for part in parts)])
