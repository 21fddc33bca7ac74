"""Dominoes, a wheel at a step, puzzles, wedges, stiff on soft, with contact of everything and no options; against closed forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import (
    Everything,
    ExactContacts,
    Material,
    QuasiStatic,
    Simulation,
    SolverSettings,
    State,
    Step,
    Support,
    Theta,
    Traction,
    at_rest,
    build_model,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.mesh import Body, RigidBody, rectangle, rigid_box, rigid_rectangle, rigid_sphere
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid

SI, TONNE_MM = (1.0, 1.0), (1e3, 1e-3)
"""Metre and kilogram; millimetre and tonne: (units of length in a metre, units of mass in a kilogram)."""


def prism(name: str, polygon: Sequence[tuple[float, float]], half: float, density: float) -> RigidBody:
    """A polygon in x, z, convex or not, from -half to half along y."""
    p, n = np.asarray(polygon, float), len(polygon)
    points = np.concatenate([np.insert(p, 1, y, axis=1) for y in (-half, half)])
    faces = [list(range(n)), list(range(n, 2 * n)), *([i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n))]
    return rigid_solid(closed_surface(name, points, faces), density=density)


def model_of(bodies: Sequence[Body | RigidBody], held: Sequence[str], gravity: Sequence[float]) -> Model:
    pull = np.array(gravity, float)
    return build_model(list(bodies), supports=[Support(name, DIRECTIONS[len(pull)]) for name in held], gravity=lambda t: pull)


def run(model: Model, mu: object, h: float, steps: int, velocities: dict[str, Sequence[float]] | None = None) -> list[Step]:
    """All steps with the options that stand when none are given; contacts create no energy but what friction returns at impacts."""
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in (velocities or {}).items():
        first = model.dof_offset[model.number[name]]
        v[first : first + len(velocity)] = velocity
    done = list(Simulation(model, Everything(model, mu), Theta(h), steps, initial=State(0.0, start.x, v)))  # type: ignore[arg-type]
    for step in done:
        known = 5e-9  # J: impulses of 0.1 to 0.4 N s at velocities known to 1e-8 m/s
        assert step.ledger.created <= 1e-3 * step.ledger.supplied + known, step.number
    return done


def force_on(step: Step, name: str) -> np.ndarray:
    return step.contact_force_on(step.model.number[name])


@pytest.mark.slow
@pytest.mark.parametrize(("length", "mass", "g"), [(*SI, 9.81), (*TONNE_MM, 1.62)])
def test_a_row_of_dominoes_falls_when_the_first_is_hit(length: float, mass: float, g: float) -> None:
    """All eight fall, one after the other, on Earth and on the Moon."""
    high, thick, pitch, n = 0.05 * length, 0.01 * length, 0.025 * length, 8
    rho = 600.0 * mass / length**3
    dominoes = [rigid_rectangle(f"domino {k}", (thick, high), (k * pitch, high / 2), rho * thick * high * length) for k in range(n)]
    floor = rigid_rectangle("floor", (3 * n * pitch, high), (0.5 * n * pitch, -high / 2), 1.0)
    model = model_of([*dominoes, floor], ["floor"], (0.0, -g * length))
    h = 2e-3 * np.sqrt(9.81 / g)
    speed = 8.0 * np.sqrt(g / 9.81)
    steps = run(model, 0.4, h, 330, {"domino 0": (0.1 * length * np.sqrt(g / 9.81), 0.0, -speed)})
    turned = np.array([np.abs(model.rigid_part(step.state.x)[:n, 2]) for step in steps])
    assert np.all(turned[-1] > 0.6)
    begun = (turned > 0.05).argmax(axis=0)
    assert np.all(np.diff(begun) > 0)
    assert max(step.penetration for step in steps) < 1e-4 * thick


@pytest.mark.parametrize("factor", [0.99, 1.01])
@pytest.mark.parametrize("corners", [16, 24])
def test_a_wheel_is_pulled_over_a_step(corners: int, factor: float) -> None:
    """A wheel's corner lies at the step's edge: it lifts off the floor where F (R - h) > W sqrt(R^2 - (R - h)^2) of that corner."""
    R, low = 0.5, np.pi / corners
    angle = 2 * np.pi * (np.arange(corners) + 0.5) / corners - np.pi / 2
    polygon = np.column_stack([R * np.cos(angle), R * np.sin(angle) + R * np.cos(low)])
    corner = polygon[corners // 8]  # of those on the right
    wheel = prism("wheel", [tuple(p) for p in polygon], 0.1, 500.0)
    x, z = corner
    step = rigid_box("step", (1.0, 1.0, z), (x + 0.5, 0, z / 2), 1.0)
    floor = rigid_box("floor", (6, 2, 0.2), (0, 0, -0.1), 1.0)
    lever, arm = R * np.cos(low) - z, x
    g = 9.81
    pull = factor * g * arm / lever
    model = model_of([wheel, step, floor], ["step", "floor"], (pull, 0, -g))
    last = run(model, 0.9, 1e-3, 40)[-1]
    turned = abs(model.rigid_part(last.state.x)[0, 4])
    if factor > 1:  # about the edge: I_edge d(omega)/dt = F lever - W arm, as long as the angle is small
        I_edge = wheel.inertia[1, 1] + wheel.mass * (arm**2 + lever**2)
        assert turned == pytest.approx(0.5 * wheel.mass * (pull * lever - g * arm) / I_edge * 0.04**2, rel=0.06)
    else:
        assert turned < 1e-7
        carried = force_on(last, "step") + force_on(last, "floor")
        assert_allclose(carried, wheel.mass * np.array([pull, 0, -g]), atol=1e-6 * wheel.mass * g)


@pytest.mark.parametrize(("length", "mass"), [SI, TONNE_MM])
@pytest.mark.parametrize(("left", "right"), [(30.0, 30.0), (20.0, 50.0), (70.0, 10.0)])
def test_a_wedge_between_flanks_of_unlike_slopes(length: float, mass: float, left: float, right: float) -> None:
    """Without friction N_left / N_right = sin(right) / sin(left), both angles from the horizontal: the flanks' forces balance sideways."""
    a, b, rho = np.tan(np.deg2rad(left)), np.tan(np.deg2rad(right)), 2000.0 * mass / length**3
    width = 0.4 * length
    top = width / (1 / a + 1 / b)
    wedge = prism("wedge", [(0, 0), (top / b, top), (-top / a, top)], 0.1 * length, rho)
    flank_l = prism("left flank", [(0, 0), (-2 * top / a, 2 * top), (-2 * top / a - length, -length), (0, -length)], 0.3 * length, rho)
    flank_r = prism("right flank", [(0, 0), (0, -length), (2 * top / b + length, -length), (2 * top / b, 2 * top)], 0.3 * length, rho)
    model = model_of([wedge, flank_l, flank_r], ["left flank", "right flank"], (0, 0, -1.62 * length))
    last = run(model, 0.0, 1e-3, 10)[-1]
    weight = wedge.mass * 1.62 * length
    on_left, on_right = force_on(last, "left flank") / weight, force_on(last, "right flank") / weight
    alpha, beta = np.deg2rad([left, right])
    N_left = np.sin(beta) / np.sin(alpha + beta)
    N_right = np.sin(alpha) / np.sin(alpha + beta)
    assert_allclose(on_left, [-N_left * np.sin(alpha), 0, -N_left * np.cos(alpha)], atol=1e-6)
    assert_allclose(on_right, [N_right * np.sin(beta), 0, -N_right * np.cos(beta)], atol=1e-6)


