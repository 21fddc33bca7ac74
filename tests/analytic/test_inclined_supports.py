"""Supports along any axes: statics of rollers on slopes, and that a problem turned in space with its supports is the same problem."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.loads import Force
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body, RigidBody
from fcsim.running.case import load_case
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

ODD = Rotation.from_rotvec(np.radians(37.0) * np.array([0.3, -0.7, 0.9]) / np.linalg.norm([0.3, -0.7, 0.9])).as_matrix()


def in_plane(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def turned(model: Model, R: np.ndarray) -> Model:
    """The model with its bodies, supports and gravity turned about the origin."""

    def body(b: Body | RigidBody) -> Body | RigidBody:
        if isinstance(b, Body):
            return replace(b, rotation=R @ b.rotation, translation=R @ b.translation)
        inertia = R @ b.inertia @ R.T if b.dimension == 3 else b.inertia
        return replace(b, inertia=inertia, centre=R @ b.centre, points=b.points @ R.T)

    supports = [replace(s, axes=R if s.axes is None else R @ np.array(s.axes)) for s in model.supports]  # type: ignore[type-var]
    gravity = model.gravity
    return replace(
        model,
        bodies=tuple(map(body, model.bodies)),
        supports=tuple(supports),
        gravity=None if gravity is None else lambda t: R @ np.asarray(gravity(t)),
    )


def unturned(model: Model, x: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The nodal part and the rigid bodies' part of x with each vector turned back."""
    back = x.copy()
    d = model.dimension
    back[: model.n_elastic] = (x[: model.n_elastic].reshape(-1, d) @ R).ravel()
    rigid = model.rigid_part(back)
    rigid[:, :d] = rigid[:, :d] @ R
    if d == 3:
        rigid[:, 3:] = rigid[:, 3:] @ R
    return back


SCHEMES = {"theta": Theta(1e-3), "implicit": Theta(1e-3, 1.0), "alpha": GeneralisedAlpha(1e-3, 0.7), "static": QuasiStatic(0.5)}


@pytest.mark.parametrize("driven", ["eliminated", "identity"])
@pytest.mark.parametrize("d", [2, 3])
def test_rollers_on_a_slope(d: int, driven: Any) -> None:
    """A block on rollers on a slope of 25 degrees, held along it at its lower end: N = W cos 25, T = W sin 25, and it is what a level
    block under turned gravity is."""
    a, g = np.radians(25.0), 9.81
    material = Material(1e7, 0.3, 2000.0)
    part = rectangle("b", (0.4, 0.2), (4, 2), material) if d == 2 else brick("b", (0.4, 0.2, 0.1), (4, 2, 1), material)
    up = "y" if d == 2 else "z"
    supports = [Support("b", (up,), f"{up}-"), Support("b", ("x",), "x-")]
    supports += [] if d == 2 else [Support("b", ("y",), "y-")]
    along = np.array([-np.sin(a), -np.cos(a)]) if d == 2 else np.array([-np.sin(a), 0, -np.cos(a)])
    level = build_model([Body("b", part)], supports=supports, gravity=lambda t: g * along, driven=driven)
    R = in_plane(25.0) if d == 2 else Rotation.from_rotvec([0, -a, 0]).as_matrix()
    slope = turned(level, R)
    assert_allclose(slope.gravity(0.0), [0.0, -g] if d == 2 else [0, 0, -g], atol=1e-14)  # type: ignore[misc]
    ends = [list(Simulation(model, Everything(model, 0.3), QuasiStatic(0.5), 2))[-1] for model in (level, slope)]
    assert_allclose(unturned(slope, ends[1].state.x, R), ends[0].state.x, atol=1e-12 * abs(ends[0].state.x).max())
    weight = 0.4 * 0.2 * (1 if d == 2 else 0.1) * 2000 * g
    force = ends[1].support_impulse.reshape(-1, d)
    assert_allclose(force.sum(axis=0), [0, weight] if d == 2 else [0, 0, weight], atol=1e-9 * weight)
    lower = np.unique(slope.facets("b", f"{up}-"))
    end = np.unique(slope.facets("b", "x-"))
    assert_allclose((force[lower] @ R)[:, -1].sum(), weight * np.cos(a), rtol=1e-9)
    assert_allclose((force[end] @ R)[:, 0].sum(), weight * np.sin(a), rtol=1e-9)
    assert_allclose((force[np.setdiff1d(lower, end)] @ R)[:, 0], 0, atol=1e-9 * weight)  # rollers


