"""How far each deformable body has turned and is strained: what its kinematics must cover."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.elements import quadrature
from fcsim.assembly.forms.rotations import angle_of
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.frames import FloatingGroup, Frames
from fcsim.assembly.kinematics.left_out import LeftOut, gradients
from fcsim.brief import brief
from fcsim.mesh.cell_type import CELL_TYPES, CellType
from fcsim.ranks import in_parts

SUSPECT = 0.3
"""Change of a cell's edge, relative to its length, below which no cell of a usable shape is inverted."""

NODES_FROM = 5000
"""Nodes of a group from which ranks share looking at its bodies."""

UNBENT = 0.03
"""Rotation [rad] that cells must exceed to be measured."""


@dataclass(frozen=True, eq=False)
class Deformation:
    """Of each deformable body (n_deformable,).

    rotation [rad] of its frame from the reference
    strain    the largest principal one in size at the most strained of the centres (`CellType.inside` of cells of second order), of bricks
              and quadrilaterals of first order also of that within their faces, in the middles, where a single row of cells that bends is
              strained; of those cells whose law is of small strain, of all where none is; without the body's rotation, of laws of points in
              bodies that turn without that of the point either
    bent [rad] the largest rotation of a cell's middle from what the kinematics turns with, the reference or the body's frame; 0 where
              rotation of points is no strain
    left_out  energy of the strains that such rotations leave out over that of the strains that there are, see `left_out`
    inverted  whether a cell has a negative volume somewhere (of finite strain: at a quadrature point)
    turning   whether its kinematics covers rotation; finite: whether its materials cover any strain
    """

    rotation: FloatArray
    strain: FloatArray
    bent: FloatArray
    left_out: FloatArray
    inverted: BoolArray
    turning: BoolArray
    finite: BoolArray

    __repr__ = brief


class DeformationMeasure:
    """Measures the bodies of groups."""

    def __init__(self, groups: Sequence[Group], count: int, unseen: float = 0.0) -> None:
        """count: number of deformable bodies; unseen: strain below which an upper bound of it will do."""
        self._count, self._unseen = count, unseen
        self._groups = [_GroupMeasure(group) for group in groups]

    def __call__(self, x: FloatArray) -> Deformation:
        """The deformation at the configuration x (n_dofs,)."""
        rotation, strain, bent, left_out = np.zeros((4, self._count))
        inverted, turning, finite = np.zeros((3, self._count), dtype=bool)
        for measure in self._groups:
            group = measure.floating.group
            looks = measure.looks(x)
            rotation[group.members], farthest, upside_down = looks.T
            inverted[group.members] = upside_down > 0
            bound = measure.strain_per_motion * farthest
            frames = measure.floating.frames(x) if measure.exceeds(bound, looks[:, 0], self._unseen) else None
            strain[group.members] = bound if frames is None else measure.strain(frames.strained, bound, self._unseen)
            if frames is not None:
                bent[group.members], left_out[group.members] = measure.bent(frames, bound, self._unseen)
            turning[group.members], finite[group.members] = group.rotates, measure.finite
        return Deformation(rotation, strain, bent, left_out, inverted, turning, finite)


