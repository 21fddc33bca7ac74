"""A semicircular arch that is too thin falls to the ground: voussoirs that turn far, on each other and on the ground.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import Case, Everything, Gap, History, Material, Model, Sensor, Simulation, SolverSettings, Support, Theta, build_model, main
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import BlockKind, SemicircularArch, blocks_that_are, rigid_box, semicircular_arch

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. thickness_ratio: thickness over mean radius; E, nu, beta: of deformable voussoirs."""

    voussoirs: int = 20
    radius: float = 1.0
    thickness_ratio: float = 0.09
    depth: float = 0.3
    divisions: tuple[int, int, int] = (1, 1, 1)
    blocks_are: BlockKind = "deformable"
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    beta: float = 1e-4
    mu: float = 0.7
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 1600
    solver: str = "auto"
    tol: float = 1e-6


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    arch = semicircular_arch(
        p.voussoirs, p.radius, p.thickness_ratio * p.radius, p.depth, p.divisions, material=Material(p.E, p.nu, p.density)
    )
    model = arch_model(arch, p)
    ground = model.number["ground"]
    weight = GRAVITY * p.density * p.depth * p.thickness_ratio * p.radius**2 * p.voussoirs * np.sin(np.pi / p.voussoirs)
    crown = np.flatnonzero(model.reference[:, 2] > model.reference[:, 2].max() - 1e-6 * p.radius)
    settings = SolverSettings(name=p.solver, tol=p.tol)
    return Case(
        name="falling_arch",
        title=f"An arch of t/R = {p.thickness_ratio:g} falls",
        simulation=Simulation(model, Everything(model, p.mu), Theta(p.h, p.theta, Gap()), p.steps, settings),
        sensors=(
            Sensor("crown", "fall of the crown", "m", lambda s: -float(model.node_displacement(s.state.x)[crown, 2].mean())),
            Sensor("ground_Rz", "force on the ground", "N", lambda s: -float(s.contact_force_on(ground)[2])),
        ),
        plots={"reaction": ("ground_Rz",), "bound": (weight, "weight"), "histories": (History("crown", ("crown",)),)},
        fclib_set="FCSIM_FallingArch",
        description=f"{p.voussoirs} voussoirs ({p.blocks_are}) on the ground, {model.n_dofs} degrees of freedom",
    )


def arch_model(arch: SemicircularArch, p: Parameters) -> Model:
    """Voussoirs that stand on a held ground."""
    R = arch.radius
    ground = rigid_box("ground", (5 * R, 1.5 * R, 0.2 * R), (0.0, 0.0, -0.1 * R), 1.0)
    return build_model(
        [*blocks_that_are(p.blocks_are, arch.bodies), ground],
        supports=[Support("ground", DIRECTIONS[3])],
        gravity=lambda t: np.array([0.0, 0.0, -GRAVITY]),
        lumped=False,  # one cell a voussoir would have three times its moment of inertia
        beta=p.beta,
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