@pytest.mark.parametrize("d", [2, 3])
def test_a_rigid_block_slides_down_its_rails(d: int) -> None:
    """Held across a slope of 25 degrees it falls along it with g sin 25, exactly; the rails carry W cos 25."""
    a, g, h = np.radians(25.0), 9.81, 1e-2
    R = in_plane(-25.0) if d == 2 else Rotation.from_rotvec(a * np.array([0, 1, 0])).as_matrix()
    body = rigid_rectangle("b", (0.4, 0.2), (0.0, 0.0), 3.0) if d == 2 else rigid_box("b", (0.4, 0.2, 0.1), (0, 0, 0), 3.0)
    others = ("y", "rz") if d == 2 else ("y", "z", "rx", "ry", "rz")
    gravity = np.array([0.0] * (d - 1) + [-g])
    model = build_model([body], supports=[Support("b", others, axes=R)], gravity=lambda t: gravity)
    step = list(Simulation(model, Everything(model, 0.3), Theta(h), 20))[-1]
    t, down = 20 * h, R[:, 0]
    assert_allclose(step.state.x[:d], 0.5 * g * np.sin(a) * t**2 * down, atol=1e-12)
    assert_allclose(step.state.x[d:], 0, atol=1e-14)
    carried = step.support_impulse[:d] / h
    assert_allclose(carried, 3.0 * g * np.cos(a) * R[:, -1], atol=1e-9)


def test_a_rigid_body_turns_about_an_inclined_axis() -> None:
    """Held but for one rotation: it falls as the compound pendulum I phi'' = -m g l sin phi, whichever way it stands."""
    g, h, m, size = 9.81, 1e-3, 2.0, np.array([0.1, 0.3, 0.5])
    inertia = m / 12 * (size[1] ** 2 + size[2] ** 2)
    body = rigid_box("b", size, (0.0, 0.0, 0.0), m)
    torque = 0.7
    level = build_model([body], supports=[Support("b", ("x", "y", "z", "ry", "rz"))])
    model = turned(level, ODD)
    moment = ODD @ [torque, 0, 0]

    model = replace(model, loads=(Force("b", (0, 0, 0), tuple(moment)),), gravity=lambda t: np.array([0, 0, -g]))
    step = list(Simulation(model, Everything(model, 0.3), Theta(h), 100))[-1]
    t = 100 * h
    assert_allclose(step.state.v[3:], ODD[:, 0] * torque * t / inertia, rtol=1e-10)
    assert_allclose(step.state.x[3:], ODD[:, 0] * 0.5 * torque * t**2 / inertia, rtol=1e-10)
    assert_allclose(step.support_impulse[:3] / h, [0, 0, m * g], atol=1e-9)
    assert abs(step.energy.residual) < 1e-12


