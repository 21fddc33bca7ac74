"""What laws are built of: variables by contact, areas, sizes."""

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Detector, SurfacePair, two_pass
from fcsim.contact_detection.general.everything import Everything
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Meeting, Timing, Variables
from fcsim.contact_law.proportions import proportions
from fcsim.mesh import rigid_capsule, rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody

SOFT = Material(1e7, 0.3, 1000.0)


def test_variables_are_kept_by_contact() -> None:
    first = Variables(np.array([2, 5, 9]), {"a": np.array([0.2, 0.5, 0.9]), "b": np.arange(6.0).reshape(3, 2)})
    assert_array_equal(first.of("a", np.array([1, 5, 9, 11]), np.full(4, -1.0)), [-1, 0.5, 0.9, -1])
    assert_array_equal(first.of("b", np.array([9, 3]), np.zeros((2, 2))), [[4, 5], [0, 0]])
    assert_array_equal(first.of("unknown", np.array([5]), np.array([7.0])), [7])
    then = first.merged(np.array([1, 5]), {"a": np.array([1.0, 5.0])}, 3.0)
    assert_array_equal(then.identity, [1, 2, 5, 9])
    assert_array_equal(then.values["a"], [1.0, 0.2, 5.0, 0.9])
    assert_array_equal(np.isnan(then.values["b"]).any(axis=1), [True, False, True, False])
    assert then.stored == 3.0


def test_sizes_are_the_least_extents_that_are_not_flat() -> None:
    bodies = [rigid_box("plank", (4.0, 0.3, 0.05), (0, 0, 0), 1.0), rigid_box("cube", (2.0, 2.0, 2.0), (5, 0, 0), 1.0)]
    assert_allclose(proportions(build_model(bodies)).size, [0.05, 2.0])


def test_sizes_of_exact_shapes_are_their_smallest_extents() -> None:
    """A ball's was 0.58 of its radius, the extent of its centre and a point along each axis."""
    solid = [
        rigid_sphere("ball", 0.3, (0, 0, 0), 1.0),
        rigid_capsule("capsule", 0.2, 1.0, (2, 0, 0), 1.0),
        rigid_cylinder("drum", 0.5, 3.0, (4, 0, 0), 1.0),
        rigid_cylinder("coin", 0.5, 0.1, (6, 0, 0), 1.0),
        rigid_plane("floor", (0, 0, -1), (0, 0, 1)),
    ]
    assert_allclose(proportions(build_model(solid)).size, [0.6, 0.4, 1.0, 0.1, inf])
    flat = [rigid_sphere("disk", 0.3, (0, 0), 1.0), rigid_capsule("stadium", 0.2, 1.0, (2, 0), 1.0), rigid_plane("line", (0, -1), (0, 1))]
    assert_allclose(proportions(build_model(flat)).size, [0.6, 0.4, inf])


@pytest.mark.parametrize(
    ("rigid", "moving", "recovery", "gap", "expected"),
    [
        (True, True, 0.1, 9e-8, 0.0),
        (True, True, 0.1, -9e-8, 0.0),
        (True, True, 0.1, 1.9e-7, 1e-4),
        (True, True, 0.1, -1.9e-7, -1e-4),
        (True, True, 0.1, 1e-6, 1e-3),
        (True, True, 0.1, -1e-6, -1e-3),
        (True, True, 0.1, 3e-6, 3e-3),
        (True, True, inf, 9e-8, 9e-5),
        (True, False, 0.1, 9e-8, 9e-8),
        (False, True, 0.1, 9e-8, 9e-5),
    ],
)
def test_gaps_that_solvers_leave_are_none_between_rigid_bodies(
    rigid: bool, moving: bool, recovery: float, gap: float, expected: float
) -> None:
    """w_N = g / h with h = 1 ms (statics: g) on a cube of 1 m; between rigid bodies that move 0 up to 1e-7 m, then by a straight
    line to all of g at 1e-6 m: 9e-8 of the 9e-7 between them are a tenth of 1e-6."""
    floor = rigid_rectangle("floor", (4, 1), (0, -0.5), 1.0)
    cube = rigid_rectangle("cube", (1, 1), (0, 0.5 + gap), 1.0)
    soft = Body("cube", rectangle("c", (1.0, 1.0), (1, 1), SOFT), translation=np.array([-0.5, gap]))
    model = build_model([floor, cube if rigid else soft])
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Everything(model, 0.5)(positions)
    timing = Timing(1e-3, 0.5, 1e-3, 1e3) if moving else Timing(1.0, 1.0, 1.0, 1.0, moving=False)
    meeting = Meeting(contacts, positions, np.zeros((len(contacts), 2)), 0.0, timing, None, proportions(model))
    w = Gap(recovery).terms(meeting).w[:, 0]
    assert len(w) == 2 and w == pytest.approx([expected] * 2, rel=1e-6, abs=1e-13)


