"""What runs say of contact laws where they leave what they cover, and what they do not say elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from fcsim import (
    Cohesive,
    Compliant,
    Detector,
    Everything,
    ExactContacts,
    Gap,
    Rolling,
    Simulation,
    Spinning,
    State,
    Support,
    SurfacePair,
    Theta,
    Velocity,
    build_model,
    contact_surface,
)
from fcsim.contact_law import Springs
from fcsim.errors import Penetration
from fcsim.mesh import rigid_box, rigid_capsule, rigid_plane, rigid_sphere

HELD = ("x", "y", "z", "rx", "ry", "rz")


def _said(run: Simulation, word: str) -> list[str]:
    return [remark for step in run for remark in step.remarks if word in remark]


def _row(air: float, law: Gap | Velocity, walls: Sequence[Any] = ()) -> Simulation:
    """Five balls of 0.1 m in a row, the first one at 1 m/s from 20 mm away."""
    balls = [rigid_sphere(f"ball {k}", 0.1, ((0.2 + air) * k - (0.02 if k == 0 else 0.0), 0.0, 0.0), 1.0) for k in range(5)]
    model = build_model(balls)
    v = np.zeros(model.n_dofs)
    v[0] = 1.0
    return Simulation(model, ExactContacts(model, 0.0), Theta(1e-3, 0.5, law), 40, initial=State(0.0, np.zeros(model.n_dofs), v))


def test_a_blow_that_goes_on_through_touching_balls_is_said() -> None:
    """The first ball comes back at 1 - 2 m / (m + M) = -0.6 from four that leave as one of their mass; a cradle gives all to the last."""
    run = _row(0.0, Velocity(1.0))
    steps = list(run)
    assert steps[-1].state.v[0] == pytest.approx(-0.6, abs=1e-6)
    said = [remark for step in steps for remark in step.remarks if "is struck by" in remark]
    assert len(said) == 1 and "'ball 1' is struck by 'ball 0' while it touches 'ball 2'" in said[0]


@pytest.mark.parametrize("run", [_row(5e-3, Velocity(1.0)), _row(0.0, Gap()), _row(0.0, Velocity(0.0))], ids=["air", "gap", "inelastic"])
def test_balls_with_air_and_laws_without_restitution_say_nothing(run: Simulation) -> None:
    assert not _said(run, "is struck by")


def test_a_stack_at_rest_and_a_ball_that_bounces_are_not_struck_together() -> None:
    floor = rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    balls = [rigid_sphere(f"ball {k}", 0.1, (0.0, 0.0, 0.1 + 0.2 * k), 1.0) for k in range(3)] + [
        rigid_sphere("free", 0.1, (1, 0, 0.12), 1.0)
    ]
    model = build_model([floor, *balls], supports=[Support("floor", HELD)], gravity=lambda t: (0.0, 0.0, -9.81))
    assert not _said(Simulation(model, ExactContacts(model, 0.3), Theta(1e-3, 0.5, Velocity(0.5)), 150), "is struck by")


@pytest.mark.parametrize(("mu", "e", "gives"), [(0.6, 1.0, True), (0.0, 1.0, False), (0.6, 0.0, False)])
@pytest.mark.parametrize("h", [1e-3, 1e-4])
def test_an_impact_to_which_friction_gives_energy_is_said(mu: float, e: float, gives: bool, h: float) -> None:
    """A rod that strikes the floor askew with its end: the energy after the impact by Newton's restitution and the cone in closed form.

    The end slides at 0.1 m/s and comes down at 1: the normal reaction alone would turn the slip round, and friction stops it.
    """
    L, angle, thin = 1.0, np.radians(45.0), 1e-4
    c, s = np.cos(angle), np.sin(angle)
    end = np.array([-0.5 * L * c, -0.5 * L * s])
    rod = rigid_capsule("rod", thin, L, tuple(-end + [0.0, thin + 0.5e-3 * h]), 1.0, (c, s))
    model = build_model([rigid_plane("floor", (0, 0), (0, 1)), rod], supports=[Support("floor", ("x", "y", "rz"))])
    v = np.zeros(model.n_dofs)
    first = model.dof_offset[model.number["rod"]]
    v[first : first + 2] = (0.1, -1.0)
    start = State(0.0, np.zeros(model.n_dofs), v)
    steps = list(Simulation(model, ExactContacts(model, mu), Theta(h, 0.5, Velocity(e)), 3, initial=start, created=np.inf, witness=None))
    inertia = float(rod.inertia[0, 0])
    arm = end - [0.0, thin]
    rows = np.array([[0.0, 1.0, arm[0]], [1.0, 0.0, -arm[1]]])  # normal, tangential velocity of the end
    W = rows @ np.diag([1.0, 1.0, 1 / inertia]) @ rows.T
    stick = np.linalg.solve(W, [1.0 + e, -0.1])
    r = stick
    if abs(stick[1]) > mu * stick[0]:
        side = np.sign(stick[1])
        r = (1.0 + e) / (W[0] @ [1.0, side * mu]) * np.array([1.0, side * mu])
    gained = r @ (np.array([-1.0, 0.1]) + 0.5 * W @ r)
    assert steps[-1].energy.kinetic - 0.505 == pytest.approx(gained, abs=1e-4)
    assert (gained > 1e-3) == gives
    said = [remark for step in steps for remark in step.remarks if "Kane" in remark]
    assert len(said) == gives
    if gives:
        assert f"gives {gained:.3g} J" in said[0] or f"{100 * gained / 0.505:.2g} %" in said[0]


@pytest.mark.parametrize("h", [1e-2, 1e-4])
def test_a_box_at_rest_has_no_impact_that_gives_energy(h: float) -> None:
    """Gravity strikes it on the floor in every step, with restitution and friction: what its points then move by is round-off."""
    floor, box = rigid_box("floor", (3, 3, 0.1), (0, 0, -0.05), 1.0), rigid_box("box", (0.1, 0.1, 0.1), (0, 0, 0.05), 100.0)
    model = build_model([floor, box], supports=[Support("floor", HELD)], gravity=lambda t: (0.0, 0.0, -9.81))
    pair = SurfacePair(contact_surface(model, [("box", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 0.01)
    assert not _said(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=Velocity(0.9)), 5), "Kane")


@pytest.mark.parametrize("theta", [0.5, 0.8, 1.0])
def test_a_ball_that_rebounds_has_no_impact_that_gives_energy(theta: float) -> None:
    """It falls straight, without slip, and keeps e^2 of its energy; at theta > 1 / (1 + e) the scheme counts r u+ instead."""
    ball = rigid_sphere("ball", 0.05, (0, 0, 0.06), 1.0)
    model = build_model(
        [rigid_plane("floor", (0, 0, 0), (0, 0, 1)), ball], supports=[Support("floor", HELD)], gravity=lambda t: (0, 0, -9.81)
    )
    assert not _said(Simulation(model, ExactContacts(model, 0.3), Theta(2e-3, theta, Velocity(0.9)), 40), "Kane")


def _bonded(**law: Any) -> Simulation:
    floor, block = rigid_box("floor", (1, 1, 0.1), (0, 0, -0.05), 1.0), rigid_box("block", (0.1, 0.1, 0.1), (0, 0, 0.05), 1.0)
    model = build_model([floor, block], supports=[Support("floor", HELD)], gravity=lambda t: (0.0, 0.0, -9.81))
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 0.01)
    cohesive = Cohesive(tension=1e4, mode_1=10.0, mode_2=10.0, **law)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(1e-3, law=cohesive), 2)


def test_rigid_bodies_bonded_on_four_points_are_named_where_their_strength_depends_on_the_shares() -> None:
    (said,) = _said(_bonded(shear=1.5e4), "are bonded")
    assert "'block' and 'floor'" in said or "'floor' and 'block'" in said
    assert "4 points" in said
    for law in ({}, {"shear": 0.5e4}, {"shear": 1.5e4, "springs": Springs(normal=1e10, tangential=1e10)}):
        assert not _said(_bonded(**law), "are bonded"), law


def _ball(law: Any) -> Simulation:
    """A ball of 8 kg and R = 0.1 m on a plane, pushed along it by 0.3 g."""
    bodies = [rigid_plane("floor", (0, 0, 0), (0, 0, 1)), rigid_sphere("ball", 0.1, (0.0, 0.0, 0.1), 8.0)]
    model = build_model(bodies, supports=[Support("floor", HELD)], gravity=lambda t: (0.3 * 9.81, 0.0, -9.81))
    return Simulation(model, ExactContacts(model, 0.5), Theta(1e-2, 0.5, law), 10)


@pytest.mark.parametrize(("arm", "told"), [(10.0, 1), (0.11, 1), (0.02, 0), (0.0, 0)])
@pytest.mark.parametrize("law", [Rolling, Spinning])
def test_a_lever_arm_longer_than_what_turns_is_said(law: Any, arm: float, told: int) -> None:
    """A resistance of 0.2 R is that of a car on sand; one above R holds the ball on a slope of 45 degrees, whatever mu lets."""
    said = _said(_ball(law(arm)), "lever arm in m")
    assert len(said) == told
    assert all(
        f"{law.__name__}({arm:g}) is a lever arm in m, longer than the radius of any body that can turn, 0.1 m" in text for text in said
    )


def test_springs_too_soft_are_named_where_they_end_a_run() -> None:
    """k = 100 N/m under 78 N: the ball would come to rest 0.78 m below the floor's surface, four times its diameter."""
    with pytest.raises(Penetration, match="The springs of the contact law are too soft for what presses on them, or contacts were missed"):
        list(_ball(Compliant(Springs(normal=100.0, tangential=100.0, each=True))))


