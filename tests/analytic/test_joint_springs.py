"""Springs and dashpots of contacts against closed forms: what a dashpot brakes, and forces that turn with the bodies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fcsim import (
    Cohesive,
    Compliant,
    Detector,
    DrivenRotation,
    Everything,
    ExactContacts,
    Force,
    GeneralisedAlpha,
    QuasiStatic,
    Simulation,
    SolverSettings,
    Springs,
    Support,
    SurfacePair,
    Theta,
    at_rest,
    build_model,
    contact_surface,
)
from fcsim.contact_law.proportions import proportions
from fcsim.mesh import rigid_box, rigid_plane, rigid_rectangle, rigid_sphere
from fcsim.timestep.step import Step

HELD = ("x", "y", "z", "rx", "ry", "rz")
TABLE = rigid_box("table", size=(1.0, 1.0, 0.1), centre=(0.0, 0.0, -0.05), mass=1.0)


def force_on(step: Step, name: str) -> Any:
    return step.contact_force_on(step.model.number[name])


def of_body(step: Step, name: str, values: Any) -> Any:
    first = step.model.dof_offset[step.model.number[name]]
    return values[first : first + 6]


@pytest.mark.parametrize(
    ("scheme", "c", "gap"), [(Theta(1e-4), 60.0, 4e-3), (Theta(1e-4), 300.0, 4e-3), (GeneralisedAlpha(1e-4, 0.9), 300.0, 5e-4)]
)
def test_a_damped_joint_brakes_what_touches_alone(scheme: Any, c: float, gap: float) -> None:
    """A ball that comes down on a spring with a dashpot: m x'' = max(-k x - c x', 0) from x = 0 on, no force before, wherever it began."""
    k, m = 1e5, 1.0
    ball, plane = rigid_sphere("ball", 0.1, (0, 0, 0.1 + gap), m), rigid_plane("plane", (0, 0, 0), (0, 0, 1))
    model = build_model([ball, plane], supports=[Support("plane", HELD)])
    start = at_rest(model)
    start.v[model.dof_offset[model.number["ball"]] + 2] = -1.0
    scheme = replace(scheme, law=Compliant(Springs(normal=k, tangential=k, normal_damping=c, each=True)))
    run = Simulation(model, ExactContacts(model, 0.0), scheme, round((gap + 0.014) / scheme.h), SolverSettings(tol=1e-10), initial=start)
    height, force, energy = [], [], 0.0
    for step in run:
        height.append(gap + of_body(step, "ball", step.state.x)[2])
        force.append(force_on(step, "ball")[2])
        energy += step.energy.normal_dissipation
    first = int(np.argmax(np.array(force) > 0))
    assert height[first] < 0 < height[first - 2]

    def leaves(t: float, y: Any) -> float:
        return float(-k * y[0] - c * y[1])

    leaves.terminal, leaves.direction = True, -1  # type: ignore[attr-defined]
    exact = solve_ivp(lambda t, y: [y[1], (-k * y[0] - c * y[1]) / m], (0, 0.05), [0, -1.0], rtol=1e-9, atol=1e-12, events=leaves)
    rebound = exact.y[1, -1]
    assert of_body(step, "ball", step.state.v)[2] == pytest.approx(rebound, rel=1e-3)
    if isinstance(scheme, Theta):
        assert energy == pytest.approx(0.5 * m * (1 - rebound**2), rel=1e-3)


@pytest.mark.parametrize("scheme", [Theta(4e-3), GeneralisedAlpha(4e-3, 0.8)])
def test_the_force_of_a_joint_turns_with_its_bodies(scheme: Any) -> None:
    """A block that is shifted by s on the springs of its four corners, then turned with its table: 4 k s, along with them."""
    k, s, begin, end = 1e5, 1e-4, 0.04, 0.2
    block = rigid_box("block", size=(0.2, 0.2, 0.1), centre=(0.0, 0.0, 0.05), mass=2.0)

    def rise(t: float) -> float:
        return 0.5 - 0.5 * np.cos(np.pi * np.clip(t, 0.0, 1.0))

    def angle(t: float) -> float:
        return np.pi / 2 * rise((t - begin) / (end - begin))

    def rate(t: float) -> float:
        return (np.pi / 2) ** 2 / (end - begin) * np.sin(np.pi * np.clip((t - begin) / (end - begin), 0.0, 1.0))

    def shift(t: float) -> float:
        return s * rise(t / begin)

    supports = [
        DrivenRotation("table", angle, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        Support("block", ("x",), displacement=lambda t: shift(t) * np.cos(angle(t))),
        Support("block", ("y",), displacement=lambda t: shift(t) * np.sin(angle(t))),
        Support("block", ("rz",), velocity=rate),
        Support("block", ("rx", "ry")),
    ]
    model = build_model([block, TABLE], supports=supports, gravity=lambda t: (0.0, 0.0, -9.81))
    scheme = replace(scheme, law=Compliant(Springs(normal=1e7, tangential=k, normal_damping=1e3, each=True)))
    for step in Simulation(model, Everything(model, mu=50.0), scheme, 52, SolverSettings(tol=1e-10)):
        turned, force = angle(step.state.t), force_on(step, "block")[:2]
        if step.state.t > begin + scheme.h:  # the force is that of half a step before
            expected = -4 * k * s * np.array([np.cos(turned), np.sin(turned)])
            assert force == pytest.approx(expected, abs=4 * k * s * (1e-2 + scheme.h * rate(step.state.t)))
            assert np.linalg.norm(force) == pytest.approx(4 * k * s, rel=1e-2)
    assert force == pytest.approx([0.0, -4 * k * s], abs=4 * k * s * 1e-2)
    assert "attitude" not in step.law_variables


@pytest.mark.parametrize("rate", [0.0, 5.0])
def test_a_block_on_springs_swings_in_one_plane_on_a_turntable(rate: float) -> None:
    """As Foucault's pendulum: x'' = -(4 k / m) x in space for a block in the middle of a table that turns it."""
    k, m, h, v = 500.0, 2.0, 2e-3, 0.05
    block = rigid_box("block", size=(0.2, 0.2, 0.1), centre=(0.0, 0.0, 0.05), mass=m)
    turned = DrivenRotation("table", lambda t: rate * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model = build_model([block, TABLE], supports=[turned], gravity=lambda t: (0.0, 0.0, -9.81))
    start = at_rest(model)
    first = model.dof_offset[model.number["block"]]
    start.v[first : first + 6] = (v, 0.0, 0.0, 0.0, 0.0, rate)
    law = Compliant(Springs(normal=1e6, tangential=k, normal_damping=500.0, each=True))
    swing = np.sqrt(4 * k / m)
    steps = round(1.3 * np.pi / swing / h)
    *_, step = Simulation(model, Everything(model, mu=50.0), Theta(h, law=law), steps, SolverSettings(tol=1e-10), initial=start)
    x, speed = (of_body(step, "block", values)[:2] for values in (step.state.x, step.state.v))
    assert speed == pytest.approx([v * np.cos(swing * step.state.t), 0.0], abs=2e-3 * v)
    assert x == pytest.approx([v / swing * np.sin(swing * step.state.t), 0.0], abs=2e-3 * v / swing)


@pytest.mark.parametrize(("degrees", "facets"), [(0.0, (2, 2)), (0.0, (6, 3)), (45.0, (3, 6))])
def test_a_joint_that_overhangs_has_the_stiffness_of_its_overlap(degrees: float, facets: tuple[int, int]) -> None:
    """A square pressed on another through the middle of their overlap sinks by F / (k A), and does not turn: shifted by half of it, A is
    half of the square, turned by a, 2 / (1 + sin a + cos a). Along the joint it yields by F / (k_T A)."""
    k, force, a = 1e8, 100.0, np.radians(degrees)
    shift, area = (0.5, 0.5) if degrees == 0 else (0.0, 2 / (1 + np.sin(a) + np.cos(a)))
    low, up = (rigid_box(n, (1, 1, 0.1), (0, 0, z), 1.0, (m, m, 1)) for n, z, m in zip(("low", "up"), (-0.05, 0.05), facets, strict=True))
    turn = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    up = replace(up, points=up.points @ turn + np.array([shift, 0, 0]), centre=up.centre + np.array([shift, 0, 0]))
    push = Force("up", (0.0, 0.1 * force, -force), (0.05 * 0.1 * force, -force * shift / 2, -0.1 * force * shift / 2))
    model = build_model([low, up], supports=[Support("low", HELD)], loads=[push])
    law = Compliant(Springs(normal=k, tangential=0.5 * k))
    (step,) = Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, 1.0, law), 1, SolverSettings(tol=1e-10), witness=None)
    moved = of_body(step, "up", step.state.x)
    assert moved[2] == pytest.approx(-force / (k * area), rel=1e-5)
    assert moved[1] == pytest.approx(0.1 * force / (0.5 * k * area), rel=1e-4)
    assert np.abs(moved[3:]).max() < 1e-4 * abs(moved[2])


@pytest.mark.parametrize("facets", [(2, 2), (3, 6)])
def test_a_bond_that_overhangs_has_the_strength_of_its_overlap(facets: tuple[int, int]) -> None:
    """Pulled open by d at once, what is left of f_t A is 1 - f_t d / (2 G): squares turned on each other by 20 degrees."""
    tension, energy, d, a = 2e5, 20.0, 1e-6, np.radians(20.0)
    low, up = (rigid_box(n, (1, 1, 0.1), (0, 0, z), 1.0, (m, m, 1)) for n, z, m in zip(("low", "up"), (-0.05, 0.05), facets, strict=True))
    up = replace(up, points=up.points @ np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]]))
    supports = [Support("low", HELD), Support("up", ("x", "y", "rx", "ry", "rz")), Support("up", ("z",), velocity=d)]
    model = build_model([low, up], supports=supports)
    scheme, settings = QuasiStatic(1.0, 0.0, Cohesive(tension=tension, mode_1=energy, mode_2=energy)), SolverSettings(tol=1e-6, floor=1e-9)
    (step,) = Simulation(model, Everything(model, 0.5), scheme, 1, settings, witness=None)
    area = 2 / (1 + np.sin(a) + np.cos(a))
    assert force_on(step, "up")[2] == pytest.approx(-tension * area * (1 - tension * d / (2 * energy)), rel=1e-6)


