"""The table of cells against what shape functions and outward facets must be, and against gmsh's and VTK's own tables."""

from math import factorial

import numpy as np
import pytest

from fcsim.mesh.cell_type import CELL_TYPES, GMSH_NUMBERS
from fcsim.mesh.order.quadrature import quadrature
from fcsim.runtime import gmsh_model

cells = pytest.mark.parametrize("cell", CELL_TYPES.values(), ids=lambda cell: cell.name)


@cells
def test_shape_functions_are_nodal_sum_to_one_and_have_their_derivatives(cell):
    rng = np.random.default_rng(3)
    at = rng.uniform(0, 1 / cell.dimension, (5, cell.dimension))
    assert np.allclose(cell.shape(cell.nodes), np.eye(cell.size), atol=1e-14)
    assert np.allclose(cell.shape(at).sum(axis=1), 1)
    assert np.allclose(cell.shape(at) @ cell.nodes, at)
    step = 1e-6
    for axis, direction in enumerate(step * np.eye(cell.dimension)):
        difference = (cell.shape(at + direction) - cell.shape(at - direction)) / (2 * step)
        assert np.allclose(cell.gradient(at)[:, :, axis], difference, atol=1e-9)


@cells
def test_facets_point_outwards_and_close_the_cell(cell):
    """Each facet's normal leads away from the centre, and the normals times areas sum to zero."""
    corners = cell.nodes[cell.facets]
    if cell.dimension == 2:
        along = corners[:, 1] - corners[:, 0]
        area = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        last = corners[:, 3] if cell.facet_corners == 4 else corners[:, 0]
        area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], last - corners[:, 1])
    assert np.all(np.vecdot(area, corners.mean(axis=1) - cell.centre) > 0)
    assert np.allclose(area.sum(axis=0), 0, atol=1e-14)


@cells
def test_edges_of_the_cell(cell):
    edges = {"hexahedron": 12, "tetrahedron": 6, "quadrilateral": 4, "triangle": 3}[cell.basix]
    assert len(cell.edges) == cell.order * edges
    lengths = np.linalg.norm(cell.nodes[cell.edges[:, 1]] - cell.nodes[cell.edges[:, 0]], axis=1)
    assert lengths.max() <= (np.sqrt(2) if cell.simplex else 2) / cell.order + 1e-12


@cells
def test_quadrature_of_monomials(cell):
    """Over [-1, 1]: int x^a = 2 / (a + 1), a even; over the unit simplex int x^a y^b z^c = a! b! c! / (a + b + c + d)!."""
    points, weights = quadrature(cell, 3)
    for powers in np.ndindex((6,) * cell.dimension):
        if sum(powers) > 5:
            continue
        if cell.simplex:
            exact = np.prod([factorial(p) for p in powers]) / factorial(sum(powers) + cell.dimension)
        else:
            exact = np.prod([0 if p % 2 else 2 / (p + 1) for p in powers])
        assert np.isclose(weights @ np.prod(points**powers, axis=1), exact, atol=1e-14)


@cells
def test_numbers_are_those_of_gmsh_and_vtk(cell):
    """gmsh's element 5 lists the reference nodes of its hexahedron; VTK's cell 12 has as many corners."""
    vtk = pytest.importorskip("vtk")
    with gmsh_model("numbers") as gmsh:
        _, dimension, order, size, nodes, _ = gmsh.model.mesh.getElementProperties(GMSH_NUMBERS[cell.name])
    assert (dimension, order, size) == (cell.dimension, cell.order, cell.size)
    assert np.allclose(np.reshape(nodes, (size, -1))[cell.from_gmsh, :dimension], cell.nodes)
    other = vtk.vtkGenericCell.InstantiateCell(cell.vtk)
    assert (other.GetCellDimension(), other.GetNumberOfPoints()) == (cell.dimension, cell.size)
    parametric = np.array([other.GetParametricCoords()[i] for i in range(3 * cell.size)]).reshape(-1, 3)[:, : cell.dimension]
    assert np.allclose(parametric, cell.nodes if cell.simplex else (cell.nodes + 1) / 2)
