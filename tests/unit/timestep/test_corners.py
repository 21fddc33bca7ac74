"""A deformable wheel rolls on a plane: what the corners between its facets take of its energy is said, a fall is not taken for that."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fcsim import Body, Everything, Material, Simulation, State, Support, Theta, build_model
from fcsim.mesh import part_from_gmsh, rigid_rectangle
from fcsim.mesh.part import Part
from fcsim.runtime import gmsh_model
from fcsim.timestep import at_rest

R, G = 0.3, 9.81


def wheel(sides: int, E: float) -> Part:
    """A disk of curved triangles of second order, `sides` around."""
    with gmsh_model("wheel") as gmsh:
        disk = gmsh.model.occ.addDisk(0.0, 0.0, 0.0, R, R)
        gmsh.model.occ.synchronize()
        for option in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(option, 2 * np.pi * R / sides)
        gmsh.model.addPhysicalGroup(2, [disk], name="wheel")
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        return part_from_gmsh(gmsh, "wheel", Material(E, 0.3, 1000.0), elements="P2")


def rolled(E: float, spin: float, fall: float) -> tuple[list[str], list[float]]:
    """What is said of corners, and the energies [J], that of gravity too, after steps of 2 ms; the wheel rolls at `spin` [rad/s], and
    comes down at `fall` [m/s]."""
    bodies = [rigid_rectangle("floor", (4.0, 0.2), (0.0, -0.1), 1.0), Body("wheel", wheel(16, E), translation=(0.0, R))]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -G))
    start = at_rest(model)
    v, place = start.v.copy(), bodies[1].points
    v[: model.n_elastic] = np.column_stack([spin * place[:, 1], -fall - spin * place[:, 0]]).ravel()
    said, energies = [], []
    weight = model.load(0.0)
    for step in Simulation(model, Everything(model, 0.5), Theta(2e-3, 0.5), 50, initial=State(0.0, start.x, v)):
        said += [text for text in step.remarks if "corners between its facets" in text]
        energies.append(step.energy.kinetic + step.energy.elastic - float(weight @ step.state.x))
        if said:
            break
    return said, energies


def test_a_stiff_wheel_that_loses_energy_to_its_corners_is_named_with_what_it_lost() -> None:
    """Nothing but contact takes energy from it at theta = 1/2."""
    (text,), energies = rolled(1e10, 10.0, 0.0)
    lost = float(re.search(r"taken ([0-9.e+]+) J", text)[1])  # type: ignore[index]
    assert lost == pytest.approx(energies[0] - energies[-1], rel=0.1)
    assert "'wheel'" in text


@pytest.mark.parametrize(("E", "spin", "fall"), [(1e8, 10.0, 0.0), (1e8, 5.0, 1.0)], ids=["soft", "falls"])
def test_a_soft_wheel_and_a_fall_are_not_named(E: float, spin: float, fall: float) -> None:
    """A soft wheel loses a hundredth; what falls loses more, by the law of impacts."""
    said, energies = rolled(E, spin, fall)
    assert not said
    assert (energies[0] - energies[-1]) / energies[0] < 0.02 or fall
