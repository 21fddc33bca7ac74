"""A wheel rolls on a plane: what the corners between its facets take of its energy is said, a fall is not taken for that."""

from __future__ import annotations

import re
import sys
from types import FrameType

import numpy as np
import pytest

from fcsim import Body, Everything, Material, Simulation, State, Support, Theta, build_model
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.mesh import RigidBody, brick, part_from_gmsh, rectangle, rigid_box, rigid_polygon, rigid_polyhedron, rigid_rectangle
from fcsim.mesh.part import Part
from fcsim.runtime import gmsh_model
from fcsim.timestep import Step, at_rest
from fcsim.timestep.remarks.of_shapes.corners import Corners, turning_rates

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


def begun(bodies: list[RigidBody], v: list[float], mu: float, steps: int) -> tuple[list[str], list[float]]:
    """What is said of corners, and the energies [J] until then: the second of two rigid bodies begins with v, the first is held."""
    d = bodies[0].points.shape[1]
    directions = ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz")
    model = build_model(bodies, supports=[Support(bodies[0].name, directions)], gravity=(0.0,) * (d - 1) + (-G,))
    start = at_rest(model)
    first = start.v.copy()
    first[-len(v) :] = v
    weight, energies = model.load(0.0), list[float]()
    for step in Simulation(model, Everything(model, mu), Theta(2e-3, 0.5), steps, initial=State(0.0, start.x, first)):
        energies.append(step.energy.kinetic - float(weight @ step.state.x))
        if said := [text for text in step.remarks if "corners between its facets" in text]:
            return said, energies
    return [], energies


