"""The semicircular arch of dry voussoirs: does it carry its own weight?

It does iff the ratio of thickness and mean radius is at least 0.1075 (radial joints: M. Milankovitch, Z. Math. Phys. 55, 1907;
N. Makris, H. Alexakis, "The effect of stereotomy on the shape of the thrust-line and the minimum thickness of semicircular masonry
arches", Arch. Appl. Mech. 83, 2013). See README.md beside this file.
"""

from __future__ import annotations

import sys
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
from fcsim.mesh import BlockKind, SemicircularArch, blocks_that_are, rigid_box, semicircular_arch

GRAVITY = 9.81  # [m/s^2]
HELD = ("x", "y", "z", "rx", "ry", "rz")
ALL_SIDES = ("x-", "x+", "y-", "y+", "z-", "z+")


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one.

    thickness_ratio: thickness over mean radius; divisions: elements of a voussoir along the arch, its depth and its thickness
    E, nu, beta, lumped: of deformable voussoirs, which fall late with their mass lumped; gravity_ramp: time over which gravity comes up
    """

    voussoirs: int = 20
    radius: float = 1.0
    thickness_ratio: float = 0.12
    depth: float = 0.3
    divisions: tuple[int, int, int] = (1, 1, 1)
    blocks_are: BlockKind = "rigid"
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    lumped: bool = False
    beta: float = 2e-3
    mu: float = 0.7
    alert: float = 1e-2
    gravity_ramp: float = 0.05
    h: float = 2e-3
    theta: float = 0.5
    steps: int = 500
    driven: Literal["eliminated", "identity"] = "eliminated"
    solver: str = "PPA-NSN-AC"
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    thickness = p.thickness_ratio * p.radius
    arch = semicircular_arch(p.voussoirs, p.radius, thickness, p.depth, p.divisions, material=Material(p.E, p.nu, p.density))
    model = arch_model(arch, p)
    simulation = Simulation(
        model,
        Detector(arch_contacts(arch, model, p), model.n_nodes),
        Theta(p.h, p.theta, Gap()),
        p.steps,
        SolverSettings(name=p.solver, tol=p.tol),
    )
    crown = top_of_crown(arch, model)
    left, right = model.number["left abutment"], model.number["right abutment"]
    return Case(
        name="arch",
        title=f"Semicircular arch, t/R = {p.thickness_ratio:g}",
        simulation=simulation,
        sensors=(
            Sensor("crown", "settlement of the crown", "m", lambda s: -float(model.node_displacement(s.state.x)[crown, 2].mean())),
            Sensor("thrust", "horizontal thrust on the right abutment", "N", lambda s: float(s.contact_force_on(right)[0])),
            Sensor("vertical", "vertical force on both abutments", "N", lambda s: vertical_force(s, left, right)),
        ),
        plots={"reaction": ("thrust", "vertical"), "bound": (weight_of(model), "weight of the arch")},
        fclib_set="FCSIM_Arch",
        description=f"{p.voussoirs} voussoirs ({p.blocks_are}) between rigid abutments, {model.n_dofs} degrees of freedom",
    )


def arch_model(arch: SemicircularArch, p: Parameters) -> Model:
    """Voussoirs under gravity between two held abutments, whose top faces are the springing joints."""
    size = (2 * arch.thickness, 1.5 * p.depth, arch.thickness)
    left, right = (
        rigid_box(f"{side} abutment", size, (sign * arch.radius, 0.0, -size[2] / 2), 1.0) for side, sign in (("left", -1), ("right", 1))
    )
    return build_model(
        [*blocks_that_are(p.blocks_are, arch.bodies), left, right],
        supports=[Support(body.name, HELD) for body in (left, right)],
        gravity=lambda t: np.array([0.0, 0.0, -GRAVITY * min(t / p.gravity_ramp, 1.0)]),
        lumped=p.lumped,
        beta=p.beta,
        driven=p.driven,
    )


def arch_contacts(arch: SemicircularArch, model: Model, p: Parameters) -> list[SurfacePair]:
    """All joints by the nodes of both sides: hinges form at the edges, which nodes alone stand on. What falls strikes elsewhere: corners,
    others' intrados and extrados, abutments; nothing is near there while the arch stands."""
    names, abutments = [body.name for body in arch.bodies], ["left abutment", "right abutment"]

    def surface(bodies: list[str], *sides: str) -> ContactSurface:
        return contact_surface(model, [(name, side) for name in bodies for side in sides])

    outsides = [(name, side) for name in names for side in ("z-", "z+")] + [(name, side) for name in abutments for side in ("x-", "x+")]
    corners, beside = surface([*names, *abutments], *ALL_SIDES), contact_surface(model, outsides)

    to_the_left, to_the_right = surface(names[1:], "x-"), surface(names[:-1], "x+")
    return [
        SurfacePair(to_the_left, to_the_right, p.mu, p.alert, "nodes", "joints, right side"),
        SurfacePair(to_the_right, to_the_left, p.mu, p.alert, "nodes", "joints, left side"),
        SurfacePair(surface(names[:1], "x-"), surface(["left abutment"], "z+"), p.mu, p.alert, "nodes", "left springing"),
        SurfacePair(surface(names[-1:], "x+"), surface(["right abutment"], "z+"), p.mu, p.alert, "nodes", "right springing"),
        SurfacePair(corners, beside, p.mu, p.alert, "nodes", "elsewhere"),
        SurfacePair(surface(names[1:-1], *ALL_SIDES), surface(abutments, "z+"), p.mu, p.alert, "nodes", "fallen on abutments"),
    ]


def top_of_crown(arch: SemicircularArch, model: Model) -> np.ndarray:
    """Nodes at the highest points of the extrados."""
    z = model.reference[:, 2]
    return np.flatnonzero(z > z.max() - 1e-6 * arch.radius)


def vertical_force(step: Step, left: int, right: int) -> float:
    """What the abutments carry [N]: in the end the weight of the arch."""
    return -float(step.contact_force_on(left)[2] + step.contact_force_on(right)[2])


def weight_of(model: Model) -> float:
    """Weight [N] of all bodies but the abutments, the last two."""
    load = model.load(np.inf)
    return -float(load[: model.n_elastic].reshape(-1, 3)[:, 2].sum() + model.rigid_part(load)[:-2, 2].sum())


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
