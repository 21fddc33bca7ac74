"""A block is pulled over another one: a case to change. `fcsim run NAME` runs it, `fcsim render results/NAME` draws it.

SI units throughout: m, kg, s, N, Pa.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from fcsim import (
    Body,
    Case,
    Everything,
    Material,
    Simulation,
    SolverSettings,
    Support,
    Theta,
    build_model,
    contact_force,
    displacement,
    main,
)
from fcsim.mesh import brick, rigid_box


@dataclass(frozen=True)
class Parameters:
    """What `--set name=value` changes."""

    E: float = 2.2e9  # Young's modulus [Pa]: 2.2 GPa
    nu: float = 0.2
    density: float = 2000.0  # [kg/m^3]
    mu: float = 0.4  # friction between the blocks
    velocity: float = 0.01  # with which the upper block is pulled [m/s]
    h: float = 1e-3  # length of a step [s]
    theta: float = 0.6  # of the time scheme, from 1/2 to 1
    steps: int = 50
    solver: str = "auto"
    tol: float = 1e-8  # of the error of each step, relative


def build(p: Parameters) -> Case:
    """The case with the given parameters."""
    # Geometry: a mesh with a material is a part; a body is a part placed in space. gmsh's files: fcsim.mesh.read_mesh.
    stone = Material(E=p.E, nu=p.nu, density=p.density)
    block = brick("block", size=(0.2, 0.1, 0.1), divisions=(8, 4, 4), material=stone)
    bodies = [
        rigid_box("floor", size=(1.0, 0.4, 0.1), centre=(0.1, 0.05, -0.05), mass=1.0),
        Body("lower", block),
        Body("upper", block, translation=(0.0, 0.0, 0.1)),
    ]
    # Loading: what is held or driven, and gravity, which points down. beta [s] damps the vibrations that an impact leaves.
    model = build_model(
        bodies,
        supports=[
            Support("floor", ("x", "y", "z", "rx", "ry", "rz")),
            Support("upper", ("x",), surface="z+", velocity=p.velocity),
        ],
        gravity=lambda t: (0.0, 0.0, -9.81),
        beta=1e-3,
    )
    # Contact: everything may touch everything, with friction by pairs of names.
    contact = Everything(model, mu={("upper", "lower"): p.mu, ("*", "*"): 0.6})
    # theta: 1/2 keeps energy, and the swinging that stiff bodies are set into by a support that starts at once; above 1/2 it dies out.
    scheme = Theta(h=p.h, theta=p.theta)
    simulation = Simulation(model, contact, scheme, p.steps, SolverSettings(name=p.solver, tol=p.tol))
    # What is measured at every step: columns of steps.csv.
    pull = displacement("pull", model, "upper", "x", point=(0.1, 0.05, 0.2), label="displacement of the upper block's top")
    friction = contact_force("friction", model, "upper", "x", label="friction on the upper block")
    return Case(
        name="NAME",
        title="A block is pulled over another one",
        simulation=simulation,
        sensors=(pull, friction),
        plots={"imposed": "pull", "reaction": ("friction",)},
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
