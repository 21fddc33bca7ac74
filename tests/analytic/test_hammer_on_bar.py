"""A rigid hammer on the end of a deformable bar."""

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta


def test_hammer_is_slowed_down_by_the_wave_it_sends() -> None:
    """v = V exp(-rho c A t / M) until the wave is back at 2 L / c (Saint-Venant), where waves of bars have nu = 0; momentum stays M V."""
    E, rho, A, L, M, V, h = 1e9, 2000.0, 0.01, 2.0, 20.0, 1.0, 2e-5
    c = np.sqrt(E / rho)
    bar = Body("bar", brick("bar", size=(L, 0.1, 0.1), divisions=(80, 1, 1), material=Material(E=E, nu=0.0, density=rho)))
    hammer = rigid_box("hammer", (0.2, 0.1, 0.1), (-0.1 - 1e-9, 0.05, 0.05), M)
    model = build_model([hammer, bar], supports=[Support("hammer", ("y", "z", "rx", "ry", "rz"))])
    at, first = model.dof_offset[model.number["hammer"]], model.dof_offset[model.number["bar"]]
    along = np.zeros(model.dof_offset[-1])
    along[at], along[first : first + 3 * 81 * 4 : 3] = 1.0, 1.0
    start = at_rest(model)
    start.v[at] = V
    for step in Simulation(model, Everything(model, 0.3), Theta(h, theta=0.5), int(1.9 * L / c / h), SolverSettings(tol=1e-10), start):
        momentum = along @ model.apply_mass(step.state.v, model.rigid_mass(step.state.x))
        assert momentum == pytest.approx(M * V, rel=1e-10)
        if step.number * h > 0.2 * L / c:
            assert step.state.v[at] == pytest.approx(V * np.exp(-rho * c * A * step.number * h / M), abs=2e-3)
