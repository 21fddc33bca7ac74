"""The matrix of the deformable bodies' unknowns as a whole, for who reads its entries."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.kinematics.turned_matrix import TurnedMatrix
from fcsim.assembly.model import Model


class ElasticMatrix:
    """The deformable bodies' block of A on the problems' unknowns, made where it is asked for."""

    def __init__(self, model: Model, mass: float, stiffness: float) -> None:
        self._model, self._mass, self._stiffness = model, mass, stiffness

    def at(self, rotation: FloatArray | None, blocks: Mapping[int, FloatArray], rigid: sp.csr_array) -> sp.csr_array:
        """The block with the bodies turned by rotation (n_deformable, d, d), None: not, and the blocks of nonlinear groups; after it that
        of the rigid bodies."""
        if self._axes is None:
            return self._own.at(rotation, blocks, rigid)
        A = self._own.at(rotation, blocks, sp.csr_array((0, 0)))
        return joined(self._restricted(self._axes @ A @ self._axes.T), rigid)

    @cached_property
    def _own(self) -> TurnedMatrix:
        """Where supports have axes of their own, of all dofs in world axes."""
        model = self._model
        if self._axes is None:
            return TurnedMatrix(model.groups, self._mass, self._stiffness, self._free, model.driven == "eliminated")
        return TurnedMatrix(model.groups, self._mass, self._stiffness, np.ones_like(self._free), False)

    @cached_property
    def _axes(self) -> sp.csr_array | None:
        axes = self._model.held.axes
        return None if axes is None else axes.matrix(0, self._model.n_elastic)

    @property
    def _free(self) -> BoolArray:
        free = np.ones(self._model.n_elastic, dtype=bool)
        free[self._model.driven_dofs[self._model.driven_dofs < len(free)]] = False
        return free

    @cached_property
    def block(self) -> sp.csr_array:
        """The block of bodies that are not turned."""
        n = self._model.n_elastic
        A = self._model.matrix(self._mass, self._stiffness)[:n, :n]
        return self._restricted(A if self._axes is None else self._axes @ A @ self._axes.T)

    def _restricted(self, A: sp.csr_array) -> sp.csr_array:
        free = self._free.astype(float)
        if self._model.driven == "eliminated":
            return sp.csr_array(A[free > 0][:, free > 0])
        A = sp.csr_array(sp.diags_array(free) @ A @ sp.diags_array(free) + sp.diags_array(1 - free))
        A.eliminate_zeros()
        return A


def joined(first: sp.csr_array, second: sp.csr_array) -> sp.csr_array:
    """diag(first, second) of two csr_arrays as one."""
    n = first.shape[0]
    return sp.csr_array(
        (
            np.concatenate([first.data, second.data]),
            np.concatenate([first.indices, second.indices + n]),
            np.concatenate([first.indptr, first.indptr[-1] + second.indptr[1:]]),
        ),
        shape=(n + second.shape[0], n + second.shape[0]),
    )
