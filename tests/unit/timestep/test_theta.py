"""The theta scheme without contacts against exact solutions, energies and the balance of momentum."""

import math
from typing import Any, Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigh, expm
from scipy.spatial.transform import Rotation

from fcsim.assembly.loads import Force
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.limits import Limits
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

RUBBER = Material(1e6, 0.3, 1000.0)
FAR = 1e3
NO_LIMITS = Limits(rotation=math.inf, strain=math.inf)  # the reference is linear theory, whatever the amplitude


def bar(held: bool = True, beta: float = 0.0, alpha: float = 0.0, **options: Any) -> Model:
    """A plane block, and a rigid one far away that nothing ever touches: a simulation wants a pair of surfaces."""
    part = rectangle("bar", (1.0, 0.2), (4, 1), RUBBER)
    far = rigid_rectangle("far", (1, 1), (FAR, 0), 1.0)
    supports = [Support("far", ("x", "y", "rz"))] + ([Support("bar", ("x", "y"), "x-")] if held else [])
    return build_model([Body("bar", part), far], supports=supports, alpha=alpha, beta=beta, **options)


def simulate(model: Model, scheme: Theta, steps: int, initial: State | None = None) -> list[Step]:
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies[-2:])
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)
    return list(Simulation(model, detector, scheme, steps, initial=initial, limits=NO_LIMITS))


def exact_state(model: Model, initial: State, t: float) -> np.ndarray:
    """(x, v) of M a + C v + K x = 0 on the free dofs, by the matrix exponential."""
    own = np.ix_(model.free_dofs, model.free_dofs)
    M, C, K = (matrix.toarray()[own] for matrix in (model.mass, model.damping, model.stiffness))
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    return expm(A * t) @ np.concatenate([initial.x[model.free_dofs], initial.v[model.free_dofs]])


@pytest.mark.each_value
@pytest.mark.parametrize(("theta", "order"), [(0.5, 2), (0.7, 1), (1.0, 1)])
@pytest.mark.parametrize("beta", [0.0, 2e-4])
def test_free_vibration_converges_with_the_order_of_the_scheme(theta: float, order: int, beta: float) -> None:
    model = bar(beta=beta, alpha=0.5)
    own = np.ix_(model.free_dofs, model.free_dofs)
    omega2, modes = eigh(model.stiffness.toarray()[own], model.mass.toarray()[own])
    period = 2 * np.pi / np.sqrt(omega2[1])
    x, v = np.zeros(model.n_dofs), np.zeros(model.n_dofs)
    x[model.free_dofs], v[model.free_dofs] = modes[:, 0], np.sqrt(omega2[1]) * modes[:, 1]
    initial = State(0.0, x, v)
    exact = exact_state(model, initial, period / 2)
    scale = np.concatenate([np.full(len(modes), np.abs(x).max()), np.full(len(modes), np.abs(v).max())])
    counts = np.array([25, 50, 100])
    errors = []
    for count in counts:
        end = simulate(model, Theta(period / 2 / count, theta), int(count), initial)[-1].state
        errors.append(
            np.linalg.norm((np.concatenate([end.x, end.v])[np.r_[model.free_dofs, model.n_dofs + model.free_dofs]] - exact) / scale)
        )
    slopes = np.diff(np.log(errors)) / np.diff(np.log(1 / counts))
    assert_allclose(slopes, order, atol=0.15)


@pytest.mark.each_value
@pytest.mark.parametrize("theta", [0.5, 0.6, 1.0])
@pytest.mark.parametrize("kinematics", ["linear", "turning"])
@pytest.mark.parametrize("held", [True, False])
def test_energy_never_grows(theta: float, held: bool, kinematics: Literal["linear", "turning"]) -> None:
    """And is constant for theta = 1/2 without damping; x and v are random, so that all modes are there."""
    model = bar(held, kinematics=kinematics)
    rng = np.random.default_rng(0)
    x, v = np.zeros(model.n_dofs), np.zeros(model.n_dofs)
    x[model.free_dofs], v[model.free_dofs] = 1e-3 * rng.standard_normal((2, len(model.free_dofs))) * [[1], [300]]
    states = [State(0.0, x, v)] + [step.state for step in simulate(model, Theta(1e-3, theta), 30, State(0.0, x, v))]
    energy = np.array([s.v @ (model.mass @ s.v) / 2 + model.elastic.energy(model.elastic.at(s.x)) for s in states])
    assert np.all(np.diff(energy) <= 1e-10 * energy[0])
    assert (energy[-1] > (1 - 1e-9) * energy[0]) == (theta == 0.5)


