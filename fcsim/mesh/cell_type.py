"""The one table of cells: shapes, orders, nodes, facets, and what gmsh, VTK, meshio and basix call them.

Nodes are in VTK's (= gmsh's for first order) order. Reference cells are [-1, 1]^d, and for simplices the unit simplex with its first
corner in the origin. Shape functions follow from the table alone: the polynomials of the cell that are 1 at one node, 0 at the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
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
        """Local nodes (ne, 2) of the cell's edges: neighbours along its facets, of simplices all pairs of corners."""
        around = np.stack([self.facets, np.roll(self.facets, -1, axis=1)], axis=-1).reshape(-1, 2)
        return np.unique(np.sort(around, axis=1), axis=0)

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


def _products(d: int) -> IntArray:
    """Exponents of all products of powers 0 and 1."""
    return np.array(list(np.ndindex((2,) * d)))


def _simplex(d: int) -> FloatArray:
    return np.vstack([np.zeros(d), np.eye(d)])


def _cell(
    name: str,
    nodes: FloatArray | IntArray,
    powers: IntArray | FloatArray,
    facet_type: str,
    facets: tuple[tuple[int, ...], ...],
    numbers: tuple[int, int],
    meshio: str,
) -> CellType:
    simplex = len(nodes) == nodes.shape[1] + 1
    arrays = np.array(nodes, dtype=float), np.array(facets), np.array(powers, dtype=np.int64)
    for array in arrays:
        array.setflags(write=False)
    return CellType(name, 1, simplex, arrays[0], facet_type, arrays[1], arrays[2], *numbers, meshio, name)


CELL_TYPES: Mapping[str, CellType] = MappingProxyType(
    {
        cell.name: cell
        for cell in (
            _cell(
                "hexahedron",
                _CUBE,
                _products(3),
                "quadrilateral",
                ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
                (5, 12),
                "hexahedron",
            ),
            _cell("tetrahedron", _simplex(3), _simplex(3), "triangle", ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)), (4, 10), "tetra"),
            _cell("quadrilateral", _SQUARE, _products(2), "line", ((0, 1), (1, 2), (2, 3), (3, 0)), (3, 9), "quad"),
            _cell("triangle", _simplex(2), _simplex(2), "line", ((0, 1), (1, 2), (2, 0)), (2, 5), "triangle"),
        )
    }
)
"""The cells that parts are made of, by name."""

GMSH_TYPES: Mapping[int, str] = MappingProxyType({15: "vertex", 1: "line", **{cell.gmsh: cell.name for cell in CELL_TYPES.values()}})
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
    }
)
"""The elements that there are for each cell, the default first; what they do is told in `fcsim.assembly.elements`."""
