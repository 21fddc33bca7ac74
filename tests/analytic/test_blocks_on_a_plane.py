"""Blocks on a rigid plane: sticking, sliding, stopping, impact. Sources: statics and point dynamics with Coulomb's law.

A block at rest on a slope of angle a sticks iff tan a < mu; else it slides with the acceleration g (sin a - mu cos a). A block that
slides on a level plane with v0 stops after v0^2 / (2 mu g). An impact with Newton's restitution e gives the rebound speed e v0.
"""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G = 9.81
MU = 0.4
H = 1e-3
SOFT = Material(1e7, 0.2, 2000.0)
AXES = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}


def turned(body: RigidBody, R: np.ndarray) -> RigidBody:
    inertia = R @ body.inertia @ R.T if body.dimension == 3 else body.inertia
    return RigidBody(body.name, body.mass, inertia, R @ body.centre, body.points @ R.T, body.surfaces)


def block_on_plane(
    d: int, kind: str, angle: float = 0.0, tilt: str = "gravity", height: float = 0.0, weight: float = G, yaw: float = 0.0
) -> Model:
    """A flat block (0.2 m long, 0.05 m high) `height` above a fixed plane; a slope that falls along +x (turned by `yaw` about N).

    tilt: "gravity" leans the gravity, "mesh" turns both meshes and leaves gravity vertical.
    """
    up = d - 1
    size = (0.2, 0.1, 0.05) if d == 3 else (0.2, 0.05)
    centre = np.zeros(d)
    centre[up] = size[up] / 2 + height
    ground = np.full(d, 20.0)
    below = np.zeros(d)
    below[up] = -10.0
    box = rigid_box if d == 3 else rigid_rectangle
    plane = box("plane", tuple(ground), tuple(below), 1.0)
    acceleration = np.zeros(d)
    acceleration[0], acceleration[up] = weight * np.sin(angle), -weight * np.cos(angle)
    R = np.eye(d)
    if tilt == "mesh":  # down the slope = +x of the plane's own axes
        R = (
            Rotation.from_euler("ZY", [yaw, angle]).as_matrix()
            if d == 3
            else np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        )
        acceleration = np.zeros(d)
        acceleration[up] = -weight
    block: Body | RigidBody
    if kind == "rigid":
        block = turned(box("block", size, tuple(centre), 2.0), R)
    else:
        origin = centre - np.array(size) / 2
        part = brick("block", size, (4, 2, 1), SOFT) if d == 3 else rectangle("block", size, (4, 1), SOFT)
        block = Body("block", part, R, R @ origin)
    return build_model(
        [block, turned(plane, R)],
        supports=[Support("plane", AXES[d])],
        gravity=lambda t: acceleration,
        beta=2e-3 if kind != "rigid" else 0.0,
    )


def simulate(model: Model, steps: int, mu: float = MU, law: Any = None, initial: State | None = None, h: float = H) -> list[Step]:
    top, bottom = ("y+", "y-") if model.dimension == 2 else ("z+", "z-")
    pair = SurfacePair(contact_surface(model, [("block", bottom)]), contact_surface(model, [("plane", top)]), mu, 1e-2)
    settings = SolverSettings(tol=1e-10, floor=1e-4)
    return list(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law or Gap()), steps, settings, initial))


def centre_velocity(model: Model, state: State) -> np.ndarray:
    d = model.dimension
    if model.rigid[0].name == "block":
        return state.v[:d]
    mass = model.mass.diagonal()[: model.n_elastic].reshape(-1, d)
    return (mass * state.v[: model.n_elastic].reshape(-1, d)).sum(axis=0) / mass.sum(axis=0)


