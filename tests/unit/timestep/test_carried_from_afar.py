"""Statics in which a support, or a load, carries a body from afar into another one within a load step."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, ExactContacts, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh import rigid_plane, rigid_sphere
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.mesh.solids.rigid_polygon import rigid_polygon
from fcsim.timestep import QuasiStatic, Simulation

YOUNG, DEPTH, ALL = 1e8, 1e-3, ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_what_a_support_brings_from_afar_bears_in_the_same_step(listed: bool, unit: float) -> None:
    """The foot of a block of 1 m ends 1 mm in a rigid floor, which it saw from 0.2 m above: E A d / h there and then."""
    block = Body("block", brick("block", (unit,) * 3, (2, 2, 1), Material(YOUNG, 0.0, 1000.0)))
    floor = rigid_box("floor", (4 * unit, 4 * unit, unit), (0.5 * unit, 0.5 * unit, -0.5 * unit), 1.0)
    height = [0.2 * unit, -DEPTH * unit, -DEPTH * unit, 0.2 * unit]
    supports = [
        Support("floor", ALL),
        Support("block", ("z",), "z+", displacement=lambda t: height[round(t) - 1] if t > 0.5 else 0.0),
        Support("block", ("x", "y"), "z+"),
    ]
    model = build_model([block, floor], supports=supports)
    pair = SurfacePair(
        contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 1e-2 * unit, "nodes", "foot"
    )
    detection = Detector([pair], model.n_nodes) if listed else Everything(model, 0.5)
    pressed = [step.contact_force_on(0)[2] / (YOUNG * DEPTH * unit**2) for step in Simulation(model, detection, QuasiStatic(1.0), 4)]
    assert pressed == pytest.approx([0.0, 1.0, 1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("floor", ["plane", "ball", "box"])
def test_what_a_load_brings_from_afar_onto_exact_shapes_bears_in_the_same_step(floor: str) -> None:
    """A ball of 1 m begins 0.3 m above: g - eta 0.3 m of its weight presses in the first step of 1 s, all of it in the second."""
    eta, height, weight = 30.0, 0.3, 1e4
    below = {
        "plane": rigid_plane("floor", (0, 0, 0), (0, 0, 1)),
        "ball": rigid_sphere("floor", 0.5, (0, 0, -0.5), mass=1.0),
        "box": rigid_box("floor", (4, 4, 1), (0, 0, -0.5), 1.0),
    }[floor]
    ball = rigid_sphere("ball", 0.5, (0, 0, 0.5 + height), mass=weight / 10)
    model = build_model([ball, below], supports=[Support("floor", ALL)], gravity=lambda t: (0.0, 0.0, -10.0))
    steps = list(Simulation(model, ExactContacts(model, 0.5), QuasiStatic(1.0, eta=eta), 2))
    pressed = [step.contact_force_on(0)[2] / weight for step in steps]
    assert pressed == pytest.approx([1 - eta * height / 10, 1.0], abs=1e-6)
    assert [step.state.x[2] for step in steps] == pytest.approx([-height, -height], abs=1e-9)


FLOOR, WALL = [(-1, -0.5), (1, -0.5), (1, 0), (-1, 0)], [(1, -0.5), (1.02, -0.5), (1.02, 1), (1, 1)]
ANGLE = [(-1, -0.5), (1.02, -0.5), (1.02, 1), (1, 1), (1, 0), (-1, 0)]
WIDTH, HALF = 0.2, 0.1


@pytest.mark.parametrize("frame", [{"angle": ANGLE}, {"floor": FLOOR, "wall": WALL}], ids=["one body", "two"])
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("eta", [1e-1, 1e-6])
def test_what_a_load_carries_through_a_wall_bears_in_it(frame: dict, rigid: bool, eta: float) -> None:
    """40 kg under 10 m/s^2 along the floor, 0.05 m from a wall a tenth as thick as they are: eta alone holds them before, so that they
    flew on behind it, 10 / eta metres away. The wall takes all but what eta has of the way; one that is one body with the floor too."""
    gap, mass, pull = 0.05, 1000 * WIDTH**2, (10.0, -9.81)
    if rigid:
        block: Body | RigidBody = rigid_rectangle("block", (WIDTH, WIDTH), (1 - gap - HALF, HALF), mass=mass)
    else:
        block = Body("block", rectangle("block", (WIDTH, WIDTH), (4, 4), Material(1e7, 0.2, 1000.0)), translation=(1 - gap - WIDTH, 0.0))
    walls = [rigid_polygon(name, np.array(shape, float), density=1e3) for name, shape in frame.items()]
    model = build_model([block, *walls], supports=[Support(name, ("x", "y", "rz")) for name in frame], gravity=lambda t: pull)
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=eta), 1)
    assert step.contact_force_on(model.number["block"]) == pytest.approx([-mass * (10.0 - eta * gap), mass * 9.81], rel=1e-4)


@pytest.mark.parametrize("distance", [0.01, 0.15])
def test_what_touches_one_side_of_a_body_is_carried_to_another(distance: float) -> None:
    """A support draws a block along the floor of an angle and 2 mm into its wall: E A d / l, without a force before. nu = 0."""
    block = Body("block", rectangle("block", (WIDTH, WIDTH), (4, 4), Material(1e7, 0.0, 1000.0)), translation=(1 - distance - WIDTH, 0.0))
    angle = rigid_polygon("angle", np.array(ANGLE, float), density=1e3)
    deep = 2e-3
    supports = [Support("angle", ("x", "y", "rz")), Support("block", ("x",), surface="x-", velocity=distance + deep)]
    model = build_model([block, angle], supports=supports, gravity=lambda t: (0.0, -9.81))
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=1e-6), 1)
    assert step.contact_force_on(0) == pytest.approx([-1e7 * deep, 9.81 * 1000 * WIDTH**2], rel=1e-4)
