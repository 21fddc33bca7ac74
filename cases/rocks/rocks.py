"""Rocks poured into a box: random convex polyhedra, rigid or deformable, fall on each other and come to rest.

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
    FloatArray,
    Gap,
    History,
    InputError,
    Material,
    Model,
    Sensor,
    Simulation,
    SolverSettings,
    Step,
    Support,
    Theta,
    build_model,
    main,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import BlockKind, Part, blocks_that_are, rigid_box, rigid_polyhedron

GRAVITY = 9.81  # [m/s^2]
WALLS = ("floor", "left", "right", "front", "back")


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. size: of a rock, the diameter of the ball around it; aspect: its longest axis by its shortest;
    corners: points of which it is the hull; rocks_are: "mixed": every second one is rigid; E, nu, beta: of deformable ones."""

    n: int = 12
    size: float = 0.2
    aspect: float = 1.8
    corners: int = 12
    rocks_are: BlockKind = "rigid"
    E: float = 1e8
    nu: float = 0.2
    beta: float = 1e-4
    width: float = 0.5
    density: float = 2500.0
    mu: float = 0.6
    seed: int = 1
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 500
    solver: str = "auto"
    tol: float = 1e-6


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = rocks_model(p)
    simulation = Simulation(model, Everything(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, SolverSettings(name=p.solver, tol=p.tol))
    floor, mass = model.number["floor"], mass_along_z(model)
    return Case(
        name="rocks",
        title=f"{p.n} rocks poured into a box",
        simulation=simulation,
        sensors=(
            Sensor("floor_Rz", "force on the floor", "N", lambda s: -float(s.contact_force_on(floor)[2])),
            Sensor("fall", "fall of the centre of mass", "m", lambda s: -float(mass @ s.state.x) / mass.sum()),
            Sensor("fastest", "largest velocity", "m/s", lambda s: fastest(model, s)),
        ),
        plots={"reaction": ("floor_Rz",), "bound": (GRAVITY * mass.sum(), "weight"), "histories": (History("fall", ("fall",)),)},
        fclib_set="FCSIM_Rocks",
        description=f"{p.n} random convex rocks ({p.rocks_are}) of {p.size:g} m, mu = {p.mu:g}",
    )


def mass_along_z(model: Model) -> FloatArray:
    """What moves along z with each degree of freedom (n_dofs,) [kg], of all that no support holds."""
    along = np.zeros(model.n_dofs)
    nodes = model.dof_of_node[:, 2]
    along[nodes[nodes >= 0]] = 1.0
    model.rigid_part(along)[:, 2] = 1.0
    along[model.driven_dofs] = 0.0
    return along * model.apply_mass(along)


def fastest(model: Model, step: Step) -> float:
    """The largest velocity of a node [m/s]."""
    return float(np.linalg.norm(model.node_velocity(step.state.v, step.state.x), axis=1).max())


def rock(name: str, points: FloatArray, material: Material) -> Body:
    """The hull of points as tetrahedra from its centre of mass to the triangles of its surface."""
    hull = rigid_polyhedron(name, points, material.density)
    facets = hull.surfaces["skin"]
    centre = np.full(len(facets), len(hull.points))
    cells = np.column_stack([facets[:, [0, 2, 1]], centre])
    return Body(name, Part(name, np.vstack([hull.points, hull.centre]), cells, "tetrahedron", {"skin": facets}, material))


def rocks_model(p: Parameters) -> Model:
    """Hulls of points on ellipsoids, each in its cell of a lattice above an open box."""
    if p.n < 1 or p.corners < 4 or not (p.size > 0 and p.aspect >= 1 and p.width >= 1.05 * p.size):
        raise InputError("rocks: expected n >= 1, corners >= 4, size > 0, aspect >= 1 and a width of at least 1.05 of the size")
    rng = np.random.default_rng(p.seed)
    across = int(p.width / (1.05 * p.size))
    cell = p.width / across
    rocks: list[Body] = []
    for k in range(p.n):
        direction = rng.normal(size=(p.corners, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        points = 0.5 * p.size * (direction * np.array([1.0, p.aspect**-0.5, 1 / p.aspect])) @ turn.T
        place = np.array([k % across, k // across % across, k // across**2]) + 0.5
        rocks.append(rock(f"rock {k + 1}", points + cell * place, Material(p.E, p.nu, p.density)))
    w, t = p.width, p.width / 4
    high = cell * (1 + (p.n - 1) // across**2)
    walls = {"floor": ((w + 2 * t, w + 2 * t, t), (w / 2, w / 2, -t / 2))}
    walls |= {name: ((t, w, high), (x, w / 2, high / 2)) for name, x in (("left", -t / 2), ("right", w + t / 2))}
    walls |= {name: ((w + 2 * t, t, high), (w / 2, y, high / 2)) for name, y in (("front", -t / 2), ("back", w + t / 2))}
    bodies = [*blocks_that_are(p.rocks_are, rocks), *(rigid_box(name, size, centre, 1.0) for name, (size, centre) in walls.items())]
    held = [Support(name, DIRECTIONS[3]) for name in WALLS]
    return build_model(bodies, supports=held, gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]), beta=p.beta)


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
