"""A box on a turntable that friction carries round: how far it creeps is known in closed form, and said where it is much."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Body, DrivenRotation, Everything, Gap, GeneralisedAlpha, Material, Simulation, State, Step, Theta, at_rest, build_model
from fcsim.mesh import brick, rigid_box

AT_ONCE = Gap(recovery=np.inf)
"""A law that takes no drift back, see `fcsim.timestep.reactions.drift`."""
RADIUS, OMEGA = 0.3, 2.0  # [m], [rad/s]: a quarter of the friction is needed


def carried(scheme: Any, steps: int, omega: float = OMEGA, elastic: bool = False) -> tuple[float, list[Step]]:
    """ln of the last distance from the axis over the first, and the steps."""
    table = rigid_box("table", (2.0, 2.0, 0.1), (0.0, 0.0, -0.05), 1.0)
    low = (RADIUS - 0.01, -0.01, 0.0)
    soft = brick("box", (0.02, 0.02, 0.02), (1, 1, 1), Material(E=1e8, nu=0.3, density=1000.0), origin=low)
    box = Body("box", soft) if elastic else rigid_box("box", (0.02, 0.02, 0.02), (RADIUS, 0.0, 0.01), 1.0)
    driven = DrivenRotation("table", lambda t: omega * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model = build_model([table, box], supports=[driven], gravity=lambda t: (0.0, 0.0, -9.81), beta=1e-3, kinematics="turning", lumped=False)
    start = at_rest(model, h=scheme.h)
    v, first = start.v.copy(), int(model.dof_offset[model.number["box"]])
    x = model.reference[:8] if elastic else np.array([[RADIUS, 0.0, 0.01]])
    v[first : first + x.size] = omega * np.cross((0.0, 0.0, 1.0), x).ravel()
    if not elastic:
        v[first + 5] = omega
    done = list(Simulation(model, Everything(model, mu=0.5), scheme, steps, initial=State(0.0, start.x, v)))
    x = x + done[-1].state.x[first : first + x.size].reshape(-1, 3)
    return float(np.log(np.hypot(*x.mean(axis=0)[:2]) / RADIUS)), done


@pytest.mark.each_value
@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("scheme", [Theta(5e-3, law=AT_ONCE), Theta(5e-3, 1.0, AT_ONCE), GeneralisedAlpha(5e-3, 0.8, law=AT_ONCE)])
def test_how_far_it_creeps(scheme: Any, elastic: bool) -> None:
    """By h omega / 2 of its distance a radian, said as soon as that is 1 % of the box (its size is its diagonal / sqrt 3 or less)."""
    grown, steps = carried(scheme, 40, elastic=elastic)
    assert_allclose(grown, 40 * (scheme.h * OMEGA) ** 2 / 2, rtol=0.05)
    ((number, text),) = [(step.number, text) for step in steps for text in step.remarks if "have crept" in text]
    assert "'box'" in text and "'table'" in text
    crept = number * (scheme.h * OMEGA) ** 2 / 2 * RADIUS
    assert 0.9 * 0.01 * 0.02 < crept < 1.2 * 0.01 * 0.02


@pytest.mark.parametrize("scheme", [Theta(5e-3), Theta(5e-3, 1.0), GeneralisedAlpha(5e-3, 0.8)])
def test_what_is_taken_back_does_not_creep(scheme: Any) -> None:
    """A box that stands still on the table stays where it is, but for what the first steps leave, before anything is known."""
    grown, steps = carried(scheme, 40)
    assert abs(grown) < 2 * (scheme.h * OMEGA) ** 2 / 2
    assert not [text for step in steps for text in step.remarks if "have crept" in text]


def test_a_pebble_that_goes_further_than_is_taken_back_creeps_alone() -> None:
    """R (omega h)^2 / 2 a step is 3e-4 sizes of a box, which is taken back, and 5e-3 of a pebble; that ended it for all bodies."""
    bodies = [
        rigid_box("box", (0.05, 0.05, 0.05), (RADIUS, 0.0, 0.025), 1.0),
        rigid_box("pebble", (0.003, 0.003, 0.003), (-RADIUS, 0.0, 0.0015), 1.0),
        rigid_box("table", (2.0, 2.0, 0.1), (0.0, 0.0, -0.05), 1.0),
    ]
    driven = DrivenRotation("table", lambda t: OMEGA * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model = build_model(bodies, supports=[driven], gravity=lambda t: (0.0, 0.0, -9.81))
    start, spin = at_rest(model, h=5e-3), OMEGA * np.array([0.0, 0.0, 1.0])
    v = start.v.copy()
    for k, x in enumerate((RADIUS, -RADIUS)):
        v[model.dof_offset[k] : model.dof_offset[k] + 6] = np.concatenate([np.cross(spin, (x, 0.0, 0.0)), spin])
    done = list(Simulation(model, Everything(model, mu=0.5), Theta(5e-3), 20, initial=State(0.0, start.x, v)))
    radii = np.linalg.norm(model.positions(done[-1].state.x)[:16, :2].reshape(2, 8, 2).mean(axis=1), axis=1)
    box, pebble = np.log(radii / RADIUS)
    assert abs(box) < 2 * (5e-3 * OMEGA) ** 2 / 2
    assert_allclose(pebble, 20 * (5e-3 * OMEGA) ** 2 / 2, rtol=0.1)


def test_what_hardly_turns_in_a_step_is_not_told() -> None:
    """A tenth of the turning in a step: a hundredth of the way, and nothing is said; nor of a box on a table that stands."""
    for omega in (OMEGA / 10, 0.0):
        grown, steps = carried(Theta(5e-3, law=AT_ONCE), 40, omega)
        assert abs(grown - 40 * (5e-3 * omega) ** 2 / 2) < 1e-6
        assert not [text for step in steps for text in step.remarks if "have crept" in text]
