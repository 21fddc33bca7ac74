"""Friction that depends on slip, rate and direction; joints with springs: closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Force, Traction
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Compliant, Elliptic, Gap, RateDependent, SlipWeakening, Springs, StaticKinetic
from fcsim.contact_law.friction import Friction
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.mesh.blocks import brick, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.material.energies import saint_venant_kirchhoff
from fcsim.mesh.part import Body
from fcsim.solvers import solve
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G, MASS = 10.0, 4.0
HELD = ("x", "y", "z", "rx", "ry", "rz")
SETTINGS = SolverSettings(tol=1e-11, floor=1e-6)


def plate_on_floor(law: Any, h: float, steps: int, *, push: Any = None, v: Any = None, mu: float = 0.3, gravity: Any = None) -> list[Step]:
    """A rigid plate of 1 m x 0.5 m that cannot turn, on a held floor."""
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), MASS), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [Support("floor", HELD), Support("plate", ("rx", "ry", "rz"))]
    if push is not None:
        supports.append(Support("plate", ("x",), velocity=push))
    model = build_model([plate, floor], supports=supports, gravity=gravity or (lambda t: (0, 0, -G)))
    initial = at_rest(model)
    if v is not None:
        initial.v[:3] = v
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), mu, 0.05)
    return list(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law), steps, SETTINGS, initial, witness=None))


def test_slip_weakening_falls_linearly_with_the_way() -> None:
    """Driven at 0.1 m/s the force is mu(slip) m g, from 0.8 to 0.2 over 0.05 m; work above the last level (0.8 - 0.2) m g D / 2."""
    law = Gap(friction=SlipWeakening(0.8, 0.2, 0.05))
    h = 4e-3
    steps = plate_on_floor(law, h, 200, push=lambda t: 0.1)
    way = 0.1 * h * np.arange(200)  # at the beginning of each step
    force = np.array([-step.contact_force_on(0)[0] for step in steps])
    expected = np.maximum(0.8 - 0.6 * way / 0.05, 0.2) * MASS * G
    assert_allclose(force, expected, atol=1e-2 * MASS * G)
    work = float(np.sum(force - 0.2 * MASS * G) * 0.1 * h)
    assert work == pytest.approx(0.6 * MASS * G * 0.05 / 2, rel=0.02)


def test_rate_dependent_friction_stops_where_its_ordinary_differential_equation_does() -> None:
    """v' = -mu(v) g with mu = d + (s - d) / (1 + v/c): the time to stop by quadrature of dv / (mu g)."""
    law, v0 = Gap(friction=RateDependent(0.6, 0.2, 0.5)), 2.0
    v = np.linspace(0, v0, 20001)
    time = np.trapezoid(1 / (G * (0.2 + 0.4 / (1 + v / 0.5))), v)
    steps = plate_on_floor(law, 2e-3, int(1.2 * time / 2e-3), v=(v0, 0, 0))
    stopped = next(step.state.t for step in steps if abs(step.state.v[0]) < 1e-6)
    assert stopped == pytest.approx(time, rel=5e-3)


@pytest.mark.slow
def test_stick_slip_of_a_mass_on_a_spring() -> None:
    """A mass drawn through a spring k at the speed V, mu_s > mu_k. With omega^2 = k/m and a = (mu_s - mu_k) g / omega^2 it slips for
    T_s = 2 (pi - atan(a omega / V)) / omega at up to V + sqrt(V^2 + (a omega)^2), and sticks for 2 a / V: the period is their sum.
    Source: e.g. B. N. J. Persson, Sliding Friction, Springer, 2000."""
    k, V, mu_s, mu_k, h = 400.0, 0.1, 0.6, 0.4, 2e-3
    omega = np.sqrt(k / MASS)
    a = (mu_s - mu_k) * G / omega**2
    slip_time = 2 * (np.pi - np.arctan(a * omega / V)) / omega
    period = slip_time + 2 * a / V
    drawn: list[float] = [0.0]

    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), MASS), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [Support("floor", HELD), Support("plate", ("rx", "ry", "rz", "y"))]
    model = build_model([plate, floor], supports=supports, gravity=lambda t: (k / MASS * (V * t - drawn[0]), 0, -G))
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), mu_k, 0.05)
    law = Gap(friction=StaticKinetic(mu_s, mu_k, 1e-4))
    steps = round(3.2 * period / h) + round(mu_s * MASS * G / k / V / h)
    x, v = [], []
    for step in Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law), steps, SETTINGS, witness=None):
        drawn[0] = float(step.state.x[0])  # the spring's end at the step's beginning: an error of O(h)
        x.append(drawn[0])
        v.append(float(step.state.v[0]))
    moving = np.array(v) > 1e-3
    starts = np.flatnonzero(np.diff(moving.astype(int)) == 1) * h
    assert len(starts) >= 3
    assert_allclose(np.diff(starts)[1:], period, rtol=0.04)
    assert np.max(v) == pytest.approx(V + np.hypot(V, a * omega), rel=0.05)