@pytest.mark.parametrize("mus", [(0.2, 0.5), (0.5, 0.2)])
def test_a_slab_between_two_plates_slides_where_friction_is_less(mus: tuple[float, float]) -> None:
    """The upper plate is thrown: what slides brakes by mu times what lies on it, and the other joint does not move at all or together."""
    upper_mu, lower_mu = mus
    floor = rigid_box("floor", (6, 2, 0.2), (0, 0, -0.1), 1.0)
    slab, plate = rigid_box("slab", (1, 0.5, 0.1), (0, 0, 0.05), 30.0), rigid_box("plate", (1, 0.5, 0.1), (0, 0, 0.15), 10.0)
    model = model_of([floor, slab, plate], ["floor"], (0, 0, -9.81))
    mu = {("plate", "slab"): upper_mu, ("slab", "floor"): lower_mu, ("*", "*"): 0.0}
    last = run(model, mu, 1e-3, 50, {"plate": (1.0, 0, 0, 0, 0, 0)})[-1]
    t, v = 0.05, model.rigid_part(last.state.v)[:, 0]
    of_plate = upper_mu * 10.0 * 9.81  # N, on the slab along x; the floor holds up to lower_mu 40 g, more than that in both cases
    assert of_plate <= lower_mu * 40.0 * 9.81
    assert v[2] == pytest.approx(1.0 - of_plate / 10.0 * t, rel=1e-6)
    assert abs(v[1]) < 1e-7
    assert -force_on(last, "floor")[0] == pytest.approx(-of_plate, rel=1e-6)


