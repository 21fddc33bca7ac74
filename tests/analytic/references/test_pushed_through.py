"""Bodies at rest that loads would carry through others within one step: they are held, with the force that statics asks for."""

from typing import Any

import numpy as np
import pytest

import fcsim
from fcsim.mesh import brick, rigid_box, rigid_sphere

HELD = ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.parametrize(
    "scheme", [fcsim.Theta(1e-2), pytest.param(fcsim.Theta(1e-2, theta=1.0), marks=pytest.mark.slow), fcsim.GeneralisedAlpha(1e-2)]
)
def test_a_block_that_a_force_throws_at_a_wall_presses_it(scheme: Any) -> None:
    """1 kg under 10 kN: 1 m in the first step of 10 ms, the wall of 0.1 m is 0.4 m away. Before, it flew on behind the wall."""
    wall = rigid_box("wall", (0.1, 2.0, 2.0), (0.5, 0.0, 0.0), 1.0)
    block = rigid_box("block", (0.1, 0.1, 0.1), (0.0, 0.0, 0.0), 1.0)
    supports, push = [fcsim.Support("wall", HELD)], fcsim.Force("block", (1e4, 0.0, 0.0))
    model = fcsim.build_model([block, wall], supports=supports, loads=[push])
    *_, last = fcsim.Simulation(model, fcsim.Everything(model, mu=0.3), scheme, 20)
    assert last.state.x[0] == pytest.approx(0.4, abs=1e-6)
    assert last.contact_force_on(model.number["wall"])[0] == pytest.approx(1e4, rel=1e-6)


@pytest.mark.parametrize("shape", ["box", "ball", "elastic"])
def test_what_falls_farther_than_a_floor_is_thick_lies_on_it(shape: str) -> None:
    """h = 0.5 s: gravity alone carries by 2.45 m in the first step, through a floor of 0.1 m that is 1 m below."""
    floor = rigid_box("floor", (10.0, 10.0, 0.1), (0.0, 0.0, -0.05), 1.0)
    part = brick("soft", (0.2, 0.2, 0.2), (1, 1, 1), fcsim.Material(1e6, 0.2, 1000.0), origin=(-0.1, -0.1, 1.0))
    body: Any = {
        "box": rigid_box("body", (0.2, 0.2, 0.2), (0.0, 0.0, 1.1), 8.0),
        "ball": rigid_sphere("body", 0.1, (0.0, 0.0, 1.1), 8.0),
        "elastic": fcsim.Body("body", part),
    }[shape]
    model = fcsim.build_model([body, floor], supports=[fcsim.Support("floor", HELD)], gravity=lambda t: (0.0, 0.0, -9.81), beta=5.0)
    found: Any = (fcsim.ExactContacts if shape == "ball" else fcsim.Everything)(model, mu=0.5)
    *_, last = fcsim.Simulation(model, found, fcsim.Theta(0.5, theta=1.0 if shape == "elastic" else 0.5), 12)
    lowest = model.positions(last.state.x)[: model.node_offset[1]].min(axis=0)[2] if shape != "ball" else 0.1 + last.state.x[2] + 0.9
    assert lowest == pytest.approx(0.0, abs=1e-6)
    assert np.allclose(last.contact_force_on(0), (0.0, 0.0, 8.0 * 9.81), atol=1e-3 * 8.0 * 9.81)