def polygonal(sides: int, spin: float) -> tuple[list[str], list[float]]:
    """A rigid wheel that rolls on one of its sides."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides - 0.5 * np.pi
    points = R * np.column_stack([np.cos(angle), np.sin(angle)])
    high = -points[:, 1].min()
    bodies = [rigid_rectangle("floor", (6.0, 0.2), (0.0, -0.1), 1.0), rigid_polygon("wheel", points + np.array([0.0, high]), mass=1.0)]
    return begun(bodies, [spin * high, 0.0, -spin], 0.8, 100)


def test_a_rigid_wheel_of_64_sides_is_named_with_what_it_lost() -> None:
    (text,), energies = polygonal(64, 5.0)
    lost = float(re.search(r"taken ([0-9.e+-]+) J", text)[1])  # type: ignore[index]
    assert lost == pytest.approx(energies[0] - energies[-1], rel=0.1)
    assert "'wheel'" in text


def test_a_rigid_polygon_of_12_sides_is_none_of_a_circle() -> None:
    """It loses a third of its energy, as a polygon does."""
    said, energies = polygonal(12, 5.0)
    assert not said
    assert energies[-1] < 0.9 * energies[0]


def test_an_ellipsoid_of_facets_that_spins_is_named() -> None:
    """One with a point that touches loses nothing where it sticks: here each corner that comes down beside the last stops what moves along
    the floor as well."""
    n = 2000
    k = np.arange(n) + 0.5
    down, round_ = np.arccos(1 - 2 * k / n), np.pi * (1 + 5**0.5) * k
    points = np.column_stack([0.2 * np.cos(round_) * np.sin(down), 0.03 * np.sin(round_) * np.sin(down), 0.02 * np.cos(down)])
    floor = rigid_box("floor", (1.0, 1.0, 0.1), (0.0, 0.0, points[:, 2].min() - 0.05), 1.0)
    (text,), energies = begun([floor, rigid_polyhedron("stone", points, 2000.0)], [0, 0, 0, 0.0, 0.5, -5.0], 1.0, 100)
    lost = float(re.search(r"taken ([0-9.e+-]+) J", text)[1])  # type: ignore[index]
    assert 0.3 * (energies[0] - energies[-1]) < lost < 1.05 * (energies[0] - energies[-1])


def test_a_rock_of_random_points_is_no_curve() -> None:
    """It loses energy as a polyhedron does, and was asked for smaller facets."""
    points = np.random.default_rng(3).normal(size=(60, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1)[:, None]
    floor = rigid_box("floor", (4.0, 4.0, 0.1), (1.0, 0.0, points[:, 2].min() - 0.05), 1.0)
    said, energies = begun([floor, rigid_polyhedron("rock", points, 2500.0)], [1.0, 0.0, 0.0, 0.0, 10.0, 0.0], 0.8, 45)
    assert not said
    assert energies[-1] < 0.7 * energies[0]


def calls(wheels: int) -> int:
    """How many calls, of Python's and of C's functions, the remark makes in the tenth step of so many wheels that roll."""
    floor = rigid_rectangle("floor", (wheels + 3.0, 0.2), (0.5 * wheels, -0.1), 1.0)
    part = wheel(16, 1e10)
    bodies = [floor, *(Body(f"wheel {k}", part, translation=(float(k), R)) for k in range(wheels))]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, -G))
    start = at_rest(model)
    v = start.v.copy()
    arm = part.points + np.array([0.0, R])
    v[: model.n_elastic] = np.tile(np.column_stack([10.0 * arm[:, 1], -10.0 * arm[:, 0]]).ravel(), wheels)
    remark, counted, bore = Corners(), [0], np.zeros(wheels, dtype=bool)

    def count(frame: FrameType, event: str, argument: object) -> None:
        counted[0] += event in ("call", "c_call")

    for step in Simulation(model, Everything(model, 0.5), Theta(2e-3, 0.5), 10, initial=State(0.0, start.x, v)):
        counted[0] = 0
        found = deformed(step)
        sys.setprofile(count)
        try:
            remark(step, found, "", frozenset())
        finally:
            sys.setprofile(None)
        bore |= np.array([step.contact_force_on(k)[1] > 0 for k in range(wheels)])
    assert bore.all()
    return counted[0]


def deformed(step: Step) -> Deformation:
    """Bodies that have turned."""
    number = len(step.model.deformable)
    zero, no = np.zeros(number), np.zeros(number, dtype=bool)
    return Deformation(np.ones(number), zero, zero, zero, no, no, no)


def test_more_wheels_take_no_more_calls() -> None:
    """Bodies are an axis of arrays: a loop over them took 6 ms a step of 300 wheels, now 1.6 ms."""
    assert calls(6) == calls(2)


@pytest.mark.parametrize("d", [2, 3])
def test_the_rate_of_turning_is_that_of_the_motion(d: int) -> None:
    """omega x (x - a) + v of three bodies in places that are turned already, each with an omega of its own; one of them is left out."""
    material = Material(1e9, 0.2, 1000.0)
    part = rectangle("block", (0.4, 0.3), (3, 2), material) if d == 2 else brick("block", (0.4, 0.3, 0.2), (3, 2, 1), material)
    model = build_model([Body(f"block {k}", part, translation=(float(k),) + (0.0,) * (d - 1)) for k in range(3)])
    omega = np.array([[0.3, -0.1, 2.0], [1.0, 2.0, -3.0], [0.0, 0.0, 0.5]]) * ((0.0, 0.0, 1.0) if d == 2 else (1.0, 1.0, 1.0))
    turn = np.array([[0.36, -0.48, 0.8], [0.8, 0.6, 0.0], [-0.48, 0.64, 0.6]]) if d == 3 else np.array([[0.6, -0.8], [0.8, 0.6]])
    place = model.reference @ turn.T
    deep = np.zeros((len(place), 3))
    deep[:, :d] = place
    v = np.cross(np.repeat(omega, len(part.points), axis=0), deep)[:, :d] + 7.0
    found = turning_rates(model, (place - model.reference).ravel(), v.ravel(), np.array([0, 2]))
    assert found == pytest.approx(np.linalg.norm(omega[[0, 2]], axis=1), rel=1e-12)