@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0, 90.0])
def test_elliptic_friction_deflects_a_sliding_body(angle: float) -> None:
    """Slip at the angle t from axis 1, the ellipse's normal: r_T = -(mu_1^2 c, mu_2^2 s) r_N / sqrt(mu_1^2 c^2 + mu_2^2 s^2)."""
    mu_1, mu_2 = 0.2, 0.5
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    step = plate_on_floor(Gap(friction=Elliptic(mu_1, mu_2, (1.0, 0.0, 0.0))), 1e-5, 2, v=(2 * c, 2 * s, 0))[-1]
    expected = -np.array([mu_1**2 * c, mu_2**2 * s]) / np.hypot(mu_1 * c, mu_2 * s) * MASS * G
    assert_allclose(step.contact_force_on(0)[:2], expected, rtol=2e-3, atol=1e-3)
    assert step.energy.tangential_dissipation > 0


def test_an_axis_turned_in_the_plane_is_the_turned_answer() -> None:
    one = plate_on_floor(Gap(friction=Elliptic(0.2, 0.5, (1.0, 0.0, 0.0))), 1e-4, 5, v=(1.0, 1.0, 0))[-1].contact_force_on(0)
    other = plate_on_floor(Gap(friction=Elliptic(0.2, 0.5, (0.0, 1.0, 0.0))), 1e-4, 5, v=(-1.0, 1.0, 0))[-1].contact_force_on(0)
    assert_allclose(other, [-one[1], one[0], one[2]], rtol=1e-6, atol=1e-8)


SPRINGS = Springs(normal=2e5, tangential=1e5)


def test_a_plate_sinks_into_springs_by_its_pressure_over_their_stiffness() -> None:
    """Damped to rest: m g / (k A), the area once however many nodes touch; the springs' energy is (m g)^2 / (2 k A)."""
    law = Compliant(Springs(normal=2e5, tangential=1e5, normal_damping=4e3))
    last = plate_on_floor(law, 4e-3, 200)[-1]
    assert last.state.x[2] == pytest.approx(-MASS * G / (2e5 * 0.5), rel=1e-5)
    assert last.energy.contact == pytest.approx((MASS * G) ** 2 / (2 * 2e5 * 0.5), rel=1e-4)


def test_springs_bounce_a_body_with_their_frequency_and_keep_its_energy() -> None:
    """Pressed down at 0.1 m/s without gravity: half a period pi sqrt(m / (k A)) in contact, then off with the same speed."""
    h = 4e-4
    steps = plate_on_floor(Compliant(SPRINGS), h, 300, v=(0, 0, -0.1), gravity=lambda t: (0, 0, 0))
    touched = [step.state.t for step in steps if np.any(step.contact_force)]
    assert touched[-1] - touched[0] == pytest.approx(np.pi * np.sqrt(MASS / (2e5 * 0.5)), abs=3 * h)
    assert steps[-1].state.v[2] == pytest.approx(0.1, rel=2e-3)
    total = [step.energy.kinetic + step.energy.contact for step in steps]
    assert_allclose(total, 0.5 * MASS * 0.1**2, rtol=0.02)
    assert steps[-1].ledger.created < 1e-3 * total[0]


