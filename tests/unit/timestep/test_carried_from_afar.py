"""Statics in which a support, or a load, carries a body from afar into another one within a load step."""

from __future__ import annotations

import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, ExactContacts, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh import rigid_plane, rigid_sphere
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
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
