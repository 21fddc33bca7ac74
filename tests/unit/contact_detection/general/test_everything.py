"""Contact of everything with everything: what takes part, what is refused, friction, 2D, curved and concave bodies, the way of a step."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Contacts, Everything, contact_matrix
from fcsim.errors import InputError
from fcsim.mesh import rigid_polyhedron
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody

STONE = Material(1e9, 0.2, 2000.0)


def contacts_of(*bodies: Body | RigidBody, mu=0.5, **options) -> tuple[Model, Contacts]:
    model = build_model(bodies)
    return model, Everything(model, mu, **options)(model.reference)


def with_surfaces(box: RigidBody, surfaces) -> RigidBody:
    return RigidBody(box.name, box.mass, box.inertia, box.centre, box.points, surfaces)


def test_matching_meshes_have_one_contact_a_node() -> None:
    part = brick("brick", (0.2, 0.1, 0.1), (4, 2, 2), STONE)
    _, found = contacts_of(Body("lower", part), Body("upper", part, translation=(0, 0, 0.1)))
    assert len(found) == 5 * 3
    assert_allclose(found.gap, 0, atol=1e-15)
    assert_allclose(np.abs(found.frame[:, 0, 2]), 1)
    assert len(np.unique(np.round(found.point, 9), axis=0)) == 15


@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_two_dimensions(kind: str) -> None:
    """Segments that overlap by a part: a corner of either at each end of the overlap, and the nodes between."""
    make = rigid_rectangle if kind == "rigid" else None
    if make:
        bodies = [rigid_rectangle("lower", (1, 1), (0, -0.5), 1.0), rigid_rectangle("upper", (1, 1), (0.7, 0.5), 1.0)]
    else:
        part = rectangle("square", (1, 1), (2, 2), STONE)
        bodies = [Body("lower", part, translation=(-0.5, -1)), Body("upper", part, translation=(0.2, 0))]
    _, found = contacts_of(*bodies)
    assert found.dimension == 2
    assert_allclose(np.sort(found.point[:, 0])[[0, -1]], [0.2, 0.5], atol=1e-12)
    assert_allclose(np.abs(found.frame[:, 0, 1]), 1)
    assert_allclose(found.gap, 0, atol=1e-15)
    assert len(found) == 2


def test_a_rigid_translation_of_all_gives_no_velocity_and_forces_have_no_resultant() -> None:
    part = brick("brick", (0.2, 0.1, 0.1), (3, 2, 2), STONE, cell="tetrahedron")
    model, found = contacts_of(rigid_box("floor", (1, 1, 1), (0.07, 0.03, -0.5), 1.0), Body("b", part), alert=1e-3)
    H = contact_matrix(found, model.n_nodes)
    assert_allclose(H.T @ np.tile([1.0, -2.0, 3.0], model.n_nodes), 0, atol=1e-12)
    assert len(found) and np.array_equal(found.identity, np.unique(found.identity))
    weights = np.where(found.nodes < 0, 0, found.weights)
    gap = np.einsum("ak,akd,ad->a", weights, model.reference[found.nodes], found.frame[:, 0])
    assert_allclose(gap, found.gap, atol=1e-12)


def test_boxes_whose_edges_or_corners_merely_meet_do_not_touch() -> None:
    for centre in ((1, 0, 1), (1, 1, 1), (1, 1, 0)):
        assert len(contacts_of(rigid_box("a", (1, 1, 1), (0, 0, 0), 1.0), rigid_box("b", (1, 1, 1), centre, 1.0))[1]) == 0


@pytest.mark.parametrize("shift", [1e-3, 0.05, 0.3, 0.7, 0.95, 0.999])
def test_side_faces_are_not_touched_from_above(shift: float) -> None:
    """Overlapping by 1e-6: 0.05 and more inside the side plane, but just below the top."""
    _, found = contacts_of(rigid_box("a", (1, 1, 1), (0, 0, 0), 1.0), rigid_box("b", (1, 1, 1), (shift, 0, 1 - 1e-6), 1.0))
    assert_allclose(np.abs(found.frame[:, 0, 2]), 1)
    assert_allclose(found.gap, -1e-6)
    assert len(found) == 4


def test_a_running_bond_has_no_contact_across_a_course() -> None:
    """Bottom corners of a brick were paired with the top of its neighbour, 0.175 m above them."""
    bricks = [rigid_box(f"{k} {i}", (0.3, 0.1, 0.175), (0.3 * i + 0.15 * (k % 2), 0, 0.175 * k), 1.0) for k in range(4) for i in range(3)]
    _, found = contacts_of(*bricks)
    assert_allclose(found.gap, 0, atol=1e-12)
    course = found.bodies // 3
    level = np.abs(found.frame[:, 0, 2]) > 0.5
    assert np.all(np.abs(np.diff(course[level], axis=1)) == 1) and np.all(np.diff(course[~level], axis=1) == 0)
    assert (~level).sum() == 4 * 4 * 2 and level.sum() == 4 * 3 * 5


def l_shape(name: str) -> RigidBody:
    """An L of unit thickness made of an extruded polygon, its inner corner at the origin, concave."""
    outline = np.array([(-1, -1), (2, -1), (2, 0), (0, 0), (0, 2), (-1, 2)], dtype=float)
    points = np.concatenate([np.column_stack([outline[:, 0], np.full(6, y), outline[:, 1]]) for y in (-1.0, 1.0)])
    walls = np.array([[k, k + 6, (k + 1) % 6 + 6, (k + 1) % 6] for k in range(6)])
    front = np.array([(0, 1, 2, 3), (0, 3, 4, 5)])
    body = {"walls": walls, "front": front, "back": front[:, ::-1] + 6}
    return RigidBody(name, 1.0, np.eye(3), np.zeros(3), points, body)


@pytest.mark.parametrize("depth", [0.0, 1e-5, -1e-4])
def test_an_inner_corner_holds_from_two_sides(depth: float) -> None:
    """A box in the inner corner of an L touches floor and wall, each along its face."""
    box = rigid_box("box", (0.4, 0.4, 0.4), (0.2 - depth, 0, 0.2 - depth), 1.0)
    _, found = contacts_of(l_shape("L"), box, alert=1e-3)
    normal = found.frame[:, 0] * np.where(found.bodies[:, :1] == 1, 1, -1)
    floor, wall = (np.abs(normal @ axis - 1) < 1e-9 for axis in ([0, 0, 1], [1, 0, 0]))
    assert floor.sum() == 4 and wall.sum() == 4 and len(found) == 8
    assert_allclose(found.gap, -depth, atol=1e-12)


def test_an_inner_corner_in_two_dimensions() -> None:
    outline = np.array([(-1, -1), (2, -1), (2, 0), (0, 0), (0, 2), (-1, 2)], dtype=float)
    segments = np.column_stack([np.arange(6), (np.arange(6) + 1) % 6])
    corner = RigidBody("L", 1.0, np.eye(1), np.zeros(2), outline, {"all": segments})
    for depth in (0.0, 1e-5, -1e-4):
        box = rigid_rectangle("box", (0.4, 0.4), (0.2 - depth, 0.2 - depth), 1.0)
        _, found = contacts_of(corner, box, alert=1e-3)
        normal = found.frame[:, 0] * np.where(found.bodies[:, :1] == 1, 1, -1)
        assert_allclose(normal[np.argsort(normal[:, 0])], [[0, 1], [0, 1], [1, 0], [1, 0]], atol=1e-12)
        assert_allclose(found.gap, -depth, atol=1e-12)


def test_a_body_inside_a_hollow_of_another_is_outside() -> None:
    """A slot: what stands in it does not touch its roof's upper side through the roof, nor its far walls."""
    box = rigid_box("box", (0.5, 0.5, 0.5), (0.5, 0, 0.3), 1.0)
    assert len(contacts_of(l_shape("L"), box, alert=1e-3)[1]) == 0


