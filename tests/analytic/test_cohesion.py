"""Joints that hold together: strengths, fracture energies and energy release, from closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Cohesive, Gap, JointLost, Springs, laws_of_bodies, laws_of_pairs
from fcsim.errors import InputError
from fcsim.mesh.blocks import rigid_box
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

HELD = ("x", "y", "z", "rx", "ry", "rz")
AREA, TENSION, G_1, G_2 = 0.5, 2e5, 20.0, 60.0
SETTINGS = SolverSettings(tol=1e-6, floor=1e-9)
STIFF = Springs(normal=1e10, tangential=2e9)
"""A held plate's normal force is determined by springs alone."""


def joint(law: Any, steps: int, *, lift: Any = 0.0, push: Any = 0.0, mu: float = 0.6, alert: float = 0.01) -> Simulation:
    """A rigid plate of 1 m x 0.5 m glued on a held floor, driven by displacements (velocities [m/s] over steps of 1 s)."""
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), 4.0), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [
        Support("floor", HELD),
        Support("plate", ("rx", "ry", "rz", "y")),
        Support("plate", ("x",), velocity=push),
        Support("plate", ("z",), velocity=lift),
    ]
    model = build_model([plate, floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), mu, alert, name="joint")
    return Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, 0.0, law), steps, SETTINGS, witness=None)


def force(steps: list[Step]) -> np.ndarray:
    return np.array([step.contact_force_on(0) for step in steps])


def balanced(steps: list[Step]) -> None:
    """What joints and friction took is what the reactions took and the scheme lost, to the solver's tolerance; nothing is made."""
    for step in steps:
        e = step.energy
        assert abs(e.residual) < 1e-9 * G_2 * AREA
        assert e.friction_dissipation > -1e-9 * G_2 * AREA
    fractured = sum(step.energy.fracture_dissipation for step in steps)
    variables = steps[-1].law_variables
    assert fractured == pytest.approx(variables["work_1"].sum() + variables["work_2"].sum(), rel=1e-12)


@pytest.mark.parametrize("n", [7, 50])
def test_peel_of_one_joint(n: int) -> None:
    """Traction falls linearly from f_t to zero at 2 G_I / f_t, at the end of each load step exactly, however large they are; what is
    dissipated is G_I A, of which the scheme counts the sum of F dx, lower by f_t A dx / 2, as the reactions' work."""
    opening = 2 * G_1 / TENSION
    steps = list(joint(Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2), int(1.3 * n), lift=opening / n))
    found = -force(steps)[:, 2]
    way = np.arange(1, len(steps) + 1) / n
    assert_allclose(found, TENSION * AREA * np.maximum(1 - way, 0), atol=1e-5 * TENSION * AREA)
    last = steps[-1]
    assert_allclose(last.law_variables["fracture"], 1.0)
    assert last.law_variables["work_1"].sum() == pytest.approx(G_1 * AREA, rel=1e-12)
    assert -sum(step.energy.contact_gain for step in steps) == pytest.approx(G_1 * AREA, rel=1e-5)
    numerical = sum(step.energy.numerical_dissipation for step in steps)
    assert numerical == pytest.approx(-G_1 * AREA / n, rel=1e-5)
    assert last.energy.contact == 0.0
    balanced(steps)


@pytest.mark.parametrize("n", [7, 50])
def test_shear_of_one_joint_that_cannot_open(n: int) -> None:
    """Shear strength mu f_t falls linearly to zero at 2 G_II / (mu f_t): work G_II A. No pressure, so nothing is left."""
    slip = 2 * G_2 / (0.6 * TENSION)
    steps = list(joint(Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, springs=STIFF), int(1.3 * n), push=slip / n))
    found = -force(steps)[:, 0]
    # the springs yield by e = mu f_t / k_t before the joint slides
    pushed, e = slip * np.arange(1, len(steps) + 1) / n, 0.6 * TENSION / STIFF.tangential
    softened = np.maximum(1 - (pushed - e) / (1 - e / slip) / slip, 0)
    assert_allclose(found, AREA * np.minimum(STIFF.tangential * pushed, 0.6 * TENSION * softened), atol=1e-5 * TENSION * AREA)
    variables = steps[-1].law_variables
    assert_allclose(variables["fracture"], 1.0)
    assert variables["work_2"].sum() == pytest.approx(G_2 * AREA, rel=1e-12) and variables["work_1"].sum() == 0
    euler = 0.5 * STIFF.tangential * AREA * float(np.sum(np.diff(found / (STIFF.tangential * AREA), prepend=0.0) ** 2))
    assert -sum(step.energy.contact_gain for step in steps) == pytest.approx(G_2 * AREA + euler, rel=1e-4)
    balanced(steps)


