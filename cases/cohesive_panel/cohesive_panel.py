"""A masonry panel with mortar joints, sheared under a held load: joints crack, a bed joint slides, friction is left.

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
    Cohesive,
    Detector,
    InputError,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    Springs,
    Support,
    SurfacePair,
    Theta,
    build_model,
    contact_surface,
    main,
)
from fcsim.assembly.loads import Force
from fcsim.mesh import Part, rectangle, rigid_rectangle
from fcsim.running.sensors import support_force


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. Mortar: tension, shear [Pa], mode_1, mode_2 [J/m^2] and mu as `Cohesive` has them, stiffness
    [Pa/m] normal and tangential. pressure [Pa] comes on the top within `ramp` [s], then the top is pushed, after another `ramp` with
    `speed` [m/s]. width: of the panel in bricks."""

    courses: int = 6
    width: int = 3
    brick: tuple[float, float] = (0.25, 0.1)
    thickness: float = 0.1
    divisions: tuple[int, int] = (4, 2)
    E: float = 16.7e9
    nu: float = 0.15
    density: float = 2000.0
    tension: float = 0.25e6
    shear: float | None = None
    mode_1: float = 18.0
    mode_2: float = 125.0
    mu: float = 0.75
    stiffness: tuple[float, float] = (82e9, 36e9)
    pressure: float = 0.3e6
    ramp: float = 0.02
    speed: float = 0.02
    beta: float = 1e-5
    alert: float = 2e-3
    h: float = 5e-4
    theta: float = 1.0
    steps: int = 320
    solver: str = "auto"
    tol: float = 1e-6


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    if p.courses < 2 or p.width < 2:
        raise InputError(f"cohesive_panel: expected courses >= 2 and width >= 2, got {p.courses} and {p.width}")
    model, joints = panel(p)
    pairs = [
        SurfacePair(
            contact_surface(model, [slave]), contact_surface(model, [master]), p.mu, p.alert, "faces", name=f"{slave[0]} on {master[0]}"
        )
        for slave, master in joints
    ]
    springs = Springs(normal=p.stiffness[0], tangential=p.stiffness[1])
    law = Cohesive(tension=p.tension, shear=p.shear, mode_1=p.mode_1, mode_2=p.mode_2, springs=springs)
    scheme = Theta(p.h, p.theta, law)
    settings = SolverSettings(name=p.solver, tol=p.tol)
    simulation = Simulation(model, Detector(pairs, model.n_nodes), scheme, p.steps, settings)
    length, broken = p.width * p.brick[0], "area of the joints that are fractured"
    shear_force = support_force("V", model, "beam", "x")
    return Case(
        name="cohesive_panel",
        title=f"{p.courses} courses of {p.width} bricks under {p.pressure / 1e6:g} MPa",
        simulation=simulation,
        sensors=(
            shear_force,
            Sensor("pushed", "way of the top", "m", lambda s: float(model.rigid_part(s.state.x)[-1, 0])),
            Sensor("fractured", broken, "m^2", lambda s: float(s.law_variables["area"] @ s.law_variables["fracture"])),
        ),
        plots={"reaction": ("V",), "bound": (p.mu * p.pressure * length * p.thickness, "friction of a joint")},
        fclib_set="FCSIM_CohesivePanel",
        description=f"{len(model.deformable)} bricks, {len(pairs)} joints, {model.n_dofs} degrees of freedom",
    )


def panel(p: Parameters) -> tuple[Model, list[tuple[tuple[str, str], tuple[str, str]]]]:
    """Courses in running bond on a held floor and under a beam that is loaded and pushed, and the joints: (slave, master) surfaces."""
    length, height = p.brick
    material = Material(p.E, p.nu, p.density)

    def part(name: str, share: float) -> Part:
        cells = (max(1, round(share * p.divisions[0])), p.divisions[1])
        return rectangle(name, (share * length, height), cells, material, plane="stress", thickness=p.thickness, elements="Q1-enhanced")

    parts = {1.0: part("brick", 1.0), 0.5: part("half", 0.5)}
    bodies, courses = list[Body](), list[list[tuple[str, float, float]]]()
    for j in range(p.courses):
        shares = [1.0] * p.width if j % 2 == 0 else [0.5, *[1.0] * (p.width - 1), 0.5]
        ends, course = np.cumsum([0.0, *shares]) * length, []
        for i, share in enumerate(shares):
            name = f"brick {j + 1}.{i + 1}"
            bodies.append(Body(name, parts[share], translation=np.array([ends[i], j * height])))
            course.append((name, float(ends[i]), float(ends[i + 1])))
        courses.append(course)
    whole, top = p.width * length, p.courses * height
    floor = rigid_rectangle("floor", (1.2 * whole, height), (whole / 2, -height / 2), 1.0)
    beam = rigid_rectangle("beam", (1.2 * whole, height), (whole / 2, top + height / 2), 10.0)
    joints = [((right[0], "x-"), (left[0], "x+")) for course in courses for left, right in pairwise(course)]
    layers = [[("floor", 0.0, whole)], *courses]
    for lower, upper in pairwise(layers):
        joints += [
            ((a, "y-"), (b, "y+")) for a, begin, end in upper for b, first, last in lower if min(end, last) - max(begin, first) > 1e-9
        ]
    joints += [((name, "y+"), ("beam", "y-")) for name, *_ in courses[-1]]
    weight = p.pressure * whole * p.thickness
    supports = [
        Support("floor", ("x", "y", "rz")),
        Support("beam", ("rz",)),
        Support("beam", ("x",), velocity=lambda t: p.speed * min(max(t / p.ramp - 1, 0.0), 1.0)),
    ]
    load = Force("beam", (0.0, -weight), factor=lambda t: min(t / p.ramp, 1.0))
    return build_model([*bodies, floor, beam], supports=supports, loads=[load], beta=p.beta), joints


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