@pytest.mark.parametrize("facets", [12, 40])
def test_a_polygon_rolls_with_a_continuous_normal(facets: int) -> None:
    """A vertex over the edges of a finely faceted cylinder: gap and normal follow the wedge between faces without a jump."""
    angle = 2 * np.pi * (np.arange(facets) + 0.5) / facets
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    drum = RigidBody(
        "drum", 1.0, np.eye(1), np.zeros(2), ring, {"all": np.column_stack([np.arange(facets), (np.arange(facets) + 1) % facets])}
    )
    tip = RigidBody("tip", 1.0, np.eye(1), np.zeros(2), np.array([(0, 0), (0.1, 1), (-0.1, 1)], float), {"all": [(0, 1), (1, 2), (2, 0)]})
    model = build_model([drum, tip])
    everything, gaps, normals = Everything(model, 0.5, alert=0.05), [], []
    for place in np.linspace(-0.3, 0.3, 601):
        x = model.reference.copy()
        x[facets:] += [np.sin(place), np.cos(place) + 0.01]
        found = everything(x)
        found = found.take((found.bodies[:, 0] == 1) & (np.argmax(found.weights, axis=1) == 0) & (found.nodes[:, 0] == facets))
        assert len(found) == 1
        gaps.append(found.gap[0])
        normals.append(found.frame[0, 0])
    assert np.abs(np.diff(gaps)).max() < 0.6 / 600 * 2 * np.pi / facets
    assert np.abs(np.diff(normals, axis=0)).max() < 1.05 * 1e-3 / 0.01  # the way of a step over the least distance from an edge


