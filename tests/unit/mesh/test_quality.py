"""Volumes, shape measure and refusals, against solids whose numbers are known from geometry."""

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.blocks import brick
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.facets import match_facets, orient_facets
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part
from fcsim.mesh.quality import cell_volumes, check_quality, scaled_jacobian

MATERIAL = Material(E=1e9, nu=0.2, density=2000)
SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
CUBE = np.array([(*p, z) for z in (0, 1) for p in SQUARE])
TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)[[0, 2, 1, 3]]  # regular, edge sqrt(8)
TRIANGLE = np.array([(0, 0), (1, 0), (0.5, np.sqrt(3) / 2)])
IDEAL = {"quadrilateral": SQUARE, "hexahedron": CUBE, "tetrahedron": TETRAHEDRON, "triangle": TRIANGLE}


def one(points):
    return np.arange(len(points))[None]


def swapped_brick(cell, element, a, b):
    """A good brick in which two nodes of one element have changed places, in that element alone."""
    part = brick("wrong", (2, 1, 1), (4, 2, 2), MATERIAL, cell)
    cells = part.cells.copy()
    cells[element, [a, b]] = cells[element, [b, a]]
    return Part("wrong", part.points, cells, cell, {}, MATERIAL)


@pytest.mark.parametrize("cell", IDEAL)
def test_ideal_cells_measure_one_and_their_mirror_images_minus_one(cell):
    points = IDEAL[cell]
    assert scaled_jacobian(points, one(points), cell) == pytest.approx(1, abs=1e-14)
    assert scaled_jacobian(points * ([-1] + [1] * (points.shape[1] - 1)), one(points), cell) == pytest.approx(-1, abs=1e-14)


@pytest.mark.parametrize(
    ("cell", "volume"), [("quadrilateral", 1), ("hexahedron", 1), ("tetrahedron", 8 / 3), ("triangle", np.sqrt(3) / 4)]
)
def test_volumes_follow_the_determinant_of_an_affine_map(cell, volume):
    points = IDEAL[cell]  # regular tetrahedron of edge a: a^3 / (6 sqrt 2) = 8/3
    d = points.shape[1]
    A = np.array([[2, 0.3, 0.1], [0.2, 1.5, 0.4], [-0.1, 0.2, 0.7]])[:d, :d]
    assert cell_volumes(points @ A.T + 1e3, one(points), cell) == pytest.approx(volume * np.linalg.det(A), rel=1e-9)


def test_volume_of_a_frustum_is_exact():
    points = CUBE * [2, 2, 3]
    points[4:, :2] = points[4:, :2] / 2 + 0.5
    assert cell_volumes(points, one(points), "hexahedron") == pytest.approx(3 / 3 * (4 + 1 + 2), rel=1e-14)  # h/3 (A + B + sqrt(A B))


def test_scaled_jacobian_of_a_rhombus_is_the_sine_of_its_angle():
    angle = np.radians(25)
    points = np.array([(0, 0), (1, 0), (1 + np.cos(angle), np.sin(angle)), (np.cos(angle), np.sin(angle))])
    assert scaled_jacobian(points, one(points), "quadrilateral") == pytest.approx(np.sin(angle))


def test_flat_boxes_are_good_elements():
    assert scaled_jacobian(CUBE * [1, 1, 1e-3], one(CUBE), "hexahedron") == pytest.approx(1)


def test_a_hexahedron_inverted_inside_only_is_found():
    """A corner pulled through the opposite ones: its own Jacobian is negative, those of the bottom face stay positive."""
    points = CUBE.copy()
    points[6] = (0.2, 0.2, 0.2)
    assert scaled_jacobian(points, one(points), "hexahedron") < 0


@pytest.mark.parametrize(("cell", "a", "b"), [("hexahedron", 0, 1), ("hexahedron", 2, 6), ("tetrahedron", 1, 2)])
def test_an_inverted_element_is_refused_by_number(cell, a, b):
    with pytest.raises(InputError, match=r"Part 'wrong'.* 1 of \d+ below, 1 of them inverted: elements 7; the worst is -.* at element 7"):
        check_quality(swapped_brick(cell, 7, a, b))


def test_many_inverted_elements_are_counted_and_the_first_listed():
    part = brick("wrong", (2, 1, 1), (4, 2, 2), MATERIAL)
    with pytest.raises(InputError, match=r"got 16 of 16 below, 16 of them inverted: elements 0, 1, 2, 3, 4, \.\.\.;"):
        check_quality(Part("wrong", part.points * [1, 1, -1], part.cells, "hexahedron", {}, MATERIAL))


@pytest.mark.parametrize("cell", IDEAL)
def test_a_collapsed_element_is_refused(cell):
    points = IDEAL[cell].copy()
    points[-1] = points[0]
    with pytest.raises(InputError, match=r"got 1 of 1 below.*elements 0"):
        check_quality(Part("flat", points, one(points), cell, {}, MATERIAL))


