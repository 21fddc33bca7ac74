"""Two tumbling rigid boxes collide in free flight: what mechanics conserves, whatever the contacts do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Velocity
from fcsim.mesh.blocks import rigid_box
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta


@pytest.mark.parametrize(("mu", "restitution"), [(0.0, 1.0), (0.6, 0.0)])
def test_collision_of_two_tumbling_boxes(mu: float, restitution: float) -> None:
    """A corner meets a face in free flight. Linear momentum is constant, and so is angular momentum about a fixed point: the scheme moves
    through the configuration of the contacts, where both bodies have friction in one point. Without friction and with restitution 1 the
    kinetic energy comes back, up to the square of the turning of the bodies during the step; else some is lost."""
    low, high = rigid_box("low", (0.4, 0.3, 0.1), (0, 0, 0), 2.0), rigid_box("high", (0.1, 0.15, 0.3), (0.08, 0.05, 0.32), 1.0)
    model = build_model([low, high])
    pair = SurfacePair(
        contact_surface(model, [("high", side) for side in high.surfaces]), contact_surface(model, [("low", "z+")]), mu, 5e-3
    )
    initial = at_rest(model)
    initial.v[:] = [0, 0, 0.3, 0.4, -0.2, 0.5, 0.1, 0, -1.0, 3.0, 2.0, -4.0]
    settings = SolverSettings(name="auto", tol=1e-12)
    run = Simulation(model, Detector([pair], model.n_nodes), Theta(5e-4, law=Velocity(restitution)), 300, settings, initial)
    steps = list(run)

    def totals(state: State) -> tuple[np.ndarray, np.ndarray, float]:
        """Linear and angular momentum about the origin, and kinetic energy."""
        momentum = model.apply_mass(state.v, model.rigid_mass(state.x)).reshape(2, 6)
        centre = np.array([low.centre, high.centre]) + state.x.reshape(2, 6)[:, :3]
        energy = 0.5 * float(state.v @ momentum.ravel())
        return momentum[:, :3].sum(axis=0), (np.cross(centre, momentum[:, :3]) + momentum[:, 3:]).sum(axis=0), energy

    linear, angular, energy = zip(*(totals(state) for state in [initial, *(step.state for step in steps)]), strict=True)
    impulses = np.array([np.linalg.norm(step.result.r) for step in steps])
    assert impulses.max() > 0.1
    assert_allclose(linear, np.tile(linear[0], (301, 1)), atol=1e-13)
    assert_allclose(angular, np.tile(angular[0], (301, 1)), atol=1e-12)
    if restitution:
        assert energy[-1] == pytest.approx(energy[0], rel=1e-6)
    else:
        assert energy[-1] < 0.9 * energy[0]
    flight = impulses == 0  # between impacts the energy oscillates with the orientation, by the square of the step
    assert np.abs(np.diff(energy)[flight]).max() < 1e-5 * energy[0]


@pytest.mark.parametrize("rho", [0.8, pytest.param(1.0, marks=pytest.mark.slow)])
def test_generalised_alpha_gives_the_energy_of_an_elastic_impact_back_with_order_two(rho: float) -> None:
    """With the inertia of another configuration than that of the contacts it would be of order one, and 100 times larger."""
    errors = []
    for h in (1e-3, 5e-4):
        low, high = rigid_box("low", (0.4, 0.3, 0.1), (0, 0, 0), 2.0), rigid_box("high", (0.1, 0.15, 0.3), (0.08, 0.05, 0.32), 1.0)
        model = build_model([low, high])
        sides = [("high", side) for side in high.surfaces]
        pair = SurfacePair(contact_surface(model, sides), contact_surface(model, [("low", "z+")]), 0.0, 5e-3)
        initial = at_rest(model)
        initial.v[:] = [0, 0, 0.3, 0.4, -0.2, 0.5, 0.1, 0, -1.0, 3.0, 2.0, -4.0]
        settings = SolverSettings(name="auto", tol=1e-12)
        scheme = GeneralisedAlpha(h, rho, Velocity(1.0))
        steps = list(Simulation(model, Detector([pair], model.n_nodes), scheme, round(0.15 / h), settings, initial))
        assert max(np.abs(step.result.r).max(initial=0.0) for step in steps) > 0.1
        assert max(abs(step.energy.residual) for step in steps) < 1e-14
        before = 0.5 * float(initial.v @ model.apply_mass(initial.v, model.rigid_mass(initial.x)))
        errors.append(abs(steps[-1].energy.kinetic / before - 1))
    assert errors[0] < 5e-6 and errors[0] / errors[1] > 3.5