def test_the_tangential_spring_yields_at_the_friction_force() -> None:
    """Driven sideways quasi-statically: k_t A x up to mu m g, then constant; back, the same slope from there."""
    law, V = Compliant(SPRINGS), 1e-3
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), MASS), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    press = 1e-3  # a displacement that is held: N = k A press
    supports = [
        Support("floor", HELD),
        Support("plate", ("rx", "ry", "rz", "y")),
        Support("plate", ("z",), velocity=lambda t: -press if t < 1 else 0.0),
        Support("plate", ("x",), velocity=lambda t: 0.0 if t < 1 else (V if t < 2 else -V)),
    ]
    model = build_model([plate, floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), 0.3, 0.05)
    steps = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(0.05, 1e-9, law), 60, SETTINGS, witness=None))
    N, kt = 2e5 * 0.5 * press, 1e5 * 0.5
    t = np.array([step.state.t for step in steps])
    x = np.where(t < 1, 0, np.where(t < 2, V * (t - 1), V * (3 - t)))
    limit = 0.3 * N
    expected, previous, force = [], 0.0, 0.0
    for way in x:
        force = np.clip(force + kt * (way - previous), -limit, limit)
        previous = way
        expected.append(-force)
    found = [step.contact_force_on(0)[0] for step in steps]
    assert_allclose(found, expected, atol=2e-2 * limit)
    assert steps[-1].contact_force_on(0)[2] == pytest.approx(N, rel=1e-6)


def test_a_problem_with_springs_is_an_ordinary_one_in_files(tmp_path: Any) -> None:
    """The joint's unknowns stand in M, H, f: what is read back has the same answer, and W = H^T M^-1 H holds C."""
    step = plate_on_floor(Compliant(SPRINGS), 1e-3, 20)[-1]
    write_fclib(tmp_path / "springs.hdf5", step.problem)
    again = solve(read_fclib(tmp_path / "springs.hdf5").problem, "NSN-AC", tol=1e-11)
    assert again.solved
    assert_allclose(again.u, step.result.u, atol=1e-8)
    p = step.problem
    W = p.H.T @ np.linalg.solve(p.M.toarray(), p.H.toarray())
    local = step.reduction.local.W
    assert_allclose(W, local if isinstance(local, np.ndarray) else local.toarray(), rtol=1e-9, atol=1e-12 * np.abs(W).max())


@pytest.mark.parametrize(("size", "mass"), [((0.4, 0.4), 2.0), ((400.0, 100.0), 2e-9)])
def test_a_plate_that_spins_on_its_corners_slows_down_linearly(size: tuple[float, float], mass: float) -> None:
    """Each corner carries friction across its arm, half the diagonal D: I d(omega)/dt = - mu m g D / 2, whatever share each carries; of a
    square 1.85 times the torque of uniform pressure, mu m g times 0.3826 sides."""
    (a, b), mu, gravity = size, 0.3, 9.81 * size[0] / 0.4
    plate, floor = rigid_box("plate", (a, b, 0.1 * a), (0, 0, 0.05 * a), mass), rigid_box("floor", (9 * a, 9 * a, a), (0, 0, -a / 2), 1.0)
    supports = [Support("floor", ("x", "y", "z", "rx", "ry", "rz"))]
    model = build_model([plate, floor], supports=supports, gravity=lambda t: (0, 0, -gravity))
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), mu, 0.05 * a)
    D, start, h, n = np.hypot(a, b), at_rest(model), 1e-3, 40
    start.v[5] = 6.0
    settings = SolverSettings(tol=1e-10, floor=1e-9 * a)
    *_, last = Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=Gap()), n, settings, initial=start)
    slowed = mu * mass * gravity * D / 2 / (mass / 12 * D**2) * n * h
    assert 0.2 < slowed < 5
    assert_allclose(last.state.v[5], 6.0 - slowed, rtol=2e-4)
    if a == b:
        x = (np.arange(400) + 0.5) / 400 - 0.5
        assert D / 2 / a / np.hypot(*np.meshgrid(x, x)).mean() == pytest.approx(1.85, abs=0.005)