KNOB = [(0.0, 0.0), (0.0, -0.1), (-0.05, -0.15), (-0.05, -0.2), (0.15, -0.2), (0.15, -0.15), (0.1, -0.1), (0.1, 0.0)]
"""A neck that widens downwards, of a piece whose body is above."""


@pytest.mark.parametrize("slack", [0.0, 1e-3])
def test_a_piece_of_a_puzzle_hangs_in_its_neighbour(slack: float) -> None:
    """A knob in a socket of its shape, wider by `slack`: the lower piece hangs, first by that much, and its weight is on the knob."""
    upper = prism("upper", [(-0.3, 0.2), (-0.3, 0.0), *KNOB, (0.4, 0.0), (0.4, 0.2)], 0.1, 1000.0)
    socket = [(x + np.sign(x - 0.05) * slack, z - slack * (z < -0.16)) for x, z in KNOB]
    lower = prism("lower", [(-0.3, -0.4), (0.4, -0.4), (0.4, 0.0), *reversed(socket), (-0.3, 0.0)], 0.1, 1000.0)
    model = model_of([upper, lower], ["upper"], (0, 0, -9.81))
    last = run(model, 0.3, 1e-3, 60)[-1]
    fallen = -model.rigid_part(last.state.x)[1, 2]
    assert fallen <= 2 * slack + 1e-7
    if not slack:
        assert force_on(last, "upper")[2] == pytest.approx(-lower.mass * 9.81, rel=1e-6)


