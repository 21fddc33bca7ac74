"""Quality of a mesh: Jacobians, volumes and a shape measure, all cells at once."""

from __future__ import annotations

from itertools import product
from typing import Protocol, runtime_checkable

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError, expect
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.facets import refuse_repeated
from fcsim.mesh.order.quadrature import quadrature

SMALLEST_SCALED_JACOBIAN = 1e-3
"""Of meshes that others made: a worse cell is a slip of the mesher."""
ROUND_OFF = 1e-9
"""A cell with a smaller scaled Jacobian has none that can be told from zero; longer ones than wide by 10^4 are still computed with."""


@runtime_checkable
class Meshed(Protocol):
    """What has a mesh: a `Part`."""

    @property
    def name(self) -> str: ...
    @property
    def points(self) -> FloatArray: ...
    @property
    def cells(self) -> IntArray: ...
    @property
    def cell_type(self) -> str: ...


def _gauss_points(d: int) -> FloatArray:
    return np.array(list(product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=d)))


def _nodes(points: FloatArray, cells: IntArray) -> FloatArray:
    """Nodes (ncells, k, d) relative to each cell's first, so that no digits are lost far from the origin."""
    return points[cells] - points[cells[:, :1]]


def _jacobians(nodes: FloatArray, gradients: FloatArray) -> FloatArray:
    """J_ij = sum_k x_ki dN_k/dxi_j (ncells, d, d)."""
    return np.matmul(nodes.transpose(0, 2, 1), gradients)


def _determinants(matrices: FloatArray) -> FloatArray:
    """det (n,) of (n, 2, 2) or (n, 3, 3), written out: several times faster than a factorisation of each."""
    if matrices.shape[-1] == 2:
        return matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]
    return np.vecdot(matrices[:, 0], np.cross(matrices[:, 1], matrices[:, 2]))


def cell_volumes(points: FloatArray, cells: IntArray, cell_type: str) -> FloatArray:
    """Volumes (ncells,) [m^3] of the cells, areas [m^2] in 2D; negative where a cell is inverted.

    Quadrilaterals and hexahedra: 2 Gauss points a direction, exact for the bilinear and trilinear maps; cells of second order: 3.
    """
    cell = CELL_TYPES[cell_type]
    d = cell.dimension
    if cell.order == 2:
        at, weights = quadrature(cell, 3)
        nodes = _nodes(points, cells)
        return np.sum([w * _determinants(_jacobians(nodes, g)) for w, g in zip(weights, cell.gradient(at), strict=True)], axis=0)
    if not cell.simplex:
        gradients = cell.gradient(_gauss_points(d))
        nodes = _nodes(points, cells)
        return np.sum([_determinants(_jacobians(nodes, g)) for g in gradients], axis=0)
    return _determinants(_nodes(points, cells)[:, 1:]) / (2 if d == 2 else 6)


def scaled_jacobian(points: FloatArray, cells: IntArray, cell_type: str) -> FloatArray:
    """Shape measure (ncells,) in [-1, 1]: 1 for a box or an equilateral simplex, 0 for a collapsed cell, negative for an inverted one.

    Quadrilaterals and hexahedra: the least of det J / prod_j |J_j| (J_j the columns of J) over the nodes, the centre and the
    2 x 2 (x 2) Gauss points. Triangles and tetrahedra: det J over the largest product of the edges that meet in a node, times
    2/sqrt(3) and sqrt(2). The measures "scaled Jacobian" of C. J. Stimpson et al., The Verdict Geometric Quality Library,
    SAND2007-1751, with the inner points added. Cells of second order: the least of these measures for the parallelepipeds, or the
    simplices, that J spans at the nodes, the centre and the points inside.
    """
    nodes = _nodes(points, cells)
    cell = CELL_TYPES[cell_type]
    if cell.order == 2 and cell.simplex:
        worst = np.full(len(cells), np.inf)
        for gradients in cell.gradient(np.concatenate((cell.nodes, cell.centre, cell.inside))):
            worst = np.minimum(worst, _simplex_measure(np.pad(_jacobians(nodes, gradients).transpose(0, 2, 1), ((0, 0), (1, 0), (0, 0)))))
        return worst
    if not cell.simplex:
        at = np.concatenate((cell.nodes, cell.centre, _gauss_points(cell.dimension)))
        worst = np.full(len(cells), np.inf)
        for gradients in cell.gradient(at):
            jacobian = _jacobians(nodes, gradients)
            worst = np.minimum(worst, _ratio(_determinants(jacobian), np.prod(np.linalg.norm(jacobian, axis=1), axis=1)))
        return worst
    return _simplex_measure(nodes)


def _simplex_measure(corners: FloatArray) -> FloatArray:
    """The measure (n,) of triangles or tetrahedra with `corners` (n, d + 1, d), the first in the origin."""
    count = corners.shape[1]
    lengths = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3)
    lengths += np.eye(count)  # a node's distance to itself is no edge: 1 leaves the product as it is
    det = _determinants(corners[:, 1:])
    return (2 / np.sqrt(3) if count == 3 else np.sqrt(2)) * _ratio(det, lengths.prod(axis=2).max(axis=1))


def _ratio(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Numerator / denominator, 0 where an edge has no length."""
    return np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0)


def check_quality(part: Meshed, smallest: float = SMALLEST_SCALED_JACOBIAN) -> FloatArray:
    """Return the scaled Jacobians (ncells,) of a part; InputError where it cannot be computed with.

    Refused: cells with a scaled Jacobian below `smallest` (inverted, bow ties, collapsed or nearly so), cells that are given twice, and
    nodes that no cell uses, which would make the stiffness and mass singular.
    """
    expect(part, Meshed, "check_quality, part", "a Part, as brick(...) gives")
    with np.errstate(over="ignore", invalid="ignore"):
        quality = scaled_jacobian(part.points, part.cells, part.cell_type)
    bad = np.flatnonzero(~(quality >= smallest))  # NaN, of coordinates whose products overflow, is bad too
    if bad.size:
        worst = int(np.argmin(quality))
        inverted = np.count_nonzero(quality[bad] < -1e-12)
        raise InputError(
            f"Part {part.name!r}: expected elements with a scaled Jacobian >= {smallest:g} (1 = box, 0 = collapsed, < 0 = inverted), got "
            f"{bad.size} of {len(quality)} below, {inverted} of them inverted: elements {_first(bad)}; the worst is {quality[worst]:.3g} "
            f"at element {worst}"
            + ("; all of them inside out: swap two nodes of every cell, or mirror the mesh" if inverted == len(quality) else "")
        )
    refuse_repeated(part.cells, f"Part {part.name!r}, cells")
    unused = np.flatnonzero(np.bincount(part.cells.ravel(), minlength=len(part.points)) == 0)
    if unused.size:
        raise InputError(
            f"Part {part.name!r}: expected every node to belong to an element, got {unused.size} of {len(part.points)} unused: "
            f"nodes {_first(unused)}"
        )
    return quality


def _first(numbers: IntArray, count: int = 5) -> str:
    return ", ".join(map(str, numbers[:count])) + (", ..." if len(numbers) > count else "")