def test_friction_by_names() -> None:
    bodies = [rigid_box(name, (1, 1, 1), (0, 0, k), 1.0) for k, name in enumerate(("floor", "low", "top"))]
    model = build_model(bodies)

    def mus(mu) -> dict[tuple[int, int], float]:
        found = Everything(model, mu)(model.reference)
        return {(min(pair), max(pair)): value for pair, value in zip(found.bodies.tolist(), found.mu, strict=True)}

    assert mus(0.3) == {(0, 1): 0.3, (1, 2): 0.3}
    assert mus({("low", "floor"): 0.1, ("*", "top"): 0.2}) == {(0, 1): 0.1, (1, 2): 0.2}
    assert mus({("floor", "*"): 0.1, ("*", "low"): 0.1, ("floor", "low"): 0.4}) == {(0, 1): 0.4, (1, 2): 0.1}
    assert mus({("floor", "*"): 0.1, ("*", "*"): 0.7}) == {(0, 1): 0.1, (1, 2): 0.7}
    assert mus(lambda one, other: 0.9 if "floor" in (one, other) else 0.0) == {(0, 1): 0.9, (1, 2): 0.0}


@pytest.mark.parametrize(
    ("mu", "message"),
    [
        (-0.1, "friction coefficient >= 0, got -0.1"),
        (np.nan, "friction coefficient"),
        ("rough", "friction coefficient >= 0, got 'rough'"),
        ({("low", "flor"): 0.1}, "'flor'"),
        ({"low": 0.1}, "pairs of body names"),
        ({("low", "floor"): -1}, ">= 0, got -1"),
        ({("low", "low"): 0.1}, r"an entry for the bodies 'floor' and 'low'"),
        (lambda one, other: None, "got None"),
        (lambda names: 0.3, r"a function of two names of bodies, got one of \(names\)"),
        ({("low", "floor"): 0.1, ("floor", "low"): 0.3}, "one number for 'low' and 'floor', got 0.1 and 0.3"),
        ({("low", "*"): 0.1, ("*", "floor"): 0.3, ("*", "*"): 0.5}, r"touch: expected one number, got 0.3 of \('\*', 'floor'\) and 0.1 of"),
    ],
)
def test_wrong_friction(mu, message: str) -> None:
    bodies = [rigid_box(name, (1, 1, 1), (0, 0, k), 1.0) for k, name in enumerate(("floor", "low"))]
    with pytest.raises(InputError, match=message):
        contacts_of(*bodies, mu=mu)


def test_excluded_and_held_pairs_do_not_touch() -> None:
    bodies = [rigid_box(name, (1, 1, 1), (0, 0, k), 1.0) for k, name in enumerate("abc")]
    model = build_model(bodies, supports=[Support(name, ("x", "y", "z", "rx", "ry", "rz")) for name in "ab"])
    assert {tuple(sorted(pair)) for pair in Everything(model, 0.5)(model.reference).bodies.tolist()} == {(1, 2)}
    assert len(Everything(model, 0.5, exclude=[("c", "b")])(model.reference)) == 0
    with pytest.raises(InputError, match="'d'"):
        Everything(model, 0.5, exclude=[("c", "d")])
    for exclude in (("a", "b"), "abc", [("a", "b", "c")], [("a",)]):
        with pytest.raises(InputError, match="exclude: expected pairs of names of bodies"):
            Everything(model, 0.5, exclude=exclude)  # type: ignore[arg-type]


