"""The balance of energy of a step: closed to round-off, and every term against dense algebra or point mechanics."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Force, Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

SOFT = Material(1e6, 0.3, 1000.0)
HELD = Support("plane", ("x", "y", "z", "rx", "ry", "rz"))
TERMS = ("load_work", "support_work", "damping_dissipation", "numerical_dissipation", "normal_dissipation", "tangential_dissipation")


def pressed(lumped: bool = True, gap: float = 1e-3, **options: Any) -> Model:
    """A bar above a rigid plane, driven down and aside at one end, pulled at the other, under its weight; everything works."""
    part = brick("bar", (1.0, 0.2, 0.3), (4, 2, 2), SOFT, origin=(0, 0, gap))
    drive = [
        Support("bar", ("z",), "x-", velocity=lambda t: -9e-3 * np.sin(20 * t)),
        Support("bar", ("x",), "x-", velocity=lambda t: 0.5 * t),
        Support("bar", ("y",), "x-"),
    ]
    pull = Traction("bar", "x+", (2e3, 500.0, -1e4), factor=lambda t: np.sin(30 * t))
    bodies = [Body("bar", part), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)]
    return build_model(bodies, supports=[HELD, *drive], loads=[pull], gravity=lambda t: (1.0, 0, -9.81), lumped=lumped, **options)


def simulate(
    model: Model, scheme: Scheme, steps: int, mu: float = 0.4, initial: State | None = None, body: str = "bar", **options: Any
) -> list[Step]:
    pair = SurfacePair(contact_surface(model, [(body, "z-")]), contact_surface(model, [("plane", "z+")]), mu, 1e-2)
    return list(Simulation(model, Detector([pair], model.n_nodes), scheme, steps, SolverSettings(tol=1e-10), initial, **options))


def assert_closed(model: Model, steps: list[Step], kinetic: bool = True) -> None:
    """Energies from dense matrices; the works from one end of the run to the other explain their change."""
    M, K = model.mass.toarray(), model.stiffness.toarray()
    states = [steps[0].previous, *(step.state for step in steps)]
    energy = np.array([kinetic * s.v @ M @ s.v + s.x @ K @ s.x for s in states]) / 2
    scale = sum(abs(getattr(step.energy, term)) for step in steps for term in TERMS)
    assert max(abs(step.energy.residual) for step in steps) <= 1e-12 * scale
    for step, after in zip(steps, energy[1:], strict=True):
        assert_allclose(step.energy.kinetic + step.energy.elastic, after, rtol=1e-10)
    sums = {term: sum(getattr(step.energy, term) for step in steps) for term in TERMS}
    given = sums["load_work"] + sums["support_work"] - sum(sums[term] for term in TERMS[2:])
    assert_allclose(energy[-1] - energy[0], given, atol=1e-11 * scale)
    assert max(np.count_nonzero(step.contact_status) for step in steps) > 3
    assert all(step.energy.friction_dissipation >= -1e-12 * scale for step in steps)
    assert sums["tangential_dissipation"] > 1e-3 * scale


@pytest.mark.each_value
@pytest.mark.parametrize("law", [Gap(), Velocity(0.0), Velocity(0.6)])
@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
@pytest.mark.parametrize("lumped", [True, False])
def test_theta_closes_the_balance(theta: float, law: Gap | Velocity, lumped: bool) -> None:
    model = pressed(lumped, alpha=2.0, beta=1e-3)
    # theta > 1/(1+e) may make impacts of elastic bodies create energy, see `Velocity`: a run stops unless it may
    steps = simulate(model, Theta(2e-3, theta, law), 40, created=np.inf)
    assert_closed(model, steps)
    numerical = np.array([step.energy.numerical_dissipation for step in steps])
    assert np.all(numerical == 0) if theta == 0.5 else np.all(numerical > 0)
    assert all(step.energy.damping_dissipation > 0 for step in steps)


@pytest.mark.parametrize("eta", [0.0, 1e-4])
def test_statics_closes_the_balance(eta: float) -> None:
    model = pressed()
    assert_closed(model, simulate(model, QuasiStatic(2e-3, eta), 20), kinetic=False)


def test_terms_against_dense_algebra() -> None:
    """Every work from its definition, force times displacement, with v_theta."""
    h, theta = 2e-3, 0.6
    model = pressed(alpha=2.0, beta=1e-3)
    M, C, K = (a.toarray() for a in (model.mass, model.damping, model.stiffness))
    for step in simulate(model, Theta(h, theta, Velocity(0.3)), 20):
        before, after, r = step.previous, step.state, step.result.r
        v = theta * after.v + (1 - theta) * before.v
        force = theta * model.load(after.t) + (1 - theta) * model.load(before.t)
        x = theta * after.x + (1 - theta) * before.x
        reaction = M @ (after.v - before.v) + h * (C @ v + K @ x - force) - step.H @ r
        u = step.H.T @ v
        energy, dv, dx = step.energy, after.v - before.v, after.x - before.x
        expected = {
            "load_work": h * v @ force,
            "support_work": (v * reaction)[model.driven_dofs].sum(),
            "damping_dissipation": h * v @ C @ v,
            "numerical_dissipation": 0.1 * (dv @ M @ dv + dx @ K @ dx),
            "normal_dissipation": -(r * u)[::3].sum(),
            "tangential_dissipation": -(r * u).sum() + (r * u)[::3].sum(),
        }
        scale = max(map(abs, expected.values()))
        for term, value in expected.items():
            assert_allclose(getattr(energy, term), value, atol=1e-11 * scale, err_msg=term)


def test_a_sliding_block_turns_its_energy_into_friction() -> None:
    """Rigid, on the plane, with v0: friction takes m v0^2 / 2 in all, mu m g times the way in each step (Coulomb)."""
    mass, v0, mu, h, g = 3.0, 0.5, 0.4, 1e-3, 9.81
    bodies = [rigid_box("block", (0.4, 0.2, 0.02), (0, 0, 0.01), mass), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)]
    model = build_model(bodies, supports=[HELD, Support("block", ("rx", "ry", "rz"))], gravity=lambda t: (0, 0, -g))
    initial = at_rest(model)
    initial.v[0] = v0
    steps = simulate(model, Theta(h), int(1.2 * v0 / (mu * g) / h), mu, initial, "block")
    sliding = [step for step in steps if step.contact_status.max(initial=0) == 2]
    for step in sliding[:-1]:
        way = step.state.x[0] - step.previous.x[0]
        assert_allclose(step.energy.tangential_dissipation, mu * mass * g * way, rtol=1e-6)
        assert_allclose(step.energy.friction_dissipation, mu * mass * g * h * step.state.v[0], rtol=1e-6)
    assert_allclose(sum(step.energy.tangential_dissipation for step in steps), mass * v0**2 / 2, rtol=1e-6)
    assert_allclose(steps[-1].energy.kinetic, 0, atol=1e-12)


def test_a_falling_block_and_a_force() -> None:
    """Weight times height, force times way; an inelastic impact takes what is left (theta = 1/2: half the sum of the speeds)."""
    mass, g, push, h = 3.0, 9.81, 5.0, 1e-3
    bodies = [rigid_box("block", (0.4, 0.2, 0.02), (0, 0, 0.01 + 2e-3), mass), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)]
    model = build_model(bodies, supports=[HELD], loads=[Force("block", (push, 0, 0))], gravity=lambda t: (0, 0, -g))
    steps = simulate(model, Theta(h, law=Velocity(0.0)), 40, 0.0, None, "block")
    x = steps[-1].state.x
    assert_allclose(sum(step.energy.load_work for step in steps), -mass * g * x[2] + push * x[0], rtol=1e-9)
    impact = next(step for step in steps if step.contact_status.any())
    lost = 0.5 * mass * impact.previous.v[2] ** 2
    # the weight's impulse of the step falls into the impact: m g h |v| / 2 of the energy
    assert_allclose(impact.energy.normal_dissipation, lost, rtol=2 * g * h / abs(impact.previous.v[2]))
    assert_allclose(steps[-1].energy.kinetic, 0.5 * mass * (push / mass * 40 * h) ** 2, rtol=1e-6)


@pytest.mark.parametrize("theta", [0.5, 0.6, 1.0])
def test_a_rigid_rebound_makes_no_energy_whatever_theta(theta: float) -> None:
    """e = 0.8 takes 0.18 m v^2 (Newton); the reaction's work on v_theta is positive from theta = 5/9 on, and the run is not stopped."""
    bodies = [rigid_box("block", (0.4, 0.2, 0.02), (0, 0, 0.01 + 2e-3), 2.0), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)]
    model = build_model(bodies, supports=[HELD])
    initial = at_rest(model)
    initial.v[2] = -1.0
    steps = simulate(model, Theta(1e-3, theta, Velocity(0.8)), 10, 0.0, initial, "block")
    assert_allclose(steps[-1].state.v[2], 0.8, rtol=1e-9)
    assert_allclose(steps[-1].ledger.gained, -0.18 * 2.0, rtol=1e-9)
    assert steps[-1].ledger.created <= 1e-9


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_what_elastic_rebounds_make_is_counted(h: float) -> None:
    """Whatever kinetic and elastic energy an elastic bar at theta = 1 has more than at an earlier time, contact is said to have made."""
    bar = brick("bar", (0.2, 0.2, 0.3), (1, 1, 3), SOFT, origin=(0, 0, 1e-3))
    model = build_model([Body("bar", bar), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)], supports=[HELD])
    initial = at_rest(model)
    initial.v[2 : model.n_elastic : 3] = -1.0
    steps = simulate(model, Theta(h, 1.0, Velocity(0.8)), 60, 0.0, initial, created=np.inf)
    energy = np.array([0.5 * 1000.0 * 0.2 * 0.2 * 0.3, *(step.energy.kinetic + step.energy.elastic for step in steps)])
    rise = (energy - np.minimum.accumulate(energy)).max()
    assert steps[-1].ledger.created >= rise - 1e-9
    assert any(step.energy.jump_dissipation > 0 for step in steps)