@pytest.mark.parametrize(("length", "mass"), [SI, TONNE_MM])
def test_a_block_slides_without_friction_down_to_a_stop(length: float, mass: float) -> None:
    """On a slope of 25 degrees the stop bears W sin, the slope W cos; gravity is turned instead of the slope."""
    floor = rigid_rectangle("floor", (6 * length, length), (0, -0.5 * length), 1.0)
    stop = rigid_rectangle("stop", (0.2 * length, length), (1.1 * length, 0.5 * length), 1.0)
    block = rigid_rectangle("block", (0.4 * length, 0.3 * length), (0.7 * length, 0.15 * length), 120.0 * mass)
    s, c = np.sin(np.deg2rad(25)), np.cos(np.deg2rad(25))
    model = model_of([floor, stop, block], ["floor", "stop"], (9.81 * s * length, -9.81 * c * length))
    last = run(model, 0.0, 5e-3, 120)[-1]
    weight = 120.0 * mass * 9.81 * length
    assert_allclose(force_on(last, "stop") / weight, [s, 0], atol=1e-6)
    assert_allclose(force_on(last, "floor") / weight, [0, -c], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", ["upper", "lower"])
def test_stiff_and_soft_blocks_press_each_other(stiffer: str) -> None:
    """E of 1e5 to 1, nu = 0: the upper one's top sinks by the sum of both columns' W h / (E A) and own weights' half of that."""
    soft, hard = Material(1e6, 0.0, 1000.0), Material(1e11, 0.0, 1000.0)
    E = {"upper": 1e11, "lower": 1e6} if stiffer == "upper" else {"upper": 1e6, "lower": 1e11}
    floor = rigid_rectangle("floor", (4, 1), (0.5, -0.5), 1.0)
    lower = Body("lower", rectangle("l", (1.0, 1.0), (4, 4), hard if stiffer == "lower" else soft))
    upper = Body("upper", rectangle("u", (1.0, 1.0), (3, 3), hard if stiffer == "upper" else soft), translation=np.array([0.0, 1.0]))
    gravity = 9.81
    model = build_model(
        [floor, lower, upper], supports=[Support("floor", DIRECTIONS[2])], gravity=lambda t: np.array([0, -gravity]), beta=0.02
    )
    last = run(model, 0.5, 5e-3, 400)[-1]
    weight = 1000.0 * gravity  # of each, per metre of depth
    assert force_on(last, "floor")[1] == pytest.approx(-2 * weight, rel=1e-3)
    own = weight / (2 * E["upper"]) + 1.5 * weight / E["lower"]
    x = model.positions(last.state.x)[model.node_offset[2] : model.node_offset[3]]
    top = x[np.isclose(model.reference[model.node_offset[2] : model.node_offset[3], 1], 2.0), 1]
    assert top == pytest.approx(2.0 - own, abs=0.01 * own)


@pytest.mark.parametrize(("reach", "stands"), [(0.99, True), (1.01, False)])
def test_a_plank_over_an_edge_is_held_by_a_weight(reach: float, stands: bool) -> None:
    """A plank of mass m and length L reaches out by a; a block of mass M at its rear end: it tips where m (a - L/2) > M (L - a - w/2)."""
    L, w, m, M = 2.0, 0.2, 10.0, 15.0
    a = reach * (m * L / 2 + M * (L - w / 2)) / (m + M)
    table = rigid_box("table", (4, 1, 1), (-2, 0, -0.5), 1.0)
    plank = rigid_box("plank", (L, 0.2, 0.05), (a - L / 2, 0, 0.025), m)
    block = rigid_box("block", (w, w, w), (a - L + w / 2, 0, 0.05 + w / 2), M)
    model = model_of([table, plank, block], ["table"], (0, 0, -9.81))
    last = run(model, 0.5, 2e-3, 100)[-1]
    turned = abs(model.rigid_part(last.state.x)[1, 4])
    assert (turned < 1e-7) == stands and (turned > 1e-4) == (not stands)


@pytest.mark.parametrize("m", [1.0, pytest.param(1e3, marks=pytest.mark.slow), 1e6])
def test_a_belt_around_a_drum_in_any_unit_of_length(m: float) -> None:
    """Euler and Eytelwein, T2 = T1 exp(mu pi), of an elastic strip drawn over half a held drum by 1.2 mm; m units of length in a metre.

    Beyond one unit of radius the alert distance was 0.05 units: in micrometres the strip lost its drum in the third step.
    """
    mu, R, thick, tail, T1 = 0.3, 0.1, 1e-3, 0.05, 10.0
    arc = np.pi * R
    steel, size = Material(1e9 / m, 0.0, 1e3 / m**3), ((arc + 2 * tail) * m, thick * m)
    part = rectangle("strip", size, (140, 1), steel, plane="stress", thickness=0.01 * m, elements="Q2")
    s, r = part.points[:, 0] / m - tail, part.points[:, 1] / m + R
    angle = np.pi - np.clip(s, 0, arc) / R
    straight = np.minimum(s, 0.0) - np.maximum(s - arc, 0.0)
    part = replace(part, points=m * np.stack([r * np.cos(angle), r * np.sin(angle) + straight], axis=1))
    drawn = Support("strip", ("y",), "x+", displacement=lambda t: -4e-3 * m * t)
    model = build_model(
        [rigid_sphere("drum", R * m, (0.0, 0.0), 1.0), Body("strip", part)],
        supports=[Support("drum", ("x", "y", "rz")), drawn],
        loads=[Traction("strip", "x-", (0.0, -T1 / (thick * 0.01 * m)))],
    )
    *_, last = Simulation(model, ExactContacts(model, mu), QuasiStatic(0.1, eta=1e-2), 3, SolverSettings(floor=1e-3 * m))
    assert -last.support_force(drawn)[1] / m == pytest.approx(T1 * np.exp(mu * np.pi), rel=0.025)
