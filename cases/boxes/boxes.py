"""A thousand rigid boxes fall on each other, course on course, and come to rest.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim import (
    Case,
    Everything,
    Gap,
    History,
    InputError,
    Model,
    RigidBody,
    Sensor,
    Simulation,
    SolverSettings,
    Support,
    Theta,
    build_model,
    main,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import rigid_box

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. across: boxes along an edge of the pile; gap: between boxes at the start, by their side;
    turn: the largest angle about the vertical by which boxes are turned at random [degrees]; shift: of every second course by the pitch."""

    across: int = 10
    side: float = 0.1
    gap: float = 0.02
    turn: float = 0.5
    shift: float = 0.25
    density: float = 2000.0
    mu: float = 0.5
    seed: int = 1
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 150
    solver: str = "auto"
    tol: float = 1e-6


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if p.across < 1 or not (p.side > 0 and p.gap >= 0.0 and 0.0 <= p.turn <= 45.0):
        raise InputError("boxes: expected across >= 1, side > 0, gap >= 0 and a turn between 0 and 45 degrees")
    if not 0.0 <= p.shift <= 0.5:
        raise InputError(f"boxes: expected a shift between 0 and 0.5 of the pitch, got {p.shift:g}")
    if 2 * np.sin(np.deg2rad(p.turn) / 2) > p.gap:
        raise InputError(f"boxes: expected a gap that boxes turned by {p.turn:g} degrees leave open, got {p.gap:g} of the side")
    model = boxes_model(p)
    floor, count = model.number["floor"], p.across**3
    weight = GRAVITY * p.density * p.side**3 * count
    simulation = Simulation(model, Everything(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, SolverSettings(name=p.solver, tol=p.tol))
    return Case(
        name="boxes",
        title=f"{count} boxes fall on each other",
        simulation=simulation,
        sensors=(
            Sensor("floor_Rz", "force on the floor", "N", lambda s: -float(s.contact_force_on(floor)[2])),
            Sensor("height", "fall of the centre of mass", "m", lambda s: -float(model.rigid_part(s.state.x)[:count, 2].mean())),
            Sensor("fastest", "largest velocity", "m/s", lambda s: float(np.linalg.norm(model.rigid_part(s.state.v)[:, :3], axis=1).max())),
        ),
        plots={"reaction": ("floor_Rz",), "bound": (weight, "weight"), "histories": (History("height", ("height",)),)},
        fclib_set="FCSIM_Boxes",
        description=f"{count} rigid cubes of {p.side:g} m, mu = {p.mu:g}",
    )


def boxes_model(p: Parameters) -> Model:
    """Courses of across x across cubes above a floor, every second one shifted both ways."""
    rng = np.random.default_rng(p.seed)
    pitch, n = p.side * (1 + p.gap), p.across
    cube = rigid_box("cube", (p.side,) * 3, (0, 0, 0), p.density * p.side**3)
    bodies: list[RigidBody] = []
    for k, j, i in np.ndindex(n, n, n):
        shift = p.shift * (k % 2)
        place = np.array([(i + shift - n / 2) * pitch, (j + shift - n / 2) * pitch, k * pitch + 0.5 * p.side + p.gap * p.side])
        R = Rotation.from_euler("z", rng.uniform(-p.turn, p.turn), degrees=True)
        bodies.append(RigidBody(f"box {k} {j} {i}", cube.mass, cube.inertia, place, R.apply(cube.points) + place, cube.surfaces))
    wide = 4 * n * p.side
    bodies.append(rigid_box("floor", (wide, wide, p.side), (0, 0, -p.side / 2), 1.0))
    return build_model(bodies, supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]))


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