@pytest.mark.each_value
@pytest.mark.parametrize("shear", [3e5, 2e4])
@pytest.mark.parametrize("n", [9, 60])
def test_friction_is_left_where_the_joint_is_damaged(shear: float, n: int) -> None:
    """Under a held pressure p of springs: c i + mu p, to the end of each step; c given apart from mu f_t, the pressure far below it or
    far above."""
    slip = 2 * G_2 / shear
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, shear=shear, springs=STIFF)
    pressed = 1e-5  # m into the springs in the first step: 1e5 Pa
    steps = list(joint(law, int(1.4 * n) + 2, lift=lambda t: -pressed if t < 1 else 0.0, push=lambda t: 0.0 if t < 2 else slip / n))
    found = -force(steps)[2:, 0] / AREA
    pushed = slip * np.arange(1, len(found) + 1) / n
    # c i + mu p = k_t e on the stretch e of the springs, pushed = e + slip, i = 1 - slip / (2 G_II / c)
    k, rest = STIFF.tangential, 0.6 * 1e5
    slid = np.maximum((pushed - (shear + rest) / k) / (1 - shear / slip / k), 0)
    exact = np.where(slid > 0, np.where(slid < slip, shear * (1 - slid / slip), 0) + rest, k * pushed)
    assert_allclose(found, exact, rtol=2e-4)
    assert steps[-1].law_variables["work_2"].sum() == pytest.approx(G_2 * AREA, rel=1e-12)
    balanced(steps)


def test_in_mixed_mode_the_shares_of_the_energies_add_up_to_one() -> None:
    """Half of mode II first, then opened: W_I / G_I + W_II / G_II = 1 at the end, less what the springs' shear slides under the growing
    tension: their stretch e = c / k_t at most, e / (2 G_II / c) of W_II."""
    law, n = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, springs=STIFF), 40
    slip, opening = 2 * G_2 / (0.6 * TENSION), 2 * G_1 / TENSION
    half = int(0.3 * n)
    steps = list(joint(law, 2 * n, push=lambda t: slip / n if t < half else 0.0, lift=lambda t: opening / n if t > half else 0.0))
    last = steps[-1].law_variables
    shares = last["work_1"].sum() / (G_1 * AREA), last["work_2"].sum() / (G_2 * AREA)
    assert min(shares) > 0.3 and 1 - 0.6 * TENSION / STIFF.tangential / slip < sum(shares) <= 1 and np.all(last["fracture"] == 1)
    balanced(steps)


@pytest.mark.parametrize("ratio", [0.2, pytest.param(1.0, marks=pytest.mark.slow), 5.0])
def test_tension_lowers_the_shear_strength_and_what_fractures_is_the_work(ratio: float) -> None:
    """Under a held tension s < f_t (of springs) the joint slides at (c / f_t) (f_t i - s), i = 1 - slip / (2 G_II / c), and breaks: the
    work of the shear force is the part of the fracture energy that is dissipated, the integral of c (i - s / f_t) over the slip."""
    s, mu = 0.25 * TENSION, 0.5
    c = ratio * mu * TENSION
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2, springs=STIFF, shear=c)
    stretched, n = s / STIFF.normal, 40
    slip = 2 * G_2 / c
    steps = list(joint(law, 2 * n, lift=lambda t: stretched if t < 1 else 0.0, push=lambda t: 0.0 if t < 2 else slip / n, mu=mu))
    found = force(steps)
    assert_allclose(found[2:10, 2], -s * AREA, rtol=1e-5)
    i = np.sqrt(1 - np.array([step.law_variables["fracture"][0] for step in steps]))
    slides = (i < 1 - 1e-4) & (i * TENSION > s)
    assert_allclose(-found[slides, 0], c / TENSION * AREA * (TENSION * i - s)[slides], atol=1e-4 * TENSION * AREA)
    pulled = slip * np.arange(-1, len(steps) - 1) / n + found[:, 0] / AREA / STIFF.tangential
    assert_allclose(i[slides], (1 - pulled / slip)[slides], atol=1e-4)
    assert np.all(np.diff(i) <= 0) and i[-1] == 0 and found[-1, 2] == 0
    q = s / TENSION
    if c**2 / STIFF.tangential < 2 * G_2:  # else the joint is more brittle than its springs are stiff, and breaks in one step
        assert steps[-1].law_variables["work_2"].sum() == pytest.approx(G_2 * AREA * (1 - q) ** 2, rel=0.05)
    balanced(steps)