def points_of_joints(model: Any, joints: list[tuple[str, str, str, str]], alert: float) -> Detector:
    """Gauss points of the overlaps of (body, side) and (body, side)."""
    sides = [(contact_surface(model, [(a, b)]), contact_surface(model, [(c, d)])) for a, b, c, d in joints]
    return Detector([SurfacePair(slave, master, 0.5, alert, "segments") for slave, master in sides], model.n_nodes)


@pytest.mark.parametrize(("facets", "below", "s"), [((3, 5), (1, 1), 1e3), ((5, 3), (7, 4), 1.0), ((1, 1), (6, 5), 1e-3)])
def test_a_box_on_points_of_overlaps_turns_as_winkler_says(facets: tuple[int, int], below: tuple[int, int], s: float) -> None:
    """F at e from the middle of b x l on a bed k: F e / (k b l^3 / 12) in the kern; beyond, c = 3 (l/2 - e) bears, 2 F / (k b c^2)."""
    k, force, b, length = 1e8 / s**2, 1e3 * s, 0.4 * s, 0.6 * s
    low = rigid_box("low", (s, s, 0.1 * s), (0.0, 0.0, -0.05 * s), 1.0, (*below, 1))
    up = rigid_box("up", (length, b, 0.1 * s), (0.0, 0.0, 0.05 * s), 1.0, (*facets, 1))
    held = [Support("low", HELD), Support("up", ("x", "y", "rx", "rz"))]
    law = Compliant(Springs(normal=k, tangential=1e-4 * k))
    for e, within in ((0.05 * s, 1e-4), (0.15 * s, 5e-3), (0.22 * s, 2e-2)):
        model = build_model([low, up], supports=held, loads=[Force("up", (0.0, 0.0, -force), (0.0, force * e, 0.0))])
        rule = points_of_joints(model, [("up", "z-", "low", "z+")], 0.02 * s)
        (step,) = Simulation(model, rule, QuasiStatic(1.0, 1.0, law), 1, SolverSettings(tol=1e-10), witness=None)
        wide = 3 * (length / 2 - e)
        turned = force * e / (k * b * length**3 / 12) if e < length / 6 else 2 * force / (b * wide**2 * k)
        assert of_body(step, "up", step.state.x)[4] == pytest.approx(turned, rel=within)


