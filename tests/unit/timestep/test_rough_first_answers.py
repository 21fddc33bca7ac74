"""First answers of steps between rigid blocks on springs say where to look; the last one is by the settings' tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim import Compliant, Everything, Gap, Simulation, SolverSettings, Springs, State, Support, Theta, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_law.law import Law
from fcsim.mesh import rigid_box
from fcsim.timestep.step_equation.look_ahead import ahead

STEP = 2e-3
SPRINGS = Compliant(Springs(normal=1e7, tangential=4e6, normal_damping=1e4, tangential_damping=4e3, each=True))


def rocking(law: Law, steps: int = 40) -> Simulation:
    """Four boxes on each other, the upper ones thrown sideways: faces open and close over new corners."""
    bodies = [rigid_box(f"box {k}", (0.2, 0.25, 0.1), (0.02 * k, 0.01 * k, 0.05 + 0.1 * k), 2000.0) for k in range(4)]
    bodies.append(rigid_box("floor", (4.0, 4.0, 0.4), (0, 0, -0.2), 1.0))
    model = build_model(bodies, supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: np.array([0.5, 0.3, -9.81]))
    start = at_rest(model)
    v = start.v.copy()
    model.rigid_part(v)[1:4, :2] = np.array([[0.1, -0.1], [0.3, 0.1], [0.4, 0.3]])
    model.rigid_part(v)[2:4, 3:] = np.array([[0.8, 0.3, 0.0], [0.5, 1.0, 0.5]])
    settings, detector = SolverSettings(tol=1e-9), Everything(model, 0.5)
    return Simulation(model, detector, Theta(STEP, 0.5, law), steps, settings, initial=State(0.0, start.x, v), witness=None)


def test_the_last_answer_of_each_step_is_by_the_settings() -> None:
    rougher = 0
    for step in rocking(SPRINGS):
        *earlier, last = step.attempts
        assert last.tol <= 1e-9 and step.result.error <= 1e-9
        rougher += sum(attempt.tol > 1e-6 for attempt in earlier)
    assert rougher > 10


def test_steps_meet_what_they_meet_with_fine_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contacts that lie about as deep as is borne, a micrometre, are met by the one run and not by the other; boxes move by centimetres."""
    rough = list(rocking(SPRINGS))
    monkeypatch.setattr(ahead, "MEANT", 0.0)
    fine = list(rocking(SPRINGS))
    assert all(attempt.tol <= 1e-9 for step in fine for attempt in step.attempts)
    for a, b in zip(rough, fine, strict=True):
        assert np.abs(a.state.x - b.state.x).max() <= 1e-4, a.number
    assert np.abs(fine[-1].state.x).max() > 1e-2


def test_joints_without_stiffness_are_solved_finely_at_once() -> None:
    assert all(attempt.tol <= 1e-9 for step in rocking(Gap(), 10) for attempt in step.attempts)
