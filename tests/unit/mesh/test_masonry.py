"""The running bond: the reference wall's counts, and any other wall's geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fcsim.errors import InputError
from fcsim.mesh.masonry import running_bond
from fcsim.mesh.material import Material
from fcsim.mesh.quality import cell_volumes

MATERIAL = Material(E=2.2e9, nu=0.2, density=2000)


@pytest.fixture(scope="module")
def wall():
    return running_bond(material=MATERIAL)


def test_the_reference_wall_has_12_bodies_of_two_parts_and_7200_dofs(wall):
    parts = {id(body.part): body.part for body in wall.bodies}
    assert len(wall.bodies) == 12
    assert sorted(len(part.cells) for part in parts.values()) == [4 * 4 * 4, 8 * 4 * 4]
    assert sum(len(body.points) for body in wall.bodies) == 2400
    assert sum(body.points.size for body in wall.bodies) == 7200
    assert wall.size == pytest.approx([0.7, 0.1, 0.3])


def test_half_block_first_in_courses_1_and_3_and_last_in_2(wall):
    halves = [body.name for body in wall.bodies if body.part.name == "half block"]
    assert halves == ["course 1 block 1", "course 2 block 4", "course 3 block 1"]
    assert [f"course {c} block {p}" for c, p in zip(wall.course, wall.position, strict=True)] == [body.name for body in wall.bodies]


def test_candidates_of_the_reference_wall_are_224_144_and_320(wall):
    """A candidate at each face centre of the bed and head joints, at each node of the outer faces against the platens."""
    bodies = wall.bodies
    upper = np.unique(wall.bed_joints()[:, 1])
    beds = sum(len(bodies[b].surfaces[wall.bottom]) for b in upper)
    heads = sum(len(bodies[right].surfaces["x-"]) for _, right in wall.head_joints())
    platens = sum(
        len(np.unique(bodies[b].surfaces[surface]))
        for course, surface in ((1, wall.bottom), (3, wall.top))
        for b in wall.bodies_of_course(course)
    )
    assert (beds, heads, platens) == (224, 144, 320)


def test_nodes_of_neighbouring_courses_meet(wall):
    def nodes(course, surface):
        return {
            tuple(np.round(x, 9))
            for b in wall.bodies_of_course(course)
            for x in wall.bodies[b].points[np.unique(wall.bodies[b].surfaces[surface])]
        }

    for course in (1, 2):
        assert nodes(course, wall.top) == nodes(course + 1, wall.bottom)


def test_volume_and_weight_of_the_reference_wall(wall):
    volume = sum(cell_volumes(body.points, body.part.cells, body.part.cell_type).sum() for body in wall.bodies)
    assert volume == pytest.approx(0.7 * 0.1 * 0.3)
    assert volume * 2000 * 9.81 == pytest.approx(412, abs=0.1)  # 30 412 N at the bottom less the 30 000 N of the platen


@settings(max_examples=15, deadline=None)
@given(
    courses=st.integers(1, 5),
    halves=st.integers(2, 9),
    gap=st.sampled_from([0.0, 0.01]),
    size=st.sampled_from([(0.2, 0.1, 0.06), (0.3, 0.1)]),
)
def test_any_wall_fills_its_outline_and_knows_its_joints(courses, halves, gap, size):
    d = len(size)
    wall = running_bond(courses, halves / 2, size, (2, 1, 1)[:d], material=MATERIAL, gap=gap)
    low = np.array([body.points.min(axis=0) for body in wall.bodies])
    high = np.array([body.points.max(axis=0) for body in wall.bodies])
    assert low.min(axis=0) == pytest.approx(0)
    assert high.max(axis=0) == pytest.approx(wall.size)
    for course in range(1, courses + 1):  # flush ends, joints of the given width
        b = wall.bodies_of_course(course)
        assert (low[b[0], 0], high[b[-1], 0]) == pytest.approx((0, wall.size[0]))
        assert low[b[1:], 0] - high[b[:-1], 0] == pytest.approx(gap)

    # All pairs: overlapping in x and one above the other, or at the same height and next to each other.
    over = (np.minimum(high[:, None, 0], high[None, :, 0]) - np.maximum(low[:, None, 0], low[None, :, 0])) > 1e-6
    above = np.isclose(low[None, :, -1] - high[:, None, -1], gap)
    beside = np.isclose(low[None, :, 0] - high[:, None, 0], gap) & np.isclose(low[:, None, -1], low[None, :, -1])
    assert sorted(map(tuple, wall.bed_joints())) == sorted(zip(*np.nonzero(over & above), strict=True))
    assert sorted(map(tuple, wall.head_joints())) == sorted(zip(*np.nonzero(beside), strict=True))


@pytest.mark.parametrize(
    ("size", "divisions", "cell", "top"),
    [
        ((0.2, 0.1, 0.1), (4, 2, 2), "tetrahedron", "z+"),
        ((0.2, 0.1), (4, 2), None, "y+"),
        ((0.2, 0.1), (4, 2), "triangle", "y+"),
    ],
)
def test_other_cells_and_the_plane_wall(size, divisions, cell, top):
    wall = running_bond(2, 3, size, divisions, material=MATERIAL, cell=cell, thickness=0.1, plane="stress")
    assert wall.top == top
    assert {body.part.cell_type for body in wall.bodies} == {cell or "quadrilateral"}
    assert len(wall.bodies) == 3 + 4
    volume = sum(cell_volumes(body.points, body.part.cells, body.part.cell_type).sum() for body in wall.bodies)
    assert volume == pytest.approx(np.prod(wall.size))
    if len(size) == 2:
        assert {(body.part.plane, body.part.thickness) for body in wall.bodies} == {("stress", 0.1)}


def test_a_wall_of_2500_bricks_knows_two_parts():
    wall = running_bond(50, 50, divisions=(2, 1, 1), material=MATERIAL)
    assert len(wall.bodies) == 25 * 50 + 25 * 51
    assert len({id(body.part) for body in wall.bodies}) == 2
    assert len(wall.bed_joints()) == 49 * 100  # each of the 2 x 50 half widths of a course joins one pair


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"divisions": (7, 4, 4)}, "divisions: expected an even number along the length, of which a half block takes half, got 7"),
        ({"divisions": (8, 4)}, "divisions: expected 3 whole numbers"),
        ({"block_size": (0.2,)}, "block_size: expected"),
        ({"blocks": 3.25}, "blocks: expected a multiple of 1/2"),
        ({"blocks": 0.5}, "blocks: expected a multiple of 1/2, >= 1"),
        ({"courses": 0}, "courses: expected a whole number >= 1"),
        ({"gap": -0.01}, "gap: expected 0 <= gap"),
        ({"gap": 0.2}, "gap: expected 0 <= gap"),
        ({"cell": "triangle"}, "'full block', cell: expected 'hexahedron' or 'tetrahedron'"),
    ],
)
def test_wrong_arguments_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        running_bond(**({"material": MATERIAL} | change))


def test_odd_divisions_are_fine_where_no_half_block_is_needed():
    assert len(running_bond(1, 3, divisions=(3, 1, 1), material=MATERIAL).bodies) == 3


def test_courses_that_do_not_exist_are_refused(wall):
    with pytest.raises(InputError, match=r"expected a course 1 \.\.\. 3, got 4"):
        wall.bodies_of_course(4)
