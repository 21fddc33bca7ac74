"""Normals over facets that stand for a curved surface: continuous, and those of the surface; none changed on flat faces and real edges."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Contacts, Everything
from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from tests.unit.contact_detection.general.strips import arc, strip

STONE = Material(1e9, 0.2, 2000.0)


def drum(facets: int) -> RigidBody:
    angle = 2 * np.pi * np.arange(facets) / facets
    rim = np.column_stack([np.arange(facets), (np.arange(facets) + 1) % facets])
    return RigidBody("drum", 1.0, np.eye(1), np.zeros(2), np.column_stack([np.cos(angle), np.sin(angle)]), {"rim": rim})


def tip(name: str = "tip") -> RigidBody:
    return RigidBody(name, 1.0, np.eye(1), np.zeros(2), np.array([(0, 0), (0.3, 1), (-0.3, 1)], float), {"all": [(0, 1), (1, 2), (2, 0)]})


def slid_over(facets: int, curved: list[str], height: float) -> list[Contacts]:
    """The tip's contacts where it slides over a regular polygon at this height above it, or, where it is curved, above its circle."""
    model = build_model([drum(facets), tip()])
    everything, found = Everything(model, 0.5, alert=0.01, curved=curved), []
    half = np.pi / facets
    for angle in np.linspace(np.pi / 2 - 0.5, np.pi / 2 + 0.5, 801):
        x = model.reference.copy()
        radius = 1.0 if curved else np.cos(half) / np.cos((angle % (2 * half)) - half)
        x[facets:] += (radius + height) * np.array([np.cos(angle), np.sin(angle)])
        contacts = everything(x)
        found.append(contacts.take(contacts.nodes[:, 0] == facets))
    return found


@pytest.mark.each_value
@pytest.mark.parametrize("facets", [9, 16, 60])
@pytest.mark.parametrize("height", [1e-7, -1e-7])
def test_a_tip_sliding_over_a_polygon_meets_the_normals_of_the_circle(facets: int, height: float) -> None:
    """Interpolated radii along a chord point to the centre exactly, and the gap is that of the circle to a hundredth of its height over the
    chord; a polygon's own normals jump by the angle between its sides."""
    found = slid_over(facets, ["drum"], height)
    assert all(len(contacts) == 1 for contacts in found)
    normal = np.array([contacts.frame[0, 0] for contacts in found])
    foot = np.array([contacts.point[0] for contacts in found])
    assert_allclose(normal, foot / np.linalg.norm(foot, axis=1)[:, None], atol=1e-9)
    gap = np.array([contacts.gap[0] for contacts in found])
    half = np.pi / facets
    assert_allclose(gap, height, atol=0.5 * half**2 * (1 - np.cos(half)))
    own = np.array([contacts.frame[0, 0] for contacts in slid_over(facets, [], height)])
    jumps = [np.linalg.norm(np.diff(normals, axis=0), axis=1).max() for normals in (normal, own)]
    assert jumps[0] < 4 / 800 and jumps[1] > np.pi / facets


def test_a_curved_deformable_body_is_smoothed_by_itself_and_its_ends_are_not() -> None:
    """A tube of 24 sides touched by the corners of small boxes: radial normals on its side, axial ones on its end."""
    part = strip("tube", *(a[:-1] for a in arc(1.0, 0, 2 * np.pi, 24)), 0.3, 2, STONE, closed=True, width=0.5)
    outer = 1.15
    bodies: list = [Body("tube", part)]
    for k, (angle, z) in enumerate([(0.1, 0.25), (1.0, 0.1), (2.5, 0.499), (4.0, 0.3)]):
        chord = outer * np.cos(np.pi / 24) / np.cos((angle % (np.pi / 12)) - np.pi / 24)
        shape = rigid_box(f"box {k}", (0.1, 0.1, 0.1), (0, 0, 0), 1.0)
        out, side = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        turn = np.column_stack([(out + side) / np.sqrt(2), (side - out) / np.sqrt(2), [0, 0, 1]])
        centre = (chord + 0.05 * np.sqrt(2) + 1e-6) * out + [0, 0, z + 0.05]
        bodies.append(RigidBody(shape.name, 1.0, shape.inertia, centre, shape.points @ turn.T + centre, shape.surfaces))
    bodies.append(rigid_box("lid", (0.3, 0.3, 0.1), (1.0, 0.0, 0.55), 1.0))
    model = build_model(bodies)
    found = Everything(model, 0.5, alert=1e-4)(model.reference)
    normal = found.frame[:, 0] * np.where(found.bodies[:, :1] == 0, -1, 1)
    lid = (found.bodies == 5).any(axis=1)
    assert_allclose(normal[lid], np.tile([0, 0, 1.0], (lid.sum(), 1)), atol=1e-12)
    on_side = ~lid & (found.bodies[:, 1] == 0) & ((found.nodes >= 0).sum(axis=1) > 2)
    assert on_side.sum() >= 4
    radial = found.point[on_side] * [1, 1, 0]
    assert_allclose(normal[on_side], radial / np.linalg.norm(radial, axis=1)[:, None], atol=1e-6)
    own = Everything(model, 0.5, alert=1e-4, smooth=False)(model.reference)
    angle = np.degrees(np.arctan2(own.frame[:, 0, 1], own.frame[:, 0, 0]))[on_side]
    assert_allclose(angle % 15.0, 7.5, atol=1e-6)  # of sides of 15 degrees, in their middles


