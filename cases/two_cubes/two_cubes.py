"""Compression of two elastic cubes, one on the other: the problem behind FCLIB's set Cubes_H8. See README.md beside this file."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim import (
    Body,
    Case,
    Detector,
    Material,
    Model,
    Part,
    QuasiStatic,
    Sensor,
    Simulation,
    SolverSettings,
    Step,
    Support,
    SurfacePair,
    build_model,
    contact_surface,
    main,
    nodal_area,
)
from fcsim.arrays import FloatArray
from fcsim.mesh import brick


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. `--set name=value` changes one.

    lower_elements: elements a side of the lower cube where they differ from the upper one's; 0: the same, the meshes match
    """

    side: float = 1.0
    elements: int = 5
    lower_elements: int = 0
    E_upper: float = 1e9
    E_lower: float = 4e9
    nu: float = 0.3
    mu: float = 0.3
    compression: float = 0.02
    candidates: Literal["nodes", "faces", "gauss"] = "nodes"
    driven: Literal["eliminated", "identity"] = "identity"
    steps: int = 10
    solver: str = "NSN-AC-HYBRID"
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = two_cubes(p)
    pair = SurfacePair(
        contact_surface(model, [("upper", "z-")]), contact_surface(model, [("lower", "z+")]), p.mu, 0.1 * p.side / p.elements, p.candidates
    )
    settings = SolverSettings(name=p.solver, tol=p.tol, floor=1e-3 * abs(p.compression))
    simulation = Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1 / max(p.steps, 1)), p.steps, settings)
    upper, area = model.number["upper"], nodal_area(model, "upper", "z-")

    def pressure(step: Step) -> FloatArray:
        """Nodal pressures [Pa] on the upper cube: its contact forces, wherever they act in a facet, spread on the nodes."""
        own = (step.H @ step.result.r)[model.dof_offset[upper] + 2 : model.dof_offset[upper + 1] : 3]
        share = area[model.node_offset[upper] : model.node_offset[upper + 1]]
        spread: FloatArray = own[share > 0] / share[share > 0]
        return spread

    return Case(
        name="two_cubes",
        title="Compression of two elastic cubes",
        simulation=simulation,
        sensors=(
            Sensor("compression", "compression", "m", lambda s: s.state.t * p.compression),
            Sensor("force", "contact force", "N", lambda s: float(s.contact_force_on(upper)[2])),
            Sensor("top_force", "force on the top", "N", lambda s: -top_force(model, s)),
            Sensor("largest_pressure", "largest nodal pressure", "Pa", lambda s: float(pressure(s).max())),
            Sensor("least_pressure", "least nodal pressure", "Pa", lambda s: float(pressure(s).min())),
        ),
        plots={"imposed": "compression", "reaction": ("force", "top_force")},
        fclib_set="FCSIM_Cubes_H8",
        description=f"two cubes of {p.elements} and {p.lower_elements or p.elements} hexahedra a side, {model.n_dofs} degrees of freedom",
    )


def two_cubes(p: Parameters) -> Model:
    """The lower cube glued to the ground, the upper one to a platen that comes down by `compression` from t = 0 to 1."""
    upper = cube("upper", p, p.elements, p.E_upper)
    lower = cube("lower", p, p.lower_elements or p.elements, p.E_lower)
    return build_model(
        [Body("lower", lower), Body("upper", upper, translation=np.array([0, 0, p.side]))],
        supports=[
            Support("lower", ("x", "y", "z"), "z-"),
            Support("upper", ("x", "y"), "z+"),
            Support("upper", ("z",), "z+", -p.compression),
        ],
        driven=p.driven,
    )


def cube(name: str, p: Parameters, elements: int, E: float) -> Part:
    return brick(name, (p.side,) * 3, (elements,) * 3, Material(E, p.nu, 0.0))


def top_force(model: Model, step: Step) -> float:
    """Vertical force [N] of the platen on the upper cube."""
    nodes = np.unique(model.facets("upper", "z+"))
    return float(step.support_impulse[model.dof_of_node[nodes, 2]].sum())


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
