"""What strains of small rotation leave out of a body that bends: their squares, which stretch what cannot draw in.

With H the displacement gradient, eps = (H + H^T) / 2 and Q = H^T H / 2, Green and Lagrange's strain is eps + Q. A body that is free to draw
in takes up Q by a displacement d: a strip that bends by any small slope does so at no cost. Where supports or its own shape (a plate bent
two ways) keep it from that, what remains is energy that the linear body lacks,

    W = min over d of  integral of (eps(d) + Q) : C : (eps(d) + Q) / 2 = integral of Q : C : Q / 2 - r . K^-1 r / 2,  r = -df/dd at d = 0

For a strip between two clamps that is bent by w it is 3/8 (w / h)^2 of the energy of bending, h the thickness, and its force is twice that
share too small.

Source: S. P. Timoshenko, S. Woinowsky-Krieger, Theory of plates and shells, 1959, chapter 13 (large deflections).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.elasticity import elasticity_matrix
from fcsim.assembly.groups import Group
from fcsim.linear.factors import Factor, factorise
from fcsim.linear.over_ranks.mumps import MumpsOverRanks
from fcsim.linear.over_ranks.rows import RowsOverRanks
from fcsim.mesh.cell_type import CELL_TYPES, CellType
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import as_tensor
from fcsim.mesh.region_parts import region_parts

UNTRIED = 0.05
"""Q over eps below which Q is not looked into: its energy is less than the square of that of the whole."""
TAKEN_UP = 0.02
"""Share of the energy of Q that may remain of what a body takes up: cells whose middles turn by unlike angles do not draw in exactly."""
SOFT = 1e-10
"""Share of the stiffness that holds what no support holds; r has no resultant and no moment."""


class LeftOut:
    """Rotation of cells' middles and the energy that is left out, of bodies of one group; gradient (nq nc d, nn): derivatives of nodal
    values at the points `CellType.inside` of all cells, of `volume` (nq nc,) [m^3]."""

    def __init__(self, group: Group, gradient: sp.csr_array) -> None:
        self._group, self._gradient = group, gradient

    def __call__(self, x: FloatArray) -> tuple[float, float]:
        """The largest rotation of a cell's middle [rad] and W over the body's energy x . K x / 2, for displacements x (nn, d) [m]."""
        d = x.shape[1]
        H = (self._gradient @ x).reshape(-1, d, d).transpose(0, 2, 1)
        eps, Q = 0.5 * (H + H.transpose(0, 2, 1)), 0.5 * H.transpose(0, 2, 1) @ H
        axial = H - H.transpose(0, 2, 1)
        sine = np.sqrt(np.einsum("nij,nij->n", axial, axial) / 8)
        cosine = 1 + 0.5 * np.trace(H, axis1=1, axis2=2)
        angle = float(np.arctan2(sine, cosine).max())
        if _largest(Q) <= UNTRIED * _largest(eps):
            return angle, 0.0
        return angle, self._share(x, Q)

    def _share(self, x: FloatArray, Q: FloatArray) -> float:
        group = self._group
        energy = 0.5 * float(x.ravel() @ (group.K @ x.ravel()))
        stress = self.stress(Q) * self.volume[:, None, None]
        whole = 0.5 * float(np.einsum("nij,nij->", stress, Q))
        r = (self._gradient.T @ stress.transpose(0, 2, 1).reshape(-1, x.shape[1])).ravel()
        if group.axes_matrix is not None:
            r = group.axes_matrix @ r
        r = r[~group.driven]
        remains = whole - 0.5 * float(r @ self._factor.solve(r)) if r.size else whole
        return remains / energy if energy > 0 and remains > TAKEN_UP * whole else 0.0

    def stress(self, strain: FloatArray) -> FloatArray:
        """Stress (nq nc, d, d) [Pa] of strains at the points, both along the world's axes."""
        R = self._group.rotation
        turned = np.einsum("ki,nkl,lj->nij", R, strain, R)
        own = np.einsum("nijkl,nkl->nij", self._elasticity[:, : len(R), : len(R)], turned)
        return np.einsum("ik,nkl,jl->nij", R, own, R)

    def mean_stress(self, strain: FloatArray) -> FloatArray:
        """A third of the trace of the stress in space (nq nc,) [Pa], of plane bodies with what acts across their plane."""
        R = self._group.rotation
        trace: FloatArray = np.einsum("niikl,nkl->n", self._elasticity, np.einsum("ki,nkl,lj->nij", R, strain, R))
        return trace / 3

    @cached_property
    def _factor(self) -> Factor:
        T, K, free = self._group.axes_matrix, self._group.K, ~self._group.driven
        if isinstance(K, RowsOverRanks):
            spread = (K if T is None else K.turned(T)).on(np.flatnonzero(free))
            return MumpsOverRanks(spread.plus(1.0, sp.diags_array(SOFT * spread.diagonal()), 1.0))
        K = sp.csr_array((K if T is None else T @ K @ T.T).tocsr()[free][:, free])
        return factorise(sp.csr_array(K + sp.diags_array(SOFT * K.diagonal())))

    @cached_property
    def volume(self) -> FloatArray:
        """Of the points (nq nc,) [m^3]: equal shares of the reference cell."""
        part = self._group.part
        cell = CELL_TYPES[part.cell_type]
        reference = 1 / (2 if part.dimension == 2 else 6) if cell.simplex else 2.0**part.dimension
        jacobian = np.einsum("cai,qaj->qcij", part.points[part.cells], cell.gradient(cell.inside))
        volume: FloatArray = np.linalg.det(jacobian).ravel() * (reference * part.thickness / len(cell.inside))
        return volume

    @cached_property
    def _elasticity(self) -> FloatArray:
        """(nq nc, 3, 3, d, d) [Pa] in the part's axes."""
        group, d = self._group, self._group.part.dimension
        cells = np.empty((len(group.part.cells), 3, 3, d, d))
        if group.laws is not None:
            for law in group.laws.regions:
                cells[law.numbers] = law.reference[..., :d, :d]
        elif isinstance(group.part.material, ByRegion):
            for region in region_parts(group.part):
                cells[region.cells] = as_tensor(elasticity_matrix(region.part))[..., :d, :d]
        else:
            cells[:] = as_tensor(elasticity_matrix(group.part))[..., :d, :d]
        return np.concatenate([cells] * len(CELL_TYPES[group.part.cell_type].inside))


def gradients(cell: CellType, at: FloatArray, points: FloatArray, cells: IntArray) -> sp.csr_array:
    """(nq nc d, nn): derivatives of nodal values by the points' coordinates (nn, d) at the places `at` (nq, d) of cells (nc, k)."""
    reference = cell.gradient(at)
    jacobian = np.einsum("cai,qaj->qcij", points[cells], reference)
    gradient = np.einsum("qaj,qcji->qcia", reference, np.linalg.inv(jacobian))
    nq, nc, d = gradient.shape[:3]
    rows = np.broadcast_to(np.arange(nq * nc * d).reshape(nq, nc, d, 1), gradient.shape)
    columns = np.broadcast_to(cells[None, :, None, :], gradient.shape)
    return sp.csr_array((gradient.ravel(), (rows.ravel(), columns.ravel())), shape=(nq * nc * d, len(points)))


def _largest(strain: FloatArray) -> float:
    return float(np.sqrt(np.einsum("nij,nij->n", strain, strain).max()))
