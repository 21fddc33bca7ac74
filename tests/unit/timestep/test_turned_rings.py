"""A ring with an interference that statics turn in its casing: it bears Lame's pressure and is braked by mu N, however far a step turns it.

The contacts of a step's beginning open by R (1 - cos(angle)) as bodies turn: of an interference of 1e-3 R a step of 2.25
degrees left 0.23, of 4.5 nothing. The pressure of both rings, held within and without, is that of `test_raised`.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from fcsim import (
    Body,
    Compliant,
    Detector,
    DrivenRotation,
    Everything,
    Material,
    Model,
    QuasiStatic,
    RigidBody,
    Simulation,
    Springs,
    Step,
    Support,
    SurfacePair,
    Witness,
    build_model,
    contact_surface,
)
from fcsim.errors import InputError
from fcsim.mesh import Part

E, NU, A, B, C, INTERFERENCE, MU = 1e7, 0.3, 0.05, 0.1, 0.15, 1e-4, 0.3


def lame(elastic: tuple[float, ...] = (A, C)) -> float:
    """The force between the rings [N] a metre of their axis (G. Lame, 1852); elastic: the other radius of those that are."""
    give = [B * abs(1 - k) / (E / (1 + NU) * (1 / (1 - 2 * NU) + k)) for k in ((other / B) ** 2 for other in elastic)]
    return 2 * np.pi * B * INTERFERENCE / sum(give)


def ring(name: str, inner: float, outer: float, around: int, first: float) -> Part:
    angle, radius = first + 2 * np.pi * np.arange(around) / around, np.linspace(inner, outer, 4)
    points = (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    here, after = np.arange(around), np.roll(np.arange(around), -1)
    cells = np.concatenate([np.stack([k + here, k + around + here, k + around + after, k + after], axis=1) for k in np.arange(3) * around])
    surfaces = {"in": np.stack([after, here], axis=1), "out": 3 * around + np.stack([here, after], axis=1)}
    return Part(name, points, cells, "quadrilateral", surfaces, Material(E, NU, 1000.0), elements="Q1-enhanced")


def contact_between(model: Model, rule: str, mu: float) -> Any:
    if rule == "Everything":
        return Everything(model, mu)
    surfaces = contact_surface(model, [("hub", "out")]), contact_surface(model, [("casing", "in")])
    pair = SurfacePair(*surfaces, mu, 5e-3, cast(Any, rule), normals="smooth" if rule == "nodes" else "facet")
    return Detector([pair], model.n_nodes)


def torque_on_hub(step: Step) -> float:
    """Of the contacts, about the axis [N m a metre]."""
    contacts, force = step.contacts, np.einsum("ad,ade->ae", step.contact_force, step.contacts.frame)
    on_hub = np.where(contacts.bodies[:, 0] == step.model.number["hub"], 1.0, -1.0)
    return float(on_hub @ (contacts.point[:, 0] * force[:, 1] - contacts.point[:, 1] * force[:, 0]))


@pytest.mark.parametrize("mu", [0.0, MU])
@pytest.mark.parametrize("degrees", [0.5, 2.25, 9.0, 40.0, 100.0])
@pytest.mark.parametrize("rule", ["mortar", "nodes", "Everything"])
def test_a_ring_turns_in_its_casing(rule: str, degrees: float, mu: float) -> None:
    """What turns it has the moment of friction, none without: forces act where the ring is when they are in balance. Steps of more than a
    fifth of a radian are cut."""
    bodies = [Body("casing", ring("casing", B, C, 28, 0.03)), Body("hub", ring("hub", A, B + INTERFERENCE, 36, 0.0), kinematics="turning")]
    turned = DrivenRotation("hub", lambda t: np.deg2rad(degrees) * max(t - 1.0, 0.0), (0.0, 0.0), surface="in")
    model = build_model(bodies, supports=[Support("casing", ("x", "y"), "out"), turned])
    steps = list(Simulation(model, contact_between(model, rule, mu), QuasiStatic(1.0), 3, witness=Witness(initial="allow")))
    for step in steps:
        assert step.contact_force[:, 0].sum() == pytest.approx(lame(), rel=0.02)
        assert not any("fit each other" in said for said in step.remarks)
    own = slice(*model.node_offset[[1, 2]])
    place, held = model.positions(steps[-1].state.x)[own], steps[-1].support_impulse[: model.n_elastic].reshape(-1, 2)[own]
    driving = (place[:, 0] * held[:, 1] - place[:, 1] * held[:, 0]).sum()
    for moment in (driving, -torque_on_hub(steps[-1])):
        assert moment / (B * lame()) == pytest.approx(mu, abs=0.005)


@pytest.mark.parametrize("mu", [0.0, MU])
@pytest.mark.parametrize("degrees", [1.0, 9.0, 40.0])
@pytest.mark.parametrize("rule", ["mortar", "nodes"])
def test_a_rigid_wheel_turns_in_a_ring(rule: str, degrees: float, mu: float) -> None:
    """The lever arms of its contacts are those of where they bear: R sin(angle) less otherwise."""
    angle, at = 2 * np.pi * np.arange(36) / 36, np.arange(36)
    rim = (B + INTERFERENCE) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    wheel = RigidBody("hub", 1.0, [[1.0]], [0.0, 0.0], rim, {"out": np.stack([at, np.roll(at, -1)], axis=1)})
    speed = Support("hub", ("rz",), velocity=lambda t: np.deg2rad(degrees) if t > 1 else 0.0)
    held = [Support("casing", ("x", "y"), "out"), Support("hub", ("x", "y")), speed]
    model = build_model([Body("casing", ring("casing", B, C, 28, 0.03)), wheel], supports=held)
    *_, last = Simulation(model, contact_between(model, rule, mu), QuasiStatic(1.0), 3, witness=Witness(initial="allow"))
    assert last.contact_force[:, 0].sum() == pytest.approx(lame((C,)), rel=0.02)
    moment = (last.H @ last.result.r)[model.dof_offset[model.number["hub"]] + 2]
    for found in (moment, torque_on_hub(last)):
        assert found / (B * lame((C,))) == pytest.approx(-mu, abs=0.005)


@pytest.mark.parametrize("rule", ["mortar", "nodes"])
def test_a_rigid_casing_turns_about_a_ring(rule: str) -> None:
    """Without friction it has no moment."""
    angle, at = 0.03 + 2 * np.pi * np.arange(28) / 28, np.arange(28)
    rim, edge = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.stack([at, np.roll(at, -1)], axis=1)
    surfaces = {"in": edge[:, ::-1], "out": 28 + edge}
    casing = RigidBody("casing", 1.0, [[1.0]], [0.0, 0.0], np.concatenate([B * rim, C * rim]), surfaces)
    speed = Support("casing", ("rz",), velocity=lambda t: np.deg2rad(9.0) if t > 1 else 0.0)
    held = [Support("hub", ("x", "y"), "in"), Support("casing", ("x", "y")), speed]
    model = build_model([Body("hub", ring("hub", A, B + INTERFERENCE, 36, 0.0)), casing], supports=held)
    *_, last = Simulation(model, contact_between(model, rule, 0.0), QuasiStatic(1.0), 3, witness=Witness(initial="allow"))
    moment = (last.H @ last.result.r)[model.dof_offset[model.number["casing"]] + 2]
    assert abs(moment) < 1e-3 * B * last.contact_force[:, 0].sum()
    assert last.contact_force[:, 0].sum() == pytest.approx(lame((A,)), rel=0.03)


def turned_together(degrees: float) -> Model:
    """Both rings, held and turned within and without by the same angle in each step but the first."""
    kinds = (("casing", ring("casing", B, C, 28, 0.03), "out"), ("hub", ring("hub", A, B + INTERFERENCE, 36, 0.0), "in"))
    bodies = [Body(name, part, kinematics="turning") for name, part, _ in kinds]
    turned = [DrivenRotation(name, lambda t: np.deg2rad(degrees) * max(t - 1.0, 0.0), (0.0, 0.0), surface=held) for name, _, held in kinds]
    return build_model(bodies, supports=turned)


@pytest.mark.parametrize("mu", [0.0, MU])
@pytest.mark.parametrize("degrees", [1.0, 9.0, 30.0, -360.0])
@pytest.mark.parametrize("rule", ["mortar", "nodes", "Everything"])
def test_rings_that_turn_together_press_as_before(rule: str, degrees: float, mu: float) -> None:
    """Held and turned within and without by the same angle: nothing slides, and the normals turn with both. By those of a step's beginning
    the pressure was 0.85 of Lame's in a step of 9 degrees, with friction the moment sin(9 degrees) N R."""
    model = turned_together(degrees)
    for step in Simulation(model, contact_between(model, rule, mu), QuasiStatic(1.0), 3, witness=Witness(initial="allow")):
        assert step.contact_force[:, 0].sum() == pytest.approx(lame(), rel=0.01)
        assert abs(torque_on_hub(step)) < 1e-3 * B * lame()


