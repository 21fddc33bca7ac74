"""A hollow rubber seal is pressed into a groove until it is folded on itself.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from fcsim import Body, Case, Everything, Limits, Model, Sensor, Simulation, SolverSettings, Step, Support, Theta, build_model, main
from fcsim.mesh import Part, rigid_rectangle
from fcsim.mesh.material import neo_hooke


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. Half of the seal, x = 0 is its plane of symmetry, plane strain. cells: through its wall and along
    the half ring; wall: half the groove's width; closing: way of the lid in `time`."""

    radius: float = 5e-3
    thickness: float = 1e-3
    cells: tuple[int, int] = (3, 40)
    wall: float = 6.5e-3
    closing: float = 7e-3
    E: float = 5e6
    nu: float = 0.45
    density: float = 1200.0
    mu: float = 0.2
    time: float = 0.1
    theta: float = 1.0
    steps: int = 100
    solver: str = "auto"
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = seal_in_groove(p)
    seal, lid = model.number["seal"], model.number["lid"]
    rigid = lid - len(model.deformable)
    simulation = Simulation(
        model,
        Everything(model, p.mu),
        Theta(p.time / p.steps, p.theta),
        p.steps,
        SolverSettings(name=p.solver, tol=p.tol),
        limits=Limits(rotation=np.inf, strain=np.inf),
    )
    return Case(
        name="seal",
        title="A hollow rubber seal pressed into a groove",
        simulation=simulation,
        sensors=(
            Sensor("closing", "way of the lid", "m", lambda s: -float(model.rigid_part(s.state.x)[rigid, 1])),
            Sensor("force", "force on the lid, whole seal", "N/m", lambda s: 2 * float(s.contact_force_on(lid)[1])),
            Sensor("side", "force on the groove's side", "N/m", lambda s: float(s.contact_force_on(model.number["side"])[0])),
            Sensor("folded", "pressure of the seal on itself, whole seal", "N/m", lambda s: 2 * on_itself(s, seal)),
        ),
        plots={"imposed": "closing", "reaction": ("force", "folded")},
        fclib_set="FCSIM_Seal",
        description=f"half a hollow rubber seal of {p.cells[0]} x {p.cells[1]} cells in a groove under a lid, {model.n_dofs} degrees of "
        "freedom",
    )


def on_itself(step: Step, seal: int) -> float:
    """Sum of the vertical forces [N/m] that the seal's contacts with itself carry."""
    own = (step.contacts.bodies == seal).all(axis=1)
    return float(np.abs(step.force_in_space[own, 1]).sum())


def seal_in_groove(p: Parameters) -> Model:
    """The half ring between floor and lid, with a side at `wall`; the tools are held, and the lid driven."""
    rubber, R = neo_hooke(p.E, p.nu, p.density), p.radius
    nr, nt = p.cells
    r, angle = np.linspace(R - p.thickness, R, nr + 1), np.linspace(-np.pi / 2, np.pi / 2, nt + 1)
    points = np.stack([np.outer(np.cos(angle), r), np.outer(np.sin(angle), r)], axis=-1).reshape(-1, 2)
    node = np.arange(len(points)).reshape(nt + 1, nr + 1)
    points[node[[0, -1]], 0] = 0.0
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    surfaces = {
        "inside": np.stack([node[1:, 0], node[:-1, 0]], axis=1),
        "outside": np.stack([node[:-1, -1], node[1:, -1]], axis=1),
        "lower cut": np.stack([node[0, :-1], node[0, 1:]], axis=1),
        "upper cut": np.stack([node[-1, 1:], node[-1, :-1]], axis=1),
    }
    ring = Part("seal", points, cells, "quadrilateral", surfaces, rubber, elements="Q1-bbar")
    wide, high = 2 * p.wall, 0.4 * R
    tools = [
        rigid_rectangle("floor", (wide, high), (p.wall / 2, -R - high / 2), 1.0),
        rigid_rectangle("lid", (1.4 * p.wall, high), (0.98 * p.wall - 0.7 * p.wall, R + high / 2), 1.0),
        rigid_rectangle("side", (high, 2 * R), (p.wall + high / 2, 0.0), 1.0),
    ]
    return build_model(
        [Body("seal", ring), *tools],
        supports=[
            Support("seal", ("x",), "lower cut"),
            Support("seal", ("x",), "upper cut"),
            *(Support(name, ("x", "y", "rz")) for name in ("floor", "side")),
            Support("lid", ("x", "rz")),
            Support("lid", ("y",), velocity=-p.closing / p.time),
        ],
    )


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
