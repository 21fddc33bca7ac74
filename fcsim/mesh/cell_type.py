"""The one table of cells: shapes, orders, nodes, facets, and what gmsh, VTK, meshio and basix call them.

Nodes are in VTK's (= gmsh's for first order) order. Reference cells are [-1, 1]^d, and for simplices the unit simplex with its first
corner in the origin. Shape functions follow from the table alone: the polynomials of the cell that are 1 at one node, 0 at the others.
Cells of second order have the corners of the first-order cell first, then a node in the middle of each edge, of each quadrilateral face
and of the hexahedron (quadrilateral) itself: `middles` says of which corners.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType

import numpy as np

from fcsim.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class CellType:
    """One kind of cell.

    nodes       (k, d) where the nodes stand in the reference cell
    facet_type  name of the facets' kind in this table's vocabulary ("line" in 2D)
    facets      (nf, kf) the cell's facets, outwards for a cell of positive Jacobian: counter-clockwise seen from outside in 3D; in 2D the
                cell lies on the left of (a, b)
    powers      (k, d) exponents of the monomials that span the cell's polynomials
    gmsh, vtk   the programs' numbers of the cell type; meshio, basix: its names
    corners     number of corners, which are the first nodes; facet_corners of a facet
    middles     of the other nodes, the corners between which each lies
    from_gmsh   (k,) place of each node among gmsh's
    inside      (ni, d) where strain is measured: the centre (first order), the points where that of second order is most accurate
    """

    name: str
    order: int
    simplex: bool
    nodes: FloatArray
    facet_type: str
    facets: IntArray
    powers: IntArray
    gmsh: int
    vtk: int
    meshio: str
    basix: str
    middles: tuple[tuple[int, ...], ...]
    from_gmsh: IntArray
    inside: FloatArray

    @property
    def corners(self) -> int:
        return self.size - len(self.middles)

    @property
    def facet_corners(self) -> int:
        return 2 if self.dimension == 2 else 3 if self.simplex else 4

    @property
    def dimension(self) -> int:
        return self.nodes.shape[1]

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def facet_size(self) -> int:
        """Number of nodes of a facet."""
        return self.facets.shape[1]

    @cached_property
    def edges(self) -> IntArray:
        """Local nodes (ne, 2) of the cell's edges: neighbours around its facets, of simplices all pairs of corners; of second order the
        two halves of each."""
        k = self.facet_corners
        ring = self.facets
        if self.order == 2:  # corner, middle, corner, middle, ...
            ring = np.stack([ring[:, :k], ring[:, k : 2 * k]], axis=2).reshape(len(ring), -1) if k > 2 else ring[:, [0, 2, 1]]
        pairs = np.stack([ring[:, :-1], ring[:, 1:]], axis=-1).reshape(-1, 2)
        closing = ring[:, [-1, 0]] if k > 2 else pairs[:0]
        return np.unique(np.sort(np.concatenate([pairs, closing]), axis=1), axis=0)

    @cached_property
    def _coefficients(self) -> FloatArray:
        """(k, k): shape functions = monomials @ coefficients."""
        return np.linalg.inv(_monomials(self.nodes, self.powers))

    def shape(self, at: FloatArray) -> FloatArray:
        """Shape functions (nq, k) at the points `at` (nq, d) of the reference cell."""
        return _monomials(at, self.powers) @ self._coefficients

    def gradient(self, at: FloatArray) -> FloatArray:
        """Derivatives (nq, k, d) of the shape functions by the reference cell's coordinates at the points `at` (nq, d)."""
        columns = []
        for axis in range(self.dimension):
            lower = self.powers.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            columns.append((self.powers[:, axis] * _monomials(at, lower)) @ self._coefficients)
        return np.stack(columns, axis=2)

    @cached_property
    def centre(self) -> FloatArray:
        """Centre (1, d) of the reference cell."""
        return np.full((1, self.dimension), 1 / (self.dimension + 1)) if self.simplex else np.zeros((1, self.dimension))


def _monomials(at: FloatArray, powers: IntArray) -> FloatArray:
    """Products of powers (n, k) of the coordinates `at` (n, d)."""
    return np.prod(at[:, None, :] ** powers, axis=2)


_SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
_CUBE = np.array([(x, y, z) for z in (-1, 1) for x, y in _SQUARE])


def _products(d: int, most: int = 1) -> IntArray:
    """Exponents of all products of powers 0 to `most`."""
    return np.array(list(np.ndindex((most + 1,) * d)))


def _simplex(d: int) -> FloatArray:
    return np.vstack([np.zeros(d), np.eye(d)])


def _cell(
    name: str,
    nodes: FloatArray | IntArray,
    powers: IntArray | FloatArray,
    facet_type: str,
    facets: tuple[tuple[int, ...], ...] | IntArray,
    numbers: tuple[int, int],
    meshio: str,
    *,
    basix: str = "",
    middles: tuple[tuple[int, ...], ...] = (),
    from_gmsh: tuple[int, ...] = (),
) -> CellType:
    at: FloatArray = np.array(nodes, dtype=float)
    size, d = at.shape
    simplex = size - len(middles) == d + 1
    order = 2 if middles else 1
    place = np.array(from_gmsh or range(size))
    arrays = at, np.array(facets), np.array(powers, dtype=np.int64), place, _inside(d, simplex, order)
    for array in arrays:
        array.setflags(write=False)
    return CellType(
        name, order, simplex, arrays[0], facet_type, arrays[1], arrays[2], *numbers, meshio, basix or name, middles, place, arrays[4]
    )


