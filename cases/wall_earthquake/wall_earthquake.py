"""A dry masonry wall on a base that follows an acceleration record, after it has come to rest under its weight.

Statics first: the weight in load steps, every block free, held by contact alone. Then the base moves with the velocity that the record
integrates to. See README.md beside this file.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from fcsim import (
    AccelerationRecord,
    Case,
    ContactSurface,
    Detector,
    Gap,
    GravityRamp,
    History,
    Material,
    Model,
    QuasiStatic,
    Sensor,
    Simulation,
    SolverSettings,
    State,
    Support,
    SurfacePair,
    Theta,
    at_rest,
    build_model,
    contact_force,
    contact_surface,
    displacement,
    joint_opening,
    main,
    read_acceleration_record,
    two_pass,
)
from fcsim.mesh import RunningBond, rigid_box, running_bond

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one."""

    courses: int = 5
    blocks: float = 2.5
    block_size: tuple[float, float, float] = (0.2, 0.1, 0.1)
    divisions: tuple[int, int, int] = (4, 2, 2)
    E: float = 2.2e9
    nu: float = 0.2
    density: float = 2000.0
    beta: float = 1e-4
    friction: float = 0.53
    friction_base: float = 0.83
    alert: float = 2e-3
    record: str = "ricker.csv"
    scale: float = 1.5
    direction: Literal["x", "y"] = "x"
    load_steps: int = 5
    eta: float = 1.0
    h: float = 1e-3
    theta: float = 0.5
    steps: int = 800
    solver: str = "PPA-NSN-AC"
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters: the wall at rest at t = 0, when the record begins."""
    beside = Path(__file__).parent / p.record
    record = read_acceleration_record(beside if beside.is_file() else p.record).scaled(p.scale)
    wall = running_bond(p.courses, p.blocks, p.block_size, p.divisions, material=Material(p.E, p.nu, p.density))
    model = wall_on_base(wall, p, record)
    detector = Detector(joints(wall, model, p), model.n_nodes)
    settings = SolverSettings(name=p.solver, tol=p.tol)
    initial = under_its_weight(model, detector, p, settings)
    weight = p.density * float(np.prod(wall.size)) * GRAVITY
    left, right = (wall.bodies[k].name for k in wall.head_joints()[0])
    top_left, top_right = (wall.bodies[k].name for k in wall.head_joints()[-1])
    corner = (float(wall.size[0]), 0.0, float(wall.size[2]))
    last, base_point = wall.bodies[-1].name, (0.5 * float(wall.size[0]), 0.5 * float(wall.size[1]), 0.0)
    return Case(
        name="wall_earthquake",
        title=f"Masonry wall shaken along {p.direction}",
        simulation=Simulation(model, detector, Theta(p.h, p.theta, Gap()), p.steps, settings, initial),
        sensors=(
            Sensor("base_a", "acceleration of the base", "m/s^2", lambda step: record(step.state.t)),
            displacement("base_u", model, "base", p.direction, base_point, "base"),
            displacement("top_u", model, last, p.direction, corner, "top corner of the wall"),
            contact_force("base_shear", model, "base", p.direction, label=f"force of the wall on the base, {p.direction}"),
            contact_force("base_Rz", model, "base", "z", label="force of the wall on the base, z"),
            joint_opening("bottom_joint", model, (left, "x+"), (right, "x-"), "head joint, bottom course"),
            joint_opening("top_joint", model, (top_left, "x+"), (top_right, "x-"), "head joint, top course"),
        ),
        plots={
            "histories": (
                History("record", ("base_a",)),
                History("displacement", ("base_u", "top_u")),
                History("openings", ("bottom_joint", "top_joint")),
                History("base_force", ("base_shear", "base_Rz")),
            )
        },
        fclib_set="FCSIM_WallEarthquake",
        description=f"{len(wall.bodies)} elastic blocks of {weight:.0f} N on a moving base, {model.n_dofs} degrees of freedom",
    )


def wall_on_base(wall: RunningBond, p: Parameters, record: AccelerationRecord) -> Model:
    """Blocks that nothing holds but contact, on a rigid base that the record moves."""
    length, thickness, _ = wall.size
    base = rigid_box("base", (2 * length, 4 * thickness, p.block_size[2]), (length / 2, thickness / 2, -p.block_size[2] / 2), 100.0)
    others = tuple(direction for direction in ("x", "y", "z", "rx", "ry", "rz") if direction != p.direction)
    return build_model(
        [*wall.bodies, base],
        supports=[Support("base", others), Support("base", (p.direction,), velocity=record.velocity)],
        gravity=GravityRamp((0.0, 0.0, -GRAVITY), -1.0, 0.0),
        beta=p.beta,
    )


def joints(wall: RunningBond, model: Model, p: Parameters) -> list[SurfacePair]:
    """Candidates are nodes; bed joints in two passes, since a block rocks about edges of its own and of the one below."""
    names = np.array([body.name for body in wall.bodies])

    def surface(bodies: Iterable[str], side: str) -> ContactSurface:
        return contact_surface(model, [(name, side) for name in bodies])

    first = names[wall.bodies_of_course(1)]
    base = SurfacePair(surface(first, wall.bottom), surface(["base"], "z+"), p.friction_base, p.alert, "nodes", "base")
    heads = SurfacePair(surface(names, "x-"), surface(names, "x+"), p.friction, p.alert, "nodes", "head joints")
    if p.courses == 1:
        return [base, heads]
    lower, upper = names[wall.course < wall.courses], names[wall.course > 1]
    return [base, *two_pass(surface(upper, wall.bottom), surface(lower, wall.top), p.friction, p.alert, "nodes", "bed joints"), heads]


def under_its_weight(model: Model, detector: Detector, p: Parameters, settings: SolverSettings) -> State:
    """The wall at rest at t = 0, its weight applied in load steps from t = -1 s on; the mass regularises what only contact holds.

    What the statics leave out of balance, the wall swings with afterwards: they are solved a hundred times more precisely.
    """
    precise = replace(settings, tol=1e-2 * p.tol)
    statics = Simulation(model, detector, QuasiStatic(1 / p.load_steps, p.eta), p.load_steps, precise, at_rest(model, -1.0))
    *_, last = statics
    return State(0.0, last.state.x, np.zeros(model.n_dofs))


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
