"""The masonry wall: 12 elastic blocks in running bond between two platens, compressed and sheared.

The reference case of V. Acary, M. Brémond, F. Dubois on frictional contact between deformable bodies; FCLIB's set LowWall_FEM
("murette") comes from LMGC90 scripts of the same wall. See README.md beside this file.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim import (
    Case,
    ContactSurface,
    Detector,
    Gap,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    Step,
    Support,
    SurfacePair,
    Theta,
    build_model,
    contact_surface,
    main,
)
from fcsim.mesh import BlockKind, RunningBond, blocks_that_are, rigid_box, running_bond

GRAVITY = 9.81  # [m/s^2]
FRICTION = {"scripts": (0.53, 0.83), "paper": (0.83, 0.53)}  # between blocks, at the platens
SOLVER = {"deformable": "NSN-AC", "rigid": "PPA-NSN-AC", "mixed": "PPA-NSN-AC"}  # joints of rigid blocks are hyperstatic: W is singular


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one. solver: empty = the one of `SOLVER` for the kind of blocks."""

    courses: int = 3
    blocks: float = 3.5
    block_size: tuple[float, float, float] = (0.2, 0.1, 0.1)
    divisions: tuple[int, int, int] = (8, 4, 4)
    blocks_are: BlockKind = "deformable"
    E: float = 2.2e9
    nu: float = 0.2
    density: float = 2000.0
    beta: float = 0.05
    lumped: bool = True
    friction: Literal["scripts", "paper"] = "scripts"
    candidates: Literal["faces", "nodes", "gauss", "mortar", "mortar-faces", "segments"] = "faces"
    heads: bool = True
    alert: float = 2e-3
    compression: float = 30_000.0
    gravity_first: int = 1
    gravity_last: int = 19
    shear_velocity: float = -1e-3
    shear_start: float = 0.021
    shear_full: float = 0.040
    h: float = 1e-3
    theta: float = 0.5
    steps: int = 500
    driven: Literal["eliminated", "identity"] = "identity"
    solver: str = ""
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    wall = running_bond(p.courses, p.blocks, p.block_size, p.divisions, material=Material(p.E, p.nu, p.density))
    model = wall_model(wall, p)
    mu_blocks, mu_platens = FRICTION[p.friction]
    simulation = Simulation(
        model,
        Detector(wall_contacts(wall, model, p, mu_blocks, mu_platens), model.n_nodes),
        Theta(p.h, p.theta, Gap(recovery=np.inf)),
        p.steps,
        SolverSettings(name=p.solver or SOLVER[p.blocks_are], tol=p.tol),
    )
    top, bottom = model.number["top platen"], model.number["bottom platen"]
    course_weight = p.density * float(np.prod(wall.size)) / p.courses * GRAVITY
    # the top platen slides on the upper course at mu_platens, the upper course on the one below at mu_blocks and with its own weight
    bound = min(mu_platens * p.compression, mu_blocks * (p.compression + course_weight))
    where = "upper bed joint" if bound < mu_platens * p.compression else "top platen"
    return Case(
        name="masonry_wall",
        title="Masonry wall under compression and shear",
        simulation=simulation,
        sensors=(
            Sensor("top_x", "imposed displacement of the top platen along -x", "m", lambda s: platen_displacement(model, s, top)),
            Sensor("bottom_Rx", "horizontal reaction, bottom platen", "N", lambda s: float(-s.contact_force_on(bottom)[0])),
            Sensor("bottom_Rz", "vertical reaction, bottom platen", "N", lambda s: float(-s.contact_force_on(bottom)[2])),
            Sensor("top_Rx", "horizontal force, top platen", "N", lambda s: float(-s.contact_force_on(top)[0])),
            Sensor("top_Rz", "vertical force, top platen", "N", lambda s: float(-s.contact_force_on(top)[2])),
            Sensor("inertia_x", "rate of change of the blocks' momentum along x", "N", lambda s: momentum_rate(model, s)[0]),
            Sensor("inertia_z", "rate of change of vertical momentum, blocks and top platen", "N", lambda s: vertical_rate(model, s, top)),
        ),
        plots={"imposed": "top_x", "reaction": ("bottom_Rx", "top_Rx"), "bound": (bound, f"friction bound at the {where}")},
        fclib_set="FCSIM_LowWall_FEM",
        description=f"{len(wall.bodies)} blocks ({p.blocks_are}) and two rigid platens, {model.n_dofs} degrees of freedom",
    )