def test_the_limit_is_an_argument():
    points = CUBE.copy()
    points[4:, 0] += 100  # sheared: 1 / sqrt(1 + 100^2) = 0.0100
    part = Part("sheared", points, one(points), "hexahedron", {}, MATERIAL)
    assert check_quality(part) == pytest.approx(1 / np.sqrt(1 + 100**2))
    with pytest.raises(InputError, match="0 of them inverted"):
        check_quality(part, smallest=0.02)


def test_unused_nodes_are_refused():
    with pytest.raises(InputError, match=r"Part 'loose'.*1 of 9 unused: nodes 8"):
        Part("loose", np.vstack((CUBE, [(9, 9, 9)])), one(CUBE), "hexahedron", {}, MATERIAL)


SQUARE = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)])


@pytest.mark.parametrize(
    ("points", "cells", "said"),
    [
        (SQUARE, [[0, 1, 3, 2]], "got 1 of 1 below"),  # a bow tie
        (SQUARE, [[3, 2, 1, 0]], "1 of them inverted"),
        (SQUARE, [[0, 1, 2, 2]], "got 1 of 1 below"),  # a node repeated
        (SQUARE, [[0, 1, 2, 3], [1, 2, 3, 0]], "expected each element once, got 1 repeated"),
        (1e200 * SQUARE, [[0, 1, 2, 3]], "got 1 of 1 below"),  # products beyond the largest number
        (SQUARE[[0, 1, 2, 3, 0]], [[0, 1, 2, 3]], "1 of 5 unused: nodes 4"),
    ],
)
def test_parts_made_in_python_are_checked_as_those_of_files(points, cells, said):
    with pytest.raises(InputError, match=f"Part 'made'.*{said}"):
        Part("made", points, np.array(cells), "quadrilateral", {}, MATERIAL)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e3, 1e9])
def test_any_unit_of_length_will_do(size):
    Part("made", size * SQUARE, np.array([[0, 1, 2, 3]]), "quadrilateral", {}, MATERIAL)


@pytest.mark.parametrize("cell", IDEAL)
def test_the_facets_of_a_cell_close_it_outwards(cell):
    """Outward area vectors sum to zero, and sum(x . n A) = d V."""
    points = IDEAL[cell]
    facets = points[CELL_TYPES[cell].facets]
    if points.shape[1] == 2:
        t = facets[:, 1] - facets[:, 0]
        normals = np.stack((t[:, 1], -t[:, 0]), axis=1)
    else:
        normals = np.cross(facets[:, 2] - facets[:, 0], facets[:, -1] - facets[:, 1]) / 2  # for a triangle: its edges 02 and 12
    assert normals.sum(axis=0) == pytest.approx(0, abs=1e-14)
    assert np.sum(facets.mean(axis=1) * normals) / points.shape[1] == pytest.approx(cell_volumes(points, one(points), cell)[0])


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_facets_in_any_order_come_back_outwards_with_the_same_first_node(cell):
    part = brick("b", (2, 1, 1), (4, 2, 2), MATERIAL, cell)
    right = part.surfaces["x+"]
    assert np.array_equal(orient_facets(part.cells, cell, right), right)
    turned = np.roll(right, 1, axis=1)
    assert np.array_equal(orient_facets(part.cells, cell, turned), turned)
    inward = right[:, [0, *range(right.shape[1] - 1, 0, -1)]]
    assert np.array_equal(orient_facets(part.cells, cell, inward), right)


def test_facets_inside_outside_or_repeated_are_refused():
    part = brick("b", (2, 1, 1), (2, 1, 1), MATERIAL)
    middle = np.flatnonzero(part.points[:, 0] == 1)[None]
    with pytest.raises(InputError, match=r"surface 'cut'.*1 of 1 that are not.*belongs to 2 cells"):
        orient_facets(part.cells, "hexahedron", middle, "surface 'cut'")
    with pytest.raises(InputError, match="belongs to 0 cells"):
        orient_facets(part.cells, "hexahedron", part.cells[:1, [0, 1, 6, 7]])
    with pytest.raises(InputError, match="come 2 times"):
        orient_facets(part.cells, "hexahedron", np.concatenate((part.surfaces["x-"], np.roll(part.surfaces["x-"], 1, axis=1))))
    assert match_facets(part.cells, "hexahedron", np.concatenate((middle, part.surfaces["y+"])))[0].tolist() == [2, 1, 1]


def test_broken_node_numbers_are_refused():
    with pytest.raises(InputError, match="not whole numbers"):
        Part("b", CUBE, one(CUBE) + 0.5, "hexahedron", {}, MATERIAL)
