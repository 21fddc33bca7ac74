"""Pressures that follow deformable bodies in a step: free bodies pressed all around, closed energy, the same bits, convergence."""

from itertools import islice
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.kinematics.following import When
from fcsim.assembly.loads import FollowerPressure
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import FinitePlastic, LinearHardening, Material, Viscoelastic, neo_hooke, saint_venant_kirchhoff
from fcsim.mesh.part import Body
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta

E, RHO = 1e6, 1e3
EVERY_STRAIN = Limits(rotation=np.inf, strain=np.inf)
MATERIALS: dict[str, Any] = {
    "linear": Material(E, 0.3, RHO),
    "neo-hooke": neo_hooke(E, 0.3, RHO),
    "plastic": FinitePlastic(E, 0.3, RHO, LinearHardening(1.5e-2 * E, 0.1 * E)),
    "viscoelastic": Viscoelastic(E, 0.3, RHO, ((0.3, 1e-2),)),
}


def spinning(material: Any, d: int, scheme: Scheme, steps: int, pressure: float, surfaces: tuple[str, ...] = ()) -> Simulation:
    """A block that turns about no axis of inertia, under a pressure that grows on its surfaces (all); a rigid one far away."""
    if d == 3:
        part, far = brick("bar", (0.6, 0.3, 0.2), (2, 1, 1), material), rigid_box("far", (1, 1, 1), (1e3, 0, 0), 1.0)
    else:
        part, far = rectangle("bar", (0.6, 0.3), (4, 2), material), rigid_rectangle("far", (1, 1), (1e3, 0), 1.0)
    model = build_model(
        [Body("bar", part), far],
        supports=[Support("far", ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))],
        loads=[FollowerPressure("bar", side, pressure, lambda t: 1 + 20 * t) for side in surfaces or part.surfaces],
    )
    axis = 5.0 * (np.array([2.0, 1.0, 2.0]) / 3 if d == 3 else np.array([0.0, 0.0, 1.0]))
    v, arm = np.zeros(model.n_dofs), part.points - part.points.mean(axis=0)
    v[: model.n_elastic] = np.cross(axis, np.column_stack([arm, np.zeros((len(arm), 3 - d))]))[:, :d].ravel()
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)
    return Simulation(model, detector, scheme, steps, initial=State(0.0, np.zeros(model.n_dofs), v), limits=EVERY_STRAIN, keep=5)


def momenta(model: Model, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Momentum and angular momentum about the origin (3,) of the deformable body."""
    d, n = model.dimension, model.n_elastic
    zeros = np.zeros((n // d, 3 - d))
    arm = np.column_stack([model.reference.ravel()[:n].reshape(-1, d) + state.x[:n].reshape(-1, d), zeros])
    momentum = np.column_stack([model.apply_mass(state.v)[:n].reshape(-1, d), zeros])
    return momentum.sum(axis=0), np.cross(arm, momentum).sum(axis=0)


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", MATERIALS)
def test_pressed_all_around_a_body_turns_freely(name: str, d: int) -> None:
    """No force, no moment: a closed surface has none as it stands in the middle of the step."""
    simulation = spinning(MATERIALS[name], d, Theta(4e-3), 8, 1e4 if name == "linear" else 5e4)
    assert simulation.initial is not None
    begin = momenta(simulation.model, simulation.initial)[1]
    size, work = float(np.linalg.norm(begin)), 0.0
    for step in simulation:
        momentum, turning = momenta(simulation.model, step.state)
        assert np.abs(momentum).max() < 1e-12 * size
        assert_allclose(turning, begin, atol=1e-9 * size)
        assert abs(step.energy.residual) < 2e-8 * step.energy.kinetic
        work += abs(step.energy.load_work)
    assert work > 1e-2 * step.energy.kinetic


@pytest.mark.each_value
@pytest.mark.parametrize("scheme", [Theta(2e-3, 0.7), GeneralisedAlpha(2e-3, 0.6)], ids=["theta", "generalised alpha"])
@pytest.mark.parametrize("name", ["linear", "neo-hooke"])
def test_thrust_on_one_face_closes_the_balance_of_energy(name: str, scheme: Scheme) -> None:
    for step in spinning(MATERIALS[name], 2, scheme, 10, 1e4, ("x-",)):
        assert abs(step.energy.residual) < 1e-8 * step.energy.kinetic
    assert momenta(step.model, step.state)[0][0] > 0  # pushed away from the face, which stands near x-


def test_thrust_turns_with_the_body() -> None:
    """As a rigid one with a force f fixed to it: v = f / (m omega) (sin, 1 - cos)(omega t); the pressure on x- of a stiff block."""
    material, steps, end = Material(1e9, 0.3, RHO), 40, 0.2
    simulation = spinning(material, 2, Theta(end / steps), steps, 1e3, ("x-",))
    *_, last = simulation
    omega, f, slope = 5.0, 0.3 * 1e3, 20.0
    t = np.linspace(0, end, 20001)
    turned = np.stack([np.cos(omega * t), np.sin(omega * t)]) * f * (1 + slope * t)
    expected = np.trapezoid(turned, t, axis=1)
    momentum = momenta(last.model, last.state)[0][:2]
    assert_allclose(momentum, expected, rtol=1e-3)


@pytest.mark.parametrize("name", ["linear", "plastic"])
def test_going_on_gives_the_same_bits(name: str) -> None:
    def run() -> Simulation:
        return spinning(MATERIALS[name], 2, Theta(2e-3), 8, 5e4)

    whole, done = list(run()), list(islice(run(), 7))
    (rest,) = run().run(after=done[6].moment, anchor=done[4].moment)
    assert_array_equal(rest.state.x, whole[7].state.x)
    assert_array_equal(rest.state.v, whole[7].state.v)


def test_newton_converges_quadratically_with_the_rims_of_open_surfaces() -> None:
    """A short beam bent by pressure on its upper face: the tangent is not symmetric there. Each residual after the first small one is of
    the order of the last one's square; a symmetric tangent leaves a constant factor."""
    part = rectangle("beam", (1.0, 0.2), (4, 1), saint_venant_kirchhoff(E, 0.2, RHO), elements="Q2")
    far = rigid_rectangle("far", (1, 1), (10, 0), 1.0)
    model = build_model(
        [Body("beam", part), far],
        supports=[Support("beam", ("x", "y"), "x-"), Support("far", ("x", "y", "rz"))],
        loads=[FollowerPressure("beam", "y+", 4e3, lambda t: t)],
    )
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1, limits=EVERY_STRAIN)
    residuals = [problem.residual for problem in step.linearised]
    first = next(k for k, size in enumerate(residuals) if size < 1e-4)
    assert len(residuals) <= first + 3
    assert abs(step.energy.residual) < 1e-7 * step.energy.load_work


