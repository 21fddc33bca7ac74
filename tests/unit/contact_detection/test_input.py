"""Bad input is refused where it enters."""

from typing import Any

import numpy as np
import pytest

from fcsim.contact_detection import ContactSurface, Detector, SurfacePair
from fcsim.contact_detection.friction import FrictionTable
from fcsim.errors import InputError
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

SQUARE = ContactSurface(np.array([[0, 1, 2, 3]]), np.array([0]))
LINE = ContactSurface(np.array([[0, 1]]), np.array([0]))
OTHER = ContactSurface(np.array([[4, 5, 6, 7]]), np.array([1]))
POINTS = np.array([[x, y, z] for z in (0.0, 0.1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])


@pytest.mark.parametrize(
    ("facets", "bodies", "message"),
    [
        ([[0, 1, 2, 3, 4]], [0], "2, 3 or 4 nodes"),
        ([[0, 1, 2, 3, 4, 5]], [0], "cut facets of second order at their nodes"),
        ([list(range(8))], [0], "cut facets of second order at their nodes"),
        ([list(range(9))], [0], "cut facets of second order at their nodes"),
        ([[0]], [0], "2, 3 or 4 nodes"),
        ([0, 1, 2], [0], "2 dimension"),
        ([[0.5, 1.0, 2.0]], [0], "integers"),
        ([[0, 1, 2]], [0, 1], "one number for each of 1 facets, got 2"),
        ([[0, 1, 2]], [-1], ">= 0"),
        ([[0, 1, -1]], [0], "4th place"),
        ([[0, 1, 2, -2]], [0], "4th place"),
        ([[0, 1, 2], [2, 3, 4]], [0, 1], "node 2 in facets of several"),
    ],
)
def test_surface(facets: Any, bodies: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ContactSurface(facets, bodies)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mu": -0.1}, "mu >= 0, got -0.1"),
        ({"mu": np.nan}, "mu >= 0"),
        ({"alert": -1e-3}, "alert distance >= 0 in m, got -0.001"),
        ({"alert": np.inf}, "alert distance"),
        ({"candidates": "edges"}, "nodes, faces, gauss, mortar, mortar-faces, segments, got 'edges'"),
        ({"slave": LINE}, "slave 2D, master 3D"),
        ({"master": ("block", "z-")}, r"'joint', master: expected a surface, as contact_surface\(model"),
    ],
)
def test_pair(changes: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {"slave": OTHER, "master": SQUARE, "mu": 0.5, "alert": 0.1, "name": "joint"}
    with pytest.raises(InputError, match=message):
        SurfacePair(**(good | changes))


def test_a_pair_of_surfaces_is_taken_once() -> None:
    """In whatever order its facets are named; two passes, and other candidates, are pairs of their own."""
    twice = ContactSurface(np.array([[0, 1, 2, 3], [2, 1, 8, 9]]), np.array([0, 0]))
    pair = SurfacePair(OTHER, twice, 0.5, 0.2, name="joint")
    again = SurfacePair(OTHER, ContactSurface(twice.facets[::-1], twice.bodies), 0.7, 0.1, name="same joint")
    with pytest.raises(InputError, match=r"'joint' \(pair 0\) again as pair 2"):
        Detector([pair, SurfacePair(twice, OTHER, 0.5, 0.2), again], 10)
    Detector([pair, SurfacePair(twice, OTHER, 0.5, 0.2), SurfacePair(OTHER, twice, 0.5, 0.2, "faces")], 10)


def test_detector() -> None:
    pair = SurfacePair(OTHER, SQUARE, 0.5, 0.2, name="joint")
    with pytest.raises(InputError, match="one or more surface pairs"):
        Detector([], 8)
    with pytest.raises(InputError, match="'joint', slave: expected node numbers below n_nodes = 6, got 7"):
        Detector([pair], 6)
    with pytest.raises(InputError, match="all 2D or all 3D"):
        Detector([pair, SurfacePair(ContactSurface(np.array([[4, 5]]), np.array([1])), LINE, 0.5, 0.2)], 8)
    with pytest.raises(InputError, match="edge_tolerance"):
        Detector([pair], 8, edge_tolerance=-1.0)


def test_positions() -> None:
    detector = Detector([SurfacePair(OTHER, SQUARE, 0.5, 0.2)], 8)
    with pytest.raises(InputError, match=r"expected shape \(8, 3\), got \(7, 3\)"):
        detector(POINTS[:7])
    with pytest.raises(InputError, match="finite"):
        detector(np.where(POINTS == 0.1, np.nan, POINTS))
    with pytest.raises(InputError, match=r"positive area, got area 0 at nodes \[4, 5, 6, 7\]"):
        detector(POINTS * [1, 0, 1])


@pytest.mark.parametrize("cell_type", ["hexahedron20", "quadrilateral8", "wedge"])
def test_parts_of_other_cells(cell_type: str) -> None:
    with pytest.raises(InputError, match=f"expected a cell type among hexahedron, .*triangle6, got '{cell_type}'"):
        Part("part", np.zeros((27, 3)), np.arange(27)[None], cell_type, {}, Material(1.0, 0.0, 1.0))


@pytest.mark.parametrize("rule", ["nodes", "mortar", "segments"])
def test_surfaces_without_facets(rule: Any) -> None:
    empty = ContactSurface(np.empty((0, 4), int), np.empty(0, int))
    for pair in (SurfacePair(OTHER, empty, 0.5, 0.2, rule), SurfacePair(empty, OTHER, 0.5, 0.2, rule)):
        assert len(Detector([pair], 8)(POINTS)) == 0


def test_a_body_named_as_any_body_has_no_table_of_friction() -> None:
    """("*", "floor") would be friction of all bodies on the floor, not that of the one."""
    with pytest.raises(InputError, match=r"mu: expected no body of the name '\*', which stands for any body"):
        FrictionTable({("*", "floor"): 0.5, ("*", "*"): 0.3}, ["*", "floor", "block"])
    assert FrictionTable(0.5, ["*", "floor"])(np.array([[0, 1]])) == 0.5
