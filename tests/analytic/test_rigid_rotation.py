"""Finite rotations of rigid bodies against rigid-body dynamics: tops without and with moments, a ball that rolls.

Sources: L. D. Landau, E. M. Lifshitz, Mechanics, 3rd ed., sections 35 (symmetric and heavy top) and 37 (asymmetric top, in Jacobi's
elliptic functions).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.loads import Force
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rigid_box
from fcsim.mesh.part import RigidBody
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta

INERTIA = np.array([1.0, 2.0, 3.5])  # about the principal axes [kg m^2]
PLACED = Rotation.from_rotvec([0.7, -0.4, 1.9]).as_matrix()  # principal axes in the world at the start
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)


def top(inertia: np.ndarray = INERTIA, placed: np.ndarray = PLACED, loads: tuple[Force, ...] = (), **options: object) -> Model:
    """A free rigid body without weight, and another far away: a simulation wants a pair of surfaces."""
    body = RigidBody("top", 3.0, placed @ np.diag(inertia) @ placed.T, np.zeros(3), CORNERS, {"face": [[0, 1, 2]]})
    far = RigidBody("far", 1.0, np.eye(3), np.full(3, 1e3), CORNERS + 1e3, {"face": [[0, 1, 2]]})
    return build_model([body, far], loads=loads, **options)  # type: ignore[arg-type]


def states(model: Model, scheme: Theta | GeneralisedAlpha, steps: int, omega: np.ndarray) -> list[State]:
    """The states from the start, with the angular velocity `omega` of the top in world axes."""
    slave, master = (contact_surface(model, [(name, "face")]) for name in ("top", "far"))
    initial = spinning(model, omega)
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)
    return [initial, *(step.state for step in Simulation(model, detector, scheme, steps, initial=initial))]


def states_without_contacts(model: Model, scheme: Theta | GeneralisedAlpha, steps: int, omega: np.ndarray) -> list[State]:
    """The same from the scheme and the factor alone, for long runs."""
    factor = SystemFactor(model, *scheme.factors(model), np.arange(3))
    history = [spinning(model, omega)]
    for _ in range(steps):
        load = scheme.right_hand_side(model, history[-1])
        mass = scheme.rigid_mass(model, history[-1], load)
        history.append(scheme.advance(model, history[-1], factor.with_rigid_mass(mass).solve(load), np.zeros(model.n_dofs), mass))
    return history


def spinning(model: Model, omega: np.ndarray) -> State:
    initial = at_rest(model)
    initial.v[3:6] = omega
    return initial


class Motion(NamedTuple):
    """At each instant: principal axes as columns (nt, 3, 3), angular velocity in them and angular momentum in the world (nt, 3),
    kinetic energy (nt,)."""

    axes: np.ndarray
    spin: np.ndarray
    momentum: np.ndarray
    energy: np.ndarray


def motion(model: Model, history: list[State], inertia: np.ndarray = INERTIA, placed: np.ndarray = PLACED) -> Motion:
    """By definition, from x and v alone."""
    axes = np.array([Rotation.from_rotvec(s.x[3:6]).as_matrix() @ placed for s in history])
    spin = np.array([Q.T @ s.v[3:6] for Q, s in zip(axes, history, strict=True)])
    momentum = np.einsum("tij,tj->ti", axes, inertia * spin)
    return Motion(axes, spin, momentum, 0.5 * np.einsum("ti,ti->t", spin, inertia * spin))


def free_asymmetric_top(t: np.ndarray, start: tuple[float, float]) -> np.ndarray:
    """Angular velocity (nt, 3) in the principal axes for (Omega_1, 0, Omega_3) at t = 0 and M^2 > 2 E I_2 (section 37)."""
    one, two, three = INERTIA
    twice = one * start[0] ** 2 + three * start[1] ** 2
    square = (one * start[0]) ** 2 + (three * start[1]) ** 2
    assert square > twice * two
    a, c = twice * three - square, square - twice * one
    rate, k2 = np.sqrt((three - two) * c / (one * two * three)), (two - one) * a / ((three - two) * c)
    sn, cn, dn, _ = ellipj(rate * t, k2)
    return np.stack(
        [
            np.sqrt(a / (one * (three - one))) * cn,
            np.sqrt(a / (two * (three - two))) * sn,
            np.sqrt(c / (three * (three - one))) * dn,
        ],
        axis=1,
    )


def test_the_simulation_is_the_scheme() -> None:
    """With and without the machinery of contacts: the same states."""
    runs = [run(top(), Theta(0.05), 30, PLACED @ [0.6, 0.1, 0.5]) for run in (states, states_without_contacts)]
    for one, other in zip(*runs, strict=True):
        assert_allclose(one.x[:6], other.x[:6], atol=1e-13)
        assert_allclose(one.v[:6], other.v[:6], atol=1e-13)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [
        (Theta(1.0, 0.5), 2),
        (Theta(1.0, 0.7), 1),
        (Theta(1.0, 1.0), 1),
        (GeneralisedAlpha(1.0, 1.0), 2),
        (GeneralisedAlpha(1.0, 0.8), 2),
        (GeneralisedAlpha(1.0, 0.0), 2),
    ],
)
def test_asymmetric_top_converges_to_jacobis_functions(scheme: Theta | GeneralisedAlpha, order: int) -> None:
    """Angular momentum is constant in space to round-off at every step size, angular velocity converges with the order of the scheme."""
    start, end = (0.6, 0.5), 6.0
    errors, counts = [], np.array([100, 200, 400])
    for count in counts:
        model = top()
        own = replace(scheme, h=end / count)
        found = motion(model, states_without_contacts(model, own, int(count), PLACED @ [start[0], 0, start[1]]))
        exact = free_asymmetric_top(np.linspace(0, end, count + 1), start)
        assert_allclose(found.momentum, np.tile(found.momentum[0], (count + 1, 1)), atol=1e-13 * count)
        errors.append(np.abs(found.spin - exact).max())
    assert errors[-1] < (2e-4 if order == 2 else 3e-2)
    assert_allclose(np.diff(np.log(errors)) / np.log(0.5), order, atol=0.15)


@pytest.mark.parametrize("scheme", [Theta(0.1), Theta(0.1, 0.8), GeneralisedAlpha(0.1, 0.8)])
def test_energy_of_a_driven_top_balances(scheme: Theta | GeneralisedAlpha) -> None:
    """The work of a constant moment is what it turns through; nothing is left over, though the inertia turns."""
    model = top(loads=(Force("top", (0.0, 0.0, 0.0), (0.2, -0.1, 0.3)),), alpha=0.02)
    slave, master = (contact_surface(model, [(name, "face")]) for name in ("top", "far"))
    initial = spinning(model, PLACED @ [0.6, 0.3, 1.0])
    simulation = Simulation(model, Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes), scheme, 20, initial=initial)
    for step in simulation:
        energy = step.energy
        found = motion(model, [step.previous, step.state])
        assert energy.kinetic == pytest.approx(found.energy[1], rel=1e-12)
        assert abs(energy.residual) < 1e-14
        mean = 0.5 * (step.previous.v + step.state.v)[3:6]
        assert energy.load_work == pytest.approx(scheme.h * np.array([0.2, -0.1, 0.3]) @ mean, abs=2e-3)
        assert abs(energy.numerical_dissipation) < 0.02


def test_energy_of_an_asymmetric_top_only_oscillates() -> None:
    """The scheme is symmetric in time at theta = 1/2: over eight turns the energy stays within C h^2 and does not drift."""
    largest = []
    for h in (0.1, 0.05):
        model = top()
        energy = motion(model, states_without_contacts(model, Theta(h), int(40 / h), PLACED @ [0.6, 0.3, 1.0])).energy
        relative = energy / energy[0] - 1
        largest.append(np.abs(relative).max())
        half = len(relative) // 2
        assert np.abs(relative[half:]).max() <= 1.05 * np.abs(relative[:half]).max()
    assert largest[0] < 0.1**2
    assert largest[1] == pytest.approx(largest[0] / 4, rel=0.1)


def test_rotation_about_the_intermediate_axis_turns_over() -> None:
    """Dzhanibekov: a disturbed rotation about the axis of the intermediate inertia turns over after 2 K(k) / rate, again and again."""
    one, two, three = INERTIA
    start = (1e-3, 1.0)  # Omega_1 and Omega_2 at t = 0, where Omega_3 = 0: cn of the other case, M^2 < 2 E I_2
    twice, square = one * start[0] ** 2 + two * start[1] ** 2, (one * start[0]) ** 2 + (two * start[1]) ** 2
    assert square < twice * two  # so axes 1 and 3 change places in the formulas
    a, c = square - twice * one, twice * three - square
    rate, k2 = np.sqrt((two - one) * c / (one * two * three)), (three - two) * a / ((two - one) * c)
    half = ellipk(k2) / rate  # from the middle of a plateau to the turn
    h = 0.04
    model = top()
    steps = int(6 * half / h)
    spin = motion(model, states_without_contacts(model, Theta(h), steps, PLACED @ [start[0], start[1], 0])).spin[:, 1]
    turns = h * np.flatnonzero(np.diff(np.sign(spin)))
    assert len(turns) == 3
    assert_allclose(turns, half * np.array([1, 3, 5]), rtol=2e-3)
    assert spin.min() < -0.999 and spin.max() > 0.999


def test_symmetric_top_precesses_about_its_angular_momentum() -> None:
    """Rate M / I_1 (section 35), for 12 precessions and as many rotations: the rotation vector passes pi again and again."""
    inertia, spin = np.array([2.0, 2.0, 3.0]), np.array([0.5, 0.0, 2.0])
    M = inertia * spin
    rate = np.linalg.norm(M) / inertia[0]
    turns, per_turn = 12, 60
    h = 2 * np.pi / rate / per_turn
    model = top(inertia)
    found = motion(model, states_without_contacts(model, Theta(h), turns * per_turn, PLACED @ spin), inertia)
    axis = PLACED @ M / np.linalg.norm(M)
    # the polygon of the steps lags by (rate h)^2 / 12 of the angle, the error of the rule tan / identity at second order
    angle = rate * h * np.arange(turns * per_turn + 1)
    exact = np.array([Rotation.from_rotvec(a * axis).as_matrix() @ PLACED[:, 2] for a in angle])
    assert np.abs(found.axes[:, :, 2] - exact).max() <= (rate * h) ** 2 / 12 * angle[-1] * 0.5
    assert_allclose(found.axes[:, :, 2] @ axis, PLACED[:, 2] @ axis, atol=1e-9)  # constant inclination
    assert_allclose(found.spin[:, 2], spin[2], rtol=1e-9)


@pytest.mark.parametrize(("theta", "order"), [(0.5, 2), (1.0, 1)])
def test_heavy_top_in_steady_precession(theta: float, order: int) -> None:
    """Inclination a, precession P about z, spin n about the axis: I_3 n P sin a + (I_3 - I_1) P^2 sin a cos a = m g l sin a, the moment of
    the weight, which turns with the axis and is applied as such."""
    inertia, a, P, n = np.array([2.0, 2.0, 1.5]), 0.6, 0.8, 3.0
    moment = inertia[2] * n * P * np.sin(a) + (inertia[2] - inertia[0]) * P**2 * np.sin(a) * np.cos(a)
    placed = Rotation.from_rotvec([0, a, 0]).as_matrix()  # the axis leans towards x; the weight's moment is about y and turns with P
    loads = (
        Force("top", (0, 0, 0), (0, moment, 0), lambda t: np.cos(P * t)),
        Force("top", (0, 0, 0), (-moment, 0, 0), lambda t: np.sin(P * t)),
    )
    omega, end = np.array([0, 0, P]) + n * placed[:, 2], 2 * np.pi / P
    errors = []
    for count in (100, 200, 400):
        model = top(inertia, placed, loads)
        found = motion(model, states_without_contacts(model, Theta(end / count, theta), count, omega), inertia, placed)
        around = np.array([Rotation.from_rotvec([0, 0, P * t]).as_matrix() @ placed[:, 2] for t in np.linspace(0, end, count + 1)])
        errors.append(np.abs(found.axes[:, :, 2] - around).max())
    assert errors[-1] < (1e-3 if order == 2 else 0.05)
    assert_allclose(np.diff(np.log(errors)) / np.log(0.5), order, atol=0.25)


@pytest.mark.parametrize("driven", ["eliminated", "identity"])
def test_a_moment_turns_a_top_about_a_held_axis(driven: str) -> None:
    """With the rotations about x and y held, a moment m about z gives m / J_zz in world axes, whatever J couples; the supports take up
    the rest: their moments are what is left of the change of angular momentum."""
    moment, h = 0.7, 0.05
    model = top(loads=(Force("top", (0, 0, 0), (0, 0, moment)),), supports=[Support("top", ("rx", "ry"))], driven=driven)
    J = PLACED @ np.diag(INERTIA) @ PLACED.T
    history = states(model, Theta(h), 40, np.zeros(3))
    found = motion(model, history)
    t = h * np.arange(41)
    assert_allclose([s.v[5] for s in history], moment / J[2, 2] * t, rtol=1e-12)
    assert_allclose([s.x[5] for s in history], moment / J[2, 2] * t**2 / 2, rtol=1e-12, atol=1e-12)
    assert_allclose([s.v[3:5] for s in history], 0, atol=1e-14)
    assert np.abs(found.momentum[-1, :2]).max() > 0.1  # a free one would have none about x and y


RADIUS, MASS, G = 0.1, 2.0, 9.81


def ball(meridians: int, parallels: int = 8) -> RigidBody:
    """A homogeneous ball on facets; its equator is a regular polygon in the plane of x and z, standing on a corner."""
    latitude, longitude = np.arange(1, parallels) * np.pi / parallels, np.arange(meridians) * 2 * np.pi / meridians - np.pi / 2
    ring = np.stack([np.cos(longitude), 0 * longitude, np.sin(longitude)], axis=1)
    rings = [RADIUS * (np.sin(a) * ring + [0, np.cos(a), 0]) for a in latitude]
    points = np.vstack([*rings, [[0, RADIUS, 0], [0, -RADIUS, 0]]])
    k = np.arange(meridians)
    nxt = (k + 1) % meridians
    facets = np.vstack([np.stack([k, nxt, nxt + meridians, k + meridians], axis=1) + row * meridians for row in range(parallels - 2)])
    centre = np.array([0, 0, RADIUS])
    return RigidBody("ball", MASS, 0.4 * MASS * RADIUS**2 * np.eye(3), centre, points + centre, {"skin": facets})


def rolled(meridians: int, slope: float, mu: float, time: float, h: float) -> State:
    plane = rigid_box("plane", (20.0, 2.0, 1.0), (0, 0, -0.5), 1.0)
    body = ball(meridians)
    model = build_model(
        [body, plane],
        supports=[Support("plane", ("x", "y", "z", "rx", "ry", "rz"))],
        gravity=lambda t: (G * np.sin(slope), 0, -G * np.cos(slope)),
    )
    pair = SurfacePair(contact_surface(model, [("ball", "skin")]), contact_surface(model, [("plane", "z+")]), mu, 2e-3)
    run = Simulation(model, Detector([pair], model.n_nodes), Theta(h), round(time / h), SolverSettings(name="auto", tol=1e-9))
    return [step.state for step in run][-1]


def test_ball_rolls_down_a_slope() -> None:
    """v = omega R and a = 5/7 g sin(slope) for a homogeneous ball that does not slip.

    A polygon of n corners loses the share 5/7 d^2, d = 2 pi / n, of its kinetic energy at each corner that comes down (a rimless
    wheel, inelastic), that is every R d: v' = a - 5/14 (d / R) v^2, so that after the distance s the speed a t is smaller by the share
    5/21 d s / R, to first order; a step finds a new corner h / 2 late, which is of first order too: both halve with d and h."""
    slope, time = 0.4, 0.3
    short = []
    for meridians, h in ((48, 1.25e-3), (96, 6.25e-4)):
        end = rolled(meridians, slope, 0.5, time, h)
        speed = 5 / 7 * G * np.sin(slope) * time
        d, s = 2 * np.pi / meridians, speed * time / 2
        expected = 5 / 21 * d * s / RADIUS
        short.append(1 - end.v[0] / speed)
        assert short[-1] == pytest.approx(expected, rel=0.25)
        assert end.v[4] * RADIUS == pytest.approx(end.v[0], rel=d)
        assert end.x[0] > RADIUS  # more than a radian
        assert_allclose(end.v[[1, 3, 5]], 0, atol=1e-6)
    # the limit d, h -> 0, up to the rise and fall over a corner: d^2 g R / 8 of 7/10 v^2, 1 % of the speed's square at n = 48
    assert abs(2 * short[1] - short[0]) < 8e-3


def test_ball_slips_where_friction_is_too_small() -> None:
    """It slips where mu < 2/7 tan(slope): then a = g (sin - mu cos) and the spin grows by 5/2 mu g cos / R.

    Each corner that comes down takes 5/4 d^2, d = 2 pi / n, of the spin w: w' = w'_0 - 5/4 d w^2, that is the share 5/6 d angle in all.
    """
    slope, time = 0.9, 0.3
    mu = 0.5 * 2 / 7 * np.tan(slope)
    end = rolled(60, slope, mu, time, 1e-3)
    spin = 2.5 * mu * G * np.cos(slope) / RADIUS * time
    share = 5 / 6 * 2 * np.pi / 60 * spin * time / 2
    assert end.v[0] == pytest.approx(G * (np.sin(slope) - mu * np.cos(slope)) * time, rel=5e-3)
    assert end.v[4] == pytest.approx(spin * (1 - share), rel=0.03)
