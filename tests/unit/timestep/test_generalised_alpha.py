"""The generalised-alpha scheme: damping and order against their formulas, the theta scheme as its limit, impacts, lasting contact."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import eigh, expm

from fcsim.assembly.loads import Force, Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Gap, Velocity
from fcsim.errors import InputError
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.limits import Limits
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.theta import Theta

RUBBER = Material(1e6, 0.3, 1000.0)
HELD = Support("plane", ("x", "y", "rz"))
NO_LIMITS = Limits(rotation=math.inf, strain=math.inf)  # the reference is linear theory, whatever the amplitude


def block_on_plane(gap: float = 0.0, rigid: bool = False, **options: Any) -> Model:
    """A plane block of 1 m x 0.2 m `gap` above a held rigid plane."""
    block: Body | RigidBody = Body("block", rectangle("block", (1.0, 0.2), (4, 2), RUBBER, origin=(0, gap)))
    if rigid:
        block = rigid_rectangle("block", (1.0, 0.2), (0.5, 0.1 + gap), 3.0)
    plane = rigid_rectangle("plane", (10, 1), (0, -0.5), 1.0)
    supports = [HELD, *options.pop("supports", [])]
    return build_model([block, plane], supports=supports, **options)


def simulation(model: Model, scheme: Scheme, steps: int, initial: State | None = None, mu: float = 0.3) -> Simulation:
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("plane", "y+")]), mu, 1e-2)
    return Simulation(
        model, Detector([pair], model.n_nodes), scheme, steps, SolverSettings(tol=1e-11, floor=1e-6), initial, limits=NO_LIMITS
    )


def amplification(rho: float, h: float) -> np.ndarray:
    """One step of an elastic element without load as a matrix on (x, v, x', p) of its two free dofs."""
    part = rectangle("block", (1.0, 1.0), (1, 1), RUBBER, origin=(0, 1.0))
    plane = rigid_rectangle("plane", (10, 1), (0, -0.5), 1.0)
    supports = [HELD, Support("block", ("x",)), Support("block", ("y",), "y-")]
    model = build_model([Body("block", part), plane], supports=supports)
    scheme, free = GeneralisedAlpha(h, rho), model.free_dofs
    one = simulation(model, scheme, 1)
    columns = []
    for k in range(4):
        for dof in free:
            start = np.zeros((4, model.n_dofs))
            start[k, dof] = 1.0
            end = one.step(Moment(0, State(0.0, *start))).state
            columns.append(np.array([end.x, end.v, end.rate, end.inertia])[:, free].ravel())
    return np.array(columns).T


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8, 1.0])
def test_spectral_radius(rho: float) -> None:
    """rho at infinite frequency (h many periods), and never above 1 at any step."""
    period = 2 * np.pi / np.sqrt(1e6 / 500.0)
    at_infinity = np.abs(np.linalg.eigvals(amplification(rho, 1e6 * period))).max()
    assert_allclose(at_infinity, rho, atol=1e-3)  # they are double at infinity, and differ from it by terms of (omega h)^-1/2
    for h in np.geomspace(0.01, 100, 5) * period:
        assert np.abs(np.linalg.eigvals(amplification(rho, h))).max() <= 1 + 1e-7


