"""Published and closed problems of dynamics: D1 and D6 of the reference list of issue 16."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector
from fcsim.linkage import Linkage, SpringDamper
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta
from tests.analytic.references.loading import ANY, contact_force, held, pair


def test_D1_rod_against_a_wall() -> None:
    """VM265 (N. J. Carpenter): L 10, A 1, E 3e7, rho 0.73e-3, v 202.2, gap 0.01: impact at 4.946e-5, release at 1.4811e-4 s, force 29 923,
    rebound at -202.2 in the mean."""
    L, E, rho, v, gap, n = 10.0, 3e7, 0.73e-3, 202.2, 0.01, 50
    c = np.sqrt(E / rho)
    assert_allclose([gap / v, gap / v + 2 * L / c, E * v / c], [4.946e-5, 1.4811e-4, 29923], rtol=2e-4)
    model = build_model(
        [
            Body("rod", rectangle("rod", (L, 1.0), (n, 1), Material(E, 0.0, rho))),
            rigid_rectangle("wall", (1.0, 4.0), (L + gap + 0.5, 0.5), 1.0),
        ],
        supports=[held("wall", 2), Support("rod", ("y",))],
        kinematics="linear",
    )
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    start.v[: model.n_elastic : 2] = v
    h = 0.5 * L / n / c
    steps = round(2.2e-4 / h)
    joint = pair(model, ("rod", "x+"), ("wall", "x-"), alert=0.1, rule="nodes")
    run = Simulation(model, Detector([joint], model.n_nodes), Theta(h, 0.5), steps, initial=start, limits=ANY, witness=None)
    t, force, mean = [], [], []
    for step in run:
        t.append(step.state.t)
        force.append(-contact_force(model, step, "rod")[:, 0].sum() / h)
        mean.append(step.state.v[: model.n_elastic : 2].mean())
    t, force = np.array(t), np.array(force)
    touching = t[force > 0]
    assert_allclose([touching[0], touching[-1]], [4.946e-5, 1.4811e-4], atol=0.02 * 2 * L / c)
    assert_allclose(force[(t > 5.2e-5) & (t < 1.45e-4)].mean(), 29923, rtol=0.01)
    assert_allclose(force.sum() * h, 2 * v * rho * L, rtol=0.02)
    assert_allclose(mean[-1], -v, rtol=0.03)  # what the last cell's mass loses as it strikes: of order 1 / n


@pytest.mark.slow
def test_D6_coulomb_block_on_a_spring() -> None:
    """A block on a spring with friction: its amplitude falls by 2 mu N / k each half cycle, and it stops inside mu N / k."""
    m, k, mu, g, x0 = 2.0, 800.0, 0.1, 9.81, 0.0235
    loss = 2 * mu * m * g / k
    model = build_model(
        [rigid_rectangle("block", (0.1, 0.1), (0.0, 0.05), m), rigid_rectangle("floor", (4.0, 0.1), (0.0, -0.05), 1.0)],
        supports=[held("floor", 2), Support("block", ("rz",))],
        gravity=lambda t: (0.0, -g),
    )
    spring = SpringDamper("spring", "block", "floor", ((0.0, 0.05), (-1.0, 0.05)), k)
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    start.x[0] = x0
    half = np.pi * np.sqrt(m / k)
    joint = pair(model, ("block", "y-"), ("floor", "y+"), mu, alert=0.01, rule="nodes")
    run = Simulation(
        model, Detector([joint], model.n_nodes), Theta(half / 200, 0.5), 1200, initial=start, linkage=Linkage(model, [spring]), witness=None
    )
    x = np.array([x0, *(step.state.x[0] for step in run)])
    turns = [x[200 * k] for k in range(5)]
    expected = [(-1) ** k * (x0 - k * loss) for k in range(5)]
    assert_allclose(turns, expected, atol=2e-3 * x0)
    assert abs(x[-1]) < 0.5 * loss and abs(x[-1] - x[-100]) < 1e-6 * x0
