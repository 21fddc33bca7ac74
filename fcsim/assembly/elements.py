"""Elements: the strain of a cell from its nodes' displacements, and its stiffness.

Hexahedra and quadrilaterals, by `Part.elements`:

* "Q1": (bi-, tri-)linear displacements, eps = sym grad x. Too stiff in bending (a cell cannot curve: by the factor
  1 + (G / E)(a / h)^2 for cells of length a in a beam of height h, so worse the longer they are) and for nu towards 1/2.
* "Q1-enhanced": the same and incompatible displacements alpha_a (1 - r_a^2) / 2 along each reference axis a, of which every cell has its
  own. Their gradient at r is taken as -(j_0 / j) r_a alpha_a (x) grad_0 r_a, grad_0 and the Jacobian's determinant j_0 at the centre,
  so that constant stress does no work on them whatever the cell's shape (patch test). In 3D the dilatations (j_0 / j) r_a r_b of
  the three pairs of axes are added, which free the volume where nu tends to 1/2. The 4 (2D) or 12 (3D) modes s are condensed: with
  K_ss s + K_su u = 0, K = K_uu - K_us K_ss^-1 K_su. Bends as a beam, also in one cell through the height; parallelograms and
  parallelepipeds lose nothing, trapezia lose part of it (no four-node element that passes the patch test can bend exactly there).
* "Q1-bbar": of Q1's strain the dilatation is replaced by its mean over the cell: no volumetric locking; bends as Q1 does.

Tetrahedra and triangles: "P1". Their strain is constant: they bend stiffly, and lock for nu towards 1/2; there is neither an
enhanced nor a B-bar variant (the mean of a constant is that constant).

"Q2" and "P2": displacements of second order (27, 9, 10 and 6 nodes), eps = sym grad x. They bend as a beam does, in one cell through the
height too, and keep most of it for nu towards 1/2.

All points and cells are axes of arrays. Strains are (xx, yy, zz, xy, yz, zx) with gamma = 2 eps in the last three, in 2D too.
Mass and loads are those of Q1 for all of them: the modes have no inertia and loads do no work on them.

Sources: E. L. Wilson et al., Incompatible displacement models, 1973; R. L. Taylor, P. J. Beresford, E. L. Wilson, A non-conforming
element for stress analysis, IJNME 10 (1976); J. C. Simo, M. S. Rifai, IJNME 29 (1990) 1595-1638 (the same strains, and the factor j_0 / j);
J. C. Simo, F. Armero, R. L. Taylor, CMAME 110 (1993) 359-386 (the dilatations in 3D); T. J. R. Hughes, IJNME 15 (1980) 1413-1418 (B-bar);
R. H. MacNeal, IJNME 24 (1987) 1793-1799 (what no four-node element can do).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, product
from math import factorial
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray, IntArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.mesh.cell_type import CELL_TYPES, CellType
from fcsim.mesh.order.quadrature import quadrature as by_gauss
from fcsim.mesh.part import Part

VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
CELLS_AT_ONCE = 2048  # bounds the memory: some 40 MB of strain matrices of hexahedra


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of one type and the elasticity matrix of their material.

    corners (nc, k, d) [m] relative to each cell's first; C (6, 6) [Pa] with the plane hypothesis applied
    """

    kind: CellType
    corners: FloatArray
    C: FloatArray

    __repr__ = brief

    def jacobians(self, at: FloatArray) -> FloatArray:
        """d x_i / d r_j (nc, nq, d, d) at the reference points `at` (nq, d)."""
        return np.einsum("cai,qaj->cqij", self.corners, self.kind.gradient(at))

    def gradients(self, at: FloatArray) -> FloatArray:
        """d N_a / d x_i (nc, nq, k, d)."""
        return self.kind.gradient(at) @ np.linalg.inv(self.jacobians(at))


