"""Press and shear: an elastic block is pressed on a larger one and then drawn sideways until it slides.

A benchmark on which contact programs were compared; statics in ten load steps. See README.md beside this file.
"""

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
)
from fcsim.mesh import brick


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units, a load step lasts 1 s. `--set name=value` changes one."""

    bottom_size: tuple[float, float, float] = (1.5, 1.5, 0.5)
    top_size: tuple[float, float, float] = (1.0, 1.0, 0.5)
    bottom_divisions: tuple[int, int, int] = (9, 9, 3)
    top_divisions: tuple[int, int, int] = (6, 6, 3)
    E: float = 1e9
    nu: float = 0.2
    density: float = 2000.0
    mu: float = 0.5
    press: float = 5e-4
    press_steps: int = 2
    shear: float = 8e-4
    shear_steps: int = 8
    candidates: Literal["mortar", "mortar-faces", "nodes", "faces", "gauss", "segments"] = "mortar"
    alert: float = 1e-2
    solver: str = "NSN-AC"
    tol: float = 1e-8


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = blocks(p)
    pair = SurfacePair(
        contact_surface(model, [("top", "z-")]), contact_surface(model, [("bottom", "z+")]), p.mu, p.alert, p.candidates, "interface"
    )
    simulation = Simulation(
        model,
        Detector([pair], model.n_nodes),
        QuasiStatic(h=1.0),
        p.press_steps + p.shear_steps,
        SolverSettings(name=p.solver, tol=p.tol),
    )
    bottom = model.number["bottom"]
    grip = model.dof_of_node[np.unique(model.facets("top", "z+")), 0]
    return Case(
        name="press_and_shear",
        title="Press and shear of two elastic blocks",
        simulation=simulation,
        sensors=(
            Sensor("top_x", "imposed horizontal displacement of the top", "m", lambda s: float(s.state.x[grip].mean())),
            Sensor("R_x", "horizontal force on the bottom block", "N", lambda s: float(s.contact_force_on(bottom)[0])),
            Sensor("R_z", "vertical force on the top block", "N", lambda s: float(-s.contact_force_on(bottom)[2])),
            Sensor("ratio", "horizontal over vertical force", "-", ratio),
        ),
        plots={"imposed": "top_x", "reaction": ("R_x", "R_z")},
        fclib_set="FCSIM_PressAndShear",
        description=f"{model.n_nodes} nodes, candidates {p.candidates}",
    )


def blocks(p: Parameters) -> Model:
    """The top block centred on the bottom one; the lowest face is clamped, the highest driven down, then along x, and held along y."""
    material = Material(p.E, p.nu, p.density)
    bottom, top = brick("bottom", p.bottom_size, p.bottom_divisions, material), brick("top", p.top_size, p.top_divisions, material)
    centred = (np.array(p.bottom_size) - p.top_size) / 2
    centred[2] = p.bottom_size[2]

    def down(t: float) -> float:
        """The press in equal steps."""
        return -p.press / p.press_steps if t < p.press_steps else 0.0

    def along(t: float) -> float:
        """The shear in equal steps after the press."""
        return p.shear / p.shear_steps if t > p.press_steps else 0.0

    return build_model(
        [Body("bottom", bottom), Body("top", top, translation=centred)],
        supports=[
            Support("bottom", ("x", "y", "z"), "z-"),
            Support("top", ("z",), "z+", velocity=down),
            Support("top", ("x",), "z+", velocity=along),
            Support("top", ("y",), "z+"),
        ],
    )


def ratio(step: Step) -> float:
    """|R_x| / |R_z| at the interface, 0 without contact."""
    force = step.contact_force_on(0)
    return float(abs(force[0] / force[2])) if force[2] else 0.0


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
