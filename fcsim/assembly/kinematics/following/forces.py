"""Forces and moments that turn with surfaces of deformable bodies: on the nodes, and their derivative."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.forms.turning_force import TurningForce
from fcsim.assembly.kinematics.following.when import When
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.loads import FollowerForce, factor_at, turning_force


class FollowingForces:
    """The `loads` on surfaces of deformable bodies; displacements x (n_dofs,) [m], forces (n_dofs,) [N]."""

    def __init__(self, layout: BodyLayout, loads: Sequence[FollowerForce]) -> None:
        self.loads, self._layout = tuple(loads), layout
        self._spread: list[tuple[IntArray, TurningForce]] = [turning_force(layout, load) for load in loads]

    @property
    def nodes(self) -> IntArray:
        """Numbers of the nodes that they act on."""
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *(nodes for nodes, _ in self._spread)]))

    def _acting(self, x: FloatArray, when: When) -> Iterator[tuple[float, IntArray, TurningForce, FloatArray]]:
        """Of each load its factor, its nodes (k,), the force and where they stand (k, d)."""
        d = self._layout.dimension
        for load, (nodes, spread) in zip(self.loads, self._spread, strict=True):
            factor = when.share * factor_at(load, when.end) + (1 - when.share) * factor_at(load, when.begin)
            yield factor, nodes, spread, self._layout.reference[nodes] + x[: self._layout.n_elastic].reshape(-1, d)[nodes]

    def force(self, x: FloatArray, when: When) -> FloatArray:
        """F (n_dofs,)."""
        total, d = np.zeros(self._layout.n_dofs), self._layout.dimension
        for factor, nodes, spread, points in self._acting(x, when):
            total[: self._layout.n_elastic].reshape(-1, d)[nodes] += factor * spread.forces(points)
        return total

    def derivative(self, x: FloatArray, when: When) -> sp.csr_array:
        """dF/dx (n_dofs, n_dofs), not symmetric, dense among the nodes of each load."""
        n, d = self._layout.n_dofs, self._layout.dimension
        total = sp.csr_array((n, n))
        for factor, nodes, spread, points in self._acting(x, when):
            dofs = (d * nodes[:, None] + np.arange(d)).ravel()
            K = factor * spread.tangents(points).transpose(0, 2, 1, 3).reshape(len(dofs), -1)
            places = np.repeat(dofs, len(dofs)), np.tile(dofs, len(dofs))
            total = total + sp.csr_array((K.ravel(), places), shape=(n, n))
        return total