def test_refusals() -> None:
    for wrong, message in (
        (lambda: SlipWeakening(-0.1, 0.2, 0.1), "static: expected"),
        (lambda: SlipWeakening(0.1, 0.2, 0.0), "distance: expected"),
        (lambda: RateDependent(0.1, float("nan"), 1.0), "dynamic: expected"),
        (lambda: Elliptic(0.0, 0.1, (1, 0, 0)), "mu_1: expected"),
        (lambda: Elliptic(0.1, 0.1, (0, 0, 0)), "direction: expected"),
        (lambda: Springs(normal=0.0, tangential=1.0), "normal: expected a stiffness"),
        (lambda: Gap(recovery=-1.0), "recovery: expected"),
        (lambda: plate_on_floor(Gap(friction=Elliptic(0.1, 0.2, (0, 0, 1))), 1e-3, 1), "not normal to the surfaces"),
        (lambda: plate_on_floor(Gap(friction=lambda s: -s.mu), 1e-3, 1), "finite coefficients >= 0"),
    ):
        with pytest.raises(InputError, match=message):
            wrong()


@pytest.mark.parametrize("h", [1.0, 0.25])
@pytest.mark.parametrize(
    ("friction", "sliding"),
    [(StaticKinetic(0.5, 0.2), 0.2), (RateDependent(0.5, 0.2, 0.02), 0.35), (lambda sliding: 0.5 - 0.1 * (sliding.velocity > 1e-3), 0.4)],
)
def test_in_statics_the_rate_is_the_way_of_the_last_load_step(friction: Friction, sliding: float, h: float) -> None:
    """A block pressed until t = 1 and drawn at 0.02 m a unit of time from t = 1 to 5: it begins to slide under mu = 0.5."""
    block = Body("block", brick("block", (1, 1, 1), (2, 2, 2), Material(1e8, 0.0, 1000.0)))
    floor = rigid_box("floor", (4, 4, 1), (0.5, 0.5, -0.5), 1.0)
    supports = [
        Support("floor", ("x", "y", "z", "rx", "ry", "rz")),
        Support("block", ("z",), "z+", displacement=lambda t: -1e-3 * min(t, 1.0)),
        Support("block", ("x",), "z+", displacement=lambda t: 0.02 * max(t - 1.0, 0.0)),
        Support("block", ("y",), "z+"),
    ]
    model = build_model([block, floor], supports=supports)
    steps = list(Simulation(model, Everything(model, 0.5), QuasiStatic(h, law=Gap(friction=friction)), round(5 / h)))
    ratio = [abs(x / z) for x, _, z in (step.contact_force_on(model.number["block"]) for step in steps[round(1 / h) :])]
    assert ratio[0] == pytest.approx(0.5)
    assert ratio[-1] == pytest.approx(sliding, rel=1e-3)


@pytest.mark.parametrize("bodies", ["rigid", "deformable"])
def test_friction_up_to_its_largest_coefficient_holds(bodies: str) -> None:
    """mu = 1e6: what is pushed by 0.2 of its weight stays, with that force; more is refused, numbers as the run begins."""
    soft = bodies == "deformable"
    part = brick("box", (1.0, 1.0, 0.5), (2, 2, 2), Material(1e8, 0.2, 2000.0))
    box = Body("box", part, translation=(-0.5, -0.5, 0.0)) if soft else rigid_box("box", (1, 1, 0.5), (0, 0, 0.25), 1000.0)
    floor = rigid_box("floor", (4, 4, 1), (0, 0, -0.5), 1.0)
    model = build_model([box, floor], supports=[Support("floor", HELD)], gravity=lambda t: (2.0, 0.0, -10.0), beta=1e-3)
    scheme = QuasiStatic(1.0, eta=1.0) if soft else Theta(1e-3)
    *_, step = Simulation(model, Everything(model, 1e6), scheme, 3)
    assert step.contact_force_on(model.number["box"]) == pytest.approx([-2000.0, 0.0, 10000.0], rel=1e-3, abs=1.0)
    for mu in (1e7, {("box", "floor"): 1e12}):
        with pytest.raises(InputError, match=r"expected coefficients of friction up to 1e\+06, got 1e\+"):
            Simulation(model, Everything(model, mu), scheme, 3)
    late = Simulation(model, Everything(model, lambda one, other: 1e12), scheme, 3)
    with pytest.raises(InputError, match=r"up to 1e\+06, got 1e\+12"):
        list(late)