@pytest.mark.parametrize("rho", [0.0, *(pytest.param(rho, marks=pytest.mark.slow) for rho in (0.5, 0.8)), 1.0])
def test_smooth_motion_converges_with_order_two(rho: float) -> None:
    """Free damped vibration of two modes under a load, against the matrix exponential; far above the plane."""
    supports = [Support("block", ("x", "y"), "x-")]
    pull = Traction("block", "x+", (0.0, 50.0), factor=lambda t: t)
    model = block_on_plane(gap=5.0, supports=supports, alpha=0.5, beta=2e-4, loads=[pull])
    own = np.ix_(model.free_dofs, model.free_dofs)
    M, C, K = (matrix.toarray()[own] for matrix in (model.mass, model.damping, model.stiffness))
    omega2, modes = eigh(K, M)
    x, v = np.zeros((2, model.n_dofs))
    x[model.free_dofs], v[model.free_dofs] = 1e-2 * modes[:, 0], 1e-2 * np.sqrt(omega2[1]) * modes[:, 1]
    end = np.pi / np.sqrt(omega2[1])
    # x, v and the load, which grows like t
    n, f = len(M), np.linalg.solve(M, model.load(1.0)[model.free_dofs])
    A = np.zeros((2 * n + 2, 2 * n + 2))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n] = np.column_stack([-np.linalg.solve(M, K), -np.linalg.solve(M, C), np.zeros(n), f])
    A[-1, -2] = 1
    exact = (expm(A * end) @ np.concatenate([x[model.free_dofs], v[model.free_dofs], [1.0, 0.0]]))[: 2 * n]
    counts = np.array([25, 50, 100])
    errors = []
    for count in counts:
        state = list(simulation(model, GeneralisedAlpha(end / count, rho), int(count), State(0.0, x, v)))[-1].state
        found = np.concatenate([state.x[model.free_dofs], state.v[model.free_dofs]])
        errors.append(np.linalg.norm((found - exact) / np.repeat([np.abs(x).max(), np.abs(v).max()], n)))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(1 / counts))
    assert_allclose(slopes, 2, atol=0.15)


@pytest.mark.each_value
@pytest.mark.parametrize("law", [Gap(), Velocity(0.5)])
@pytest.mark.parametrize("lumped", [True, False])
def test_without_damping_it_is_the_theta_scheme_of_one_half(law: Any, lumped: bool) -> None:
    """Through impact, sliding and sticking, with a driven side, loads and Rayleigh damping."""
    side = Support("block", ("x",), "x-", velocity=lambda t: 0.05 * np.sin(40 * t))
    model = block_on_plane(gap=1e-3, supports=[side], gravity=lambda t: (0.0, -9.81), beta=1e-4, alpha=0.3, lumped=lumped)
    initial = at_rest(model)
    initial.v[1 : model.n_elastic : 2] = -0.2
    h = 1e-3
    one = list(simulation(model, GeneralisedAlpha(h, 1.0, law), 40, initial))
    other = list(simulation(model, Theta(h, 0.5, law), 40, initial))
    assert max(len(step.contacts) for step in one) > 2
    for a, b in zip(one, other, strict=True):
        assert_allclose(a.state.x, b.state.x, atol=1e-9)
        assert_allclose(a.state.v, b.state.v, atol=1e-7)
        assert_allclose(a.result.r, b.result.r, atol=1e-6 * np.abs(b.result.r).max(initial=1e-9))
        assert_allclose(a.energy.kinetic + a.energy.elastic, b.energy.kinetic + b.energy.elastic, rtol=1e-6)
        assert_allclose(a.energy.normal_dissipation, b.energy.normal_dissipation, atol=1e-7)
        assert abs(a.energy.numerical_dissipation) < 1e-9


