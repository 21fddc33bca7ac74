"""The cells of a part as the laws of points see them: deformation gradient, forces and tangent of cells from those of points.

"Q1", "P1": F = 1 + sum_a u_a (x) grad N_a. "Q1-bbar": the volume of all points of a cell is that of the cell (no volumetric locking):

    finite strain  F~ = (T / J)^(1/3) F,  J = det F, T = the mean of J over the cell's reference volume
    small strain   F~ = F + (mean tr F - tr F) / 3 1

The former becomes the latter, and both the B-bar of `fcsim.assembly.elements`, where displacements are small. Forces are the derivative of
sum_q w W(F~), so that the tangent is symmetric where that of the law is: with c = (T/J)^(1/3), g = F^-T grad N, t = P~ . grad N,
p = P~ : F, a = (T' / T - g) / 3, T' = mean(J g) and X_(ai)(bk) = g_ak g_bi

    f = sum w c (t + p a)
    K = sum w [B~^T A B~ + c (a t^T + t a^T + p a a^T + p/3 (T''/T - T' T'^T / T^2 + X))],  T'' = mean(J (g g^T - X))

Source: J. C. Simo, R. L. Taylor, K. S. Pister, CMAME 51 (1985) 177-208 (mean dilatation); B. Moran, M. Ortiz, C. F. Shih, IJNME 29 (1990)
483-514 (as a projected F).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.discretisation import once_per_part
from fcsim.assembly.elements import quadrature, refuse_inverted
from fcsim.assembly.nonlinear._tangent_kernels import cell_tangents
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part


@dataclass(frozen=True, eq=False)
class PartCells:
    """Of a part's cells, in its axes: gradient (nc, nq, k, d) [1/m] of shape functions, weight (nc, nq) [m^3], place (nc, nq, 3) [m]."""

    cells: IntArray
    gradient: FloatArray
    weight: FloatArray
    place: FloatArray


@once_per_part
def part_cells(part: Part) -> PartCells:
    """The cells of a part at its quadrature points."""
    kind = CELL_TYPES[part.cell_type]
    at, weights = quadrature(kind)
    refuse_inverted(part)
    corners = part.points[part.cells]
    jacobians = np.einsum("cai,qaj->cqij", corners - corners[:, :1], kind.gradient(at))
    gradient = kind.gradient(at) @ np.linalg.inv(jacobians)
    place = np.zeros((*gradient.shape[:2], 3))
    place[..., : part.dimension] = np.einsum("qa,cai->cqi", kind.shape(at), corners)
    return PartCells(part.cells, np.ascontiguousarray(gradient), part.thickness * weights * np.linalg.det(jacobians), place)


class CellStrain(Protocol):
    """The deformation of some cells with displacements u (n, k, d): what the law is asked, and what its answer makes of the cells.

    P (n, nq, 3, 3), A (n, nq, 3, 3, 3, 3): of the law, already times the points' weights
    """

    F: FloatArray

    def __init__(self, gradient: FloatArray, weight: FloatArray, u: FloatArray) -> None: ...

    def force(self, P: FloatArray) -> FloatArray:
        """(n, k, d) [N]."""
        ...

    def tangent(self, P: FloatArray, A: FloatArray) -> FloatArray:
        """(n, k d, k d) [N/m]."""
        ...

    def rate(self, v: FloatArray) -> FloatArray:
        """The change (n, nq, 3, 3) of F for changes v (n, k, d) of the displacements."""
        ...


class Displacements:
    """F of the displacements' own gradient."""

    def __init__(self, gradient: FloatArray, weight: FloatArray, u: FloatArray) -> None:
        self._G = gradient
        self.F = _in_space(np.einsum("cai,cqaj->cqij", u, gradient, optimize=True))
        self.F[..., [0, 1, 2], [0, 1, 2]] += 1

    def force(self, P: FloatArray) -> FloatArray:
        d = self._G.shape[-1]
        f: FloatArray = np.einsum("cqij,cqaj->cai", P[..., :d, :d], self._G, optimize=True)
        return f

    def tangent(self, P: FloatArray, A: FloatArray) -> FloatArray:
        size = self._G.shape[2] * self._G.shape[3]
        K = np.zeros((len(A), size, size))
        cell_tangents(self._G, np.ascontiguousarray(A), K)
        return K

    def rate(self, v: FloatArray) -> FloatArray:
        return _in_space(np.einsum("cai,cqaj->cqij", v, self._G, optimize=True))


class MeanDilatation:
    """F with the cell's mean of tr F: for small strains."""

    def __init__(self, gradient: FloatArray, weight: FloatArray, u: FloatArray) -> None:
        self._plain = Displacements(gradient, weight, u)
        self._share = weight / weight.sum(axis=1, keepdims=True)
        mean = np.einsum("cq,cqai->cai", self._share, gradient)
        self._difference = ((mean[:, None] - gradient) / 3).reshape(*gradient.shape[:2], -1)  # (n, nq, k d)
        self.F = self.rate(u)
        self.F[..., [0, 1, 2], [0, 1, 2]] += 1

    def rate(self, v: FloatArray) -> FloatArray:
        rate = self._plain.rate(v)
        rate[..., [0, 1, 2], [0, 1, 2]] += np.einsum("cqn,cn->cq", self._difference, v.reshape(len(v), -1))[..., None]
        return rate

    def force(self, P: FloatArray) -> FloatArray:
        f = self._plain.force(P)
        return f + np.einsum("cq,cqn->cn", np.trace(P, axis1=2, axis2=3), self._difference).reshape(f.shape)

    def tangent(self, P: FloatArray, A: FloatArray) -> FloatArray:
        B = _operator(self._plain._G)
        B[:, :, [0, 4, 8]] += self._difference[:, :, None]
        return _product(B, A)


