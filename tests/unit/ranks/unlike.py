"""Small models of unlike bodies whose W is shared by the ranks, for `test_unlike.py`. Run as a program under mpiexec, each rank writes what
it has found of a model as JSON into the folder that it is given; with a third word a rank's product with W raises that error."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.linear.factors import SingularMatrix
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Placed
from fcsim.problem.distributed import DistributedDelassus, SharesByParts
from fcsim.ranks import sharing
from fcsim.solvers import SOLVERS
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta
from tests.unit.ranks.walls import digest

STONE, SOFT, STEEL = Material(1e10, 0.2, 2400.0), Material(1e8, 0.35, 1200.0), Material(2.1e11, 0.3, 7800.0)
TOLERANCE, FAILING = 1e-8, 1


def on_a_floor(bodies: list[Body], scheme: Scheme, steps: int, gravity: Callable[[float], tuple[float, float, float]]) -> Simulation:
    floor = rigid_box("floor", (2, 2, 0.4), (0, 0, -0.2), 1.0)
    placed: list[Placed] = [*bodies, floor]
    support = Support("floor", ("x", "y", "z", "rx", "ry", "rz"))
    model = build_model(placed, supports=[support], gravity=gravity, lumped=False, beta=1e-4)
    return Simulation(model, Everything(model, 0.5), scheme, steps, SolverSettings(name="NSN-AC", tol=TOLERANCE))


def lever() -> Simulation:
    """A bar on a block with a small block at each end: joints of four contacts, fewer than the bodies' twelve motions ask for."""
    parts = (
        (brick("block", (0.1, 0.1, 0.1), (1, 1, 1), STONE, "tetrahedron"), (0.0, 0.0, 0.0)),
        (brick("bar", (0.6, 0.1, 0.05), (3, 1, 1), SOFT), (-0.25, 0.0, 0.1)),
        (brick("right", (0.08, 0.06, 0.05), (1, 1, 1), STEEL), (0.27, 0.07, 0.15)),
        (brick("left", (0.08, 0.06, 0.05), (1, 1, 1), STEEL), (-0.22, -0.03, 0.15)),
    )
    bodies = [Body(part.name, part, translation=np.array(place)) for part, place in parts]
    return on_a_floor(bodies, Theta(1e-3), 3, lambda t: (0.0, 0.0, -9.81))


def tower(scheme: Scheme, elements: str | None, gravity: Callable[[float], tuple[float, float, float]]) -> Simulation:
    """Four blocks of unlike sizes, meshes and materials on each other."""
    blocks = (
        ((0.5, 0.4, 0.2), (4, 3, 2), STONE),
        ((0.3, 0.35, 0.1), (3, 3, 1), SOFT),
        ((0.36, 0.2, 0.25), (2, 2, 2), STEEL),
        ((0.2, 0.2, 0.15), (1, 2, 1), STONE),
    )
    bodies, z = [], 0.0
    for k, (size, divisions, material) in enumerate(blocks):
        part = brick(f"block {k}", size, divisions, material, elements=elements)
        bodies.append(Body(part.name, part, translation=np.array([0.01 * k - size[0] / 2, -0.013 * k - size[1] / 2, z])))
        z += size[2]
    return on_a_floor(bodies, scheme, 2, gravity)


MODELS: dict[str, Callable[[], Simulation]] = {
    "lever": lever,
    "tower of quadratic cells": lambda: tower(Theta(1e-3), "Q2", lambda t: (1.0, 0.5, -9.81)),
    "tower in statics": lambda: tower(QuasiStatic(0.25, eta=1e-4), None, lambda t: (min(t, 1), 0.0, -9.81 * min(t, 1))),
}


def found(name: str) -> list[dict[str, object]]:
    return [
        {
            "contacts": step.contacts.identity.tolist(),
            "force": (-step.contact_force_on(step.model.number["floor"])).tolist(),
            "r": step.result.r.tolist(),
            "digest": digest(np.concatenate([step.result.r, step.state.x, step.state.v])),
            "iterations": sum(attempt.iterations for attempt in step.attempts),
            "distributed": isinstance(step.reduction.local.W, DistributedDelassus),
        }
        for step in MODELS[name]()
    ]


def failing(kind: str, rank: int, folder: Path) -> None:
    """Let the fifth product with W of one rank raise an error, beside a file that says when."""
    error = {"MemoryError": MemoryError("no room"), "SingularMatrix": SingularMatrix("a pivot is zero")}[kind]
    product, count = SharesByParts.of, iter(range(1000))

    def spoiled(self: SharesByParts, W: DistributedDelassus, x: np.ndarray) -> np.ndarray:
        if rank == FAILING and next(count) == 4:
            folder.joinpath("failed").touch()
            raise error
        return product(self, W, x)

    SharesByParts.of = spoiled  # type: ignore[method-assign]


def main(folder: Path, failure: str = "") -> None:
    on_any_model = replace(SOLVERS["NSN-AC"], over_ranks_from=0.0)  # so small a one is not worth it
    with sharing() as ranks, mock.patch.dict(SOLVERS, {"NSN-AC": on_any_model}):
        assert ranks is not None
        if failure:
            failing(failure, ranks.number, folder)
            found("lever")
        answer = {name: found(name) for name in MODELS}
        (folder / f"{ranks.number}.json").write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