@pytest.mark.each_value
@pytest.mark.parametrize("rho", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("lumped", [True, False])
def test_balance_of_energy(rho: float, lumped: bool) -> None:
    """Closed to round-off at every step, with everything at work, a driven side in contact included."""
    side = Support("block", ("x", "y"), "x-", velocity=lambda t: 0.02 * np.sin(40 * t))
    model = block_on_plane(gap=1e-4, supports=[side], gravity=lambda t: (3.0 * t, -9.81), beta=1e-4, alpha=0.3, lumped=lumped)
    steps = list(simulation(model, GeneralisedAlpha(1e-3, rho), 60))
    terms = ("load_work", "support_work", "damping_dissipation", "numerical_dissipation", "normal_dissipation", "tangential_dissipation")
    scale = sum(abs(getattr(step.energy, term)) for step in steps for term in terms)
    assert max(abs(step.energy.residual) for step in steps) < 1e-12 * scale
    assert min(step.energy.friction_dissipation for step in steps) >= -1e-12 * scale
    assert max(np.count_nonzero(step.contact_status) for step in steps) >= 2
    numerical = sum(step.energy.numerical_dissipation for step in steps)
    assert abs(numerical) < 1e-12 * scale if rho == 1 else numerical > 0


@pytest.mark.parametrize("rho", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_rebound_of_a_rigid_block(rho: float, e: float) -> None:
    """Newton's law: speed e after the impact, and no memory of it afterwards."""
    model = block_on_plane(gap=5.5e-3, rigid=True)
    initial = at_rest(model)
    initial.v[1] = -1.0
    steps = list(simulation(model, GeneralisedAlpha(1e-3, rho, Velocity(e)), 15, initial))
    speeds = np.array([step.state.v[1] for step in steps])
    assert speeds[0] == -1.0
    assert_allclose(speeds[np.flatnonzero(np.abs(speeds + 1) > 1e-9)], e, atol=1e-8)
    assert_allclose(speeds[-1], e, atol=1e-8)
    assert_allclose(steps[-1].state.inertia, 0, atol=1e-9)


@pytest.mark.each_value
@pytest.mark.parametrize("rho", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("law", [Gap(), Velocity(0.0)])
def test_a_contact_that_lasts(rho: float, law: Any) -> None:
    """A rigid block on the plane: from the first step on the reaction is the weight, and nothing moves."""
    touching = -1e-12  # which the velocity law asks for; the gap law takes all near contacts
    model = block_on_plane(touching, rigid=True, gravity=lambda t: (0.0, -9.81), loads=[Force("block", (2.0, 0.0))])
    for step in simulation(model, GeneralisedAlpha(1e-2, rho, law), 40):
        assert_allclose(step.contact_force_on(0), [-2.0, 3.0 * 9.81], atol=1e-6)
        assert_allclose(step.state.x[:3], 0, atol=1e-9)


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=pytest.mark.slow), 0.7])
def test_supports_carry_the_weight(rho: float) -> None:
    """At rest, after the vibration has died out."""
    model = block_on_plane(gap=5.0, supports=[Support("block", ("x", "y"), "x-")], gravity=lambda t: (0.0, -9.81), beta=0.3)
    step = list(simulation(model, GeneralisedAlpha(0.02, rho), 180))[-1]
    reaction = step.force_per_reaction * step.support_impulse[: model.n_elastic].reshape(-1, 2).sum(axis=0)
    assert_allclose(reaction, [0, 1.0 * 0.2 * RUBBER.density * 9.81], atol=1e-3)


def test_a_run_goes_on_from_its_checkpoint_bit_by_bit(tmp_path: Path) -> None:
    model = block_on_plane(gap=1e-4, gravity=lambda t: (3.0, -9.81), beta=1e-4)
    whole: list[Step] = list(simulation(model, GeneralisedAlpha(1e-3, 0.5), 20))
    write_checkpoint(tmp_path / "checkpoint.h5", whole[9])
    stored = read_checkpoint(tmp_path / "checkpoint.h5")
    assert stored is not None
    again = list(simulation(model, GeneralisedAlpha(1e-3, 0.5), 20).run(*stored))
    assert [step.number for step in again] == list(range(11, 21))
    for one, other in zip(whole[10:], again, strict=True):
        for name in ("x", "v", "rate", "inertia"):
            assert_array_equal(getattr(one.state, name), getattr(other.state, name))


def test_refusals() -> None:
    for rho in (-0.1, 1.1, float("nan")):
        with pytest.raises(InputError, match="rho: expected a spectral radius"):
            GeneralisedAlpha(1e-3, rho)
    with pytest.raises(InputError, match="h: expected"):
        GeneralisedAlpha(0.0)