@pytest.mark.parametrize("candidates", ["nodes", "faces", "gauss", "mortar", "segments"])
@pytest.mark.parametrize("twice", [False, True])
def test_areas_add_up_to_the_joint(candidates: Any, twice: bool) -> None:
    """A brick on a wide one, its side faces named too: 0.6 m x 0.4 m, in one pass and in two."""
    upper, lower = brick("u", (0.6, 0.4, 0.2), (3, 2, 1), SOFT), brick("l", (0.6, 0.4, 0.2), (2, 3, 1), SOFT)
    model = build_model([Body("lower", lower), Body("upper", upper, translation=np.array([0, 0, 0.2]))])
    first, second = contact_surface(model, [("upper", "z-")]), contact_surface(model, [("lower", "z+")])
    pairs = two_pass(first, second, 0.5, 0.01, candidates) if twice else (SurfacePair(first, second, 0.5, 0.01, candidates),)
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Detector(pairs, model.n_nodes)(positions)
    assert proportions(model).area_at(contacts, positions).sum() == pytest.approx(0.6 * 0.4, rel=1e-9)


@pytest.mark.parametrize(
    ("upper", "lower", "size", "shift"),
    [(2, 2, 0.4, 0.0), (2, 5, 0.4, 0.0), (8, 3, 0.4, 0.0), (8, 3, 0.4, 0.013), (2, 2, 0.2, 0.0), (2, 2, 0.2, 1e-6), (4, 4, 0.4, 0.0)],
)
@pytest.mark.parametrize("d", [2, 3])
def test_areas_of_everything_add_up_to_the_joint(d: int, upper: int, lower: int, size: float, shift: float) -> None:
    """A block of 0.2 m with its whole face on one as wide or wider, of other facets: nodes of both bodies, some of them where two meet."""
    blocks, columns, side = [], {"l": lower, "u": upper}, {"l": size, "u": 0.2}
    for name, low, left in (("l", -0.1, (0.2 - size) / 2), ("u", 0.0, shift if size > 0.2 else 0.0)):
        edges, n = (side[name],) * (d - 1), (columns[name],) * (d - 1)
        part = rectangle(name, (*edges, 0.1), (*n, 1), SOFT) if d == 2 else brick(name, (*edges, 0.1), (*n, 1), SOFT)
        blocks.append(Body(name, part, translation=np.array([left] * (d - 1) + [low])))
    model = build_model(blocks)
    positions = model.positions(np.zeros(model.n_dofs))
    if size == 0.2:  # the upper one a hair narrower: its rim meets the lower one's facets, and what is within them its nodes
        own = slice(model.node_offset[model.number["u"]], None)
        positions[own, :-1] -= 2 * shift * (positions[own, :-1] - 0.1)
    contacts = Everything(model, 0.5)(positions)
    assert proportions(model).area_at(contacts, positions).sum() == pytest.approx(0.2 ** (d - 1), rel=1e-5)