def _inside(d: int, simplex: bool, order: int) -> FloatArray:
    """The centre, or for second order the points of the rules of degree 2 (simplices) and of two Gauss points a direction."""
    if order == 1:
        return np.full((1, d), 1 / (d + 1) if simplex else 0.0)
    if not simplex:
        return np.array(list(product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=d)))
    near = {2: 2 / 3, 3: (5 + 3 * np.sqrt(5)) / 20}[d]
    points = np.full((d + 1, d), (1 - near) / d)
    points[1:] += (near - (1 - near) / d) * np.eye(d)
    return points


def _second_order(
    name: str,
    first: CellType,
    middles: tuple[tuple[int, ...], ...],
    facet_type: str,
    numbers: tuple[int, int],
    meshio: str,
    from_gmsh: tuple[int, ...] = (),
) -> CellType:
    """The cell of second order on the corners of a first-order one; its facets: corners, middles of the edges around, and the face's."""
    nodes = np.concatenate([first.nodes, [first.nodes[list(corners)].mean(axis=0) for corners in middles]])
    place = {frozenset(corners): len(first.nodes) + k for k, corners in enumerate(middles)}
    facets = []
    for facet in first.facets.tolist():
        around = zip(facet, facet[1:] + facet[:1], strict=True) if len(facet) > 2 else [facet]
        face = [place[frozenset(facet)]] if len(facet) == 4 else []
        facets.append(facet + [place[frozenset(edge)] for edge in around] + face)
    d = first.dimension
    powers = _products(d, 2)
    powers = powers[powers.sum(axis=1) <= 2] if first.simplex else powers
    return _cell(
        name, nodes, powers, facet_type, np.array(facets), numbers, meshio, basix=first.basix, middles=middles, from_gmsh=from_gmsh
    )


_HEXAHEDRON = _cell(
    "hexahedron",
    _CUBE,
    _products(3),
    "quadrilateral",
    ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    (5, 12),
    "hexahedron",
)
_TETRAHEDRON = _cell("tetrahedron", _simplex(3), _simplex(3), "triangle", ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)), (4, 10), "tetra")
_QUADRILATERAL = _cell("quadrilateral", _SQUARE, _products(2), "line", ((0, 1), (1, 2), (2, 3), (3, 0)), (3, 9), "quad")
_TRIANGLE = _cell("triangle", _simplex(2), _simplex(2), "line", ((0, 1), (1, 2), (2, 0)), (2, 5), "triangle")
_RING = (0, 1), (1, 2), (2, 3), (3, 0)
_HEXAHEDRON_27 = _second_order(
    "hexahedron27",
    _HEXAHEDRON,
    (
        *(*_RING, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),  # edges
        *((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)),  # faces -x +x -y +y -z +z
        tuple(range(8)),
    ),
    "quadrilateral9",
    (12, 29),
    "hexahedron27",
    from_gmsh=(*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26),
)
_TETRAHEDRON_10 = _second_order(
    "tetrahedron10",
    _TETRAHEDRON,
    ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "triangle6",
    (11, 24),
    "tetra10",
    from_gmsh=(*range(8), 9, 8),
)
_QUADRILATERAL_9 = _second_order("quadrilateral9", _QUADRILATERAL, (*_RING, (0, 1, 2, 3)), "line3", (10, 28), "quad9")
_TRIANGLE_6 = _second_order("triangle6", _TRIANGLE, ((0, 1), (1, 2), (2, 0)), "line3", (9, 22), "triangle6")

CELL_TYPES: Mapping[str, CellType] = MappingProxyType(
    {
        cell.name: cell
        for cell in (
            *(_HEXAHEDRON, _TETRAHEDRON, _QUADRILATERAL, _TRIANGLE),
            *(_HEXAHEDRON_27, _TETRAHEDRON_10, _QUADRILATERAL_9, _TRIANGLE_6),
        )
    }
)
"""The cells that parts are made of, by name."""

RAISED: Mapping[str, str] = MappingProxyType({cell.basix: cell.name for cell in CELL_TYPES.values() if cell.order == 2})
"""The cell type of second order on each of first order."""

GMSH_TYPES: Mapping[int, str] = MappingProxyType(
    {15: "vertex", 1: "line", 8: "line3", **{cell.gmsh: cell.name for cell in CELL_TYPES.values()}}
)
"""Names of what gmsh numbers, points and lines included."""

GMSH_NUMBERS: Mapping[str, int] = MappingProxyType({name: number for number, name in GMSH_TYPES.items()})

FROM_MESHIO: Mapping[str, str] = MappingProxyType({cell.meshio: cell.name for cell in CELL_TYPES.values()})
TO_MESHIO: Mapping[str, str] = MappingProxyType({cell.name: cell.meshio for cell in CELL_TYPES.values()})

ELEMENTS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "hexahedron": ("Q1", "Q1-enhanced", "Q1-bbar"),
        "tetrahedron": ("P1",),
        "quadrilateral": ("Q1", "Q1-enhanced", "Q1-bbar"),
        "triangle": ("P1",),
        "hexahedron27": ("Q2",),
        "tetrahedron10": ("P2",),
        "quadrilateral9": ("Q2",),
        "triangle6": ("P2",),
    }
)
"""The elements that there are for each cell, the default first; what they do is told in `fcsim.assembly.elements`. A part of first-order
cells can be given the elements of second order too: its cells are raised (`fcsim.mesh.order.second_order`)."""
