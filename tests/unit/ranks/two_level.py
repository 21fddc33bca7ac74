"""What ranks make together of Newton's linear system on a wall, see `test_two_level.py`. `main` has each rank write what it has as
JSON into a folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from fcsim.arrays import FloatArray
from fcsim.problem import Delassus
from fcsim.problem.distributed import DistributedDelassus
from fcsim.ranks import sharing
from fcsim.solvers import SOLVERS
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems.over_ranks import SystemOverRanks
from fcsim.solvers.newton.systems.two_level.over_ranks import patches
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.over_ranks.system import TwoLevelOverRanks
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate
from tests.unit.ranks.walls import simulation
from tests.unit.solvers.newton.systems.test_two_level import linearisation

NEAR, FAR = 0.2, 0.0
"""What is `needed` of a system: its defect is measured in the residual, and as reactions."""


WORST = 7
"""A contact whose joint is farther from solved than all others."""


def unsolved(diagonal: FloatArray) -> tuple[ContactIterate, list[float]]:
    """Contacts, half of which are beyond friction; limits above which many joints, one, and none are."""
    nc, rng = len(diagonal), np.random.default_rng(3)
    r = np.zeros((nc, 3))
    r[:, 0] = rng.uniform(1.0, 2.0, nc)
    r[: nc // 2, 1:] = 0.6 * rng.standard_normal((nc // 2, 2))
    r[WORST, 1:] = 10.0, 5.0
    given = ContactIterate(np.zeros((nc, 3)), r, np.full(nc, 0.5), 1 / diagonal, diagonal.mean(1))
    missed = given.weight[:, None] * alart_curnier(given.u, given.r, given.mu, given.rho)[0]
    total = float(np.linalg.norm(missed))
    return given, [1e-6 * total, 0.9 * float(np.linalg.norm(missed[WORST])), 2 * total]


def blocks_of_all(nc: int) -> tuple[FloatArray, FloatArray]:
    """A and B (nc, 3, 3), some of which are a diagonal alone and nothing."""
    A, B = np.tile(2 * np.eye(3), (nc, 1, 1)), np.tile(np.eye(3), (nc, 1, 1))
    A[1::3, 0, 1], B[::3] = 1.0, 0.0
    return A, B


def in_patches(W: DistributedDelassus, A: FloatArray, B: FloatArray, rhs: FloatArray) -> dict[str, object]:
    """What patches that are solved move by, before a system was solved, after it, and where all of W is used."""
    system = SystemOverRanks(Delassus(W, 3), lambda whole: pytest.fail("the ranks' system is enough"))
    space = LocalSpace(system, np.zeros(rhs.size), np.zeros(rhs.size))
    given, limits = unsolved(W.diagonal().reshape(rhs.shape))
    before = system.settled(given, limits[0]) is None
    system.solve(A, B, rhs)
    with mock.patch.multiple(patches, SHARE=1.0, MORE=1.0):  # all above the limit that have no joint in common, and no others
        found, knows = [system.settled(given, limit) for limit in limits], space.knows_joints
    assert system._two_level is not None
    system._two_level.pays = False
    after = system.settled(given, limits[0]) is None
    return {
        "settled": [None if own is None else [part.tolist() for part in own] for own in found],
        "knows": [knows, space.knows_joints],
        "nowhere": [before, after],
    }


def made_together(W: DistributedDelassus) -> dict[str, object]:
    """Products, the preconditioner before and after contacts changed, solutions, and of what size this rank's part is."""
    behind = W.bodies
    assert behind is not None
    bodies = behind.bodies
    assert bodies is not None
    joints = OwnJoints(W, behind, bodies, {})
    parts = joints.parts
    asked: list[int] = []

    def make_h(some: np.ndarray | None) -> tuple[np.ndarray, ...]:
        asked.append(W.layout.nc if some is None else len(some))
        return behind.make_h(some)

    counted = replace(behind, make_h=make_h)
    again = OwnJoints(W, counted, bodies, joints.pattern)
    compared = OwnJoints(W, counted, bodies, joints.pattern | {"made_of": ()})
    moved = (np.roll(joints.entries[0], 1), *joints.entries[1:])
    other = OwnJoints(W, behind, bodies, joints.pattern | {"entries": moved, "made_of": ()})
    x = np.random.default_rng(2).standard_normal((W.layout.nc, W.layout.dimension))
    own = x[parts.own]
    A, B = linearisation(len(x), float(W.diagonal().mean()))
    P = PreconditionerOverRanks(joints, W.layout)
    P.update(A[joints.halo.contacts], B[joints.halo.contacts], place=joints.in_halo)
    wide = x[joints.halo.contacts].astype(np.float32).ravel()
    first = P(wide).reshape(-1, 3)
    kept = P.following(bodies, joints.diagonal_of_W)
    assert kept is not None
    changed_A, changed_B = A.copy(), B.copy()
    changed_A[::7], changed_B[::7] = 0, np.eye(3)
    kept.update(changed_A[joints.order], changed_B[joints.order])
    after = kept(wide).reshape(-1, 3)
    of_bodies = np.concatenate([parts.own, joints.shares.foreign])
    blocks = blocks_of_all(len(x))
    share = joints.shares.applied(*(every[of_bodies] for every in blocks))(joints.shares.of(W, x[of_bodies]), x[of_bodies])
    joined = joints.halo.joined(share.ravel(), np.array([1.0, parts.world.number]))
    solved = [TwoLevelOverRanks(W, behind).solve(A, B, x, needed) for needed in (NEAR, FAR)]
    return {
        "product": parts.whole(joints.shares.product(W, own)).ravel().tolist(),
        "preconditioned": parts.whole(first[: len(own)]).ravel().tolist(),
        "changed": parts.whole(after[: len(own)]).ravel().tolist(),
        "of others": [joints.shares.foreign.tolist(), first[len(own) :].tolist(), after[len(own) :].tolist()],
        "given away": [P.given_away, P.following(bodies, joints.diagonal_of_W) is None, kept.given_away],
        "solved": [[part.tolist() for part in found] for found in solved if found is not None],
        "own": parts.own.tolist(),
        "halo": joints.halo.contacts.tolist(),
        "joined": [joined[0].tolist(), joined[1], joined[2].tolist()],
        "entries": len(joints.E),
        "taken over": [new.halo is joints.halo and new.coarse is joints.coarse for new in (again, compared, other)],
        "contacts of h": [asked, len(joints.order), W.layout.nc],
        "the same": [np.array_equal(new.E, joints.E) and np.array_equal(new.order, joints.order) for new in (again, compared, other)],
        **in_patches(W, A, B, x),
        "refused": kept.following(bodies, 2 * joints.diagonal_of_W) is None,
    }


def main(folder: Path) -> None:
    on_any_wall = replace(SOLVERS["NSN-AC"], over_ranks_from=0.0)  # so small a one is not worth it
    with sharing() as ranks, mock.patch.dict(SOLVERS, {"NSN-AC": on_any_wall}):
        assert ranks is not None
        posed = iter(simulation("NSN-AC", 2)[0])
        next(posed)
        W = next(posed).reduction.local.W
        assert isinstance(W, DistributedDelassus)
        (folder / f"{ranks.number}.json").write_text(json.dumps(made_together(W)), encoding="utf-8")
