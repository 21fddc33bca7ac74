"""Balls poured into a box: exact spheres of spread radii fall on each other and come to rest.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import Case, Gap, History, InputError, Model, Sensor, Simulation, SolverSettings, Support, Theta, build_model, main
from fcsim.arrays import FloatArray
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh import RigidBody, rigid_plane, rigid_sphere

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. radius: the mean one; spread: the largest deviation from it, relative; width of the box [m]."""

    n: int = 60
    radius: float = 0.02
    spread: float = 0.3
    width: float = 0.24
    density: float = 2500.0
    mu: float = 0.4
    seed: int = 1
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 400
    solver: str = "auto"
    tol: float = 1e-6


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = granular_model(p)
    settings = SolverSettings(name=p.solver, tol=p.tol)
    simulation = Simulation(model, ExactContacts(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, settings)
    balls, walls = slice(0, p.n), [model.number[name] for name in WALLS]
    weight = GRAVITY * float(sum(body.mass for body in model.rigid[balls]))
    return Case(
        name="granular",
        title=f"{p.n} balls poured into a box",
        simulation=simulation,
        sensors=(
            Sensor("floor_Rz", "force on the floor", "N", lambda s: -float(s.contact_force_on(walls[0])[2])),
            Sensor("height", "mean height of the balls", "m", lambda s: float(np.mean(centres(model, s.state.x)[balls, 2]))),
            Sensor("fastest", "largest velocity", "m/s", lambda s: float(np.linalg.norm(model.rigid_part(s.state.v)[:, :3], axis=1).max())),
        ),
        plots={"reaction": ("floor_Rz",), "bound": (weight, "weight"), "histories": (History("height", ("height",)),)},
        fclib_set="FCSIM_Granular",
        description=f"{p.n} exact spheres of radius {p.radius:g} m +- {100 * p.spread:g} %, mu = {p.mu:g}",
    )


WALLS = ("floor", "left", "right", "front", "back")


def granular_model(p: Parameters) -> Model:
    """Balls on a lattice above a box of five planes, each moved a little in its cell."""
    if p.n < 1:
        raise InputError(f"granular, n: expected a whole number >= 1, got {p.n}")
    largest = p.radius * (1 + p.spread)
    if not (0 <= p.spread < 1 and p.radius > 0 and p.width >= 2.4 * largest):
        raise InputError(
            f"granular: expected radius > 0, 0 <= spread < 1 and a width of at least 1.2 of the largest diameter, got radius {p.radius}, "
            f"spread {p.spread}, width {p.width}"
        )
    rng = np.random.default_rng(p.seed)
    cell = 2.2 * largest
    across = int(p.width / cell)
    radius = p.radius * (1 + p.spread * rng.uniform(-1, 1, p.n))
    layer, row, column = np.unravel_index(np.arange(p.n), (-(-p.n // across**2), across, across))
    centre = (np.stack([column, row, layer], axis=1) + 0.5) * cell
    centre[:, :2] += (p.width - across * cell) / 2
    centre += rng.uniform(-1, 1, (p.n, 3)) * (cell / 2 - radius)[:, None]
    mass = p.density * 4 / 3 * np.pi * radius**3
    bodies: list[RigidBody] = [rigid_sphere(f"ball {k + 1}", radius[k], centre[k], mass[k]) for k in range(p.n)]
    w = p.width
    places = {"floor": ((w / 2, w / 2, 0), (0, 0, 1)), "left": ((0, w / 2, w / 2), (1, 0, 0)), "right": ((w, w / 2, w / 2), (-1, 0, 0))}
    places |= {"front": ((w / 2, 0, w / 2), (0, 1, 0)), "back": ((w / 2, w, w / 2), (0, -1, 0))}
    shown = {name: w / 50 if name in ("front", "right") else w for name in WALLS}  # pictures look into the box past these two
    bodies += [rigid_plane(name, point, normal, size=shown[name]) for name, (point, normal) in places.items()]
    return build_model(
        bodies,
        supports=[Support(name, DIRECTIONS[3]) for name in WALLS],
        gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]),
    )


def centres(model: Model, x: FloatArray) -> FloatArray:
    """Centres of the rigid bodies (nr, 3) [m]."""
    found: FloatArray = np.array([body.centre for body in model.rigid]) + model.rigid_part(x)[:, :3]
    return found


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