@pytest.mark.parametrize("unit", [1.0, 1e3], ids=["m kg s", "mm t s"])
def test_a_block_on_a_plane_bears_pressure_times_its_width_as_it_stands(unit: float) -> None:
    """Rubber between a smooth plane and the pressure p: sigma_y = -p, sigma_x = 0 in plane strain, mu (l^2 - 1) + lambda ln J = sigma J,
    and the plane bears p times the width l_x w; with a dead load it would be p w."""
    mass = 1e-3 if unit > 1 else 1.0  # of a kilogram: tonnes
    modulus, density, w = E * mass / unit, RHO * mass / unit**3, 0.4 * unit
    p = 0.15 * modulus
    block = rectangle("block", (w, w), (2, 2), neo_hooke(modulus, 0.3, density), origin=(0.0, 0.0))
    floor = rigid_rectangle("floor", (4 * w, w), (0.0, -0.5 * w), 1.0)
    model = build_model(
        [Body("block", block), floor],
        supports=[Support("floor", ("x", "y", "rz")), Support("block", ("x",), "x-")],
        loads=[FollowerPressure("block", "y+", p, lambda t: t)],
    )
    *_, step = Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.5, eta=1e-2), 2, limits=EVERY_STRAIN)
    shear, lame = modulus / 2.6, modulus * 0.3 / (1.3 * 0.4)
    lx, ly = 1.0, 1.0
    for _ in range(60):  # Newton's method on sigma_x J = 0, sigma_y J = -p J
        J = lx * ly
        f = np.array([shear * (lx**2 - 1) + lame * np.log(J), shear * (ly**2 - 1) + lame * np.log(J) + p * J])
        D = np.array([[2 * shear * lx + lame / lx, lame / ly], [lame / lx + p * ly, 2 * shear * ly + lame / ly + p * lx]])
        lx, ly = np.array([lx, ly]) - np.linalg.solve(D, f)
    x = step.state.x[: model.n_elastic].reshape(-1, 2) + block.points
    assert_allclose(np.ptp(x, axis=0) / w, [lx, ly], rtol=1e-6)
    assert_allclose(step.contact_force_on(0), [0, p * lx * w], rtol=1e-6, atol=1e-6 * p * w)
    assert lx > 1.05


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_newton_converges_quadratically_where_contact_holds_the_body(mu: float) -> None:
    """Rubber on a plane, nothing but its mass beside: the pressure's whole tangent is in the matrix once contacts press. By the pressure
    over the modulus, which is 0.15, 5 to 13 iterations a step would be needed."""
    block, floor = rectangle("block", (0.4, 0.4), (2, 2), neo_hooke(E, 0.3, RHO)), rigid_rectangle("floor", (1.6, 0.4), (0.0, -0.2), 1.0)
    model = build_model(
        [Body("block", block), floor],
        supports=[Support("floor", ("x", "y", "rz")), Support("block", ("x",), "x-")],
        loads=[FollowerPressure("block", "y+", 0.15 * E, lambda t: t)],
    )
    for step in Simulation(model, Everything(model, mu=mu), QuasiStatic(0.5, eta=1e-2), 2, limits=EVERY_STRAIN):
        residuals = [problem.residual for problem in step.linearised]
        assert len(residuals) <= 4
        assert residuals[-1] < 1e-2 * residuals[-2] < 1e-4 * residuals[-3]


