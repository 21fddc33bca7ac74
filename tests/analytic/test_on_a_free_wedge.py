"""A ball rolls or slides down a wedge that is free to move along the floor, in any units: Lagrange's equations, and momentum."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim import Simulation, SolverSettings, Support, Theta, build_model
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh import rigid_polyhedron, rigid_sphere

G, SLOPE = 9.81, np.deg2rad(30)


@pytest.mark.each_value
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("mu", "spun"), [(0.6, 0.4), (0.0, 0.0)], ids=["rolls", "slides"])
def test_a_ball_on_a_wedge_free_to_move(mu: float, spun: float, unit: float) -> None:
    """With inertia k m r^2 (k = 2/5, or 0 without friction, where it does not turn) it goes down along the slope relative to the wedge by
    s'' = g sin a / (1 + k - m cos^2 a / (m + M)), and the wedge goes by X'' = -m cos a s'' / (m + M)."""
    run, rise, radius = 2.0 * unit, 2.0 * unit * np.tan(SLOPE), 0.1 * unit
    corners = [(x, y, z) for y in (-0.5 * unit, 0.5 * unit) for x, z in ((0.0, 0.0), (run, 0.0), (0.0, rise))]
    normal = np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    ball = rigid_sphere("ball", radius, np.array([0.3 * run, 0.0, 0.7 * rise]) + radius * normal, 8.0 * unit**3)
    wedge = rigid_polyhedron("wedge", np.array(corners), 20.0)
    gravity = (0.0, 0.0, -G * unit)
    model = build_model([ball, wedge], supports=[Support("wedge", ("y", "z", "rx", "ry", "rz"))], gravity=lambda t: gravity)
    m, M = ball.mass, wedge.mass
    *_, step = Simulation(model, ExactContacts(model, mu), Theta(2e-3, 0.5), 100, SolverSettings(name="auto", tol=1e-10))
    along = G * unit * np.sin(SLOPE) / (1 + spun - m * np.cos(SLOPE) ** 2 / (m + M)) * step.state.t
    moved = -m * np.cos(SLOPE) / (m + M) * along
    v = {name: step.state.v[model.dof_offset[k := model.number[name]] : model.dof_offset[k] + 3] for name in ("ball", "wedge")}
    assert abs(moved) > 0.05 * along
    assert v["wedge"][0] == pytest.approx(moved, rel=1e-6)
    assert v["ball"] == pytest.approx([moved + along * np.cos(SLOPE), 0.0, -along * np.sin(SLOPE)], rel=1e-6, abs=1e-6 * along)
    assert m * v["ball"][0] + M * v["wedge"][0] == pytest.approx(0.0, abs=1e-8 * m * along)
    assert not step.remarks
