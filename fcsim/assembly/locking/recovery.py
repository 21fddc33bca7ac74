"""Stress at the nodes, recovered from cells, and by how much the cells' own differs from it: the estimator of Zienkiewicz and Zhu.

Each cell's stress at its points of quadrature is fitted by the polynomials that its element's stress has throughout (constant in "P1",
linear in "P2", linear in each direction in "Q1" and "Q2"), fits are taken to the nodes and averaged there by the cells' volumes, material
by material: s*. With the norm of energy ||s||^2 = int s : C^-1 : s,

    eta^2 = ||s* - s||^2 / ||s*||^2

is about the share of the energy that a finer mesh would change: stress that jumps from cell to cell, or swings within them, is not that of
a body but of its cells. Cells that are too stiff in bending or lock by shear, membrane or volume swing so; stress near a point that bears a
force does, too. Stress is that of small strain, of laws of points the second of Piola and Kirchhoff, which no rotation changes.

Source: O. C. Zienkiewicz, J. Z. Zhu, "A simple error estimator and adaptive procedure for practical engineering analysis", Int. J. Numer.
Methods Eng. 24 (1987) 337-357.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.discretisation import once_per_part
from fcsim.assembly.elements import VOIGT, quadrature
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part


@dataclass(frozen=True, eq=False)
class Recovery:
    """The operators of some cells of one part: cells (nc, k); volume (nc, nq) of their points; fit (k, nq): from points to nodes; back
    (nq, k): the shape functions at the points; mean_pressure: whether the pressure is one of each cell, as in "Q1-bbar": it is an unknown
    beside the displacements, so that its jumps are of no stiffness, and errors are those of the deviator."""

    cells: IntArray
    volume: FloatArray
    fit: FloatArray
    back: FloatArray
    mean_pressure: bool = False

    @cached_property
    def _mean(self) -> tuple[IntArray, csr_array]:
        """The nodes (n,) of the cells, and means (n, nc k) there of values at the cells' nodes by the cells' volumes."""
        nodes, place = np.unique(self.cells, return_inverse=True)
        weight = np.repeat(self.volume.sum(axis=1), self.cells.shape[1])
        place = place.ravel()
        total = np.bincount(place, weight)
        columns = np.arange(len(place))
        return nodes, csr_array((weight / total[place], (place, columns)), shape=(len(nodes), len(place)))

    def at_nodes(self, stress: FloatArray) -> tuple[IntArray, FloatArray]:
        """The cells' nodes (n,) and s* (n, 6) there of stress (nc, nq, 6) at the points."""
        fitted = np.einsum("kq,cqs->cks", self.fit, stress)
        nodes, mean = self._mean
        return nodes, mean @ fitted.reshape(-1, stress.shape[2])

    def energies(self, stress: FloatArray, compliance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """||s* - s||^2 and ||s*||^2 (nc,) [J] of each cell; compliance (6, 6) [1/Pa], engineering shear strains."""
        nodes, recovered = self.at_nodes(stress)
        smooth = np.einsum("qk,cks->cqs", self.back, recovered[np.searchsorted(nodes, self.cells)])
        error = smooth - stress
        if self.mean_pressure:
            error[..., :3] -= error[..., :3].mean(axis=-1, keepdims=True)
        return (
            np.einsum("cq,cqs,st,cqt->c", self.volume, error, compliance, error, optimize=True),
            np.einsum("cq,cqs,st,cqt->c", self.volume, smooth, compliance, smooth, optimize=True),
        )


@once_per_part
def recovery(part: Part) -> Recovery:
    """The operators of all cells of a part."""
    kind = CELL_TYPES[part.cell_type]
    at, weights = quadrature(kind)
    jacobian = np.einsum("cai,qaj->cqij", part.points[part.cells], kind.gradient(at))
    if kind.simplex:
        powers = np.vstack([np.zeros(kind.dimension, int), np.eye(kind.dimension, dtype=int)])[: 1 if kind.order == 1 else None]
    else:
        powers = np.array(list(np.ndindex((2,) * kind.dimension)))
    at_points, at_nodes = (np.prod(place[:, None, :] ** powers, axis=2) for place in (at, kind.nodes))
    root = np.sqrt(weights)[:, None]
    fit = at_nodes @ np.linalg.pinv(root * at_points) * root.T
    return Recovery(part.cells, part.thickness * weights * np.linalg.det(jacobian), fit, kind.shape(at), part.elements == "Q1-bbar")


def of_cells(whole: Recovery, numbers: IntArray) -> Recovery:
    """The operators of some cells, whose stress is not averaged with that of others."""
    return Recovery(whole.cells[numbers], whole.volume[numbers], whole.fit, whole.back, whole.mean_pressure)


def voigt(stress: FloatArray) -> FloatArray:
    """Components (..., 6) of symmetric tensors (..., 3, 3) in the order of `fcsim.assembly.stress.COMPONENTS`."""
    rows, columns = np.transpose(VOIGT)
    return stress[..., rows, columns]