class MeanVolume:
    """F with the cell's mean of det F, see the top of this file."""

    def __init__(self, gradient: FloatArray, weight: FloatArray, u: FloatArray) -> None:
        self._G, self._plain = gradient, Displacements(gradient, weight, u)
        F = self._plain.F
        J = np.linalg.det(F)
        share = weight / weight.sum(axis=1, keepdims=True)
        T = np.einsum("cq,cq->c", share, J)
        with np.errstate(invalid="ignore", divide="ignore"):
            self._c = np.where((J > 0) & (T[:, None] > 0), T[:, None] / J, np.nan) ** (1 / 3)
        inverse = np.linalg.inv(np.where((np.abs(J) > 0)[..., None, None], F, np.eye(3)))
        d = gradient.shape[-1]
        self._g = (gradient @ inverse[..., :d, :d]).reshape(*gradient.shape[:2], -1)
        self._share, self._J, self._T = share, J, T
        self._first = np.einsum("cq,cqn->cn", share * J, self._g)
        self._a = (self._first[:, None] / T[:, None, None] - self._g) / 3
        self.F = self._c[..., None, None] * F

    def rate(self, v: FloatArray) -> FloatArray:
        a = np.einsum("cqn,cn->cq", self._a, v.reshape(len(v), -1))
        return self._c[..., None, None] * (self._plain.rate(v) + a[..., None, None] * self._plain.F)

    def force(self, P: FloatArray) -> FloatArray:
        f = self._plain.force(self._c[..., None, None] * P)
        p = np.einsum("cqij,cqij->cq", P, self._plain.F)
        return f + np.einsum("cq,cqn->cn", self._c * p, self._a).reshape(f.shape)

    def tangent(self, P: FloatArray, A: FloatArray) -> FloatArray:
        nc, nq, k, d = self._G.shape
        c, a, F = self._c, self._a, self._plain.F
        B = c[..., None, None] * (_operator(self._G) + F.reshape(nc, nq, 9, 1) * a[:, :, None])
        K = _product(B, A)
        t = np.einsum("cqij,cqaj->cqai", P[..., :d, :d], self._G).reshape(nc, nq, -1)
        p = c * np.einsum("cqij,cqij->cq", P, F)
        at = np.einsum("cq,cqm,cqn->cmn", c, a, t, optimize=True)
        K += at + at.transpose(0, 2, 1) + np.einsum("cq,cqm,cqn->cmn", p, a, a, optimize=True)
        g = self._g.reshape(nc, nq, k, d)
        weights = np.stack([p / 3, self._share * self._J])
        X = np.einsum("scq,cqak,cqbi->scaibk", weights, g, g, optimize=True).reshape(2, nc, k * d, k * d)
        gg = np.einsum("cq,cqm,cqn->cmn", weights[1], self._g, self._g, optimize=True)
        T = self._T[:, None, None]
        curved = (gg - X[1]) / T - self._first[:, :, None] * self._first[:, None] / T**2
        return K + X[0] + weights[0].sum(axis=1)[:, None, None] * curved


STRAIN: Mapping[str, tuple[type[CellStrain], type[CellStrain]]] = MappingProxyType(
    dict.fromkeys(("P1", "Q1", "P2", "Q2"), (Displacements, Displacements)) | {"Q1-bbar": (MeanDilatation, MeanVolume)}
)
"""How elements strain laws of small and of finite strain."""


def cell_strain(part: Part, finite: bool) -> type[CellStrain]:
    """How the part's elements strain a law of finite or of small strain."""
    if part.elements not in STRAIN:
        known = " or ".join(map(repr, STRAIN))
        raise InputError(f"Part {part.name!r}, elements: expected {known} for a material that is not linear, got {part.elements!r}")
    return STRAIN[part.elements][finite]


def _in_space(H: FloatArray) -> FloatArray:
    """(.., d, d) as (.., 3, 3), zero elsewhere."""
    d = H.shape[-1]
    if d == 3:
        return H
    F = np.zeros((*H.shape[:-2], 3, 3))
    F[..., :d, :d] = H
    return F


def _operator(G: FloatArray) -> FloatArray:
    """(n, nq, 9, k d): F's changes by the displacements of the nodes."""
    n, nq, k, d = G.shape
    B = np.zeros((n, nq, 3, 3, k, d))
    for i in range(d):
        B[:, :, i, :d, :, i] = G.swapaxes(2, 3)
    return B.reshape(n, nq, 9, k * d)


def _product(B: FloatArray, A: FloatArray) -> FloatArray:
    """sum_q B^T A B (n, k d, k d)."""
    n, nq, nine, size = B.shape
    AB = A.reshape(n, nq, nine, nine) @ B
    product: FloatArray = B.reshape(n, nq * nine, size).transpose(0, 2, 1) @ AB.reshape(n, nq * nine, size)
    return product