def _turned(body: RigidBody, degrees: float, shift: float) -> RigidBody:
    """Turned about its centre and the vertical, then shifted along x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    points = (body.points - body.centre) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + body.centre
    along = np.array([shift, 0.0, 0.0])
    return replace(body, points=points + along, centre=body.centre + along)


@pytest.mark.parametrize(("lower", "upper"), [(1, 1), (2, 2), (3, 6), (6, 3), (4, 3)])
@pytest.mark.parametrize("rigid", [False, True])
def test_areas_of_faces_that_overhang_each_other_are_their_overlaps(lower: int, upper: int, rigid: bool) -> None:
    """Unit squares shifted by s: 1 - s, in 2D times the thickness; turned on each other by a: 2 / (1 + sin a + cos a); planks crossed."""
    for shift in (0.5, 0.13, 5e-5):
        bar = rectangle("l", (1.0, 0.1), (lower, 1), SOFT, thickness=0.25)
        model = build_model([Body("l", bar, translation=(0.0, -0.1)), rigid_rectangle("u", (1, 0.1), (0.5 + shift, 0.05), 1.0, (upper, 1))])
        assert _area(model) == pytest.approx((0.25 * (1 - shift), 0.5 + shift / 2), rel=1e-9)
    slab = rigid_box("l", (1, 1, 0.1), (0, 0, -0.05), 1.0, (lower, lower, 1))
    under = slab if rigid else Body("l", brick("l", (1, 1, 0.1), (lower, lower, 1), SOFT, origin=(-0.5, -0.5, -0.1)))
    for degrees, shift in ((0.0, 0.5), (0.0, 5e-5), (20.0, 0.0), (45.0, 0.0), (0.1, 0.0)):
        above = _turned(rigid_box("u", (1, 1, 0.1), (0, 0, 0.05), 1.0, (upper, upper, 1)), degrees, shift)
        a = np.radians(degrees)
        exact = 2 / (1 + np.sin(a) + np.cos(a)) - shift
        assert _area(build_model([under, above])) == pytest.approx((exact, shift / 2), rel=1e-9, abs=1e-9)
    planks = [rigid_box(n, s, (0, 0, z), 1.0, (lower, upper, 1)) for n, s, z in (("l", (3, 1, 1), -0.5), ("u", (1, 3, 1), 0.5))]
    assert _area(build_model(planks)) == pytest.approx((1.0, 0.0), abs=1e-9)


def _area(model: Any) -> tuple[float, float]:
    """The sum of all areas under `Everything`, and the x of their centre."""
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Everything(model, 0.5)(positions)
    areas = proportions(model).area_at(contacts, positions)
    assert areas.min() > 0
    return areas.sum(), areas @ contacts.point[:, 0] / areas.sum()


@pytest.mark.parametrize("degrees", [0.0, 63.0])
def test_each_foot_of_a_bridge_has_its_own_area(degrees: float) -> None:
    """Feet of 0.3 m, one of one facet, the other of four, half of which is beyond the ground's end; all turned in the plane."""
    x = np.array([0.0, 0.3, 0.7, 0.775, 0.85, 0.925, 1.0, 1.0, 0.0])
    y = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5])
    points = np.stack([np.insert(x, 2, [0.3, 0.7]), np.insert(y, 2, [0.2, 0.2])], axis=1)
    skin = np.stack([np.arange(11), (np.arange(11) + 1) % 11], axis=1)
    ground = rigid_rectangle("ground", (0.95, 0.2), (0.375, -0.1), 1.0, (5, 1))
    turn = np.array([[np.cos(a := np.radians(degrees)), np.sin(a)], [-np.sin(a), np.cos(a)]])
    bridge = RigidBody("bridge", 1.0, 1.0, np.array([0.5, 0.3]) @ turn, points @ turn, {"skin": skin})
    model = build_model([bridge, replace(ground, points=ground.points @ turn, centre=ground.centre @ turn)])
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Everything(model, 0.5)(positions)
    areas, left = proportions(model).area_at(contacts, positions), (contacts.point @ turn.T)[:, 0] < 0.5
    assert areas[left].sum() == pytest.approx(0.3, rel=1e-9)
    assert areas[~left].sum() == pytest.approx(0.15, rel=1e-9)


def test_points_that_are_named_as_surfaces_have_no_area() -> None:
    """A node of the joint, which a support may hold, is a surface of its own."""
    stone = rectangle("stone", (1.0, 1.0), (2, 2), SOFT)
    stone = replace(stone, surfaces={**stone.surfaces, "middle": np.array([[stone.surfaces["y-"][0, 1]] * 2])})
    under = rigid_rectangle("floor", (3.0, 1.0), (0.5, -0.5), 1.0)
    model = build_model([Body("stone", stone), under])
    positions = model.positions(np.zeros(model.n_dofs))
    pair = SurfacePair(contact_surface(model, [("stone", "y-")]), contact_surface(model, [("floor", "y+")]), 0.5, 1e-2)
    contacts = Detector([pair], model.n_nodes)(positions)
    assert proportions(model).area_at(contacts, positions).sum() == pytest.approx(1.0, rel=1e-9)


def test_what_is_too_far_away_for_a_contact_has_no_area() -> None:
    """A slab of 4 x 4 facets that opens about one side: only its nodes there are in contact, with half of a row of facets times
    f(1/2): f = a + b x^2 on the shares 1/8, 1/4, 1/4, 1/4, 1/8 at x = -1/2 ... 1/2 with sums 1 and of x^2 1/12: a = 10/9, b = -32/27."""
    slab, floor = rigid_box("slab", (1, 1, 0.1), (0, 0, 0.05), 1.0, (4, 4, 1)), rigid_box("floor", (3, 3, 1), (0, 0, -0.5), 1.0)
    hinge, c, s = np.array([-0.5, 0.0, 0.0]), np.cos(0.1), np.sin(0.1)
    points = (slab.points - hinge) @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) + hinge
    assert _area(build_model([replace(slab, points=points), floor]))[0] == pytest.approx((10 / 9 - 8 / 27) / 8, rel=6e-3)