def beam_above_a_floor(mu: float, pressure: float) -> Simulation:
    """A clamped beam that would sink by three quarters of its length in the first of four steps, 0.15 above a floor of 0.2."""
    part = rectangle("beam", (1.0, 0.1), (8, 1), saint_venant_kirchhoff(E, 0.2, RHO), elements="Q2")
    floor = rigid_rectangle("floor", (3.0, 0.2), (0.5, -0.25), 1.0)
    model = build_model(
        [Body("beam", part), floor],
        supports=[Support("beam", ("x", "y"), "x-"), Support("floor", ("x", "y", "rz"))],
        loads=[FollowerPressure("beam", "y+", pressure, lambda t: t)],
    )
    return Simulation(model, Everything(model, mu=mu), QuasiStatic(0.25), 4, limits=EVERY_STRAIN)


@pytest.mark.each_value
@pytest.mark.parametrize("pressure", [1.8e3, 2.02e3, 2.2e3])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_way_to_equilibrium_does_not_lead_through_the_floor(mu: float, pressure: float) -> None:
    """Its upper face alone may bear the beam, and no step is cut: without what iterates pass the lower one holds it down, steps are cut,
    and some do not converge."""
    for step in beam_above_a_floor(mu, pressure):
        pressed = step.result.r.reshape(-1, 2)[:, 0] > 0
        assert pressed.any()
        assert_allclose(step.contacts.frame[pressed, 0], [[0.0, 1.0]] * np.count_nonzero(pressed), atol=1e-12)
        assert step.substeps == 1
        assert len(step.linearised) <= 9


@pytest.mark.parametrize("mu", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_a_beam_pressed_onto_a_floor_is_in_equilibrium_as_it_stands(mu: float) -> None:
    """Forces of pressure, contact and the clamp sum to zero, and so do their moments in the deformed configuration: the pressure's part of
    the matrix, that of its rims and that of contact stand beside each other."""
    simulation = beam_above_a_floor(mu, 2e3)
    model = simulation.model
    *_, step = simulation
    n = model.n_elastic
    pressure = model.following.force(step.state.x, When.at(1.0))[:n].reshape(-1, 2)
    clamp, contact = step.support_impulse[:n].reshape(-1, 2), step.force_in_space
    assert np.linalg.norm(contact.sum(axis=0)) > 500
    assert_allclose(pressure.sum(axis=0) + clamp.sum(axis=0) + step.contact_force_on(0), 0, atol=1e-5)
    own = -(step.H @ step.result.r)[:n].reshape(-1, 2)  # what the beam's nodes give
    x, force = model.positions(step.state.x)[: n // 2], pressure + clamp - own
    assert_allclose(np.sum(x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]), 0, atol=1e-4)
    assert abs(step.energy.residual) < 1e-8 * step.energy.load_work


def test_a_turning_body_under_pressure_in_statics() -> None:
    """Of linear material in its frame: p turned with the body, the balance closed; the clamp bears the pressure as it stands."""
    part = rectangle("b", (1.0, 0.3), (4, 1), Material(E, 0.2, RHO))
    model = build_model(
        [Body("b", part, kinematics="turning"), rigid_rectangle("far", (1, 1), (10, 0), 1.0)],
        supports=[Support("b", ("x", "y"), "x-"), Support("far", ("x", "y", "rz"))],
        loads=[FollowerPressure("b", "y+", 1e3, lambda t: t)],
    )
    *_, step = Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.5), 2)
    pressure = model.following.force(step.state.x, When.at(1.0))[: model.n_elastic].reshape(-1, 2).sum(axis=0)
    assert pressure[0] < -10  # the end sinks, and the face with it
    assert_allclose(step.support_impulse[: model.n_elastic].reshape(-1, 2).sum(axis=0), -pressure, atol=1e-5)
    assert abs(step.energy.residual) < 1e-8 * step.energy.load_work
