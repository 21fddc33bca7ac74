"""Derivatives of runs with quadratic cells, driven rotations, loads that follow, sizes in the plane: against differences of whole runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import FollowerPressure
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Everything, ExactContacts
from fcsim.mesh import brick, rectangle, rigid_box, rigid_rectangle, rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.sensitivity import sensitivities
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta

EXACT = SolverSettings(name="auto", tol=1e-12)
GROUND = Support("ground", ("x", "y", "z", "rx", "ry", "rz"))


def quadratic(E: float, mu: float, speed: float) -> Simulation:
    """A block of Q2 cells that falls on the ground and slides."""
    part = brick("block", (0.3, 0.2, 0.1), (2, 2, 1), Material(E, 0.3, 1000.0), elements="Q2")
    bodies = [Body("block", part, translation=(-0.15, -0.1, 1e-4)), rigid_box("ground", (4, 4, 0.2), (0, 0, -0.1), 1.0)]
    model = build_model(bodies, supports=[GROUND], gravity=lambda t: (0, 0, -9.81))
    v = np.zeros(model.n_dofs)
    v[0 : model.n_elastic : 3] = speed
    start = State(0.0, np.zeros(model.n_dofs), v)
    return Simulation(model, Everything(model, mu), Theta(1e-3), 20, EXACT, initial=start, witness=None)


def table(acceleration: float) -> Simulation:
    """A ball on a table that turns."""
    bodies = [rigid_sphere("ball", 0.1, (0.5, 0, 0.1), 2.0), rigid_box("table", (4, 4, 0.2), (0, 0, -0.1), 1.0)]
    turned = DrivenRotation("table", lambda t: acceleration * t**2, (0, 0, 0), (0, 0, 1))
    model = build_model(bodies, supports=[turned], gravity=lambda t: (0, 0, -9.81))
    return Simulation(model, ExactContacts(model, 0.4), Theta(2e-3), 30, EXACT, witness=None)


def follower(pressure: float, E: float) -> Simulation:
    """A beam held at one end under a pressure that follows its upper side."""
    beam = Body("beam", brick("beam", (0.3, 0.2, 0.1), (3, 2, 2), Material(E, 0.3, 1000.0)))
    model = build_model([beam], supports=[Support("beam", ("x", "y", "z"), "x-")], loads=[FollowerPressure("beam", "z+", pressure)])
    return Simulation(model, Everything(model, 0.3), Theta(1e-3), 20, EXACT, witness=None)


def size(length: float, density: float) -> Simulation:
    """A block in the plane that slides down a slope, its length and density."""
    part = rectangle("block", (length, 0.1), (4, 2), Material(1e6, 0.3, density), plane="strain")
    bodies = [Body("block", part, translation=(0, 1e-4)), rigid_rectangle("ground", (4, 0.2), (0, -0.1), 1.0)]
    model = build_model(bodies, supports=[Support("ground", ("x", "y", "rz"))], gravity=lambda t: (4.9, -9.81))
    return Simulation(model, Everything(model, 0.2), Theta(1e-3, theta=0.6), 20, EXACT, witness=None)


@pytest.mark.parametrize(
    ("build", "parameters", "allowed"),
    [
        (quadratic, {"E": 1e6, "mu": 0.3, "speed": 1.0}, 1e-6),
        (table, {"acceleration": 0.8}, 1e-6),
        (follower, {"pressure": 2e3, "E": 1e6}, 1e-6),
        (size, {"length": 0.3, "density": 1000.0}, 3e-5),
    ],
)
def test_against_whole_runs(build: Callable[..., Simulation], parameters: Mapping[str, float], allowed: float) -> None:
    """dx/dp and dv/dp after the last step."""
    *_, (_, found) = sensitivities(build, parameters)
    for name, value in parameters.items():
        d = 1e-5 * value
        (*_, high), (*_, low) = (list(build(**{**parameters, name: value + side})) for side in (d, -d))
        for of in ("x", "v"):
            expected = (getattr(high.state, of) - getattr(low.state, of)) / (2 * d)
            own = getattr(found[name].state, of)
            assert np.abs(expected).max() > 0
            assert np.abs(own - expected).max() <= allowed * np.abs(expected).max(), (name, of)


def test_steps_in_which_nothing_moves_any_more() -> None:
    """A block that hangs from its upper side, its weight all there from the first step on: dx/dE = -x/E after every step. Of an end that is
    moved and then stays, what f is made of is in the supports' force alone, and E moves nothing."""

    def hung(E: float, weight: float, way: float) -> Simulation:
        part = rectangle("block", (0.2, 0.1), (2, 2), Material(E, 0.2, 1000.0))
        supports = [Support("block", ("x", "y"), "y+")]
        if way:
            supports.append(Support("block", ("y",), "y-", displacement=lambda t: -way * min(t, 0.5)))
        model = build_model([Body("block", part)], supports=supports, gravity=lambda t: (0, -weight))
        return Simulation(model, Everything(model, 0.3), QuasiStatic(0.5), 3, EXACT)

    E = 1e7
    for step, found in sensitivities(lambda E: hung(E, 9.81, 0.0), {"E": E}):
        assert_allclose(found["E"].state.x, -step.state.x / E, atol=1e-9 * np.abs(step.state.x).max() / E)
    for step, found in sensitivities(lambda E: hung(E, 0.0, 1e-3), {"E": E}):
        assert np.abs(found["E"].state.x).max() < 1e-9 * np.abs(step.state.x).max() / E