def test_surfaces_that_do_not_enclose_a_body_are_refused() -> None:
    box = rigid_box("box", (1, 1, 1), (0, 0, 0), 1.0)
    opened = with_surfaces(box, {name: facets for name, facets in box.surfaces.items() if name != "z+"})
    inverted = with_surfaces(box, {name: facets[:, ::-1] for name, facets in box.surfaces.items()})
    mixed = with_surfaces(box, {name: facets[:, ::-1] if name == "z+" else facets for name, facets in box.surfaces.items()})
    flat = with_surfaces(box, {})
    for body, message in ((opened, "closed surface.*open: 4 edges"), (inverted, "inside out"), (mixed, "disagree"), (flat, "got none")):
        with pytest.raises(InputError, match=f"'box'.*{message}"):
            contacts_of(body)


def test_a_surface_named_twice_or_read_triangle_by_triangle_counts_once() -> None:
    box = rigid_box("box", (1, 1, 1), (0, 0, 1), 1.0)
    floor = rigid_box("floor", (3, 3, 1), (0, 0, 0), 1.0)
    _, expected = contacts_of(box, floor)
    _, twice = contacts_of(with_surfaces(box, {**box.surfaces, "bottom": box.surfaces["z-"]}), floor)
    assert_allclose(twice.point, expected.point)
    quads = np.concatenate(list(box.surfaces.values()))
    soup = np.concatenate([box.points[quads[:, [0, 1, 2]]], box.points[quads[:, [0, 2, 3]]]]).reshape(-1, 3)
    loose = RigidBody("box", 1.0, np.eye(3), box.centre, soup, {"all": np.arange(len(soup)).reshape(-1, 3)})
    _, found = contacts_of(loose, floor)
    assert_allclose(np.sort(found.point, axis=0), np.sort(expected.point, axis=0))


def test_wrong_input() -> None:
    model = build_model([rigid_box("a", (1, 1, 1), (0, 0, 0), 1.0)])
    everything = Everything(model, 0.5)
    for x, message in ((np.zeros((3, 3)), r"expected shape \(8, 3\)"), (np.full((8, 3), np.nan), "finite")):
        with pytest.raises(InputError, match=message):
            everything(x)
        with pytest.raises(InputError, match=message):
            everything(model.reference, x)
    for alert in (0.0, -1.0, np.nan, np.inf, "1e-3"):
        with pytest.raises(InputError, match="Everything, alert: expected a distance > 0"):
            Everything(model, 0.5, alert=alert)  # type: ignore[arg-type]
    assert len(everything(model.reference)) == 0


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_what_is_met_on_the_way(scale: float) -> None:
    """A corner, a crossing edge and a small fast body against a thin plate; what passes beside or stays short is not found."""
    plate, small = (
        rigid_box("plate", np.array([1, 1, 0.01]) * scale, (0, 0, 0), 1.0),
        rigid_box("small", np.full(3, 0.05) * scale, (0, 0, scale), 1.0),
    )
    model = build_model([plate, small])
    everything, way = Everything(model, 0.5), np.zeros((16, 3))
    assert len(everything(model.reference, way)) == 0
    way[8:] = np.array([0.2, 0.1, -5.0]) * scale
    found = everything(model.reference, way)
    assert len(found) == 4
    assert_allclose(np.abs(found.frame[:, 0, 2]), 1)
    assert_allclose(found.gap, 0.97 * scale)
    way[8:] = np.array([8.0, 0.0, -1.0]) * scale  # beside the plate by then
    assert len(everything(model.reference, way)) == 0
    way[8:] = np.array([0.0, 0.0, -0.9]) * scale
    assert len(everything(model.reference, way)) == 0
    with pytest.raises(InputError, match="shorten the step"):
        way[8:] = np.array([0.0, 0.0, -50.0]) * scale
        everything(model.reference, way)


def test_the_same_twice_and_identity_that_stays() -> None:
    """No state; and what moves by less than a contact's facet keeps its number."""
    part = brick("brick", (0.2, 0.1, 0.1), (4, 2, 2), STONE)
    model = build_model([rigid_box("floor", (1, 1, 1), (0.0, 0.0, -0.5), 1.0), Body("b", part, translation=(0.013, 0.027, 0.0))])
    everything = Everything(model, 0.5)
    first, again = everything(model.reference), everything(model.reference)
    moved = model.reference.copy()
    moved[: len(part.points)] += [3e-3, 1e-3, 1e-7]
    later = everything(moved)
    assert np.array_equal(first.identity, again.identity) and np.array_equal(first.gap, again.gap)
    assert np.array_equal(first.identity, later.identity)