@pytest.mark.parametrize(
    ("facets", "below", "within", "s"),
    [
        ((3, 5), (1, 1), 0.06, 1e3),
        ((5, 3), (7, 4), 0.03, 1.0),
        ((1, 1), (6, 5), 0.1, 1e-3),
        ((1, 1), (1, 1), 0.03, 1.0),
        ((2, 1), (1, 1), 0.02, 1e-3),
        ((1, 2), (1, 1), 0.02, 1e3),
    ],
)
def test_a_rigid_box_among_everything_turns_as_winkler_says(
    facets: tuple[int, int], below: tuple[int, int], within: float, s: float
) -> None:
    """The same under `Everything`: nodes have the overlap's second moments, with points within it where all are at its rim; in uplift they
    are few."""
    k, force, b, length = 1e8 / s**2, 1e3 * s, 0.4 * s, 0.6 * s
    low = rigid_box("low", (s, s, 0.1 * s), (0.0, 0.0, -0.05 * s), 1.0, (*below, 1))
    up = rigid_box("up", (length, b, 0.1 * s), (0.0, 0.0, 0.05 * s), 1.0, (*facets, 1))
    held, law = [Support("low", HELD), Support("up", ("x", "y", "rx", "rz"))], Compliant(Springs(normal=k, tangential=1e-4 * k))
    for e, turned, off in (
        (0.05 * s, force * 0.05 * s / (k * b * length**3 / 12), 1e-4),
        (0.15 * s, 2 * force / (b * (0.45 * s) ** 2 * k), within),
    ):
        model = build_model([low, up], supports=held, loads=[Force("up", (0.0, 0.0, -force), (0.0, force * e, 0.0))])
        rule, scheme = Everything(model, 0.5), QuasiStatic(1.0, 1.0, law)
        (step,) = Simulation(model, rule, scheme, 1, SolverSettings(tol=1e-10), witness=None)
        assert of_body(step, "up", step.state.x)[4] == pytest.approx(turned, rel=off)