@pytest.mark.parametrize("degrees", [3.0, 9.0])
def test_a_ring_carries_another_round_by_friction(degrees: float) -> None:
    """The outer one has no support: its reactions have no moment, and it turns by the same angle."""
    bodies = [
        Body("casing", ring("casing", B, C, 28, 0.03), kinematics="turning"),
        Body("hub", ring("hub", A, B + INTERFERENCE, 36, 0.0), kinematics="turning"),
    ]
    turned = DrivenRotation("hub", lambda t: np.deg2rad(degrees) * max(t - 1.0, 0.0), (0.0, 0.0), surface="in")
    model = build_model(bodies, supports=[turned])
    scheme = QuasiStatic(1.0, eta=1.0)
    for step in Simulation(model, contact_between(model, "mortar", MU), scheme, 3, witness=Witness(initial="allow")):
        R = model.elastic.rotation(model.elastic.at(step.state.x))
        assert abs(torque_on_hub(step)) < 1e-3 * B * lame()
    angle = np.rad2deg(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    assert angle == pytest.approx(2 * degrees, rel=2e-3)


@pytest.mark.parametrize(("degrees", "said"), [(2.0, False), (9.0, True)])
def test_joints_that_turn_by_much_in_a_step_are_named(degrees: float, said: bool) -> None:
    """Joints with stiffness have the contacts of the beginning."""
    model = turned_together(degrees)
    scheme = QuasiStatic(1.0, law=Compliant(Springs(normal=1e12, tangential=1e12)))
    steps = list(Simulation(model, contact_between(model, "mortar", MU), scheme, 2, witness=None))
    remarks = [remark for step in steps for remark in step.remarks if "stiffness or adhesion" in remark]
    assert len(remarks) == said
    assert all("'casing'" in remark and "'hub'" in remark and "0.16 rad" in remark for remark in remarks)


def test_what_may_not_be_cut_is_refused() -> None:
    """Nothing bore after a step of 100 degrees, and nothing was said."""
    model = turned_together(100.0)
    simulation = Simulation(model, contact_between(model, "mortar", MU), QuasiStatic(1.0), 2, witness=Witness(initial="allow"), cuttings=0)
    with pytest.raises(InputError, match=r"at most 1 rad in a part of a load step, got 1\.75 rad of '(casing|hub)': take more steps"):
        list(simulation)