def frame_of_slope(d: int, angle: float, tilt: str, yaw: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors down the slope and along the normal."""
    if tilt == "gravity":
        return np.eye(d)[0], np.eye(d)[d - 1]
    if d == 2:
        return np.array([np.cos(angle), -np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    R = Rotation.from_euler("ZY", [yaw, angle]).as_matrix()
    return R[:, 0], R[:, 2]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("tilt", ["gravity", "mesh"])
@pytest.mark.parametrize("factor", [0.9, 0.999, 1.0, 1.001, 1.5])
def test_rigid_block_on_a_slope(d: int, tilt: str, factor: float) -> None:
    """Exact for every h: constant forces. `factor` is tan(angle) / mu: it sticks up to the limit, slides a thousandth above."""
    angle, yaw = np.arctan(factor * MU), 0.7 if d == 3 else 0.0
    model = block_on_plane(d, "rigid", angle, tilt, yaw=yaw)
    steps = simulate(model, 20)
    along, normal = frame_of_slope(d, angle, tilt, yaw)
    expected = G * (np.sin(angle) - MU * np.cos(angle)) * 20 * H if factor > 1 else 0.0
    v = centre_velocity(model, steps[-1].state)
    assert_allclose(v, expected * along, atol=1e-7)
    force = steps[-1].contact_force_on(model.number["block"])
    weight = 2.0 * G
    assert_allclose(force @ normal, weight * np.cos(angle), rtol=1e-6)
    assert_allclose(force @ along, -weight * min(np.sin(angle), MU * np.cos(angle)), rtol=1e-6)
    slip = steps[-1].result.u.reshape(-1, d)[:, 1:]
    assert_allclose(np.linalg.norm(slip, axis=1), expected, atol=1e-7)


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("factor", [0.8, 1.5])
def test_deformable_block_on_a_slope(d: int, factor: float) -> None:
    """It vibrates first, so the acceleration of the centre of mass is taken over the second half; tilting the meshes changes nothing."""
    angle = np.arctan(factor * MU)
    found = []
    for tilt in ("gravity", "mesh"):
        model = block_on_plane(d, "deformable", angle, tilt)
        steps = simulate(model, 40)
        along, normal = frame_of_slope(d, angle, tilt)
        v = np.array([centre_velocity(model, step.state) for step in steps])
        found.append([v @ along, v @ normal])
        acceleration = (v[-1] - v[19]) @ along / (20 * H)
        if factor > 1:
            assert_allclose(acceleration, G * (np.sin(angle) - MU * np.cos(angle)), rtol=0.01)
            assert np.all(steps[-1].contact_status == 2)
        else:
            assert abs(acceleration) < 0.005 * G
            assert abs(v[-1] @ along) < 0.01 * G * np.sin(angle) * 40 * H
    assert_allclose(found[0], found[1], atol=1e-6)


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_stopping_distance(d: int, kind: str) -> None:
    """v0^2 / (2 mu g), to the distance of a step for a rigid block; then it stays."""
    v0 = 0.3
    model = block_on_plane(d, kind)
    initial = at_rest(model)
    free = model.free_dofs
    one = np.zeros(model.n_dofs)
    one[(0 if kind == "rigid" else slice(0, model.n_elastic, d))] = v0
    initial.v[free] = one[free]
    end = int(1.2 * v0 / (MU * G) / H)
    steps = simulate(model, end, initial=initial)
    x = steps[-1].state.x
    travelled = x[0] if kind == "rigid" else x[: model.n_elastic : d].mean()
    assert_allclose(travelled, v0**2 / (2 * MU * G), rtol=0.01 if kind == "rigid" else 0.03)
    if kind == "rigid":
        assert abs(travelled - v0**2 / (2 * MU * G)) <= v0 * H / 2
        assert np.abs(steps[-1].state.v).max() < 1e-7
    energy = [0.5 * s.state.v @ (model.mass @ s.state.v) + 0.5 * s.state.x @ (model.stiffness @ s.state.x) for s in steps]
    lost = sum(step.friction_dissipation for step in steps)
    assert all(step.friction_dissipation >= -1e-12 for step in steps)
    assert energy[-1] < 0.02 * 0.5 * v0**2 * (2.0 if kind == "rigid" else SOFT.density * 0.2 * 0.05 * (0.1 if d == 3 else 1.0))
    assert lost > 0


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("d", [2, 3])
def test_rebound_of_a_rigid_block(d: int, e: float) -> None:
    """Without weight, so that the speeds are exact."""
    model = block_on_plane(d, "rigid", height=5e-3, weight=0.0)
    initial = at_rest(model)
    initial.v[d - 1] = -1.0
    steps = simulate(model, 15, law=Velocity(e), initial=initial)
    speeds = np.array([step.state.v[d - 1] for step in steps])
    assert speeds[0] == -1.0
    assert_allclose(speeds[-1], e, atol=1e-8)
    assert np.all((np.abs(speeds + 1) < 1e-9) | (np.abs(speeds - e) < 1e-8))  # one impact, no other speed
    assert_allclose(np.delete(steps[-1].state.v[: len(AXES[d])], d - 1), 0, atol=1e-9)


@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_no_penetration_with_the_gap_law(kind: str) -> None:
    """A block falls on the plane: in no configuration of detection is it below, and no energy is made."""
    model = block_on_plane(3, kind, height=2e-3)
    energies, initial = [], at_rest(model)
    steps = simulate(model, 60)
    for step in steps:
        assert step.penetration <= 1e-9
        x, v = step.state.x, step.state.v
        potential = -model.load(0.0) @ x
        energies.append(0.5 * v @ (model.mass @ v) + 0.5 * x @ (model.stiffness @ x) + potential)
        assert x @ (model.stiffness @ x) >= 0
        assert step.friction_dissipation >= -1e-12
    before = 0.0  # at rest
    scale = max(abs(e) for e in energies)
    assert initial.t == 0 and max(energies) <= before + 1e-9 * scale
    assert np.all(np.diff(energies) <= 1e-6 * scale)
    assert len(steps[-1].contacts) and steps[-1].contact_force_on(model.number["block"])[2] > 0


def test_rigid_block_comes_to_rest_with_the_gap_law() -> None:
    """Inelastic: after the impact the reaction is the weight and nothing moves."""
    model = block_on_plane(3, "rigid", height=2e-3)
    last = simulate(model, 60)[-1]
    assert_allclose(last.state.v, 0, atol=1e-8)
    assert_allclose(last.contact_force_on(model.number["block"]), [0, 0, 2.0 * G], atol=1e-5)
    assert_allclose(last.state.x[2], -2e-3, atol=1e-9)