def overlap_of_squares(degrees: float, shift: float) -> tuple[float, float, float]:
    """Area and second moments about x and y through the centre of what unit squares share, shifted or turned by 45 degrees."""
    if degrees == 45.0:  # a regular octagon: A (6 R^2 - a^2) / 24 of its side a = sqrt(2) - 1 and outer radius R
        side = np.sqrt(2) - 1
        area = 2 * (1 + np.sqrt(2)) * side**2
        moment = area * (6 * (0.25 + side**2 / 4) - side**2) / 24
        return area, moment, moment
    return 1 - shift, (1 - shift) / 12, (1 - shift) ** 3 / 12


@pytest.mark.parametrize(("degrees", "shift"), [(0.0, 0.0), (0.0, 0.55), (45.0, 0.0)])
def test_areas_of_nodes_have_the_moments_of_the_overlap(degrees: float, shift: float) -> None:
    """Squares shifted, or turned on each other, wherever the two lie in space."""
    low, up = (rigid_box(n, (1, 1, 0.2), (0, 0, z), 1.0, (m, m, 1)) for n, z, m in (("low", -0.1, 5), ("up", 0.1, 6)))
    model, a = build_model([low, up]), np.radians(degrees)
    x, own = model.reference.copy(), model.node_offset[1]
    x[own:] = x[own:] @ np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]]) + [shift, 0.0, 0.0]
    turn, _ = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [-2.0, 1.0, 0.5], [0.3, 0.7, -1.0]]))
    turn *= np.sign(np.linalg.det(turn))
    found = Everything(model, 0.5)(x @ turn.T)
    area = proportions(model, both_ways=True).area_at(found, x @ turn.T)
    arm = found.point @ turn - [0.5 * shift, 0.0, 0.0]
    whole, about_x, about_y = overlap_of_squares(degrees, shift)
    assert area.min() > 0
    assert area.sum() == pytest.approx(whole)
    assert area @ arm[:, :2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.einsum("a,ai,aj->ij", area, arm, arm)[:2, :2] == pytest.approx(np.diag([about_y, about_x]), abs=1e-6)


@pytest.mark.parametrize("facets", [((1, 1), (6, 6)), ((3, 4), (2, 5)), ((6, 6), (1, 1))])
def test_areas_of_nodes_do_not_depend_on_what_is_open(facets: tuple[tuple[int, int], tuple[int, int]]) -> None:
    """A block that tips on its edge: what has a contact still keeps its area."""
    up = rigid_box("up", (0.6, 0.4, 0.2), (0.0, 0.0, 0.1), 1.0, (*facets[0], 1))
    low = rigid_box("low", (1.0, 1.0, 0.2), (0.0, 0.0, -0.1), 1.0, (*facets[1], 1))
    model = build_model([low, up], supports=[Support("low", HELD)])
    rule, sizes, own = Everything(model, 0.5), proportions(model, both_ways=True), model.node_offset[1]
    areas = []
    for angle in (0.0, 0.015, 0.03, 0.1):
        x, turn = model.reference.copy(), np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        x[own:, ::2] = (x[own:, ::2] - [0.3, 0.0]) @ turn.T + [0.3, 0.0]
        found = rule(x)
        areas.append(dict(zip(found.identity.tolist(), sizes.area_at(found, x).tolist(), strict=True)))
    assert len(areas[0]) > len(areas[1]) > len(areas[3]) > 1
    for some in areas[1:]:
        assert some == pytest.approx({k: areas[0][k] for k in some}, rel=1e-2)


@pytest.mark.parametrize("shift", [0.0, 0.5])
def test_faces_of_one_facet_have_the_moments_of_their_overlap(shift: float) -> None:
    """Squares of one facet, shifted by half as bricks in a bond are: points within share the overlap with what is at its rim, and neither
    it nor its parts change as the upper one lifts."""
    low, up = (rigid_box(n, (1, 1, 0.2), (x, 0, z), 1.0) for n, x, z in (("low", 0.0, -0.1), ("up", shift, 0.1)))
    model = build_model([low, up], supports=[Support("low", HELD)])
    law = Compliant(Springs(normal=1e8, tangential=1e8))
    run = Simulation(model, Everything(model, 0.5), Theta(1.0, law=law), 1).substeps
    whole, about_x, about_y = overlap_of_squares(0.0, shift)
    areas = []
    for angle in (0.0, 0.01, 0.03):
        x, turn = model.reference.copy(), np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        x[model.node_offset[1] :, ::2] = (x[model.node_offset[1] :, ::2] - [0.5, 0.0]) @ turn.T + [0.5, 0.0]
        found = run.detection(x)
        areas.append(dict(zip(found.identity.tolist(), run.proportions.area_at(found, x).tolist(), strict=True)))
        if angle == 0.0:
            area, arm = np.array(list(areas[0].values())), found.point - [0.5 * shift, 0.0, 0.0]
            assert area.min() > 0
            assert area.sum() == pytest.approx(whole)
            assert area @ arm[:, :2] == pytest.approx([0.0, 0.0], abs=1e-9)
            assert np.einsum("a,ai,aj->ij", area, arm, arm)[:2, :2] == pytest.approx(np.diag([about_y, about_x]), rel=1e-6, abs=1e-9)
    assert len(areas[0]) >= len(areas[1]) > len(areas[2]) > 1
    for some in areas[1:]:
        assert some == pytest.approx({k: areas[0][k] for k in some}, rel=2e-2)


def test_areas_go_over_to_points_within_by_degrees() -> None:
    """Squares of 2 x 2 facets that slide by 0.002: nodes and points share the overlap nearly as before; 0.37 of 0.63 went over at once.
    Points that are met on the way alone, without the mark of their joint, have an area as well."""
    low, up = (rigid_box(n, (1, 1, 0.2), (0.0, 0.0, z), 1.0, (2, 2, 1)) for n, z in (("low", -0.1), ("up", 0.1)))
    model = build_model([low, up], supports=[Support("low", HELD)])
    law = Compliant(Springs(normal=1e8, tangential=1e8))
    run, before = Simulation(model, Everything(model, 0.5), Theta(1.0, law=law), 1).substeps, dict[int, float]()
    within = []
    for shift in np.arange(0.28, 0.38, 0.002):
        x = model.reference.copy()
        x[model.node_offset[1] :, 0] += shift
        found = run.detection(x)
        area = run.proportions.area_at(found, x)
        assert area.sum() == pytest.approx(1 - shift)
        assert run.proportions.area_at(replace(found, area=None), x).min() > 0
        now = dict(zip(found.identity.tolist(), area.tolist(), strict=True))
        assert not before or sum(abs(now.get(k, 0.0) - before.get(k, 0.0)) for k in now.keys() | before.keys()) < 0.1
        before = now
        within.append(bool(found.within_faces.any()))
    assert within == sorted(within) and within[-1] and not within[0]


def test_a_bond_that_slides_by_a_hair_keeps_its_shear() -> None:
    """k_T A d of a glued joint, pulled along by d and open by d: points that came within it at 0.36586 had no spring's force, which fell to
    a third."""
    k, d = 1e9, 1e-5
    low, up = (rigid_box(n, (1, 1, 0.2), (x, 0.0, z), 1.0, (2, 2, 1)) for n, x, z in (("low", 0.0, -0.1), ("up", 0.36586, 0.1)))
    held = [Support("low", HELD), Support("up", ("y", "rx", "ry", "rz")), Support("up", ("x", "z"), velocity=d)]
    model = build_model([low, up], supports=held)
    law = Cohesive(tension=1e5, mode_1=1e3, mode_2=1e3, springs=Springs(normal=k, tangential=k))
    for step in Simulation(model, Everything(model, 0.5), QuasiStatic(0.1, law=law), 3, witness=None):
        assert force_on(step, "up")[0] == pytest.approx(-k * (1 - 0.36586) * d * step.state.t, rel=1e-3)


def test_a_rectangle_of_one_segment_turns_as_winkler_says() -> None:
    """The same in the plane: F e / (k l^3 / 12) of the thickness 1."""
    k, force, length, e = 1e8, 1e3, 0.6, 0.05
    low, up = rigid_rectangle("low", (1.0, 0.1), (0.0, -0.05), 1.0), rigid_rectangle("up", (length, 0.1), (0.0, 0.05), 1.0)
    push = Force("up", (0.0, -force), (-force * e,))
    model = build_model([low, up], supports=[Support("low", ("x", "y", "rz")), Support("up", ("x",))], loads=[push])
    law = Compliant(Springs(normal=k, tangential=1e-4 * k))
    (step,) = Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, 1.0, law), 1, SolverSettings(tol=1e-10), witness=None)
    assert step.state.x[model.dof_offset[1] + 2] == pytest.approx(-force * e / (k * length**3 / 12), rel=1e-4)


