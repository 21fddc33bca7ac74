"""A disk that rolls inclined, about its centre at rest: what friction gives it is weighed by its mechanical energy, and said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import ExactContacts
from fcsim.mesh import rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.timestep import Simulation, State, Theta, at_rest
from fcsim.timestep.step import Step

ALL, G = ("x", "y", "z", "rx", "ry", "rz"), 9.81
A, DEPTH, ANGLE = 0.2, 2e-3, np.pi / 6  # radius, thickness [m], inclination


def spin() -> tuple[np.ndarray, np.ndarray, float]:
    """Axis (3,), angular velocity (3,) [rad/s] and height [m] of the steady motion: the momentum I omega turns about z by the weight's
    moment, and omega, along centre to contact, leaves the point of contact at rest."""
    axis = np.array([np.sin(ANGLE), 0.0, np.cos(ANGLE)])
    arm = A * np.array([np.cos(ANGLE), 0.0, -np.sin(ANGLE)]) - DEPTH / 2 * axis
    along = arm / np.linalg.norm(arm)
    _, rate = np.linalg.solve(np.array([[axis[0], -along[0]], [axis[2], -along[2]]]), [0.0, -1.0])
    polar, across = A**2 / 2, (3 * A**2 + DEPTH**2) / 12
    omega = rate * along
    momentum = polar * (omega @ axis) * axis + across * (omega - (omega @ axis) * axis)
    turns = np.sqrt(np.cross(arm, [0.0, 0.0, G])[1] / np.cross([0.0, 0.0, 1.0], momentum)[1])
    return axis, turns * omega, -arm[2]


def energy(state: State, first: int, axis: np.ndarray) -> float:
    """Mechanical energy [J] of the disk of 1 kg over that at its first height, at rest."""
    x, v = state.x[first : first + 6], state.v[first : first + 6]
    now = Rotation.from_rotvec(x[3:]).apply(axis)
    polar, across = A**2 / 2, (3 * A**2 + DEPTH**2) / 12
    return float(0.5 * v[:3] @ v[:3] + 0.5 * across * v[3:] @ v[3:] + 0.5 * (polar - across) * (now @ v[3:]) ** 2 + G * x[2])


def rolled(h: float, time: float) -> tuple[list[Step], list[str], float]:
    """Steps, what is said of energy, and the mechanical energy gained over that at the beginning."""
    axis, omega, height = spin()
    bodies = [rigid_plane("plane", (0, 0, 0), (0, 0, 1)), rigid_cylinder("disk", A, DEPTH, (0, 0, height), 1.0, axis)]
    model = build_model(bodies, supports=[Support("plane", ALL)], gravity=lambda t: (0.0, 0.0, -G))
    start = at_rest(model)
    v, first = start.v.copy(), int(model.dof_offset[model.number["disk"]])
    v[first + 3 : first + 6] = omega
    steps = list(Simulation(model, ExactContacts(model, 1.0), Theta(h), round(time / h), initial=State(0.0, start.x, v)))
    gained = energy(steps[-1].state, first, axis) - energy(State(0.0, start.x, v), first, axis)
    return steps, [text for step in steps for text in step.remarks if "to what rolls" in text], gained


def test_what_friction_gives_a_disk_is_named_and_falls_with_the_square_of_the_step() -> None:
    """Nothing is in the scene that gives or takes energy: what there is more of at the end was created, by friction alone."""
    gained, named = {}, {}
    for h in (4e-3, 2e-3):
        steps, said, gained[h] = rolled(h, 0.25)
        assert gained[h] == pytest.approx(sum(step.energy.contact_gain for step in steps), rel=1e-3)
        share = steps[-1].ledger.created / steps[-1].ledger.supplied
        named[h] = said
        assert len(said) == (share > 5e-3)
        assert all("'disk'" in text and "'plane'" in text for text in said)
    assert named[4e-3]
    assert 3.0 < gained[4e-3] / gained[2e-3] < 5.0


def test_a_ball_that_rolls_straight_on_is_given_nothing() -> None:
    """Without a tangential acceleration of what touches there is no work and no remark, at the same h omega."""
    bodies = [rigid_plane("plane", (0, 0, 0), (0, 0, 1)), rigid_sphere("ball", A, (0, 0, A), 1.0)]
    model = build_model(bodies, supports=[Support("plane", ALL)], gravity=lambda t: (0.0, 0.0, -G))
    start = at_rest(model)
    v, first = start.v.copy(), int(model.dof_offset[model.number["ball"]])
    v[first], v[first + 4] = 20.0 * A, 20.0
    steps = list(Simulation(model, ExactContacts(model, 1.0), Theta(2e-3), 250, initial=State(0.0, start.x, v)))
    assert abs(steps[-1].ledger.created) < 1e-9 * steps[-1].ledger.supplied
    assert not [text for step in steps for text in step.remarks if "to what rolls" in text]
