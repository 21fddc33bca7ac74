"""Floating frames: what of a body's motion is rotation, and the elastic forces of what is left.

A turning body stands at x_i = c + R (X_i + y_i), X_i its nodes in the reference configuration relative to their centre, R the rotation of
the polar decomposition of A = sum_i w_i (x_i - c) X_i^T with the nodes' shares w_i of the volume: of all rotations the one that leaves the
least sum w_i |y_i|^2. Its energy is E = y . K y / 2 with the K of small strains, so that no rotation stresses it.

Forces are a discrete derivative of E between two configurations 0 and 1 (which may be one and the same: then they are the gradient).
With the means R_ = (R_0 + R_1) / 2 and p_ of x - c, N = R_^-1 A_ and any change dx of the nodes from 0 to 1

    y_1 - y_0 = D dx,  D dx = b - phi x q,  b = R_^T (dx - dc),  q = R_^-1 p_,  (tr N I - N) phi = sum_i w_i X_i x b_i

exactly, since R^T A is symmetric at both ends. The forces D^T f with f = K (y_0 + y_1) / 2 do exactly the work E_1 - E_0 and have no
resultant and no moment about the mean configuration: a scheme whose mean velocity is dx / h keeps momentum, angular momentum
and energy.

Sources: B. Fraeijs de Veubeke, "The dynamics of flexible bodies", Int. J. Eng. Sci. 14, 1976 (the frame); O. Gonzalez, "Time integration
and discrete Hamiltonian systems", J. Nonlinear Sci. 6, 1996 (discrete derivatives).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.forms.rotations import polar_rotation
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics._frame_kernels import (
    block_product,
    columns_between,
    forces_between,
    forces_of,
    spread_arms,
    strained,
    turned_back,
    turned_forth,
)
from fcsim.brief import brief
from fcsim.linear.over_ranks.rows import RowsOverRanks


@dataclass(frozen=True, eq=False)
class Frames:
    """Where bodies of one part stand: rotation R (nb, d, d); spread A (nb, d, d); arm x - c (nb, nn, d); strained y (nb, nn, d) [m]."""

    rotation: FloatArray
    spread: FloatArray
    arm: FloatArray
    strained: FloatArray

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Turned:
    """What is taken from the forces of a difference w F - s T K T^T x: weight w, factor s, rotation Q (n_deformable, d, d) of each body's
    nodes in T, x (n_dofs,)."""

    weight: float
    factor: float
    Q: FloatArray
    x: FloatArray


class FloatingGroup:
    """The frames of a group's bodies and the forces in them; vectors on all dofs (n_dofs,) are in world axes."""

    def __init__(self, group: Group) -> None:
        self.group = group
        weight = group.nodal_volume / group.nodal_volume.sum()
        points = group.part.points @ group.rotation.T
        self.weight = weight
        self.arm: FloatArray = points - weight @ points

    @cached_property
    def dimension(self) -> int:
        return self.arm.shape[1]

    @cached_property
    def _axes(self) -> tuple[int, ...]:
        return tuple(range(self.dimension))

    def displacement(self, x: FloatArray) -> FloatArray:
        """The group's nodes' share (nb, nn, d) of a vector on all dofs."""
        return x[self.group.dofs].reshape(-1, *self.arm.shape)

    def frames(self, x: FloatArray, some: slice = slice(None)) -> Frames:
        """The frames of some of the bodies at the displacements x (n_dofs,) [m]."""
        first = self.group.first[some]
        shape = (len(first), *self.arm.shape)
        arm, y, spread = np.empty(shape), np.empty(shape), np.empty((shape[0], shape[2], shape[2]))
        spread_arms(self._axes, x, first, self.weight, self.arm, arm, spread)
        R = polar_rotation(spread)
        strained(self._axes, arm, R, self.arm, y)
        return Frames(R, spread, arm, y)

    def force(
        self, ends: tuple[Frames, Frames], share: float, damping: float, v: FloatArray | None, less: Turned | None, into: FloatArray
    ) -> None:
        """w D^T K (share y_1 + (1 - share) y_0 + damping D v) [N] between the frames 0 and 1, less s T K T^T x of `less`, into a vector
        (n_dofs,); damping [s], v (n_dofs,) [m/s]. K is read once for both."""
        group, nothing = self.group, into[:0]
        given = [array for end in ends for array in (end.rotation, end.spread, end.arm, end.strained)]
        rate = (0.0, nothing) if v is None else (damping, v)
        second = (False, 1.0, 0.0, ends[0].rotation, nothing)
        if less is not None:
            second = (True, less.weight, less.factor, less.Q[group.members], less.x)
        body, pair = (group.first, self.weight, self.arm), tuple(given)
        if not isinstance(group.K, RowsOverRanks):
            forces_between(self._axes, *body, pair, share, rate, self._K, second, into)
            return
        columns, mean = columns_between(self._axes, *body, pair, share, rate, second)
        forces_of(self._axes, group.K @ columns, mean, *body, pair, second, into)

    def turned_stiffness(self, Q: FloatArray, x: FloatArray, into: FloatArray) -> None:
        """T K T^T x with the rotation Q (n_deformable, d, d) of each body's nodes in T, x (n_dofs,), into a vector (n_dofs,)."""
        group = self.group
        columns, own = np.empty((group.size, len(group.first))), Q[group.members]
        turned_back(self._axes, x, group.first, own, self._all, columns, 0)
        products = group.K @ columns if isinstance(group.K, RowsOverRanks) else block_product(*self._K, columns)
        turned_forth(self._axes, products, group.first, own, self._all, into)

    @cached_property
    def _K(self) -> tuple[IntArray, IntArray, FloatArray]:
        """indptr, indices and node blocks (nblocks, d, d) of K."""
        K = sp.bsr_array(self.group.K, blocksize=(self.dimension, self.dimension))
        return K.indptr, K.indices, K.data

    @cached_property
    def _all(self) -> BoolArray:
        return np.ones(self.group.size, dtype=bool)