@pytest.mark.parametrize(("facets", "ratio", "s"), [((1, 1), 3.0, 1e-3), ((3, 5), None, 1.0), ((5, 5), None, 1e3)])
def test_springs_at_too_few_nodes_are_named(facets: tuple[int, int], ratio: float | None, s: float) -> None:
    """Corners alone have three times the second moment: said from a tenth on, not of points of overlaps, nor of `Everything`, which has
    points within faces."""
    low = rigid_box("low", (s, s, 0.1 * s), (0.0, 0.0, -0.05 * s), 1.0)
    up = rigid_box("up", (0.6 * s, 0.4 * s, 0.1 * s), (0.0, 0.0, 0.05 * s), 1.0, (*facets, 1))
    model = build_model([low, up], supports=[Support("low", HELD)], gravity=lambda t: (0.0, 0.0, -9.81 * s))
    law = Compliant(Springs(normal=1e7 / s**2, tangential=1e7 / s**2))
    up_down, low_up = (contact_surface(model, [side]) for side in (("up", "z-"), ("low", "z+")))
    nodes = Detector([SurfacePair(up_down, low_up, 0.5, 0.02 * s)], model.n_nodes)
    points = points_of_joints(model, [("up", "z-", "low", "z+")], 0.02 * s)
    for rule, said in ((nodes, ratio), (Everything(model, 0.5), None), (points, None)):
        (step,) = Simulation(model, rule, QuasiStatic(1.0, 1.0, law), 1, SolverSettings(tol=1e-8), witness=None)
        remarks = [text for text in step.remarks if "second moment" in text]
        assert len(remarks) == (said is not None)
        assert said is None or all("'up'" in text and f"{said:.3g} times that of the area" in text for text in remarks)


