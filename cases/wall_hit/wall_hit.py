"""A dry wall in running bond is hit by a block, breaks through and comes to rest as rubble.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import (
    Body,
    Case,
    Everything,
    Gap,
    History,
    InputError,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    State,
    Support,
    Theta,
    at_rest,
    build_model,
    main,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import BlockKind, blocks_that_are, rigid_box, running_bond

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. blocks: bricks in a course; shot: side of the cube that hits; distance: from the wall at t = 0;
    height, along: where it hits, by the wall's height and length; E, nu, beta: of deformable bricks."""

    courses: int = 6
    blocks: float = 4.0
    block_size: tuple[float, float, float] = (0.4, 0.2, 0.2)
    divisions: tuple[int, int, int] = (2, 1, 1)
    blocks_are: BlockKind = "rigid"
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    beta: float = 1e-4
    shot: float = 0.25
    speed: float = 20.0
    distance: float = 0.1
    height: float = 0.6
    along: float = 0.45
    mu: float = 0.6
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 600
    solver: str = "auto"
    tol: float = 1e-5


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if not (p.speed >= 0 and p.distance >= 0 and p.shot > 0):
        raise InputError(f"wall_hit: expected speed, distance >= 0 and shot > 0, got {p.speed}, {p.distance}, {p.shot}")
    model = wall_model(p)
    ground, shot = model.number["ground"], model.number["shot"]
    start = at_rest(model)
    v = start.v.copy()
    v[model.dof_offset[shot] + 1] = p.speed
    weight = -float(model.load(0.0).sum()) - GRAVITY * model.rigid[ground - len(model.deformable)].mass  # gravity acts along z alone
    settings = SolverSettings(name=p.solver, tol=p.tol)
    simulation = Simulation(model, Everything(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, settings, State(0.0, start.x, v))
    return Case(
        name="wall_hit",
        title=f"A wall hit at {p.speed:g} m/s",
        simulation=simulation,
        sensors=(
            Sensor("shot_v", "velocity of what hits", "m/s", lambda s: float(s.state.v[model.dof_offset[shot] + 1])),
            Sensor("ground_Rz", "force on the ground", "N", lambda s: -float(s.contact_force_on(ground)[2])),
        ),
        plots={"reaction": ("ground_Rz",), "bound": (weight, "weight"), "histories": (History("velocity", ("shot_v",)),)},
        fclib_set="FCSIM_WallHit",
        description=f"a cube of {p.shot:g} m at {p.speed:g} m/s into {p.courses} courses of {p.blocks_are} bricks",
    )


def wall_model(p: Parameters) -> Model:
    """Bricks on a held ground, the length along x, and the cube before the wall."""
    wall = running_bond(p.courses, p.blocks, p.block_size, p.divisions, material=Material(p.E, p.nu, p.density))
    length, thickness, height = wall.size
    place = np.array([p.along * length, -p.distance - p.shot / 2, p.height * height])
    shot = rigid_box("shot", (p.shot,) * 3, place, p.density * p.shot**3)
    deep = 2.5 * length
    ground = rigid_box("ground", (4 * length, 1.6 * deep, thickness), (length / 2, 0.6 * deep, -thickness / 2), 1.0)
    bricks: list[Body] = list(wall.bodies)
    return build_model(
        [*blocks_that_are(p.blocks_are, bricks), shot, ground],
        supports=[Support("ground", DIRECTIONS[3])],
        gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]),
        beta=p.beta,
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
