"""A stack of equal bricks that leans over the edge of a table: it stands up to the largest overhang (L/2) (1 + 1/2 + ... + 1/n).

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fcsim import (
    Body,
    Case,
    Detector,
    Gap,
    InputError,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    Support,
    SurfacePair,
    Theta,
    build_model,
    contact_surface,
    main,
    two_pass,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.memory import refuse_beyond_memory
from fcsim.mesh import BlockKind, blocks_that_are, brick, rigid_box

GRAVITY = 9.81  # [m/s^2]
BYTES_PER_BRICK = 2e4


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units.

    overhang: of each brick over the one below, relative to the largest that stands; lumped: the mass of deformable bricks on their nodes,
    which makes them fall late
    """

    bricks: int = 4
    size: tuple[float, float, float] = (0.4, 0.1, 0.1)
    divisions: tuple[int, int, int] = (4, 1, 1)
    overhang: float = 0.97
    blocks_are: BlockKind = "rigid"
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    lumped: bool = False
    beta: float = 2e-3
    mu: float = 0.6
    alert: float = 5e-3
    gravity_ramp: float = 0.05
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 150
    solver: str = "PPA-NSN-AC"
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if p.bricks < 1:
        raise InputError(f"stack, bricks: expected a whole number >= 1, got {p.bricks}")
    refuse_beyond_memory(f"stack: {p.bricks} bricks", BYTES_PER_BRICK * p.bricks)
    model = stack_model(p)
    table, top = model.number["table"], model.number[f"brick {p.bricks}"]
    detector = Detector(stack_contacts(model, p), model.n_nodes)
    simulation = Simulation(model, detector, Theta(p.h, p.theta, Gap()), p.steps, SolverSettings(name=p.solver, tol=p.tol))
    tip = np.flatnonzero(model.reference[:, 0] > model.reference[model.node_offset[top] :, 0].max() - 1e-9)
    weight = p.bricks * p.density * float(np.prod(p.size)) * GRAVITY
    reach = p.overhang * p.size[0] / 2 * sum(1 / k for k in range(1, p.bricks + 1))
    return Case(
        name="stack",
        title=f"{p.bricks} bricks, {p.overhang:g} of the largest overhang",
        simulation=simulation,
        sensors=(
            Sensor("table_Rz", "force on the table", "N", lambda s: -float(s.contact_force_on(table)[2])),
            Sensor("sinking", "sinking of the tip", "m", lambda s: -float(model.node_displacement(s.state.x)[tip, 2].mean())),
        ),
        plots={"reaction": ("table_Rz",), "bound": (weight, "weight of the stack")},
        fclib_set="FCSIM_Stack",
        description=f"{p.bricks} bricks ({p.blocks_are}) that reach {reach:.3f} m over the edge, {model.n_dofs} degrees of freedom",
    )


def stack_model(p: Parameters) -> Model:
    """Bricks on a held table whose edge is at x = 0; from below to above each overhangs by overhang L / (2 k), k = n ... 1."""
    length, depth, height = p.size
    part = brick("brick", p.size, p.divisions, Material(p.E, p.nu, p.density))
    ends = np.cumsum([p.overhang * length / (2 * k) for k in range(p.bricks, 0, -1)])
    bodies = [Body(f"brick {j + 1}", part, translation=np.array([end - length, 0.0, j * height])) for j, end in enumerate(ends)]
    table = rigid_box("table", (2 * length, depth, height), (-length, depth / 2, -height / 2), 1.0)
    return build_model(
        [*blocks_that_are(p.blocks_are, bodies), table],
        supports=[Support("table", DIRECTIONS[3])],
        gravity=lambda t: np.array([0.0, 0.0, -GRAVITY * min(t / p.gravity_ramp, 1.0)]),
        lumped=p.lumped,
        beta=p.beta,
    )


def stack_contacts(model: Model, p: Parameters) -> list[SurfacePair]:
    """All joints by the nodes of both sides: a brick tips about the edge below it, on which its own nodes do not lie."""
    pairs: list[SurfacePair] = []
    for lower, upper in pairwise(["table", *(f"brick {j + 1}" for j in range(p.bricks))]):
        above, below = contact_surface(model, [(upper, "z-")]), contact_surface(model, [(lower, "z+")])
        pairs += two_pass(above, below, mu=p.mu, alert=p.alert)
    return pairs


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
