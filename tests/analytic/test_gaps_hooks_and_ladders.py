"""Gaps of exactly a box's width, pins with little play, hooks, wedges driven in and drawn out, ladders, gears; against statics and closed
forms, in several systems of units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fcsim import (
    Everything,
    ExactContacts,
    Gap,
    Material,
    QuasiStatic,
    Simulation,
    SolverSettings,
    State,
    Step,
    Support,
    Theta,
    Witness,
    at_rest,
    build_model,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.contact_detection.friction import Friction
from fcsim.mesh import Body, Part, RigidBody, rectangle, rigid_box, rigid_cylinder, rigid_sphere
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

Polygon = Sequence[tuple[float, float]] | np.ndarray


@dataclass(frozen=True)
class Units:
    """How many units of length, mass and time are a metre, a kilogram and a second."""

    L: float = 1.0
    M: float = 1.0
    T: float = 1.0

    @property
    def g(self) -> float:
        return 9.81 * self.L / self.T**2

    @property
    def density(self) -> float:
        """Of water."""
        return 1000.0 * self.M / self.L**3

    @property
    def pascal(self) -> float:
        return self.M / (self.L * self.T**2)


SI, MILLI = Units(), Units(1e3, 1.0, 1e3)  # m, kg, s; mm, kg, ms
SMALL = Units(1e-6, 1e-18, 1e-3)  # bodies of micrometres and 1e-15 kg, seen in SI
EITHER = pytest.mark.parametrize("unit", [SI, pytest.param(MILLI, marks=pytest.mark.slow), pytest.param(SMALL, marks=pytest.mark.slow)])


def plate(name: str, polygon: Polygon, unit: Units) -> RigidBody:
    return rigid_polygon(name, np.asarray(polygon, float) * unit.L, density=unit.density, thickness=unit.L)


def prism(name: str, polygon: Polygon, half: float, unit: Units) -> RigidBody:
    """A polygon in x, z from -half to half along y."""
    p = np.asarray(polygon, float) * unit.L
    n = len(p)
    points = np.concatenate([np.insert(p, 1, y * unit.L, axis=1) for y in (-half, half)])
    faces = [list(range(n)), list(range(n, 2 * n)), *([i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n))]
    return rigid_solid(closed_surface(name, points, faces), density=unit.density)


def placed(body: RigidBody, R: np.ndarray, to: np.ndarray) -> RigidBody:
    return RigidBody(body.name, body.mass, R @ body.inertia @ R.T, R @ body.centre + to, body.points @ R.T + to, body.surfaces)


def model_of(
    bodies: Sequence[Body | RigidBody], held: Sequence[str], gravity: np.ndarray, more: Sequence[Support] = (), beta: float = 0.0
) -> Model:
    supports = [*(Support(name, DIRECTIONS[len(gravity)]) for name in held), *more]
    return build_model(list(bodies), supports=supports, gravity=lambda t: gravity, beta=beta)


def run(model: Model, mu: Friction, h: float, steps: int, exact: bool = False) -> list[Step]:
    """All steps; no overlap above 1e-3 of a body, and no energy from nothing, at any."""
    detection = ExactContacts(model, mu) if exact else Everything(model, mu)
    done = list(Simulation(model, detection, Theta(h), steps, SolverSettings(tol=1e-8), witness=Witness(every=1, tolerance=1e-3)))
    assert max(step.ledger.created for step in done) <= 1e-4 * done[-1].ledger.supplied + 1e-9 * model_scale(model)
    return done


def model_scale(model: Model) -> float:
    """The energy [J] of raising the free bodies by a thousandth of the model."""
    g = 0.0 if model.gravity is None else float(np.linalg.norm(model.gravity(0.0)))
    mass = sum(body.mass for body in model.bodies if isinstance(body, RigidBody))
    return 1e-3 * mass * g * float(np.ptp(model.reference, axis=0).max())


def down(unit: Units, d: int = 2) -> np.ndarray:
    return np.append(np.zeros(d - 1), -unit.g)


def force_on(step: Step, name: str) -> np.ndarray:
    return step.contact_force_on(step.model.number[name])


def of_rigid(step: Step, name: str, values: np.ndarray) -> np.ndarray:
    return step.model.rigid_part(values)[step.model.number[name] - len(step.model.deformable)]


@EITHER
@pytest.mark.parametrize(("wider", "mu"), [(0.0, 0.0), (0.0, 0.4), (1e-3, 0.0), (-1e-3, 0.4)])
def test_a_box_falls_through_a_gap_of_its_width(unit: Units, wider: float, mu: float) -> None:
    """Freely where the gap is as wide as the box or wider; where it is narrower by a thousandth, it lies on both edges."""
    w = 0.1 * (1 + wider)
    left, right = plate("left", [(-1, -1), (-w, -1), (-w, 0), (-1, 0)], unit), plate("right", [(w, -1), (1, -1), (1, 0), (w, 0)], unit)
    box = plate("box", [(-0.1, 0.001), (0.1, 0.001), (0.1, 0.2), (-0.1, 0.2)], unit)
    last = run(model_of([left, right, box], ["left", "right"], down(unit)), mu, 2e-3 * unit.T, 40)[-1]
    fallen = 0.5 * 9.81 * 0.08**2 if wider >= 0 else 0.001
    assert_allclose(of_rigid(last, "box", last.state.x) / [unit.L, unit.L, 1], [0, -fallen, 0], atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [SI, MILLI, SMALL])
def test_a_box_drops_askew_into_a_gap(unit: Units) -> None:
    """It turns about the edges that it meets and jams; a share of a size a second is another one where time has another unit."""
    c, s = np.cos(0.1), np.sin(0.1)
    left = plate("left", [(-1, -1), (-0.105, -1), (-0.105, 0), (-1, 0)], unit)
    right = plate("right", [(0.105, -1), (1, -1), (1, 0), (0.105, 0)], unit)
    corners = np.array([(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)]) @ [[c, s], [-s, c]] + [0, 0.15]
    box = plate("box", corners, unit)
    model = model_of([left, right, box], ["left", "right"], down(unit))
    scheme, witness = Theta(1e-3 * unit.T, law=Gap(recovery=0.1 / unit.T)), Witness(every=1, tolerance=1e-4)
    *_, last = Simulation(model, Everything(model, 0.1), scheme, 1000, SolverSettings(tol=1e-8), witness=witness)
    assert last.ledger.created <= 1e-6 * last.ledger.supplied
    assert np.abs(of_rigid(last, "box", last.state.v)).max() < 1e-6
    assert_allclose(force_on(last, "box") / (box.mass * unit.g), [0, 1], atol=1e-6)


def test_a_plate_hangs_on_a_pin_with_a_thousandth_of_play() -> None:
    n, R, play = 32, 0.05, 5e-5
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    hole = (R + play) * np.column_stack([np.cos(angle - np.pi / 2), np.sin(angle - np.pi / 2)])
    slit = hole[0, 0]  # narrow, at the bottom, so that the plate is one polygon
    outer = [(slit, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (-slit, -0.2)]
    body = plate("plate", [*outer, *map(tuple, hole[::-1])], SI)
    pin = plate("pin", R * np.column_stack([np.cos(angle), np.sin(angle)]), SI)
    last = run(model_of([body, pin], ["pin"], down(SI)), 0.3, 2e-3, 30)[-1]
    assert_allclose(force_on(last, "plate") / (body.mass * SI.g), [0, 1], atol=1e-6)
    assert of_rigid(last, "plate", last.state.x)[1] == pytest.approx(-play * np.cos(np.pi / n), rel=1e-3)


HOOK = [(-0.1, -0.1), (0.1, -0.1), (0.1, -0.02), (0.06, -0.02), (0.06, -0.06), (-0.06, -0.06), (-0.06, 0.06), (0.06, 0.06),
        (0.06, 0.02), (0.1, 0.02), (0.1, 0.1), (-0.1, 0.1)]  # fmt: skip
"""A link of a chain, open at one side."""


@pytest.mark.slow
@pytest.mark.parametrize("unit", [SI, MILLI, SMALL])
def test_an_open_link_is_drawn_up_by_another(unit: Units) -> None:
    """Hung into it askew, it comes to hang straight and is carried along; what draws it bears its weight."""
    upper, lower = prism("upper", HOOK, 0.015, unit), prism("lower", HOOK, 0.015, unit)
    lower = placed(lower, Rotation.from_euler("z", 80, degrees=True).as_matrix(), np.array([0.01, 0.005, -0.1]) * unit.L)
    speed = 0.2 * unit.L / unit.T
    drawn = [Support("upper", ("x", "y", "rx", "ry", "rz")), Support("upper", ("z",), velocity=speed)]
    last = run(model_of([upper, lower], [], down(unit, 3), drawn), 0.3, 1e-3 * unit.T, 600)[-1]
    assert_allclose(force_on(last, "lower") / (lower.mass * unit.g), [0, 0, 1], atol=1e-5)
    assert_allclose(of_rigid(last, "lower", last.state.v)[:3] / speed, [0, 0, 1], atol=1e-5)


@EITHER
def test_a_wedge_is_driven_between_two_blocks(unit: Units) -> None:
    """Between blocks on the floor: N (cos a - mu sin a) = mu_f (W + N (sin a + mu cos a)), and the wedge takes 2 N (sin a + mu cos a)."""
    mu, floor_mu, a = 0.2, 0.5, np.radians(10)
    t = np.tan(a)

    def half(y: float) -> float:
        return float(0.05 + t * y)

    wedge = plate("wedge", [(-half(0), 0), (half(0), 0), (half(0.3), 0.3), (-half(0.3), 0.3)], unit)
    left = plate("left", [(-0.8, -0.2), (-half(-0.2), -0.2), (-half(0.5), 0.5), (-0.8, 0.5)], unit)
    right = plate("right", [(0.8, -0.2), (0.8, 0.5), (half(0.5), 0.5), (half(-0.2), -0.2)], unit)
    floor = plate("floor", [(-3, -0.5), (3, -0.5), (3, -0.2), (-3, -0.2)], unit)
    speed = 0.1 * unit.L / unit.T
    driven = [Support("wedge", ("x", "rz")), Support("wedge", ("y",), velocity=-speed)]
    model = model_of([wedge, left, right, floor], ["floor"], down(unit), driven)
    last = run(model, {("wedge", "left"): mu, ("wedge", "right"): mu, ("*", "*"): floor_mu}, 1e-3 * unit.T, 30)[-1]
    into, along = np.cos(a) - mu * np.sin(a), np.sin(a) + mu * np.cos(a)
    N = floor_mu * left.mass * unit.g / (into - floor_mu * along)
    assert_allclose(force_on(last, "wedge"), [0, 2 * N * along], atol=1e-5 * N)
    assert_allclose(of_rigid(last, "left", last.state.v)[0] / speed, -t, rtol=1e-6)


def test_a_wedge_between_elastic_jaws_is_held_by_friction() -> None:
    """Driven in, every point slides: F = 2 N (sin a + mu cos a). Let go it stays, and to draw it out takes a pull, since mu > tan a: less
    than 2 N (mu cos a - sin a) of the N that is left while points still stick."""
    mu, a, n, k = 0.3, np.radians(10), 6, 8
    bodies: list[Body | RigidBody] = []
    for name, side in (("left", -1), ("right", 1)):
        y = np.linspace(-0.1, 0.2, k + 1)
        x = np.linspace(0.05 + np.tan(a) * y, np.full(k + 1, 0.6), n + 1, axis=1)[:, ::side] * side
        points = np.stack([x, np.broadcast_to(y[:, None], x.shape)], axis=2).reshape(-1, 2)
        corner = (np.arange(k)[:, None] * (n + 1) + np.arange(n)).ravel()
        cells = corner[:, None] + [0, 1, n + 2, n + 1]
        back = np.arange(k) * (n + 1) + (n if side > 0 else 0)
        surfaces = {"back": np.stack([back, back + n + 1], axis=1)[:, ::side]}
        bodies.append(Body(name, Part(name, points, cells, "quadrilateral", surfaces, Material(1e7, 0.0, 1000.0))))
    top = 0.05 + 0.3 * np.tan(a)
    bodies.append(plate("wedge", [(-0.05, 0), (0.05, 0), (top, 0.3), (-top, 0.3)], SI))
    supports = [Support(name, ("x", "y"), "back") for name in ("left", "right")]
    supports += [Support("wedge", ("x", "rz")), Support("wedge", ("y",), velocity=lambda s: -0.02 if s < 0.5 else 0.02)]
    model = build_model(bodies, supports=supports)
    steps = list(Simulation(model, Everything(model, mu), QuasiStatic(0.05), 19, SolverSettings(tol=1e-8, floor=1e-9)))
    force = np.array([force_on(step, "wedge")[1] for step in steps])
    N = np.array([step.contact_force[:, 0].sum() for step in steps])
    assert_allclose(force[:10], N[:10] * (np.sin(a) + mu * np.cos(a)), rtol=1e-6)
    assert np.all(np.diff(force[:10]) > 0) and np.all(np.diff(force[9:14]) < 0)
    drawn = N * (np.sin(a) - mu * np.cos(a))
    assert np.all(force[14:] < 0) and np.all(force[14:] >= (1 + 1e-6) * drawn[14:])
    assert force[14] == pytest.approx(drawn[14], rel=0.05)


@EITHER
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_a_ladder_at_a_smooth_wall(unit: Units, turned: bool, factor: float) -> None:
    """It slips where the floor's mu is less than the wall's force over the weight, about its foot; also with the whole scene turned."""
    angle, length, thick = 1.1, 2.0, 0.05
    rotate = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    p = np.array([(0, 0), (length, 0), (length, thick), (0, thick)]) @ rotate
    p -= [p[:, 0].max(), p[:, 1].min()]
    foot, head, centre = p[p[:, 1].argmin()], p[p[:, 0].argmax()], p.mean(axis=0)
    need = (centre[0] - foot[0]) / (head[1] - foot[1])
    floor, wall = [(-4, -0.5), (1, -0.5), (1, 0), (-4, 0)], [(0, 0.001), (0.5, 0.001), (0.5, 4), (0, 4)]
    Q = Rotation.from_euler("xyz", [0.3, -0.4, 0.5]).as_matrix() if turned else np.eye(2)
    if turned:
        shapes = {"ladder": (p, 0.2), "floor": (floor, 1.0), "wall": (wall, 1.0)}
        bodies = [placed(prism(name, shape, half, unit), Q, np.zeros(3)) for name, (shape, half) in shapes.items()]
    else:
        bodies = [plate("ladder", p, unit), plate("floor", floor, unit), plate("wall", wall, unit)]
    model = model_of(bodies, ["floor", "wall"], Q @ down(unit, 3 if turned else 2))
    last = run(model, {("ladder", "floor"): factor * need, ("*", "*"): 0.0}, 2e-3 * unit.T, 40)[-1]
    moved = float(np.abs(of_rigid(last, "ladder", last.state.x)[: len(Q)]).max()) / unit.L
    assert moved > 5e-5 if factor < 1 else moved < 1e-8
    if factor > 1:
        assert (Q.T @ force_on(last, "wall"))[0] == pytest.approx(need * bodies[0].mass * unit.g, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [SI, MILLI, SMALL])
@pytest.mark.parametrize("factor", [0.99, 1.01])
@pytest.mark.parametrize(("shape", "k"), [("cube", 0.0), ("sphere", 0.4), ("cylinder", 0.5)])
def test_what_slides_or_rolls_down_a_plane_in_a_turned_frame(shape: str, k: float, factor: float, unit: Units) -> None:
    """I = k m R^2 rolls up to tan(a) = mu (1 + 1/k) with g sin(a) / (1 + k), and slides beyond with g (sin a - mu cos a)."""
    mu, t = 0.4, 0.1
    a = np.arctan(factor * mu * (1 + 1 / k if k else 1))
    Q = Rotation.from_euler("xyz", [0.7, 0.2, -0.4]).as_matrix()
    centre = Q @ [0, 0, 0.1 * unit.L]
    floor = placed(rigid_box("floor", np.array([4, 4, 0.2]) * unit.L, (0, 0, 0), unit.M), Q, -centre)
    if shape == "cube":
        body = placed(rigid_box("body", np.full(3, 0.2 * unit.L), (0, 0, 0), unit.M), Q, centre)
    elif shape == "sphere":
        body = rigid_sphere("body", 0.1 * unit.L, centre, unit.M)
    else:
        body = rigid_cylinder("body", 0.1 * unit.L, 0.3 * unit.L, centre, unit.M, axis=Q @ [0, 1.0, 0])
    model = model_of([floor, body], ["floor"], Q @ [np.sin(a), 0, -np.cos(a)] * unit.g)
    last = run(model, mu, 1e-3 * unit.T, 100, exact=bool(k))[-1]
    rolling, sliding = np.sin(a) / (1 + k) if k else 0.0, np.sin(a) - mu * np.cos(a)
    v = Q.T @ of_rigid(last, "body", last.state.v)[:3] / (9.81 * t * unit.L / unit.T)
    assert_allclose(v, [max(rolling, sliding, 0.0), 0, 0], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "k"), [(0.0, 1.0), (0.8, 1.5)])
def test_a_marble_swings_in_a_bowl(mu: float, k: float) -> None:
    """T = 2 pi sqrt(k (R - r) / g) (1 + angle^2 / 16), k = 1 without friction and 3/2 for a disk that rolls."""
    R, r, angle, h = 0.5, 0.05, 0.1, 2e-3
    a = np.linspace(-0.9 * np.pi, -0.1 * np.pi, 241)
    bowl = plate("bowl", [*map(tuple, R * np.column_stack([np.cos(a), np.sin(a)])), (1, -0.1), (1, -1), (-1, -1), (-1, -0.1)], SI)
    begin = (R * np.cos(0.4 * np.pi / 240) - r) * np.array([np.sin(angle), -np.cos(angle)])  # it touches the facets
    model = model_of([bowl, rigid_sphere("disk", r, begin, 1.0)], ["bowl"], down(SI))
    half = np.pi * np.sqrt(k * (R - r) / SI.g) * (1 + angle**2 / 16)
    steps = run(model, mu, h, int(1.7 * half / h), exact=True)
    x = begin[0] + np.array([of_rigid(step, "disk", step.state.x)[0] for step in steps])
    falls, rises = np.flatnonzero((x[:-1] > 0) & (x[1:] <= 0))[0], np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))[0]
    assert (rises - falls) * h == pytest.approx(half, abs=0.01 * half)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [SI, MILLI])
def test_gears_turn_each_other_in_the_ratio_of_their_teeth(unit: Units) -> None:
    """12 teeth drive 20 without load: what the follower turns by follows within its play, a quarter of a tooth."""

    def gear(name: str, teeth: int, centre: float, phase: float) -> RigidBody:
        profile = [(-0.25, -1.25), (-0.17, 0.0), (-0.1, 1.0), (0.1, 1.0), (0.17, 0.0), (0.25, -1.25)]
        angle = np.array([phase + 2 * np.pi * (i + share) / teeth for i in range(teeth) for share, _ in profile])
        radius = np.array([0.02 * (teeth / 2 + high) for _ in range(teeth) for _, high in profile])
        return plate(name, np.column_stack([centre + radius * np.cos(angle), radius * np.sin(angle)]), unit)

    driver, follower = gear("driver", 12, 0.0, 0.0), gear("follower", 20, 0.32, np.pi + np.pi / 20)
    turned = [Support("driver", ("x", "y")), Support("driver", ("rz",), velocity=2 / unit.T), Support("follower", ("x", "y"))]
    last = run(model_of([driver, follower], [], np.zeros(2), turned), 0.05, 2e-3 * unit.T, 500)[-1]
    angle = of_rigid(last, "follower", last.state.x)[2]
    assert angle == pytest.approx(-2 * 1.0 * 12 / 20, abs=0.25 * 2 * np.pi / 20)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [SI, MILLI])
def test_a_sheet_hangs_over_an_edge(unit: Units) -> None:
    """A strip with the overhang L on a rigid table lifts off behind the edge over b = sqrt(2) L, where it is held by w b / 4: so much slope
    at the edge that its end sinks by slope L + w L^4 / 8 E I."""
    E, L, t, rho = 1e9, 0.3, 0.005, 2000.0
    sheet = rectangle("sheet", np.array([1.0, t]) * unit.L, (100, 2), Material(E * unit.pascal, 0.0, 2 * unit.density),
                      elements="Q1-enhanced", thickness=unit.L)  # fmt: skip
    body = Body("sheet", sheet, translation=np.array([L - 1, 0]) * unit.L)
    table = plate("table", [(-1, -0.5), (0, -0.5), (0, 0), (-1, 0)], unit)
    last = run(model_of([body, table], ["table"], down(unit), beta=0.02 * unit.T), 0.5, 5e-3 * unit.T, 200)[-1]
    w, EI = rho * t * 9.81, E * t**3 / 12
    # from where it lifts off: y = R s^3 / 6 E I - w s^4 / 24 E I is 0 at the edge, s = b, and its moment there that of the overhang
    b = brentq(lambda s: w * s / 4 * s - w * s**2 / 2 + w * L**2 / 2, 0.1 * L, 3 * L)
    slope = (w * b / 4 * b**2 / 2 - w * b**3 / 6) / EI
    moved = last.model.positions(last.state.x) - last.model.reference
    end = np.isclose(last.model.reference[:, 0], L * unit.L)
    assert moved[end, 1].mean() / unit.L == pytest.approx(slope * L - w * L**4 / (8 * EI), rel=0.02)
    assert_allclose(force_on(last, "sheet") / (rho * t * unit.density / 1000 * unit.L**3 * unit.g), [0, 1], atol=1e-3)


@pytest.mark.slow
def test_a_spiral_of_dominoes_falls() -> None:
    """Each lies in the end on the next: turned by more than 60 degrees, the last one on the floor, by 90."""
    bodies, angle = [rigid_box("floor", (2, 2, 0.2), (0, 0, -0.1), 1.0)], 0.0
    for k in range(12):
        radius = 0.12 + 0.012 * angle
        at = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.03])
        domino = rigid_box(f"domino {k}", (0.01, 0.03, 0.06), (0, 0, 0), 0.01)
        bodies.append(placed(domino, Rotation.from_euler("z", angle + np.pi / 2).as_matrix(), at))
        angle += 0.03 / radius
    model = model_of(bodies, ["floor"], down(SI, 3))
    start = at_rest(model)
    v = start.v.copy()
    first = model.dof_offset[1]
    v[first : first + 6] = [0, 0.24, 0, -8.0, 0, 0]
    settings, witness = SolverSettings(tol=1e-8), Witness(every=1, tolerance=1e-3)
    *_, last = Simulation(model, Everything(model, 0.4), Theta(2e-3), 300, settings, State(0.0, start.x, v), witness=witness)
    turned = np.linalg.norm(model.rigid_part(last.state.x)[1:, 3:], axis=1)
    assert np.all(turned > np.radians(60))
    assert turned[-1] == pytest.approx(np.pi / 2, abs=0.03)