class Element(Protocol):
    """The strain matrices B (nc, nq, 6, k d) of cells at reference points (nq, d): strain = B @ the displacements of the cell's nodes."""

    def __call__(self, cells: Cells, at: FloatArray) -> FloatArray: ...


def displacement_strain(cells: Cells, at: FloatArray) -> FloatArray:
    """Strain matrices of the displacements' own gradient: Q1 and P1."""
    return strain_of_gradients(cells.gradients(at))


def bbar_strain(cells: Cells, at: FloatArray) -> FloatArray:
    """Strain matrices whose dilatation is the cell's mean: B + m (mean(m^T B) - m^T B) / 3, m = (1, 1, 1, 0, 0, 0)."""
    points, weights = gauss(cells.kind.dimension)
    volume = weights * np.linalg.det(cells.jacobians(points))
    dilatation = strain_of_gradients(cells.gradients(points))[:, :, :3].sum(axis=2)
    mean = np.einsum("cq,cqn->cn", volume / volume.sum(axis=1, keepdims=True), dilatation)
    B = strain_of_gradients(cells.gradients(at))
    B[:, :, :3] += (mean[:, None] - B[:, :, :3].sum(axis=2))[:, :, None] / 3
    return B


def enhanced_strain(cells: Cells, at: FloatArray) -> FloatArray:
    """Strain matrices with the incompatible modes s = -K_ss^-1 K_su u put in: B - B_s K_ss^-1 K_su."""
    points, weights = gauss(cells.kind.dimension)
    volume = weights * np.linalg.det(cells.jacobians(points))
    B, modes = displacement_strain(cells, points), mode_strain(cells, points)
    weighted = np.einsum("cq,pr,cqrs->cqps", volume, cells.C, modes)
    K_ss = np.einsum("cqps,cqpt->cst", weighted, modes, optimize=True)
    K_su = np.einsum("cqps,cqpn->csn", weighted, B, optimize=True)
    amplitude = np.linalg.solve(K_ss, K_su)
    return displacement_strain(cells, at) - mode_strain(cells, at) @ amplitude[:, None]


def mode_strain(cells: Cells, at: FloatArray) -> FloatArray:
    """Strains (nc, nq, 6, modes) of the incompatible modes of unit size, 4 in 2D and 12 in 3D (see the head of this file)."""
    d = cells.kind.dimension
    central = cells.jacobians(cells.kind.centre)[:, 0]
    across = np.linalg.inv(central)  # row a: gradient of r_a at the centre
    across /= np.linalg.norm(across, axis=2, keepdims=True)  # only the size of the modes: long cells stay well conditioned
    factor = np.linalg.det(central)[:, None] / np.linalg.det(cells.jacobians(at))
    strain = strain_of_gradients(np.einsum("cq,qa,cai->cqai", factor, at, across))
    if d == 2:
        return strain
    pairs = np.stack([at[:, a] * at[:, b] for a, b in combinations(range(d), 2)], axis=1)
    dilatation = np.zeros((*strain.shape[:3], len(pairs.T)))
    dilatation[:, :, :3] = (factor[:, :, None] * pairs)[:, :, None]
    return np.concatenate([strain, dilatation], axis=3)


def strain_of_gradients(gradients: FloatArray) -> FloatArray:
    """Strain matrices (nc, nq, 6, k d) of vector-valued functions from their scalar factors' gradients (nc, nq, k, d)."""
    d = gradients.shape[-1]
    strain = np.zeros((*gradients.shape[:2], 6, *gradients.shape[2:]))
    for component, (i, j) in enumerate(VOIGT):
        if max(i, j) < d:
            strain[:, :, component, :, i] = gradients[..., j]
            strain[:, :, component, :, j] = gradients[..., i]
    return strain.reshape(*strain.shape[:3], -1)


STRAIN: Mapping[str, Element] = MappingProxyType(
    {
        **dict.fromkeys(("P1", "Q1", "P2", "Q2"), displacement_strain),
        "Q1-enhanced": enhanced_strain,
        "Q1-bbar": bbar_strain,
    }
)
"""What the names of `Part.elements` mean."""