def test_a_state_has_not_what_springs_remember_and_that_is_said() -> None:
    """A block drawn over springs at 1 mm/s: after 8 ms the whole run holds it by 4 k v t; a run that begins from the state at 5 ms by what
    3 ms stretch; one that goes on from the moment by all of it."""
    k, v, h = 1e4, 1e-3, 1e-3
    bodies = [rigid_box("block", (0.2, 0.2, 0.1), (0, 0, 0.05), 1.0), rigid_box("floor", (1, 1, 0.1), (0, 0, -0.05), 1.0)]
    drawn = [Support("block", ("x",), velocity=v), Support("block", ("y", "rx", "ry", "rz")), Support("floor", HELD)]
    model = build_model(bodies, supports=drawn, gravity=lambda t: (0.0, 0.0, -9.81))
    table = Everything(model, 0.5)

    def run(law: Any, steps: int, initial: State | None = None) -> Simulation:
        return Simulation(model, table, Theta(h, 1.0, law), steps, initial=initial, created=np.inf)

    law = Compliant(Springs(normal=1e6, tangential=k, each=True))
    whole = list(run(law, 8))
    word = "what the contact law remembers: tangential springs begin without stretch"
    again, on = list(run(law, 3, whole[4].state)), list(run(law, 8).run(whole[4].moment))
    for steps, stretched, said in ((whole, 8, False), (on, 8, False), (again, 3, True)):
        assert -steps[-1].contact_force_on("block")[0] == pytest.approx(4 * k * v * stretched * h, rel=1e-3)
        assert [word in remark for step in steps for remark in step.remarks if "remembers" in remark] == [True] * said
    assert not _said(run(Gap(), 1, whole[4].state), "remembers")