@pytest.mark.parametrize("d", [2, 3])
def test_areas_do_not_ask_which_body_is_first(d: int) -> None:
    """A corner alone in the ground, its faces 30 degrees and more from it: the same in both orders."""
    made, turn = (
        (rigid_rectangle, [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
        if d == 2
        else (rigid_box, Rotation.from_rotvec([0.4, 0.5, 0.2]).as_matrix())
    )
    box, floor = made("box", (0.3,) * d, (0.0,) * d, 1.0), made("floor", (4.0,) * d, (0.0,) * (d - 1) + (-2.0,), 1.0)
    corners = box.points @ np.transpose(turn)
    to = np.append(np.full(d - 1, 0.03), -corners[:, -1].min() - 1e-3)
    areas = []
    for bodies in ([floor, placed := replace(box, points=corners + to, centre=to)], [placed, floor]):
        model = build_model(bodies)
        areas.append(proportions(model).area_at(Everything(model, 0.5)(model.reference), model.reference))
    assert_allclose(areas[0], areas[1], rtol=1e-9)
    part = 0.3 ** (d - 1) / 2 ** (d - 1)
    assert 0.75 * part < areas[0].sum() < 2 * part


def test_two_edges_that_cross_alone_have_no_more_than_the_overlap() -> None:
    """A tilted bar across the rim of a block, by one contact: one point is off its mean by round-off alone."""
    block, bar = rigid_box("block", (1.0, 1.0, 1.0), np.zeros(3), 1.0), rigid_box("bar", (0.4, 0.3, 0.3), np.zeros(3), 1.0)
    corners = (bar.points + np.array([0.2, 0.15, 0.15])) @ Rotation.from_euler("yx", (0.35, 0.2)).as_matrix().T
    crossing = corners[0] + 0.75 * (corners[np.argmax(bar.points @ np.array([1, -1, -1]))] - corners[0])
    for y in np.random.default_rng(1).uniform(-0.25, -0.05, 20):
        to = np.array([0.5, 0.5 + y, 0.5 - 1e-4]) - crossing
        model = build_model([block, replace(bar, points=corners + to, centre=corners.mean(axis=0) + to)])
        contacts = Everything(model, 0.5)(model.reference)
        assert len(contacts) == 1
        assert 0 < proportions(model).area_at(contacts, model.reference)[0] < 0.4 * 0.3


def test_areas_in_two_dimensions_have_the_thickness() -> None:
    upper = rectangle("u", (0.6, 0.2), (3, 1), SOFT, thickness=0.25)
    model = build_model([Body("upper", upper, translation=np.array([0, 0.0])), rigid_rectangle("floor", (3, 1), (0, -0.5), 1.0)])
    pair = SurfacePair(contact_surface(model, [("upper", "y-")]), contact_surface(model, [("floor", "y+")]), 0.5, 0.01)
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Detector([pair], model.n_nodes)(positions)
    areas = proportions(model).area_at(contacts, positions)
    assert_allclose(np.sort(areas), 0.25 * np.array([0.1, 0.1, 0.2, 0.2]))


@pytest.mark.parametrize(
    ("below", "above", "shared"), [(0.5, 0.25, 0.25), (0.25, 0.5, 0.25), (None, 0.25, 0.25), (0.5, None, 0.5), (None, None, 1.0)]
)
@pytest.mark.parametrize("passes", [0, 1, 2])
def test_joints_of_unlike_thickness_have_the_area_that_both_share(
    below: float | None, above: float | None, shared: float, passes: int
) -> None:
    """0.6 m of a joint by the smaller thickness, whichever body is the slave, and in two passes; None: rigid."""

    def block(name: str, low: float, columns: int, thickness: float | None) -> Body | RigidBody:
        if thickness is None:
            return rigid_rectangle(name, (0.6, 0.2), (0.3, low + 0.1), 1.0, (columns, 1))
        return Body(name, rectangle(name, (0.6, 0.2), (columns, 1), SOFT, thickness=thickness), translation=np.array([0.0, low]))

    model = build_model([block("lower", 0.0, 2, below), block("upper", 0.2, 3, above)])
    first, second = (contact_surface(model, [side]) for side in (("upper", "y-"), ("lower", "y+")))
    first, second = (second, first) if passes == 1 else (first, second)
    pairs = two_pass(first, second, 0.5, 0.01, "faces") if passes == 2 else (SurfacePair(first, second, 0.5, 0.01, "faces"),)
    positions = model.positions(np.zeros(model.n_dofs))
    contacts = Detector(pairs, model.n_nodes)(positions)
    assert proportions(model).area_at(contacts, positions).sum() == pytest.approx(0.6 * shared)
