"""Rocks poured into a box: random convex rigid polyhedra fall on each other and come to rest.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

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
from fcsim.assembly.supports import DIRECTIONS
from fcsim.mesh import rigid_box, rigid_polyhedron

GRAVITY = 9.81  # [m/s^2]
WALLS = ("floor", "left", "right", "front", "back")


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. size: of a rock, the diameter of the ball around it; aspect: its longest axis by its shortest."""

    n: int = 12
    size: float = 0.2
    aspect: float = 1.8
    corners: int = 12
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
    floor, mass = model.number["floor"], np.array([body.mass for body in model.rigid[: p.n]])
    start = np.array([body.centre[2] for body in model.rigid[: p.n]])
    return Case(
        name="rocks",
        title=f"{p.n} rocks poured into a box",
        simulation=simulation,
        sensors=(
            Sensor("floor_Rz", "force on the floor", "N", lambda s: -float(s.contact_force_on(floor)[2])),
            Sensor("height", "height of the centre of mass", "m", lambda s: _height(s.state.x, model, mass, start)),
            Sensor("fastest", "largest velocity", "m/s", lambda s: float(np.linalg.norm(model.rigid_part(s.state.v)[:, :3], axis=1).max())),
        ),
        plots={"reaction": ("floor_Rz",), "bound": (GRAVITY * mass.sum(), "weight"), "histories": (History("height", ("height",)),)},
        fclib_set="FCSIM_Rocks",
        description=f"{p.n} random convex rocks of {p.size:g} m, mu = {p.mu:g}",
    )


def _height(x: np.ndarray, model: Model, mass: np.ndarray, start: np.ndarray) -> float:
    return float(mass @ (start + model.rigid_part(x)[: len(mass), 2]) / mass.sum())


def rocks_model(p: Parameters) -> Model:
    """Hulls of points on ellipsoids, each in its cell of a lattice above an open box."""
    if p.n < 1 or p.corners < 4 or not (p.size > 0 and p.aspect >= 1 and p.width >= 1.05 * p.size):
        raise InputError("rocks: expected n >= 1, corners >= 4, size > 0, aspect >= 1 and a width of at least 1.05 of the size")
    rng = np.random.default_rng(p.seed)
    across = int(p.width / (1.05 * p.size))
    cell = p.width / across
    bodies: list[RigidBody] = []
    for k in range(p.n):
        direction = rng.normal(size=(p.corners, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        points = 0.5 * p.size * (direction * np.array([1.0, p.aspect**-0.5, 1 / p.aspect])) @ turn.T
        place = np.array([k % across, k // across % across, k // across**2]) + 0.5
        bodies.append(rigid_polyhedron(f"rock {k + 1}", points + cell * place, p.density))
    w, t = p.width, p.width / 4
    high = cell * (1 + (p.n - 1) // across**2)
    walls = {"floor": ((w + 2 * t, w + 2 * t, t), (w / 2, w / 2, -t / 2))}
    walls |= {name: ((t, w, high), (x, w / 2, high / 2)) for name, x in (("left", -t / 2), ("right", w + t / 2))}
    walls |= {name: ((w + 2 * t, t, high), (w / 2, y, high / 2)) for name, y in (("front", -t / 2), ("back", w + t / 2))}
    bodies += [rigid_box(name, size, centre, 1.0) for name, (size, centre) in walls.items()]
    held = [Support(name, DIRECTIONS[3]) for name in WALLS]
    return build_model(bodies, supports=held, gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]))


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