def test_a_joint_that_breaks_in_motion_takes_its_fracture_energy_exactly() -> None:
    """A plate thrown off the floor at theta = 1/2: what it loses is G_I A however coarse the steps are, in the last of which the joint
    breaks; slower, it is stopped at the opening where f_t A (d - d^2 / (2 d_c)) is its energy, and drawn back."""
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), 4.0), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    model = build_model([plate, floor], supports=[Support("floor", HELD)])
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), 0.6, 0.01)
    law, opening = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2), 2 * G_1 / TENSION
    for energy, steps in ((1.7, 6), (1.7, 33), (1.2, 15), (0.75, 40)):
        start = at_rest(model)
        start.v[2] = speed = np.sqrt(2 * energy * G_1 * AREA / 4.0)
        h = 2 * opening / speed / steps
        run = list(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law), steps, SETTINGS, initial=start, witness=None))
        kinetic = np.array([step.energy.kinetic for step in run]) / (G_1 * AREA)
        x = np.array([step.state.x[2] for step in run]) / opening
        lost = np.array([step.energy.fracture_dissipation for step in run]).cumsum() / (G_1 * AREA)
        widest = np.maximum.accumulate(np.minimum(x, 1))
        assert_allclose(lost, widest * (2 - widest), atol=1e-6)
        away = x >= widest  # on the way back it falls with what force is left
        assert_allclose(kinetic[away], (energy - lost)[away], atol=1e-5)
        if energy > 1:
            assert_allclose(kinetic[-1], energy - 1, rtol=1e-5)
        else:
            assert widest.max() == pytest.approx(1 - np.sqrt(1 - energy), rel=2e-2) and x[-1] < widest.max()
        assert sum(abs(step.energy.numerical_dissipation) for step in run) < 1e-5 * G_1 * AREA


def test_what_was_not_joined_at_the_start_does_not_stick() -> None:
    """A plate let down on the floor is lifted again without force."""
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    model_steps = joint(law, 5, lift=1e-5)
    gone = [step.contact_force_on(0)[2] for step in joint(law, 8, lift=lambda t: 1e-3 if t < 3 else (-1e-3 if t < 6 else 1e-3))]
    assert next(iter(model_steps)).contact_force_on(0)[2] < 0
    assert gone[-1] == pytest.approx(0.0, abs=1e-9 * TENSION) and gone[-2] == pytest.approx(0.0, abs=1e-9 * TENSION)


def test_a_joint_that_holds_and_is_not_seen_any_more_stops_the_run() -> None:
    law = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    with pytest.raises(JointLost, match=r"4 joints that still hold .* expected an alert distance above"):
        list(joint(law, 10, lift=2e-5, alert=5e-5))


@pytest.mark.parametrize(("axis", "steps"), [((1.0, 0.0, 0.0), 56), ((1.0, 0.6, 0.3), 5)])
def test_equal_cubes_stay_glued_corner_on_corner_as_they_spin(axis: tuple[float, ...], steps: int) -> None:
    """The contact is that of one corner on the other's face or the other way round, or of two edges, by the last digits: the joint is
    one, and as strong as that of a cube on a face a little wider; it was lost in step 54 and in the second."""
    energies = []
    for width in (1.0, 1.001):
        lower, upper = rigid_box("lower", (width, width, 1.0), (0, 0, -0.5), 1e3), rigid_box("upper", (1.0,) * 3, (0, 0, 0.5), 1e3)
        model = build_model([lower, upper])
        start = at_rest(model)
        v, omega = start.v.copy(), np.array(axis) / np.linalg.norm(axis)
        model.rigid_part(v)[:] = [[*np.cross(omega, (0, 0, z)), *omega] for z in (-0.5, 0.5)]
        law = Cohesive(tension=1e6, shear=1e6, mode_1=1e3, mode_2=1e3)
        settings = SolverSettings(tol=1e-10)
        *_, last = Simulation(model, Everything(model, 0.5), Theta(5e-3, 0.5, law), steps, settings, initial=State(0.0, start.x, v))
        assert len(last.contacts) == 4 and last.law_variables["fracture"].max() < 2e-3
        energies.append(last.energy.kinetic)
    assert energies[0] == pytest.approx(energies[1], rel=2e-3)


def test_a_run_goes_on_from_its_checkpoint_bit_by_bit(tmp_path: Any) -> None:
    law, opening = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2), 2 * G_1 / TENSION
    whole = list(joint(law, 30, lift=opening / 40, push=opening / 30))
    write_checkpoint(tmp_path / "checkpoint.h5", whole[12])
    stored = read_checkpoint(tmp_path / "checkpoint.h5")
    assert stored is not None
    again = list(joint(law, 30, lift=opening / 40, push=opening / 30).run(*stored))
    assert [step.number for step in again] == list(range(14, 31))
    for one, other in zip(whole[13:], again, strict=True):
        assert_array_equal(one.state.x, other.state.x)
        assert_array_equal(one.reaction, other.reaction)
        for name, values in one.law_variables.items():
            assert_array_equal(values, other.law_variables[name])


