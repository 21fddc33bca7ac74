"""What ranks make together of Newton's linear system on a wall, see `test_two_level.py`. Run as a program under mpiexec, each rank writes
what it has as JSON into the folder that it is given."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from fcsim.problem.distributed import DistributedDelassus
from fcsim.ranks import sharing
from fcsim.solvers import SOLVERS
from fcsim.solvers.newton.systems.two_level.over_ranks.joints import OwnJoints, parts_by_joints
from fcsim.solvers.newton.systems.two_level.over_ranks.preconditioner import PreconditionerOverRanks
from fcsim.solvers.newton.systems.two_level.over_ranks.system import ProductByParts, TwoLevelOverRanks
from tests.unit.ranks.walls import simulation
from tests.unit.solvers.newton.systems.test_two_level import linearisation

NEAR, FAR = 0.2, 0.0
"""What is `needed` of a system: its defect is measured in the residual, and as reactions."""


def made_together(W: DistributedDelassus) -> dict[str, object]:
    """Products, the preconditioner before and after contacts changed, solutions, and of what size this rank's part is."""
    behind = W.bodies
    assert behind is not None
    sides = behind.sides()
    assert sides is not None
    parts = parts_by_joints(W, behind, sides[0])
    joints = OwnJoints(W, behind, parts, *sides)
    x = np.random.default_rng(2).standard_normal((W.layout.nc, W.layout.dimension))
    own = x[parts.own]
    A, B = linearisation(len(x), float(W.diagonal().mean()))
    P = PreconditionerOverRanks(joints, W.layout)
    P.update(A, B)
    first = parts.whole(P(own.ravel()).reshape(own.shape))
    kept = P.following(sides[0], joints.diagonal_of_W)
    assert kept is not None
    changed_A, changed_B = A.copy(), B.copy()
    changed_A[::7], changed_B[::7] = 0, np.eye(3)
    kept.update(changed_A, changed_B)
    solved = [TwoLevelOverRanks(W, behind).solve(A, B, x, needed) for needed in (NEAR, FAR)]
    return {
        "product": parts.whole(ProductByParts(W, parts)(own)).ravel().tolist(),
        "preconditioned": first.ravel().tolist(),
        "changed": parts.whole(kept(own.ravel()).reshape(own.shape)).ravel().tolist(),
        "before": parts.whole(P(own.ravel()).reshape(own.shape)).ravel().tolist(),
        "solved": [[part.tolist() for part in found] for found in solved if found is not None],
        "own": parts.own.tolist(),
        "entries": len(joints.E),
        "refused": kept.following(sides[0], 2 * joints.diagonal_of_W) is None,
    }


if __name__ == "__main__":
    with sharing() as ranks:
        assert ranks is not None
        SOLVERS["NSN-AC"] = replace(SOLVERS["NSN-AC"], over_ranks_from=0.0)  # so small a wall is not worth it
        posed = iter(simulation("NSN-AC", 2)[0])
        next(posed)
        W = next(posed).reduction.local.W
        assert isinstance(W, DistributedDelassus)
        Path(sys.argv[1], f"{ranks.number}.json").write_text(json.dumps(made_together(W)), encoding="utf-8")