def test_flat_faces_and_real_edges_stay() -> None:
    """Two bricks on each other: on a flat side the normals are the side's, to round-off."""
    part = brick("brick", (0.2, 0.1, 0.1), (4, 2, 2), STONE)
    model = build_model([Body("lower", part), Body("upper", part, translation=(0.05, 0.02, 0.1))])
    found = Everything(model, 0.5)(model.reference)
    assert_allclose(np.abs(found.frame[:, 0, 2]), 1, atol=1e-15)


@pytest.mark.parametrize(("curved", "message"), [("drum", "several names"), (["dram"], "dram")])
def test_wrong_names(curved, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Everything(build_model([drum(9), tip()]), 0.5, curved=curved)


@pytest.mark.parametrize("aside", [0.0, 1e-17, -1e-17, 1e-12, -1e-12, 1e-7, -1e-7])
@pytest.mark.parametrize("kind", ["rigid", "deformable"])
def test_a_node_above_a_joint_of_two_bodies_is_held_by_one_or_both(kind: str, aside: float) -> None:
    """Wherever round-off puts it, the node has a contact, normals are the floor's and gaps are what they are."""
    floors = [rigid_box(name, (1, 1, 1), (x, 0, -0.5), 1.0) for name, x in (("left", -0.5), ("right", 0.5))]
    block: Body | RigidBody
    if kind == "rigid":
        block = rigid_box("block", (0.4, 0.2, 0.2), (0.1 + aside, 0, 0.1 + 1e-6), 1.0, divisions=(4, 2, 2))
    else:
        block = Body("block", brick("block", (0.4, 0.2, 0.2), (4, 2, 2), STONE), translation=(aside - 0.1, -0.1, 1e-6))
    model = build_model([*floors, block])
    found = Everything(model, 0.5, alert=1e-3, exclude=[("left", "right")])(model.reference)
    assert_allclose(np.abs(found.frame[:, 0, 2]), 1, atol=1e-12)
    assert_allclose(found.gap, 1e-6, atol=1e-12)
    places = np.unique(np.round(found.point[:, :2] - [aside, 0], 6), axis=0)
    assert {tuple(place) for place in places} >= {(x, y) for x in (-0.1, 0.0, 0.1, 0.2, 0.3) for y in (-0.1, 0.1)}


def test_smooth_is_a_switch() -> None:
    with pytest.raises(InputError, match="smooth: expected True or False, got 'no'"):
        Everything(build_model([drum(9), tip()]), 0.5, smooth="no")  # type: ignore[arg-type]


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize(("profile", "curved"), [((0, 1, 0, 1, 0), False), ((0, 0, 1, 2, 3), False), ((0, 3, 4, 3, 0), True)])
def test_ridges_and_teeth_of_flat_faces_are_no_curve(cell: str, profile: tuple[int, ...], curved: bool) -> None:
    """The top of a block of four strips: teeth and a ramp are flat faces, each its own; strips of a barrel are a curve."""
    part = brick("block", (4.0, 2.0, 1.0), (4, 2, 1), STONE, cell=cell)
    points = part.points.copy()
    points[:, 2] += 0.1 * points[:, 2] * np.asarray(profile)[np.round(points[:, 0]).astype(int)]
    everything = Everything(build_model([Body("block", replace(part, points=points))]), 0.5)
    patch = everything.skin.patch[everything.reference_normals[:, 2] > 0.8]
    flats = 1 + np.count_nonzero(np.diff(profile, 2))
    assert len(np.unique(patch)) == (1 if curved else flats)


@pytest.mark.parametrize("around", [18, 40])
@pytest.mark.parametrize("turn", [0.0, 0.1])
def test_the_rim_of_a_flat_end_lies_in_its_plane(around: int, turn: float) -> None:
    """The end of a coarse tube on a bar whose edges cross its rims: they touch without gap or overlap, as flat faces do, though the side's
    facets are chords of a circle and up to 1.5 % of the radius below it."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([np.column_stack([r * ring, np.full(around, z)]) for z in (0.0, 0.5) for r in (0.6, 1.0)])
    i, j = np.arange(around), np.roll(np.arange(around), -1)
    side = np.column_stack([i, around + i, around + j, j])
    part = Part("tube", points, np.hstack([side, 2 * around + side]), "hexahedron", {}, STONE)
    c, s = np.cos(turn), np.sin(turn)
    tube = Body("tube", part, [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    model = build_model([rigid_box("bar", (4.0, 0.5, 0.3), (0.0, 0.0, -0.15), 1.0), tube])
    everything = Everything(model, 0.5)
    found = everything(model.reference)
    assert everything.bulge is not None and len(found) >= 16
    assert_allclose(found.frame[:, 0], np.tile([0.0, 0.0, 1.0], (len(found), 1)), atol=1e-12)
    assert_allclose(found.gap, 0.0, atol=1e-12)
