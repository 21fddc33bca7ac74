"""A plastic sheet is stamped by a round punch between two round shoulders, and springs back when the punch leaves it.

See README.md beside this file.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fcsim import (
    Body,
    Case,
    ExactContacts,
    History,
    Limits,
    Model,
    QuasiStatic,
    Sensor,
    Simulation,
    SolverSettings,
    Support,
    build_model,
    main,
)
from fcsim.arrays import FloatArray
from fcsim.mesh import rectangle, rigid_sphere
from fcsim.mesh.material import FinitePlastic, LinearHardening


@dataclass(frozen=True)
class Parameters:
    """Every number of the case; SI units. Half the sheet, x = 0 is the plane of symmetry, plane strain; `stroke` in the time 1, then the
    punch goes back until it is free. shoulder: x of the centre of the die's shoulder; hold [1/s^2]: stiffness per mass that holds the sheet
    where nothing touches it."""

    length: float = 0.04
    thickness: float = 1e-3
    cells: tuple[int, int] = (64, 4)
    punch_radius: float = 0.01
    shoulder_radius: float = 5e-3
    shoulder: float = 0.02
    stroke: float = 0.012
    E: float = 210e9
    nu: float = 0.3
    density: float = 7800.0
    yield_stress: float = 250e6
    hardening: float = 1e9
    mu: float = 0.1
    alert: float = 1e-4
    hold: float = 1600.0
    pressing: int = 40
    leaving: int = 10
    solver: str = "auto"
    tol: float = 1e-9


def build(p: Parameters) -> Case:
    """Return the case with the given parameters."""
    model = sheet_and_tools(p)
    sheet, punch = model.number["sheet"], model.number["punch"]
    n = len(model.bodies[sheet].points)
    middle = np.flatnonzero(np.isclose(model.reference[:n, 0], 0.0))
    end = int(np.argmax(model.reference[:n] @ [1.0, 1e-3]))
    h = 1 / p.pressing
    steps = p.pressing + p.leaving
    simulation = Simulation(
        model,
        ExactContacts(model, p.mu, p.alert),
        QuasiStatic(h, p.hold * h**2),
        steps,
        SolverSettings(name=p.solver, tol=p.tol),
        limits=Limits(rotation=np.inf, strain=np.inf),
    )
    return Case(
        name="stamped_sheet",
        title="A sheet stamped by a round punch, and its springback",
        simulation=simulation,
        sensors=(
            Sensor("stroke", "way of the punch", "m", lambda s: -float(model.rigid_part(s.state.x)[punch - len(model.deformable), 1])),
            Sensor("force", "force of the punch, whole sheet", "N/m", lambda s: 2 * float(s.contact_force_on(punch)[1])),
            Sensor("sag", "sag of the middle below the end", "m", lambda s: sag(model, s.state.x, middle, end)),
            Sensor("angle", "slope of the end", "deg", lambda s: slope(model, s.state.x, end)),
        ),
        plots={"imposed": "stroke", "reaction": ("force",), "histories": (History("angle", ("angle",)),)},
        fclib_set="FCSIM_StampedSheet",
        description=f"half a sheet of {p.cells[0]} x {p.cells[1]} plastic cells on a round shoulder under a round punch, {model.n_dofs} "
        "degrees of freedom",
    )


def sheet_and_tools(p: Parameters) -> Model:
    """The sheet lies on the shoulder, the punch on the sheet; both tools are held, and the punch driven."""
    steel = FinitePlastic(p.E, p.nu, p.density, LinearHardening(p.yield_stress, p.hardening))
    sheet = rectangle("sheet", (p.length, p.thickness), p.cells, steel, elements="Q1-bbar")
    punch = rigid_sphere("punch", p.punch_radius, (0.0, p.thickness + p.punch_radius), 1.0)
    die = rigid_sphere("die", p.shoulder_radius, (p.shoulder, -p.shoulder_radius), 1.0)
    return build_model(
        [Body("sheet", sheet), punch, die],
        supports=[
            Support("sheet", ("x",), "x-"),
            Support("die", ("x", "y", "rz")),
            Support("punch", ("x", "rz")),
            Support("punch", ("y",), velocity=lambda t: -p.stroke if t < 1 else p.stroke),
        ],
    )


def sag(model: Model, x: FloatArray, middle: NDArray[np.integer], end: int) -> float:
    """How far the middle's mean stands below the end [m]."""
    y = model.positions(x)[:, 1]
    return float(y[end] - y[middle].mean())


def slope(model: Model, x: FloatArray, end: int) -> float:
    """Angle [degrees] of the sheet's upper side at its end, over its last sixth."""
    top = np.flatnonzero(
        np.isclose(model.reference[:, 1], model.reference[end, 1]) & (model.reference[:, 0] > 5 / 6 * model.reference[end, 0])
    )
    top = top[top < model.node_offset[1]]
    positions = model.positions(x)[top]
    return float(np.degrees(np.arctan2(*np.ptp(positions, axis=0)[::-1])))


if __name__ == "__main__":
    raise SystemExit(main(["run", __file__, *sys.argv[1:]]))