def test_rigid_free_fall_is_exact() -> None:
    bodies = [rigid_box("a", (1, 1, 1), (0, 0, 0), 3.0), rigid_box("far", (1, 1, 1), (FAR, 0, 0), 5.0)]
    model = build_model(bodies, gravity=lambda t: (0, 0, -9.81))
    initial = at_rest(model)
    initial.v[:6], omega = (1.0, 0, 2.0, 0.3, -0.4, 1.2), np.array([0.3, -0.4, 1.2])
    for step in simulate(model, Theta(0.01), 50, initial):
        t = step.number * 0.01
        assert_allclose(step.state.v[:3], [1, 0, 2 - 9.81 * t], atol=1e-12)
        assert_allclose(step.state.x[:3], [t, 0, 2 * t - 9.81 * t**2 / 2], atol=1e-12)
        # a cube keeps its angular velocity
        assert_allclose(model.rigid_rotation(step.state.x)[0], Rotation.from_rotvec(omega * t).as_matrix(), atol=1e-12)


@pytest.mark.parametrize("theta", [0.6, 1.0])
def test_velocity_of_free_fall_is_exact_for_all_theta(theta: float) -> None:
    bodies = [rigid_rectangle("a", (1, 1), (0, 0), 3.0), rigid_rectangle("far", (1, 1), (FAR, 0), 5.0)]
    model = build_model(bodies, gravity=lambda t: (0, -9.81), loads=[Force("a", (0, 0), (2.0,))])
    inertia = 3.0 / 12 * 2
    end = simulate(model, Theta(0.01, theta), 20)[-1].state
    assert_allclose(end.v[:3], [0, -9.81 * 0.2, 2 / inertia * 0.2], rtol=1e-12)


@pytest.mark.each_value
@pytest.mark.parametrize("driven", ["eliminated", "identity"])
@pytest.mark.parametrize("lumped", [True, False])
def test_support_reactions_are_statics(driven: str, lumped: bool) -> None:
    """Sum of the support impulses = change of momentum - weight, at every step; the weight alone once it is at rest."""
    model = bar(gravity=lambda t: (0, -10.0), beta=0.3, driven=driven, lumped=lumped)
    weight, h = 1.0 * 0.2 * RUBBER.density * 10, 0.02
    own = slice(0, model.n_elastic)
    before = np.zeros(2)
    for step in simulate(model, Theta(h, 0.7), 200):
        momentum = (model.mass @ step.state.v)[own].reshape(-1, 2).sum(axis=0)
        reaction = step.support_impulse[own].reshape(-1, 2).sum(axis=0) / h
        assert_allclose(reaction, [0, weight] + (momentum - before) / h, atol=1e-9 * weight)
        before = momentum
    assert_allclose(reaction, [0, weight], atol=1e-3 * weight)
    assert_allclose(np.delete(step.support_impulse, model.driven_dofs), 0, atol=1e-10 * weight * h)


def test_driven_support_moves_its_dofs() -> None:
    """v(t) at the end of each step, x by the trapezoidal rule of the scheme."""
    part = brick("bar", (1.0, 0.2, 0.2), (2, 1, 1), RUBBER)
    far = rigid_box("far", (1, 1, 1), (FAR, 0, 0), 1.0)
    for driven in ("eliminated", "identity"):
        model = build_model([Body("bar", part), far], supports=[Support("bar", ("x",), "x-", lambda t: np.sin(t))], driven=driven)
        steps = simulate(model, Theta(0.02), 25)
        nodes = np.unique(part.surfaces["x-"])
        assert_allclose(steps[-1].state.v[3 * nodes], np.sin(0.5), rtol=1e-12)
        assert_allclose(steps[-1].state.x[3 * nodes], 1 - np.cos(0.5), rtol=1e-4)


def test_refusals() -> None:
    bad: list[dict[str, Any]] = [{"h": 0.0}, {"h": -1.0}, {"h": float("nan")}, {"h": 1.0, "theta": 0.0}, {"h": 1.0, "theta": 1.1}]
    for options in bad:
        with pytest.raises(InputError, match="expected a number > 0"):
            Theta(**options)
    for restitution in (-0.1, 1.1, float("nan")):
        with pytest.raises(InputError, match="restitution"):
            Velocity(restitution)
    assert Theta(1.0).law == Gap()


def test_rigid_bodies_alone_and_deformable_alone() -> None:
    """Either kind may be absent."""
    both = [rigid_rectangle("a", (1, 1), (0, 0), 1.0), rigid_rectangle("far", (1, 1), (FAR, 0), 5.0)]
    assert len(simulate(build_model(both), Theta(0.1), 2)) == 2
    part = rectangle("bar", (1.0, 0.2), (1, 1), RUBBER)
    two = [Body("a", part), Body("far", part, translation=np.array([FAR, 0]))]
    model = build_model(two, gravity=lambda t: (0, -10))
    assert_allclose(simulate(model, Theta(0.1), 2)[-1].state.v.reshape(-1, 2), [[0, -2.0]] * 8, atol=1e-12)