def wall_model(wall: RunningBond, p: Parameters) -> Model:
    """Blocks and platens; the bottom platen is held, the top one driven along x and free otherwise."""
    length, thickness, height = wall.size
    platen = (1.2 * length, 2 * thickness, p.block_size[2])
    mass = p.compression / GRAVITY
    middle = (length / 2, thickness / 2)
    top = rigid_box("top platen", platen, (*middle, height + platen[2] / 2), mass)
    bottom = rigid_box("bottom platen", platen, (*middle, -platen[2] / 2), mass)

    def gravity(t: float) -> np.ndarray:
        """A ramp over the steps after gravity_first up to gravity_last."""
        return np.array([0, 0, -np.interp(t / p.h, [p.gravity_first, p.gravity_last], [0.0, GRAVITY])])

    def shear(t: float) -> float:
        """Zero until shear_start, then a linear ramp to shear_velocity at shear_full."""
        return float(np.interp(t, [p.shear_start, p.shear_full], [0.0, p.shear_velocity]))

    return build_model(
        [*blocks_that_are(p.blocks_are, wall.bodies), bottom, top],
        supports=[
            Support("bottom platen", ("x", "y", "z", "rx", "ry", "rz")),
            Support("top platen", ("x",), velocity=shear),
        ],
        gravity=gravity,
        lumped=p.lumped,
        beta=p.beta,
        driven=p.driven,
        kinematics="linear",  # the benchmark is defined with small rotations; turning blocks would give other problems and files
    )


def wall_contacts(wall: RunningBond, model: Model, p: Parameters, mu_blocks: float, mu_platens: float) -> list[SurfacePair]:
    """Bed and head joints with the chosen candidates, platens with the nodes of the outer faces."""
    names = np.array([body.name for body in wall.bodies])
    lower, upper = names[wall.course < wall.courses], names[wall.course > 1]
    first, last = names[wall.bodies_of_course(1)], names[wall.bodies_of_course(wall.courses)]

    def surface(bodies: Iterable[str], side: str) -> ContactSurface:
        return contact_surface(model, [(name, side) for name in bodies])

    pairs = [
        SurfacePair(surface(first, wall.bottom), surface(["bottom platen"], "z+"), mu_platens, p.alert, "nodes", "bottom platen"),
        SurfacePair(surface(last, wall.top), surface(["top platen"], "z-"), mu_platens, p.alert, "nodes", "top platen"),
    ]
    if p.courses > 1:
        pairs.append(SurfacePair(surface(upper, wall.bottom), surface(lower, wall.top), mu_blocks, p.alert, p.candidates, "bed joints"))
    if p.heads:
        pairs.append(SurfacePair(surface(names, "x-"), surface(names, "x+"), mu_blocks, p.alert, p.candidates, "head joints"))
    return pairs


def platen_displacement(model: Model, step: Step, body: int) -> float:
    """Displacement of a platen against the x axis [m]: the default case drives it along -x."""
    return -float(step.state.x[model.dof_offset[body]])


def momentum_rate(model: Model, step: Step) -> np.ndarray:
    """(p+ - p-) / h of all blocks together (3,) [N]: what their reactions differ from statics by. The platens are the last two bodies."""
    change = model.apply_mass(step.state.v - step.previous.v)
    deformable, rigid = change[: model.n_elastic].reshape(-1, 3), model.rigid_part(change)[:-2, :3]
    rate: np.ndarray = (deformable.sum(axis=0) + rigid.sum(axis=0)) / (step.state.t - step.previous.t)
    return rate


def vertical_rate(model: Model, step: Step, platen: int) -> float:
    """The vertical rate of change of momentum [N] of the blocks and a platen."""
    change = model.apply_mass(step.state.v - step.previous.v)[model.dof_offset[platen] + 2]
    return float(momentum_rate(model, step)[2] + change / (step.state.t - step.previous.t))


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
