"""A shaft turns in a sleeve, climbs to the angle of friction and is braked by it: the friction circle of a journal.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import (
    Body,
    Case,
    ExactContacts,
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
    at_rest,
    build_model,
    main,
)
from fcsim.mesh import Part, rigid_sphere

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units, per metre of the shaft. radius: of the shaft; clearance: how much larger the sleeve's is;
    cells: through the sleeve's wall and around it; mass of the shaft [kg/m]; speed: its angular velocity as it begins, at rest in the
    lowest place."""

    radius: float = 0.05
    clearance: float = 5e-4
    wall: float = 0.03
    cells: tuple[int, int] = (4, 96)
    mass: float = 60.0
    speed: float = 40.0
    mu: float = 0.3
    E: float = 1e11
    nu: float = 0.3
    density: float = 8000.0
    beta: float = 2e-5
    h: float = 1e-3
    theta: float = 1.0
    steps: int = 400
    solver: str = "auto"
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = shaft_in_sleeve(p)
    start = at_rest(model)
    start.v[-1] = p.speed
    settings = SolverSettings(name=p.solver, tol=p.tol)
    simulation = Simulation(model, ExactContacts(model, p.mu), Theta(p.h, p.theta), p.steps, settings, initial=start)
    circle = p.radius * p.mass * GRAVITY * np.sin(np.arctan(p.mu))
    return Case(
        name="shaft",
        title="A shaft turns in a sleeve",
        simulation=simulation,
        sensors=(
            Sensor("speed", "angular velocity of the shaft", "rad/s", lambda s: float(s.state.v[-1])),
            Sensor("formula", "angular velocity by the friction circle", "rad/s", lambda s: braked(p, s.state.t)),
            Sensor("torque", "friction torque on the shaft", "N m/m", torque),
            Sensor("circle", "torque of the friction circle", "N m/m", lambda s: -circle if s.state.v[-1] > 1e-3 else 0.0),
            Sensor("place", "angle by which the shaft has climbed", "degrees", lambda s: place(p, s)),
        ),
        plots={
            "histories": (History("speed", ("speed", "formula")), History("torque", ("torque", "circle")), History("place", ("place",))),
        },
        fclib_set="FCSIM_Shaft",
        description=f"a shaft of {p.radius:g} m in a sleeve of {p.cells[0]} x {p.cells[1]} cells, clearance {p.clearance:g} m, "
        f"mu = {p.mu:g}",
    )


def braked(p: Parameters, t: float) -> float:
    """Angular velocity [rad/s] of a shaft that is braked by r W sin(phi), phi = atan mu, from the beginning, until it stands."""
    inertia = 0.5 * p.mass * p.radius**2
    return max(0.0, p.speed - p.radius * p.mass * GRAVITY * float(np.sin(np.arctan(p.mu))) / inertia * t)


def torque(step: Step) -> float:
    """Moment [N m] of the contacts about the shaft's axis."""
    return float(step.force_per_reaction * (step.H @ step.result.r)[-1])


def place(p: Parameters, step: Step) -> float:
    """The angle [degrees] of the shaft's axis about the sleeve's, from the lowest place, positive against its sense of rolling."""
    x, y = step.state.x[-3:-1]
    return float(np.degrees(np.arctan2(-x, p.clearance - y)))


def shaft_in_sleeve(p: Parameters) -> Model:
    """The sleeve, whose facets touch a circle about the origin and whose outside is held, and the shaft in its lowest place."""
    through, around = p.cells
    if min(p.cells) < 1 or around < 8:
        raise InputError(f"shaft, cells: expected at least 1 through the wall and 8 around it, got {p.cells}")
    if not (0 < p.clearance < p.radius):
        raise InputError(f"shaft, clearance: expected a length > 0 and below the radius {p.radius}, got {p.clearance}")
    inner = (p.radius + p.clearance) / np.cos(np.pi / around)
    r, angle = np.linspace(inner, inner + p.wall, through + 1), 2 * np.pi * (np.arange(around) - 0.5) / around - np.pi / 2
    points = np.stack([np.outer(np.cos(angle), r), np.outer(np.sin(angle), r)], axis=-1).reshape(-1, 2)
    node = np.arange(len(points)).reshape(around, through + 1)
    after = np.roll(node, -1, axis=0)
    cells = np.stack([node[:, :-1], node[:, 1:], after[:, 1:], after[:, :-1]], axis=-1).reshape(-1, 4)
    surfaces = {"inside": np.stack([after[:, 0], node[:, 0]], axis=1), "outside": np.stack([node[:, -1], after[:, -1]], axis=1)}
    ring = Part("sleeve", points, cells, "quadrilateral", surfaces, Material(p.E, p.nu, p.density))
    shaft = rigid_sphere("shaft", p.radius, (0.0, -p.clearance), p.mass)
    return build_model(
        [Body("sleeve", ring), shaft],
        supports=[Support("sleeve", ("x", "y"), "outside")],
        gravity=lambda t: np.array([0.0, -GRAVITY]),
        beta=p.beta,
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