@pytest.mark.parametrize("degrees", [0.06, 0.2, 1.0, 1.9, 3.0, 10.0])
@pytest.mark.parametrize("gap", [1e-5, -1e-5])
def test_shallow_ridges_that_cross_hold_each_other(degrees: float, gap: float) -> None:
    """Two roofs whose faces meet at `degrees`, ridge across ridge: nearest, or deepest, where the ridges cross, by the gap set."""

    def roof(name: str, up: float, across: bool) -> RigidBody:
        fall = 0.1 * np.tan(np.deg2rad(degrees) / 2)
        section = [(-0.1, -0.1 - fall), (0.1, -0.1 - fall), (-0.1, -fall), (0.1, -fall), (0.0, 0.0)]
        points = np.array([(x, y, up * z) for x in (-0.5, 0.5) for y, z in section])
        return rigid_polyhedron(name, points[:, [1, 0, 2]] if across else points, 1000.0)

    model = build_model([roof("lower", 1.0, False), roof("upper", -1.0, True)])
    positions = model.reference.copy()
    positions[model.node_offset[1] :, 2] += gap
    found = Everything(model, 0.5)(positions)
    nearest = int(np.argmin(found.gap))
    assert found.gap[nearest] == pytest.approx(gap, rel=1e-3)
    assert np.abs(found.point[nearest]).max() < 1e-4
    assert abs(found.frame[nearest, 0, 2]) > np.cos(np.deg2rad(degrees))
    assert np.sort(found.gap)[1:].min(initial=1.0) > 0


def hinge(degrees: float, overlap: float, kind: str = "deformable") -> tuple[Everything, np.ndarray]:
    """Two blocks of equal depth, the upper one opened by an angle about the edge of the lower one, their ends flush; it overlaps the lower
    one by that share of a block, both ways."""
    part = brick("block", (0.2, 0.3, 0.2), (1, 1, 1), Material(1e9, 0.2, 2000.0))
    box = rigid_box("lower", (0.2, 0.3, 0.2), (0.1, 0.15, 0.1), 1.0)
    upper = RigidBody("upper", 1.0, box.inertia, box.centre, box.points, box.surfaces)
    model = build_model([Body("lower", part), Body("upper", part)] if kind == "deformable" else [box, upper])
    x = model.reference.copy()
    R = Rotation.from_euler("y", -degrees, degrees=True).as_matrix()
    x[8:] = x[8:] @ R.T + np.array([0.2, 0.0, 0.2]) - overlap * 0.2 * np.array([1.0, 0.0, 1.0])
    return Everything(model, 0.5), x


@pytest.mark.parametrize("degrees", [20.0, 40.0, 50.0, 55.0, 65.0, 75.0])
@pytest.mark.parametrize("overlap", [1e-3, 1e-4, 2e-5])
def test_elastic_blocks_that_overlap_with_parallel_edges_hold_each_other(degrees: float, overlap: float) -> None:
    """The edge of a turned block of the same depth, its ends flush, within that of another by so little that elastic bodies count it as
    on the rim: in a hinge that has opened wide nothing held there, and voussoirs went into each other by 1e-3 of their size."""
    everything, x = hinge(degrees, overlap)
    assert -1.5 * overlap * 0.2 < everything(x).gap.min(initial=0.0) < -0.5 * overlap * 0.2


@pytest.mark.parametrize("kind", ["deformable", "rigid"])
def test_a_corner_that_passes_another_one_slowly_is_held_where_it_would_enter(kind: str) -> None:
    """In a hinge that has opened wide nothing holds while the corners merely meet. A step that carries one into the other finds it on its
    way, however slow; one past it or away from it is not hindered."""
    everything, x = hinge(25.0, 0.0, kind)
    way = np.zeros_like(x)
    assert len(everything(x)) == 0
    for share in (2e-4, 2e-3):
        way[8:] = -share * 0.2 * np.array([0.6, 0.0, 0.8])
        found = everything(x, way)
        assert len(found) >= 2
        assert_allclose(found.gap, 0.0, atol=1e-12)
        for past in ([0.9, 0.0, 1.1], [1.0, 0.0, -0.5], [-0.5, 0.0, 1.0]):
            way[8:] = share * 0.2 * np.array(past)
            found = everything(x, way)
            opens = np.einsum("ak,akd,ad->a", np.where(found.nodes < 0, 0.0, found.weights), way[found.nodes], found.frame[:, 0])
            assert np.all(found.gap + opens >= 0)
