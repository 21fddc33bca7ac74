"""Loads that follow a body: resultants from formulas, the motion of a spinning rigid body in closed form."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.kinematics.following import When
from fcsim.assembly.loads import FollowerForce, FollowerPressure, Force, ForceAtPoint, Traction
from fcsim.assembly.model import build_model
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta


def test_pressure_on_the_faces_of_a_box() -> None:
    """p A inwards; through the middle of the face: about a centre of mass that is not below it, a moment."""
    box = rigid_box("box", (2.0, 3.0, 5.0), (0, 0, 0), 7.0, (2, 3, 4))
    for surface, force in {"x+": (-15, 0, 0), "x-": (15, 0, 0), "y+": (0, -10, 0), "z-": (0, 0, 6)}.items():
        vector = build_model([box], loads=[FollowerPressure("box", surface, 4.0)]).load(0.0)
        assert_allclose(vector, [*np.multiply(force, 4.0), 0, 0, 0], atol=1e-12)
    shifted = RigidBody("box", 7.0, box.inertia, np.array([0.5, 0, 0]), box.points, box.surfaces)
    vector = build_model([shifted], loads=[FollowerPressure("box", "z+", 1.0)]).load(0.0)
    assert_allclose(vector, [0, 0, -6, 0, -0.5 * 6, 0], atol=1e-12)  # (-0.5, 0, 2.5) x (0, 0, -6)
    everywhere = [FollowerPressure("box", side, 1.0) for side in box.surfaces]
    assert_allclose(build_model([shifted], loads=everywhere).load(0.0), 0, atol=1e-12)
    flat = rigid_rectangle("box", (2.0, 3.0), (0.5, 0), 7.0)
    moved = RigidBody("box", 7.0, flat.inertia, np.array([0.0, 0]), flat.points, flat.surfaces)
    assert_allclose(build_model([moved], loads=[FollowerPressure("box", "y-", 2.0)]).load(0.0), [0, 4, 0.5 * 4], atol=1e-12)


def test_a_follower_turns_with_its_body() -> None:
    box = rigid_box("box", (2.0, 3.0, 5.0), (1, 2, 3), 7.0)
    still = Force("box", (0.0, 1.0, 0.0))
    model = build_model([box], loads=[FollowerForce("box", (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), lambda t: t), still])
    R = Rotation.from_rotvec([0.3, -0.8, 0.5])
    x = np.concatenate([[9.0, 8.0, 7.0], R.as_rotvec()])
    assert_allclose(model.load(2.0, x), [*(2 * R.apply([1, 2, 3]) + [0, 1, 0]), *(2 * R.apply([4, 5, 6]))])
    assert_allclose(model.load(2.0), [2, 5, 6, 8, 10, 12])


@pytest.mark.parametrize("scheme", [Theta, lambda h: GeneralisedAlpha(h, 0.5)])
def test_thrust_on_a_spinning_body(scheme: Any) -> None:
    """A force f fixed to a plane body that spins with omega: v = f / (m omega) (sin, 1 - cos)(omega t); order 2."""
    mass, f, omega, end = 2.0, 3.0, 5.0, 1.0
    bodies = [rigid_rectangle("a", (1, 1), (0, 0), mass), rigid_rectangle("far", (1, 1), (1e3, 0), 1.0)]
    model = build_model(bodies, loads=[FollowerForce("a", (f, 0.0))])
    pair = SurfacePair(contact_surface(model, [("a", "x+")]), contact_surface(model, [("far", "x-")]), 0.0, 1e-3)
    initial = at_rest(model)
    initial.v[2] = omega
    exact = f / (mass * omega) * np.array([np.sin(omega * end), 1 - np.cos(omega * end)])
    errors = []
    for steps in (20, 40):
        last = list(Simulation(model, Detector([pair], model.n_nodes), scheme(end / steps), steps, initial=initial))[-1]
        assert abs(last.energy.residual) < 1e-12
        errors.append(np.linalg.norm(last.state.v[:2] - exact))
    assert_allclose(np.log2(errors[0] / errors[1]), 2, atol=0.1)


def test_pressure_on_a_deformable_body_is_a_load_of_its_own_where_the_body_rotates() -> None:
    """Of linear kinematics it is the traction -p n of the reference, turned with the body's placement; else it is not in `load`."""
    part = brick("soft", (1, 2, 3), (1, 2, 1), Material(1e6, 0.3, 1e3))
    R = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    body = Body("soft", part, rotation=R)
    pressure, dead = FollowerPressure("soft", "x+", 4.0, lambda t: 1 + t), Traction("soft", "x+", tuple(-4.0 * R[:, 0]), lambda t: 1 + t)
    small = build_model([body], loads=[pressure], kinematics="linear")
    assert not small.following
    assert_allclose(small.load(2.0), build_model([body], loads=[dead]).load(2.0), atol=1e-12)
    free = build_model([body], loads=[pressure])
    assert_allclose(free.load(2.0), 0)
    x, turn = np.zeros(free.n_dofs), Rotation.from_rotvec([0.0, 0.0, 1.0]).as_matrix()
    assert_allclose(free.following.force(x, When.at(2.0)), small.load(2.0), atol=1e-12)
    x[:] = (body.points @ turn.T - body.points).ravel()
    there = free.following.force(x, When(0.0, 2.0, 0.25))  # 0.75 f(0) + 0.25 f(2)
    assert_allclose(there.reshape(-1, 3).sum(axis=0), -1.5 * 4.0 * 6.0 * turn @ R[:, 0], atol=1e-12)