def test_two_laws_in_one_model() -> None:
    """One plate glued, one only lying there; both are lifted. By bodies and by pairs."""
    glued, loose = rigid_box("glued", (1.0, 0.5, 0.1), (-1, 0, 0.05), 4.0), rigid_box("loose", (1.0, 0.5, 0.1), (1, 0, 0.05), 4.0)
    floor = rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    supports = [Support("floor", HELD)]
    for name in ("glued", "loose"):
        supports += [Support(name, ("rx", "ry", "rz", "x", "y")), Support(name, ("z",), velocity=1e-6)]
    model = build_model([glued, loose, floor], supports=supports)
    ground = contact_surface(model, [("floor", "z+")])
    pairs = [SurfacePair(contact_surface(model, [(name, "z-")]), ground, 0.6, 0.01, name=name) for name in ("glued", "loose")]
    detector = Detector(pairs, model.n_nodes)
    glue = Cohesive(tension=TENSION, mode_1=G_1, mode_2=G_2)
    by_bodies = laws_of_bodies(model, {("glued", "floor"): glue}, Gap())
    by_pairs = laws_of_pairs(detector, {"glued": glue}, Gap())
    for law in (by_bodies, by_pairs):
        steps = list(Simulation(model, detector, QuasiStatic(1.0, 0.0, law), 3, SETTINGS, witness=None))
        assert steps[0].contact_force_on(0)[2] == pytest.approx(-TENSION * AREA * (1 - 1e-6 / (2 * G_1 / TENSION)), rel=1e-6)
        assert all(step.contact_force_on(1)[2] == 0 for step in steps)
        assert steps[-1].law_variables["fracture"].shape == (8,)
    with pytest.raises(InputError, match="expected names of surface pairs"):
        laws_of_pairs(detector, {"mortar": glue}, Gap())
    with pytest.raises(InputError, match="nobody"):
        laws_of_bodies(model, {"nobody": glue}, Gap())
    with pytest.raises(InputError, match="one law for 'floor' and 'glued', in either order, got two"):
        laws_of_bodies(model, {("glued", "floor"): glue, ("floor", "glued"): Gap()}, Gap())


def test_refusals() -> None:
    for options, message in (
        ({"tension": 0.0, "mode_1": 1.0, "mode_2": 1.0}, "tension: expected"),
        ({"tension": 1.0, "mode_1": -1.0, "mode_2": 1.0}, "mode_1: expected"),
        ({"tension": 1.0, "mode_1": 1.0, "mode_2": 1.0, "shear": 0.0}, "shear: expected"),
    ):
        with pytest.raises(InputError, match=message):
            Cohesive(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("theta", "first", "second"), [(0.5, 9 / 8, 7 / 8), (1.0, 1 / 2, 1.0)])
@pytest.mark.parametrize("h", [1e-3, 2e-3])
def test_two_glued_halves_that_spin_from_the_first_step_are_held_by_what_their_circle_takes(
    theta: float, first: float, second: float, h: float
) -> None:
    """m omega^2 R of each half, by the circle that its centre goes; of the first two steps with what is between it and the chord of x_m,
    R (omega h)^2 / 8, and at theta = 1 the half step before the first force. The joint does not stand open by R (omega h)^2 / 2."""
    omega, mass, R = 10.0, 1000.0, 0.5
    halves = [rigid_box("left", (1.0, 1.0, 1.0), (-R, 0, 0), mass), rigid_box("right", (1.0, 0.8, 0.8), (R, 0, 0), mass)]
    model = build_model(halves)
    start = at_rest(model)
    model.rigid_part(start.v)[:, 1] = omega * R * np.array([-1.0, 1.0])
    model.rigid_part(start.v)[:, 5] = omega
    law = Cohesive(tension=2e5, mode_1=1e3, mode_2=1e3)
    steps = list(Simulation(model, Everything(model, 0.5), Theta(h, theta, law), 5, SETTINGS, initial=start, witness=None))
    held = [np.linalg.norm(step.contact_force_on(1)) / (mass * omega**2 * R) for step in steps]
    assert_allclose(held, [first, second, 1.0, 1.0, 1.0], rtol=5 * (omega * h) ** 2)
    assert max(step.contacts.gap.max() for step in steps[1:]) < 0.01 * R * (omega * h) ** 2
