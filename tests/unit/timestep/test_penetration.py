"""The penetration that a step tells of is that at its end, whatever its law saw of it."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.mesh.blocks import rigid_box
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta

HELD = ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.each_value
@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("law", [Velocity(0.5), Velocity(0.0), Gap()])
def test_a_box_that_falls_on_the_floor(law: Any, theta: float, scale: float) -> None:
    """In every step the lowest corner below the floor, from the states alone; the law on velocities lets a box in by less than the way of
    a step, the law on gaps not at all, in metres and in millimetres."""
    box, floor = rigid_box("box", (scale,) * 3, (0, 0, 0.6 * scale), 1.0), rigid_box("floor", (9 * scale,) * 3, (0, 0, -4.5 * scale), 1.0)
    model = build_model([box, floor], supports=[Support("floor", HELD)], gravity=lambda t: (0, 0, -9.81 * scale))
    start = at_rest(model)
    start.v[:6] = [0.1 * scale, 0, -3 * scale, 0, 0, 0]
    pair = SurfacePair(contact_surface(model, [("box", "z-")]), contact_surface(model, [("floor", "z+")]), 0.3, 0.1 * scale)
    h, deepest = 7e-3, 0.0
    for step in Simulation(model, Detector([pair], model.n_nodes), Theta(h, theta, law), 40, initial=start, witness=None, created=np.inf):
        lowest = model.positions(step.state.x)[:8, 2].min()
        assert_allclose(step.penetration, max(-lowest, 0.0), atol=2e-6 * scale)
        deepest = max(deepest, step.penetration)
    limit = 1e-5 * scale if isinstance(law, Gap) else 3.4 * scale * h
    assert deepest <= limit and (isinstance(law, Gap) or deepest > 0.02 * limit)


def test_tetrahedra_that_tumble_on_the_floor_are_not_deep_in_it() -> None:
    """Contacts that are found ahead are brought back to where bodies stood, with gaps that were no penetration of theirs."""
    corners = 0.1 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    bodies = [rigid_polyhedron(f"t{k}", corners @ _turn(0.7 * k + 0.3) + [0.05 * k, 0.03 * k, 0.25 + 0.4 * k], 2000.0) for k in range(2)]
    floor = rigid_box("floor", (4, 4, 1), (0, 0, -0.5), 1.0)
    model = build_model([*bodies, floor], supports=[Support("floor", HELD)], gravity=lambda t: (0, 0, -9.81))
    deepest = 0.0
    for step in Simulation(model, Everything(model, 0.5), Theta(2e-3, law=Gap()), 180):
        lowest = model.positions(step.state.x)[:8, 2].min()
        assert max(-lowest, 0.0) - 1e-6 <= step.penetration <= 1e-3
        deepest = max(deepest, -lowest)
    assert deepest < 1e-4


def _turn(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