def test_bricks_in_a_row_bend_as_a_beam_of_their_joints() -> None:
    """A cantilever of rigid bricks on glued joints with springs: the end sinks by sum_j F a_j^2 / (k I) + F / (k_T A) over the joints."""
    k, shear, force, size, b, count = 1e9, 1e7, 0.1, 0.2, 0.1, 4
    bricks = [rigid_box(str(i), (size, b, b), (i * size, 0.0, 0.0), 1.0, (1, 1 + i % 3, 1 + i % 2)) for i in range(count + 1)]
    model = build_model(bricks, supports=[Support("0", HELD)], loads=[Force(str(count), (0.0, 0.0, -force))])
    rule = points_of_joints(model, [(str(i + 1), "x-", str(i), "x+") for i in range(count)], 0.01)
    law = Cohesive(tension=1e6, mode_1=1e3, mode_2=1e3, springs=Springs(normal=k, tangential=shear))
    (step,) = Simulation(model, rule, QuasiStatic(1.0, 1.0, law), 1, SolverSettings(tol=1e-10), witness=None)
    arms = size * (np.arange(count) + 0.5)
    sinks = force * (arms @ arms) / (k * b**4 / 12) + count * force / (shear * b**2)
    assert of_body(step, str(count), step.state.x)[2] == pytest.approx(-sinks, rel=1e-3)


