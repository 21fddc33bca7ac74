"""Steps that turn, or whose impacts bring new contacts about, end without overlap and without energy from nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim import Everything, Gap, RigidBody, Simulation, SolverSettings, State, Support, Theta, Velocity, Witness, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import rigid_box

SETTINGS = SolverSettings(name="auto", tol=1e-6)


def tumbling(metre: float, h: float, steps: int) -> Simulation:
    """Four boxes that turn at some 20 rad/s above a floor; all lengths, also gravity's, in units of `metre`."""
    rng = np.random.default_rng(3)
    size = (0.2 * metre, 0.15 * metre, 0.1 * metre)
    bodies: list[RigidBody] = [
        rigid_box(f"box {k}", size, (k % 2 * 0.3 * metre, k // 2 * 0.3 * metre, 0.3 * metre), 2000.0) for k in range(4)
    ]
    bodies.append(rigid_box("floor", (4 * metre, 4 * metre, 0.4 * metre), (0, 0, -0.2 * metre), 1.0))
    model = build_model(bodies, supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: np.array([0, 0, -9.81 * metre]))
    start = at_rest(model)
    v = start.v.copy()
    model.rigid_part(v)[:4, 3:] = rng.normal(size=(4, 3)) * 12
    model.rigid_part(v)[:4, :3] = rng.normal(size=(4, 3)) * metre
    witness = Witness(every=1, tolerance=0.01, stop=False)  # measured, not refused
    return Simulation(model, Everything(model, 0.4), Theta(h, 0.5, Gap()), steps, SETTINGS, initial=State(0.0, start.x, v), witness=witness)


@pytest.mark.parametrize("metre", [1.0, 1e-3])
def test_tumbling_boxes_do_not_overlap_however_much_a_step_turns_them(metre: float) -> None:
    """omega h = 0.1: a straight step would leave R (omega h)^2 / 2 = half a per cent of a box, again and again."""
    for step in tumbling(metre, 5e-3, 120):
        assert step.overlap is not None
        assert step.overlap.share <= 1e-4, f"step {step.number}: {step.overlap.between}"
        assert step.ledger.created <= 1e-4 * step.ledger.supplied


def in_a_row(v: float, h: float, steps: int) -> Simulation:
    """Three equal boxes in a row without friction or gravity, 65 mm and 10 mm apart; the first one flies at v."""
    places = (0.0, 0.265, 0.475)
    bodies = [rigid_box(f"box {k}", (0.2, 0.2, 0.2), (x, 0.0, 0.0), 1000.0) for k, x in enumerate(places)]
    model = build_model(bodies)
    start = at_rest(model)
    velocity = start.v.copy()
    model.rigid_part(velocity)[0, 0] = v
    witness = Witness(every=1, tolerance=0.01, stop=False)
    scheme = Theta(h, 0.5, Gap())
    return Simulation(model, Everything(model, 0.0), scheme, steps, SETTINGS, initial=State(0.0, start.x, velocity), witness=witness)


@pytest.mark.parametrize("h", [5e-4, 2e-3])
def test_what_an_impact_throws_against_a_third_body_meets_it(h: float) -> None:
    """At 2 ms the second box would fly 1 cm into the third within the step that struck it: it was not moving, and none looked there.
    Inelastic, so that all three go on at a third of the velocity (momentum)."""
    run = in_a_row(20.0, h, 20)
    for step in run:
        assert step.overlap is not None and step.overlap.share <= 1e-4, step.number
    velocity = run.model.rigid_part(step.state.v)
    assert velocity[:, 0] == pytest.approx(20.0 / 3, rel=1e-6)
    assert np.abs(velocity[:, 1:]).max() < 1e-5


def test_a_law_that_does_not_ask_for_gaps_is_left_alone() -> None:
    """Moreau's law finds an impact when it is past: looking ahead changes nothing, and each step is solved once."""
    run = tumbling(1.0, 2e-3, 60)
    run = Simulation(run.model, run.detector, Theta(2e-3, 0.5, Velocity(0.0)), 60, SETTINGS, initial=run.initial, witness=None)
    assert all(len([a for a in step.attempts if a.status == "solved"]) == step.substeps for step in run)


def on_a_corner(name: str, rotation: Rotation, low: float) -> RigidBody:
    """A unit cube of 1 t, turned, its lowest point at the height `low`."""
    box, R = rigid_box(name, (1.0, 1.0, 1.0), (0, 0, 0), 1000.0), rotation.as_matrix()
    points = box.points @ R.T
    centre = np.array([0.0, 0.0, low - points[:, 2].min()])
    return RigidBody(name, box.mass, box.inertia, centre, points + centre, box.surfaces)


CORNER, EDGE_X, EDGE_Y = (
    Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0],
    Rotation.from_euler("x", 45, degrees=True),
    Rotation.from_euler("y", 45, degrees=True),
)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [(CORNER, CORNER), (EDGE_X, EDGE_Y), (Rotation.identity(), CORNER), (EDGE_X, EDGE_X), (EDGE_X, CORNER)],
    ids=["corner on corner", "edge across edge", "corner on face", "edge along edge", "corner on edge"],
)
def test_a_cube_dropped_on_a_corner_or_an_edge_is_held_there(lower: Rotation, upper: Rotation) -> None:
    """At 1 m/s, 1 mm a step: what comes beside faces is no contact before it is there. Inelastic: it stands on the spot, slowly losing its
    balance, where an edge lies along an edge it slides off to one side."""
    held = on_a_corner("held", lower, 0.0)
    model = build_model(
        [held, on_a_corner("dropped", upper, held.points[:, 2].max() + 1e-3)],
        supports=[Support("held", DIRECTIONS[3])],
        gravity=lambda t: np.array([0, 0, -9.81]),
    )
    start = at_rest(model)
    v = start.v.copy()
    model.rigid_part(v)[1, 2] = -1.0
    witness = Witness(every=1, tolerance=0.01, stop=False)
    run = Simulation(model, Everything(model, 0.5), Theta(1e-3, 0.5, Gap()), 30, SETTINGS, initial=State(0.0, start.x, v), witness=witness)
    for step in run:
        assert step.overlap is not None and step.overlap.share <= 1e-4, step.number
        assert step.ledger.created <= 1e-4 * step.ledger.supplied
    if lower is not EDGE_X or upper is not EDGE_X:
        assert model.rigid_part(step.state.x)[1, 2] == pytest.approx(-1e-3, abs=1e-4)
        assert abs(model.rigid_part(step.state.v)[1, 2]) < 0.02