def quadrature(kind: CellType) -> tuple[FloatArray, FloatArray]:
    """Points (nq, d) and weights (nq,) of the rule with which a cell's strains are integrated: Gauss' of two points a direction, the centre
    of simplices, whose strain is constant; for second order three points a direction, of simplices the rule of degree 5."""
    if kind.order == 2:
        return by_gauss(kind, 3)
    if kind.simplex:
        return kind.centre, np.array([1 / factorial(kind.dimension)])
    return gauss(kind.dimension)


def gauss(d: int) -> tuple[FloatArray, FloatArray]:
    """Points (2^d, d) and weights (2^d,) of the rule of two Gauss points a direction on [-1, 1]^d."""
    return np.array(list(product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=d))), np.ones(2**d)


def strain_blocks(part: Part, C: FloatArray, at: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
    """The part's cells some at a time: their dofs (nc, k d) and strain matrices (nc, nq, 6, k d) at the points `at` (nq, d)."""
    for dofs, cells in _blocks(part, C):
        yield dofs, STRAIN[part.elements](cells, at)


def stiffness(part: Part, C: FloatArray) -> csr_array:
    """Return K (d nn, d nn) [N/m] of a part, exactly symmetric, by `quadrature`:
    K = sum over cells of int B^T C B, with B that of `Part.elements`.

    Since the modes minimise the energy, int B^T C B with them put into B is the condensed K_uu - K_us K_ss^-1 K_su.
    Raises InputError for a cell that is inverted or flat at its centre or a Gauss point.
    """
    points, weights = quadrature(CELL_TYPES[part.cell_type])
    n = part.points.size
    K = csr_array((n, n))
    for dofs, cells in _blocks(part, C):
        determinants = np.linalg.det(cells.jacobians(points))
        B = STRAIN[part.elements](cells, points)
        CB = np.einsum("cq,pr,cqrn->cqpn", weights * determinants, C, B, optimize=True)
        nc, nq, six, size = B.shape
        K_cells = B.reshape(nc, nq * six, size).transpose(0, 2, 1) @ CB.reshape(nc, nq * six, size)
        row, column = np.broadcast_to(dofs[:, :, None], K_cells.shape), np.broadcast_to(dofs[:, None], K_cells.shape)
        K = K + csr_array((K_cells.ravel(), (row.ravel(), column.ravel())), shape=(n, n))
    half = 0.5 * part.thickness * K
    return with_short_indices(csr_array(half + half.T))


def _blocks(part: Part, C: FloatArray) -> Iterator[tuple[IntArray, Cells]]:
    d = part.dimension
    if part.elements in ("Q1-enhanced", "Q1-bbar"):
        refuse_inverted(part)
    for begin in range(0, len(part.cells), CELLS_AT_ONCE):
        numbers = part.cells[begin : begin + CELLS_AT_ONCE]
        corners = part.points[numbers] - part.points[numbers[:, :1]]  # no digits are lost far from the origin
        yield (d * numbers[:, :, None] + np.arange(d)).reshape(len(numbers), -1), Cells(CELL_TYPES[part.cell_type], corners, C)


def refuse_inverted(part: Part) -> None:
    """InputError for cells that are inverted or flat: the modes' factor j_0 / j would be infinite, the volume of points negative."""
    kind = CELL_TYPES[part.cell_type]
    at = np.vstack([kind.centre, quadrature(kind)[0]])
    least = np.linalg.det(np.einsum("cai,qaj->cqij", part.points[part.cells], kind.gradient(at))).min(axis=1)
    if np.any(least <= 0):
        cell = int(np.argmax(least <= 0))
        raise InputError(
            f"Part {part.name!r}: expected cells of positive Jacobian for {part.elements!r} elements, got "
            f"{np.count_nonzero(least <= 0)} others, the first is cell {cell} with det J = {least[cell]:.3g} at its centre or a Gauss point"
        )