class _GroupMeasure:
    """Measures the bodies of one group, which share a part: gradients at its cells' points are made once."""

    def __init__(self, group: Group) -> None:
        self.floating = FloatingGroup(group)
        self._cell = CELL_TYPES[group.part.cell_type]
        self._where = quadrature(self._cell)[0] if group.finite else self._cell.nodes
        self._points = self.floating.arm
        self._cells = group.part.cells
        limited = None if group.laws is None else group.laws.of_small_strain
        self.finite, self._stretches = limited is not None and not limited.size, limited is not None and group.rotates
        self._limited = self._cells if limited is None or self.finite else self._cells[limited]
        self._inside = self._gradient(_strained_most(self._cell), self._limited)
        self._left_out = None if self.finite or self._stretches else LeftOut(group, self._gradient(self._cell.inside, self._limited))
        components = np.sqrt(np.asarray(self._inside.multiply(self._inside).sum(axis=1)).reshape(-1, self._points.shape[1]).sum(axis=1))
        self.strain_per_motion = float(components.max()) * np.sqrt(self._cells.shape[1])
        edges = np.unique(np.sort(self._cells[:, self._cell.edges].reshape(-1, 2), axis=1), axis=0)
        self._edges: IntArray = edges.T
        self._lengths = np.linalg.norm(self._points[edges[:, 0]] - self._points[edges[:, 1]], axis=1)
        self._shortest = float(self._lengths.min())

    def _gradient(self, at: FloatArray, cells: IntArray) -> sp.csr_array:
        return gradients(self._cell, at, self._points, cells)

    def _displacement_gradient(self, operator: sp.csr_array, y: FloatArray) -> FloatArray:
        """d y_c / d X_i as (places, nb, c, i) for y (nb, nn, d)."""
        nb, nn, d = y.shape
        values = operator @ y.transpose(1, 0, 2).reshape(nn, nb * d)
        return values.reshape(-1, d, nb, d).transpose(0, 2, 3, 1)

    def looks(self, x: FloatArray) -> FloatArray:
        """Of each body (nb, 3) at the configuration x (n_dofs,): rotation [rad], how far a node is from where its frame has it [m], and 1
        where a cell is inverted; each rank looks at some of many."""
        found = np.empty((len(self.floating.group.first), 3))

        def look(begin: int, end: int) -> None:
            frames = self.floating.frames(x, slice(begin, end))
            y, own = frames.strained, found[begin:end]
            own[:, 0] = angle_of(frames.rotation)
            own[:, 1] = np.sqrt(np.einsum("bni,bni->bn", y, y).max(axis=1))
            own[:, 2] = self._inverted(y, own[:, 1])

        in_parts("deformation", len(found), max(2, NODES_FROM // len(self._points)), look, found)
        return found

    def exceeds(self, bound: FloatArray, rotation: FloatArray, unseen: float) -> bool:
        """Whether a body's strain may not be below `unseen`, or its cells may be bent: by the `bound` of strain,
        ||H|| <= ||grad N|| ||y_cell||, and its rotation (nb,)."""
        small = bound.max(initial=0.0) < unseen and not len(self._bent(bound, rotation, unseen))
        return not small

    def _bent(self, bound: FloatArray, rotation: FloatArray, unseen: float) -> IntArray:
        """The bodies whose cells may turn by what counts beside what the kinematics turns with."""
        if self._left_out is None:
            return np.empty(0, dtype=np.int64)
        turned = bound if self.floating.group.rotates else bound + rotation
        return np.flatnonzero(turned >= min(unseen, UNBENT))

    def strain(self, y: FloatArray, bound: FloatArray, unseen: float) -> FloatArray:
        """Largest principal strain in size (nb,) of y (nb, nn, d); its bound where all of these are below `unseen`."""
        if bound.max(initial=0.0) < unseen:
            return bound
        H = self._displacement_gradient(self._inside, y)
        epsilon = 0.5 * (H + H.swapaxes(2, 3))
        if self._stretches:  # Green and Lagrange's strain, which no rotation of a point changes
            epsilon = epsilon + 0.5 * H.swapaxes(2, 3) @ H
        if len(self._within):
            first = len(epsilon) - len(self._within)
            epsilon[first:] = self._within[:, None] @ epsilon[first:] @ self._within[:, None]
        most = np.argmax(np.einsum("qbij,qbij->qb", epsilon, epsilon), axis=0)
        principal: FloatArray = np.linalg.eigvalsh(epsilon[most, np.arange(len(y))])
        return np.abs(np.sqrt(1 + 2 * principal) - 1 if self._stretches else principal).max(axis=1)

    @cached_property
    def _within(self) -> FloatArray:
        """1 - n n^T (nq nc, d, d) of the faces' middles: strains within the faces, since shear across the end faces of long cells that bend
        is none of bodies but of the cells' few degrees of freedom, and modes within take it away."""
        d = self._points.shape[1]
        middles = _strained_most(self._cell)[len(self._cell.inside) :]
        if not len(middles):
            return np.empty((0, d, d))
        jacobian = np.einsum("cai,qaj->qcij", self._points[self._limited], self._cell.gradient(middles))
        # the middle of a face of [-1, 1]^d is its normal
        normal = np.einsum("qj,qcji->qci", middles, np.linalg.inv(jacobian)).reshape(-1, d)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        within: FloatArray = np.eye(d) - normal[:, :, None] * normal[:, None, :]
        return within

    def bent(self, frames: Frames, bound: FloatArray, unseen: float) -> tuple[FloatArray, FloatArray]:
        """Largest rotations (nb,) of cells' middles [rad] and what strains of small rotation leave out (nb,), see `Deformation`; 0 where
        the bound of strain tells that both are small."""
        angle, share = np.zeros((2, len(frames.rotation)))
        if self._left_out is None:
            return angle, share
        y = frames.strained
        for b in self._bent(bound, angle_of(frames.rotation), unseen):
            moved = y[b] if self.floating.group.rotates else frames.arm[b] - self.floating.arm
            angle[b], share[b] = self._left_out(moved)
        return angle, share

    def _inverted(self, y: FloatArray, farthest: FloatArray) -> BoolArray:
        """Whether a cell of each body is inverted (nb,) by y (nb, nn, d), the largest of which are `farthest` (nb,)."""
        found = np.zeros(len(y), dtype=bool)
        suspect = np.flatnonzero(2 * farthest > SUSPECT * self._shortest)  # no edge can change by more
        if suspect.size:
            a, b = self._edges
            change = np.linalg.norm(y[suspect][:, a] - y[suspect][:, b], axis=2) / self._lengths
            suspect = suspect[change.max(axis=1) > SUSPECT]
        if suspect.size:
            H = self._displacement_gradient(self._gradient(self._where, self._cells), y[suspect])
            found[suspect] = np.any(np.linalg.det(np.eye(y.shape[2]) + H) <= 0, axis=0)
        return found


def _strained_most(cell: CellType) -> FloatArray:
    """Where strain is measured (nq, d): `CellType.inside`; of first order but simplices the middles of the faces, too."""
    if cell.simplex or cell.order > 1:
        return cell.inside
    return np.concatenate([cell.inside, cell.nodes[cell.facets].mean(axis=1)])