@pytest.mark.parametrize(("m", "s"), [(1.0, 1.0), (1e6, 1e-3)])
def test_what_sticks_to_a_belt_is_at_rest_in_all_units(m: float, s: float) -> None:
    """A box on a belt of 0.1 m/s is held back by 0.4 of its weight: it sticks (mu_s = 0.5), and goes with it; thrown at half of that speed
    it slides (mu_k = 0.3), and falls back by 0.1 g t. m, s: units of length and time in a metre and a second.

    What counted as rest was 1e-6 in any units: in micrometres, less than what the solver leaves of 1e5, so that the box slid.
    """
    g, V, h = G * m / s**2, 0.1 * m / s, 1e-3 * s
    belt, box = (
        rigid_rectangle("belt", (4 * m, 0.2 * m), (0, -0.1 * m), 1.0),
        rigid_rectangle("box", (0.4 * m, 0.1 * m), (0, 0.05 * m), 2.0),
    )
    model = build_model(
        [belt, box],
        supports=[Support("belt", ("x",), velocity=V), Support("belt", ("y", "rz"))],
        loads=[Force("box", (-0.4 * 2.0 * g, 0.0))],
        gravity=lambda t: (0.0, -g),
    )
    for thrown, goes in ((V, V), (V / 2, V / 2 - 0.1 * g * 40 * h)):
        start = at_rest(model)
        start.v[3:5] = thrown, 0.0
        *_, last = Simulation(model, Everything(model, 0.5), Theta(h, law=Gap(friction=StaticKinetic(0.5, 0.3))), 40, initial=start)
        assert last.state.v[3] == pytest.approx(goes, rel=1e-3)


@pytest.mark.parametrize("way", [1e-7, 1e-2])
def test_a_block_drawn_by_little_a_load_step_slides_with_its_kinetic_friction(way: float) -> None:
    """On a floor, by 1e-7 of its size a step too: what counted as rest was 1e-6 in a unit of time, below which mu_s never ended."""
    block = Body("block", brick("block", (1, 1, 1), (1, 1, 1), Material(1e8, 0.0, 1000.0)))
    floor = rigid_box("floor", (4, 4, 1), (0.5, 0.5, -0.5), 1.0)
    held = [Support("block", ("y",)), Support("block", ("x",), "z+", displacement=lambda t: way * t)]
    model = build_model(
        [block, floor], supports=[Support("floor", HELD), *held], loads=[Traction("block", "z+", (0.0, 0.0, -1e-2 * way * 1e8))]
    )
    law = Gap(friction=StaticKinetic(0.5, 0.2))
    *_, step = Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, eta=1.0, law=law), 4)
    x, _, z = step.contact_force_on(0)
    assert abs(x / z) == pytest.approx(0.2, rel=1e-3)


def test_what_was_lifted_is_at_rest_when_it_meets_again() -> None:
    """Pressed, drawn until it slides at mu = 0.2, lifted far out of reach, and pressed while it is drawn on: what comes to bear has
    no rate, mu = 0.5, and slides at 0.2 from the next load step on. Of bodies of finite strain, whose contacts are those where a step ends,
    it had kept the rate from before it was lifted."""
    material = saint_venant_kirchhoff(1e8, 0.0, 1000.0)
    block = Body("block", brick("block", (1, 1, 1), (1, 1, 1), material))
    floor = rigid_box("floor", (4, 4, 1), (0.5, 0.5, -0.5), 1.0)
    times = [0.0, 1.0, 4.0, 5.0, 6.0, 9.0]
    supports = [
        Support("floor", HELD),
        Support("block", ("z",), "z+", displacement=lambda t: float(np.interp(t, times, [0, -1e-3, -1e-3, 0.2, -1e-3, -1e-3]))),
        Support("block", ("x",), "z+", displacement=lambda t: float(np.interp(t, times, [0, 0, 0.06, 0.06, 0.08, 0.14]))),
        Support("block", ("y",), "z+"),
    ]
    model = build_model([block, floor], supports=supports)
    law = Gap(friction=StaticKinetic(0.5, 0.2))
    forces = [
        step.contact_force_on(model.number["block"]) for step in Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, law=law), 9)
    ]
    assert not np.any(forces[4])  # in the air
    assert [abs(x / z) for x, _, z in (forces[k] for k in (1, 3, 5, 6, 8))] == pytest.approx([0.5, 0.2, 0.5, 0.2, 0.2], rel=1e-3)