@pytest.mark.parametrize("R", [np.eye(3), Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()], ids=["straight", "placed"])
def test_a_force_on_a_surface_turns_with_it(R: np.ndarray) -> None:
    """Its resultant acts at the middle of the surface, however the cells divide it; of linear kinematics it stays as it is."""
    part = brick("soft", (1, 1, 1), (2, 3, 2), Material(1e6, 0.3, 1e3))
    part = replace(part, points=part.points**1.5 * [1.0, 2.0, 3.0])
    body = Body("soft", part, rotation=R)
    load = FollowerForce("soft", (4.0, 5.0, 6.0), (1.0, 2.0, 3.0), lambda t: 1 + t, "x+")
    turn = Rotation.from_rotvec([0.4, 1.2, -2.0]).as_matrix()
    free = build_model([body], loads=[load])
    x = (body.points @ turn.T - body.points + 0.7).ravel()
    assert_allclose(free.load(2.0, x), 0)
    for model, rotation in ((free, turn), (build_model([body], loads=[load], kinematics="linear"), np.eye(3))):
        forces = model.following.force(x, When(0.0, 2.0, 0.25)) if model.following else 0.5 * model.load(2.0, x)  # 1.5 is half of 3
        force = forces.reshape(-1, 3)
        arm = (body.points - R @ [1.0, 1.0, 1.5]) @ rotation.T
        assert_allclose(force.sum(axis=0), 1.5 * rotation @ [4, 5, 6], atol=1e-12)
        assert_allclose(np.cross(arm, force).sum(axis=0), 1.5 * rotation @ [1, 2, 3], atol=1e-12)


def test_the_arm_of_a_force_at_a_point_turns_with_its_body() -> None:
    """moment + R (p - c) x F, in space and in the plane."""
    turn = Rotation.from_rotvec([0.4, 1.2, -2.0])
    box = build_model([rigid_box("box", (1, 1, 1), (5, 0, 0), 1.0)], loads=[ForceAtPoint("box", (4.0, 5, 6), (5.5, 0.2, 0.1), (1.0, 2, 3))])
    turning = np.array([1, 2, 3]) + np.cross(turn.apply([0.5, 0.2, 0.1]), [4, 5, 6])
    assert_allclose(box.load(0.0, np.array([9.0, 8, 7, *turn.as_rotvec()])), [4, 5, 6, *turning])
    flat = build_model([rigid_rectangle("flat", (1, 1), (5, 0), 1.0)], loads=[ForceAtPoint("flat", (4.0, 5), (5.5, 0), (1.0,))])
    assert_allclose(flat.load(0.0, np.array([9.0, 8, np.pi / 2])), [4, 5, 1 - 0.5 * 4])


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (FollowerForce("soft", (1.0, 0, 0)), "FollowerForce on body 'soft', surface: expected the name of a surface .* got None"),
        (FollowerForce("soft", (1.0, 0, 0), surface="side"), "body 'soft': expected a surface among"),
        (FollowerForce("soft", (1.0, 0), surface="x+"), "FollowerForce on body 'soft': expected 3 force and 3 moment components"),
        (
            FollowerForce("box", (1.0, 0, 0), surface="x+"),
            "on body 'box', surface: expected none on a rigid body, got 'x\\+'",
        ),
        (FollowerPressure("soft", "side", 1.0), "body 'soft': expected a surface among"),
        (FollowerPressure("soft", "x+", float("inf")), "FollowerPressure on body 'soft': expected a finite pressure"),
        (FollowerPressure("soft", "x+", "1e5"), "expected a finite pressure in Pa, got '1e5'"),  # type: ignore[arg-type]
        (FollowerPressure("box", "top", 1.0), "body 'box': expected a surface among"),
        (FollowerPressure("box", "x+", float("nan")), "expected a finite pressure"),
        (ForceAtPoint("soft", (1.0, 0, 0), (0.0, 0, 0)), "ForceAtPoint on body 'soft': expected a rigid body"),
        (ForceAtPoint("box", (1.0, 0, 0), (0.0, 0)), "ForceAtPoint on body 'box', point: expected 3 finite numbers"),
        (FollowerForce("box", (1.0, 0)), "expected 3 force and 3 moment components"),
    ],
)
def test_refusals(load: Any, message: str) -> None:
    soft = Body("soft", brick("soft", (1, 1, 1), (1, 1, 1), Material(1e6, 0.3, 1e3)))
    with pytest.raises(InputError, match=message):
        build_model([soft, rigid_box("box", (1, 1, 1), (5, 0, 0), 1.0)], loads=[load])


@pytest.mark.parametrize("kind", [Traction, FollowerPressure])
@pytest.mark.parametrize("factor", [2.0, lambda t: float("nan"), lambda t: (1, 2), lambda t: "much", lambda: 1.0])
def test_factors_that_are_none(kind: Any, factor: Any) -> None:
    """One sentence, before anything runs, for each kind of load."""
    soft = Body("soft", brick("soft", (1, 1, 1), (1, 1, 1), Material(1e6, 0.3, 1e3)))
    load = kind("soft", "x+", (1.0, 0, 0) if kind is Traction else 1.0, factor)
    with pytest.raises(InputError, match=r"on body 'soft', factor at t = 0.0 s: expected a function of t that gives a finite number"):
        build_model([soft], loads=[load])
