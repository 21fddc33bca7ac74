"""What turns together and goes apart by s (omega h)^2 / 2 a step is taken back together, `fcsim.timestep.reactions.drift`."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim import Everything, Gap, Simulation, SolverSettings, Support, Theta, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_law import StaticKinetic
from fcsim.contact_law.coulomb import NO_GAP
from fcsim.mesh import rigid_box, rigid_rectangle
from fcsim.timestep import substep
from fcsim.timestep.reactions import drift
from fcsim.timestep.reactions.drift import CLOSE, FITS, LEAST, TURNS, drift_of, fits, least_motion, turn_apart
from fcsim.timestep.step import Step

H, SIZE, SIDE = 5e-3, 0.1, 0.2


def toppling(steps: int, sideways: float, scale: float = 1.0) -> list[Step]:
    """Four boxes on each other and a floor; a load sideways of so many g turns them about an edge as one; scale: of all lengths."""
    box = (SIDE * scale, 0.25 * scale, SIZE * scale)
    bodies = [rigid_box(f"box {k}", box, (0, 0, (0.05 + SIZE * k) * scale), 2000.0) for k in range(4)]
    bodies.append(rigid_box("floor", (4.0 * scale, 4.0 * scale, 0.4 * scale), (0, 0, -0.2 * scale), 1.0))
    load = 9.81 * scale * np.array([sideways, 0.0, -1.0])
    model = build_model(bodies, supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: load)
    return list(Simulation(model, Everything(model, 0.8), Theta(H, law=Gap()), steps, SolverSettings(), witness=None))


def opened(step: Step) -> float:
    """The largest gap, in sizes, of contacts that bear at the end."""
    bears = step.result.r.reshape(-1, 3)[:, 0] > 0
    return float(np.abs(step.contacts.gap[bears]).max() / step.encounter.meeting.size.min())


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_joints_in_motion_are_open_by_no_more_than_one_step_leaves(scale: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """H omega is the same in all units; a joint SIZE above the next one opens by SIZE (omega h)^2 / 2 in a step."""
    last = toppling(12, 0.53, scale)[-1]
    omega = float(np.linalg.norm(last.model.rigid_part(last.state.v)[1, 3:]))
    left = 0.5 * (omega * H) ** 2
    assert left > 10 * LEAST and opened(last) <= left
    monkeypatch.setattr(substep, "drift_of", lambda *_: None)
    assert opened(toppling(12, 0.53, scale)[-1]) > 3 * left


def test_what_rests_has_none() -> None:
    assert all(step.encounter.meeting.drift is None for step in toppling(4, 0.2))


def test_what_a_motion_of_bodies_made_it_takes_back() -> None:
    H, free = sp.csc_array(np.random.default_rng(0).normal(size=(12, 24))), np.arange(6)
    moved = np.concatenate([np.arange(1.0, 7.0), np.zeros(6)])
    found = least_motion(H, np.ones((8, 3)), (H.T @ moved).reshape(8, 3), free)
    assert found is not None and np.allclose(found, -moved, atol=1e-9)


def test_gaps_that_are_gone_at_once_and_first_steps_have_none() -> None:
    step = toppling(1, 0.7)[0]
    assert drift_of(step.scheme, step.model, None) is None and step.encounter.meeting.drift is None
    assert drift_of(Theta(H, law=Gap(recovery=np.inf)), step.model, step.reactions) is None
    assert drift_of(Theta(H, law=Gap(friction=StaticKinetic(0.4, 0.3))), step.model, step.reactions) is None
    assert drift_of(step.scheme, step.model, step.reactions) is not None


def test_a_body_that_overlaps_the_groove_it_sticks_in_is_not_thrown_out() -> None:
    """Wedged by mu > 1 in a groove of right angles; the whole overlap as drift along both faces made some J in the second step."""
    over, aslope = 5e-4 * SIDE, np.sqrt(0.5)
    bodies = [
        rigid_rectangle("box", (SIDE, SIDE), (0, 0), 2000.0),
        rigid_rectangle("below", (2.0, 1.0), (-0.5, -0.5 - SIDE / 2 + over), 1.0),
        rigid_rectangle("beside", (1.0, 2.0), (0.5 + SIDE / 2 - over, 0.5), 1.0),
    ]
    load = 9.81 * np.array([aslope, -aslope])
    model = build_model(bodies, supports=[Support(name, DIRECTIONS[2]) for name in ("below", "beside")], gravity=lambda t: load)
    steps = list(Simulation(model, Everything(model, 1.2), Theta(1e-3, law=Gap()), 2, SolverSettings(tol=1e-6), witness=None))
    assert steps[-1].contacts.gap.min() < -0.9 * over
    fastest = np.sqrt(2.0) * NO_GAP * SIDE / 1e-3
    assert max(step.energy.kinetic for step in steps) <= 1.01 * 0.5 * 2000.0 * fastest**2


@pytest.mark.parametrize(
    ("first", "gap", "bore", "fit"),
    [(2 * CLOSE, 0.0, False, False), (2 * CLOSE, 5e-6, True, False), (2 * CLOSE, 5e-6, False, True), (0.5 * CLOSE, 0.0, False, True)],
)
def test_what_bore_or_touches_must_be_taken_back_where_joints_are_open(first: float, gap: float, bore: bool, fit: bool) -> None:
    """Two contacts of bodies of SIZE, the first one bore; dq leaves too much of the second. What is hardly apart need not fit."""
    left = SIZE * np.array([0.5 * FITS, -2 * FITS])
    assert fits(left, SIZE * np.array([first, gap]), np.array([True, bore]), np.full(2, SIZE)) is fit


@pytest.mark.parametrize(("turn", "none"), [(1.01 * TURNS, True), (0.99 * TURNS, False)])
def test_there_is_none_where_bodies_turn_against_each_other(turn: float, none: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drift, "turn_apart", lambda *_: turn)
    assert (toppling(3, 0.53)[-1].encounter.meeting.drift is None) is none


def test_a_common_turn_and_that_of_what_slides_are_none() -> None:
    """Three boxes of one mass and a pebble on a floor, which slides or sticks: the mean of |turn|^2 by mass about its mean."""
    bodies = [rigid_box(f"box {k}", (SIDE, SIDE, SIDE), (0, 0, (0.5 + k) * SIDE), 2000.0) for k in range(3)]
    bodies.append(rigid_box("pebble", (0.01 * SIDE,) * 3, (1.0, 0, 0.005 * SIDE), 2e-3))
    bodies.append(rigid_box("floor", (4.0, 4.0, 0.4), (0, 0, -0.2), 1e6))
    model = build_model(bodies, supports=[Support("floor", DIRECTIONS[3])])
    whole, hinged, pebble = np.zeros((3, 5, 6))
    whole[:4, 4] = 1e-5
    hinged[:3, 4] = 1e-5 * np.array([1.0, 0.0, -1.0])
    pebble[3, 4] = 1e-5
    boxes, all_of_them = np.array([[0, 1], [1, 2], [0, 4]]), np.array([[0, 1], [1, 2], [3, 4]])
    assert turn_apart(model, whole.ravel(), all_of_them) < 1e-12
    assert turn_apart(model, hinged.ravel(), boxes) == pytest.approx(1e-5 * np.sqrt(2 / 3), rel=1e-12)
    assert turn_apart(model, pebble.ravel(), boxes) == 0.0
    assert turn_apart(model, pebble.ravel(), all_of_them) == pytest.approx(1e-5 * np.sqrt(1e-6 / 3), rel=1e-5)
