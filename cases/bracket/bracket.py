"""A bracket of an aluminium alloy, held to a wall by a steel bolt that is tightened, then loaded at its tip: second-order tetrahedra from a
mesh file with two named volumes.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fcsim import (
    Body,
    Case,
    Detector,
    Material,
    Model,
    QuasiStatic,
    Sensor,
    Simulation,
    SolverSettings,
    Support,
    SurfacePair,
    build_model,
    contact_surface,
    main,
)
from fcsim.assembly import Traction
from fcsim.mesh import read_mesh, rigid_box
from fcsim.mesh.material import ByRegion

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. mesh: written by mesh.py beside this file; tightening: way of the bolt's end into the wall in the
    time 1; load: force on the tip, downwards, from the time 1 to 2."""

    mesh: Path = HERE / "bracket.msh"
    elements: str = "P2"
    E: tuple[float, float] = (70e9, 210e9)
    nu: tuple[float, float] = (0.33, 0.3)
    density: tuple[float, float] = (2700.0, 7800.0)
    tightening: float = 1.5e-5
    load: float = 1000.0
    mu: float = 0.3
    alert: float = 1e-3
    eta: float = 0.0
    tightened: int = 2
    loaded: int = 8
    solver: str = "auto"
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = bracket_on_wall(p)
    pair = SurfacePair(contact_surface(model, [("bracket", "back")]), contact_surface(model, [("wall", "x+")]), p.mu, p.alert)
    simulation = Simulation(
        model,
        Detector([pair], model.n_nodes),
        QuasiStatic(1 / p.tightened, p.eta),
        p.tightened + p.loaded,
        SolverSettings(name=p.solver, tol=p.tol),
    )
    wall = model.number["wall"]
    tip, end = (np.unique(model.facets("bracket", name)) for name in ("tip", "shank end"))
    held = model.dof_of_node[end]
    return Case(
        name="bracket",
        title="A bracket held to a wall by a bolt",
        simulation=simulation,
        sensors=(
            Sensor("load", "load on the tip", "N", lambda s: p.load * share(p, s.state.t)),
            Sensor("tip", "sag of the tip", "m", lambda s: -float(model.node_displacement(s.state.x)[tip, 2].mean())),
            Sensor("wall", "pressure on the wall", "N", lambda s: -float(s.contact_force_on(wall)[0])),
            Sensor("bolt", "tension of the bolt", "N", lambda s: -float(s.support_impulse[held[:, 0]].sum())),
            Sensor("bolt_shear", "shear of the bolt", "N", lambda s: float(s.support_impulse[held[:, 2]].sum())),
            Sensor("friction", "friction of the wall", "N", lambda s: -float(s.contact_force_on(wall)[2])),
            Sensor("open", "share of the wall's contacts that are open", "", lambda s: float(np.mean(s.contact_status == 0))),
        ),
        plots={"imposed": "load", "reaction": ("bolt", "wall", "friction")},
        fclib_set="FCSIM_Bracket",
        description=f"a bracket and its bolt of second-order tetrahedra ({p.mesh.name}), {model.n_dofs} degrees of freedom",
    )


def share(p: Parameters, t: float) -> float:
    """Of the load at the time t."""
    return float(np.clip((t - 1) * p.tightened / p.loaded, 0.0, 1.0))


def bracket_on_wall(p: Parameters) -> Model:
    """One part of two materials, bonded where they share nodes, before a rigid wall."""
    names = ("bracket", "bolt")
    materials = {name: Material(*numbers) for name, numbers in zip(names, zip(p.E, p.nu, p.density, strict=True), strict=True)}
    part = read_mesh(p.mesh, ByRegion(materials), name="bracket", elements=p.elements)
    area = np.ptp(part.points[:, 1]) * THICK
    return build_model(
        [Body("bracket", part), rigid_box("wall", (0.02, 0.1, 0.12), (-0.01, 0.02, 0.03), 1.0)],
        supports=[
            Support("wall", ("x", "y", "z", "rx", "ry", "rz")),
            Support("bracket", ("x",), "shank end", velocity=lambda t: -p.tightening if t < 1 else 0.0),
            Support("bracket", ("y", "z"), "shank end"),
        ],
        loads=[Traction("bracket", "tip", (0.0, 0.0, -p.load / area), factor=lambda t: share(p, t))],
    )


THICK = 0.008
"""Of the lying leg [m], as in mesh.py."""


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
