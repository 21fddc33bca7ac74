"""A smooth brick that slides over the edge of a table and tips, in the plane and in space, beside Lagrange's equations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from fcsim import Everything, Simulation, State, Support, Theta, at_rest, build_model
from fcsim.mesh import rigid_box, rigid_rectangle

G, LONG, HALF = 9.81, 0.2, 0.05  # [m/s^2]; length and half the height of the brick [m]


def tipped(time: float) -> np.ndarray:
    """Angle [rad] and speed along the brick's underside after the centre, at 1 m/s, has passed the edge.

    With s the way of the centre beyond the edge along the underside, c its height over that and q the angle, the centre moves by
    (s' + c q') t - s q' n: T = ((s' + c q')^2 + s^2 q'^2 + k^2 q'^2) / 2, V = g (c cos q - s sin q).
    """
    k2 = (LONG**2 + (2 * HALF) ** 2) / 12

    def rates(_: float, y: np.ndarray) -> list[float]:
        s, q, ds, dq = y
        inertia = np.array([[1.0, HALF], [HALF, HALF**2 + s**2 + k2]])
        force = [s * dq**2 + G * np.sin(q), -2 * s * ds * dq + G * (s * np.cos(q) + HALF * np.sin(q))]
        return [ds, dq, *np.linalg.solve(inertia, force)]

    return solve_ivp(rates, (0.0, time), [0.0, 0.0, 1.0, 0.0], rtol=1e-9).y[1, -1]


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("L", [1.0, 1e3])
def test_a_brick_tips_over_the_edge(d: int, L: float) -> None:
    """2 cm before the edge the brick stands level; 8 cm beyond it has turned as the equations say, and its energy is what it was: while it
    has turned by less than a degree, too, and its trailing corners are within the alert distance of the table."""
    if d == 2:
        table = rigid_rectangle("table", (L, 0.5 * L), (-0.5 * L, -0.25 * L), 1.0)
        brick = rigid_rectangle("brick", (LONG * L, 2 * HALF * L), (-0.02 * L, HALF * L), 2.0)
    else:
        table = rigid_box("table", (L, L, 0.5 * L), (-0.5 * L, 0.0, -0.25 * L), 1.0)
        brick = rigid_box("brick", (LONG * L, 0.1 * L, 2 * HALF * L), (-0.02 * L, 0.0, HALF * L), 2.0)
    held = Support("table", ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))
    model = build_model([table, brick], supports=[held], gravity=lambda t: (0.0,) * (d - 1) + (-G * L,))
    start, first = at_rest(model), int(model.dof_offset[1])
    v = start.v.copy()
    v[first] = L
    h, turned = 1e-3, first + (2 if d == 2 else 4)
    steps = list(Simulation(model, Everything(model, mu=0.0), Theta(h), 100, initial=State(0.0, start.x, v)))
    assert abs(steps[19].state.x[turned]) < 1e-9
    for k in (60, 100):
        assert_allclose(abs(steps[k - 1].state.x[turned]), tipped(h * k - 0.02), rtol=2e-3)
    energy = [step.energy.kinetic + 2.0 * G * L * step.state.x[first + d - 1] for step in steps]
    assert_allclose(energy, L**2, rtol=2e-5)