def test_areas_of_points_do_not_depend_on_what_is_open() -> None:
    """A block that tips on its edge: what it has in sight keeps its area, the overlap's facets are whole."""
    low, up = (rigid_box(n, (1, 1, 0.2), (0, 0, z), 1.0, (m, 2, 1)) for n, z, m in (("low", -0.1, 4), ("up", 0.1, 3)))
    model = build_model([low, up], supports=[Support("low", HELD)])
    rule, sizes, own = points_of_joints(model, [("up", "z-", "low", "z+")], 0.01), proportions(model), model.node_offset[1]
    areas = {}
    for angle in (0.0, 0.015, 0.03, 0.1):
        x, turn = model.reference.copy(), np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        x[own:, ::2] = (x[own:, ::2] + [0.5, 0.0]) @ turn - [0.5, 0.0]
        found = rule(x)
        areas[angle] = dict(zip(found.identity.tolist(), sizes.area_at(found, x), strict=True))
    assert sum(areas[0.0].values()) == pytest.approx(1.0)
    assert len(areas[0.0]) > len(areas[0.015]) > len(areas[0.03]) > len(areas[0.1]) > 0
    share = [sum(a for a in some.values()) for some in areas.values()]
    assert share[1:] == pytest.approx([0.01 / angle for angle in list(areas)[1:]], abs=0.1)