@pytest.mark.each_value
@pytest.mark.parametrize("name", [*SCHEMES])
@pytest.mark.parametrize("driven", ["eliminated", "identity"])
def test_a_problem_turned_in_space_is_the_same_problem(name: str, driven: Any) -> None:
    """A bending beam driven along its own axes and a rigid weight on rails, turned by 37 degrees about an odd axis: the same motion and
    forces, the same balance of energy, closed, with turning kinematics too."""
    part = brick("beam", (0.4, 0.1, 0.1), (4, 1, 1), Material(1e6, 0.3, 1000.0))
    static = name == "static"
    supports = [
        Support("beam", ("x", "z"), "x-"),
        Support("beam", ("y",)),  # plane motion: the beam turns about its y axis
        Support("beam", ("z",), "x+", 0.0 if static else 0.3),
        Support("weight", ("y", "rx", "rz")),
    ]
    if static:
        supports += [Support("weight", ("x", "z", "ry"))]
    weight = rigid_box("weight", (0.1, 0.1, 0.2), (0.0, 1.0, 0.0), 1.0)
    level = build_model(
        [Body("beam", part), weight], supports=supports, gravity=lambda t: np.array([1.0, 0, -9.81]), driven=driven, beta=1e-4
    )
    model = turned(level, ODD)
    steps = 2 if static else 30
    ends = [list(Simulation(m, Everything(m, 0.3), SCHEMES[name], steps))[-1] for m in (level, model)]
    scale = abs(ends[0].state.x).max()
    assert_allclose(unturned(model, ends[1].state.x, ODD), ends[0].state.x, atol=1e-9 * scale)
    force = ends[0].support_impulse
    assert_allclose(unturned(model, ends[1].support_impulse, ODD), force, atol=1e-8 * abs(force).max())
    for end in ends:
        exchanged = sum(abs(w) for w in (end.energy.load_work, end.energy.support_work, end.energy.elastic))
        assert abs(end.energy.residual) < 1e-9 * exchanged
    assert_allclose(ends[1].energy.support_work, ends[0].energy.support_work, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("scheme", [Theta(2e-3), QuasiStatic(0.25)])
def test_a_body_of_finite_strain_turned_in_space_is_the_same_body(scheme: Any) -> None:
    """A neo-Hookean beam bent along its own axes, upright and turned."""
    part = brick("b", (0.3, 0.1, 0.1), (3, 1, 1), neo_hooke(1e7, 0.3, 1000.0))
    bend = 0.02 if isinstance(scheme, QuasiStatic) else 0.5
    supports = [Support("b", ("x", "z"), "x-"), Support("b", ("y",)), Support("b", ("z",), "x+", bend)]
    level = build_model([Body("b", part)], supports=supports)
    one, other = (list(Simulation(m, Everything(m, 0.3), scheme, 4, witness=None))[-1] for m in (level, turned(level, ODD)))
    assert_allclose(unturned(level, other.state.x, ODD), one.state.x, atol=1e-12)
    force = one.support_impulse
    assert_allclose(unturned(level, other.support_impulse, ODD), force, atol=1e-10 * abs(force).max())


@cache
def wall() -> Simulation:
    script = load_case(Path(__file__).parents[2] / "cases" / "masonry_wall")
    p = script.parameters(
        courses=2, blocks=2.5, divisions=(4, 2, 2), steps=40, gravity_last=8, shear_start=0.009, shear_full=0.012, tol=1e-12
    )
    return script.build(p).simulation


@pytest.mark.parametrize("kinematics", ["linear", "turning"])
def test_the_wall_turned_in_space_and_driven_along_its_own_axes(kinematics: Any) -> None:
    """Turned by 37 degrees about an odd axis: the unturned wall's reactions, node by node of its platens, to round-off of the solver."""
    level = replace(wall(), steps=40 if kinematics == "linear" else 20)
    level = replace(level, model=replace(level.model, kinematics=kinematics))
    inclined = replace(level, model=turned(level.model, ODD))
    for one, other in list(zip(level, inclined, strict=True))[1:]:  # nothing is loaded in the first step
        force, normal = one.support_impulse, one.contact_force[:, 0]
        assert_allclose(unturned(level.model, other.support_impulse, ODD), force, atol=1e-9 * abs(force).max())
        assert_allclose(other.contact_force[:, 0], normal, atol=1e-7 * abs(normal).max())
    assert abs(one.contact_force[:, 1:]).max() > 0.1 * normal.max()


def test_supports_along_different_axes_at_one_node_are_held_together() -> None:
    """Two rails that are not at right angles hold the node of their crossing, and a third must agree."""
    part = rectangle("b", (1.0, 1.0), (1, 1), Material(1e7, 0.3, 2000.0))
    rails = [Support("b", ("x",), "x-", 0.1, in_plane(0.0)), Support("b", ("x",), "x-", 0.2, in_plane(30.0))]
    model = build_model([Body("b", part)], supports=rails)
    held = np.unique(model.facets("b", "x-"))
    v = model.of_driven(model.driven_velocity(0.0)).reshape(-1, 2)
    assert len(model.driven_dofs) == 4
    assert_allclose(v[held], np.tile([0.1, (0.2 - 0.1 * np.cos(np.pi / 6)) / np.sin(np.pi / 6)], (2, 1)))
    third = [*rails, Support("b", ("x",), "x-", lambda t: float(t), in_plane(60.0))]
    with pytest.raises(InputError, match=r"supports 0, 1, 2 of body 'b': expected the same motion where they hold one node"):
        build_model([Body("b", part)], supports=third)
    agreeing = [*rails, Support("b", ("y",), "x-", float(v[held[0], 1]))]
    assert_allclose(build_model([Body("b", part)], supports=agreeing).driven_velocity(0.0)[:2], v[held[0]])
    with pytest.raises(InputError, match="is driven twice and differently, by the supports 0 and 1"):
        build_model([Body("b", part)], supports=[rails[1], replace(rails[1], velocity=0.3)])


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (np.eye(3), r"axes: expected a rotation matrix \(2, 2\), got \(3, 3\)"),
        (2 * np.eye(2), r"axes: expected a rotation matrix \(orthogonal, determinant \+1\)"),
        (np.diag([1.0, -1.0]), r"expected a rotation matrix \(orthogonal, determinant \+1\)"),
        (30.0, r"axes: expected a rotation matrix \(d, d\) of finite numbers, got 30.0"),
        ("slope", r"axes: expected a rotation matrix \(d, d\) of finite numbers, got 'slope'"),
        (np.array([[np.nan, 0], [0, 1]]), "of finite numbers"),
    ],
)
def test_axes_that_are_none_are_refused(axes: Any, message: str) -> None:
    part = rectangle("b", (1.0, 1.0), (1, 1), Material(1e7, 0.3, 2000.0))
    with pytest.raises(InputError, match=message):
        build_model([Body("b", part)], supports=[Support("b", ("x",), axes=axes)])
