"""Bodies that share their operators: K and M of a part are assembled and turned once for all its like copies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly import elasticity
from fcsim.assembly.layout import BodyLayout
from fcsim.mesh.part import Part


@dataclass(frozen=True, eq=False)
class Group:
    """Deformable bodies that share their operators: one part, one orientation, the same supported degrees of freedom.

    first (nb,) first dof of each body; rotation (d, d) of all of them; K, M (n_part, n_part) in world axes; driven (n_part,) bool
    """

    part: Part
    first: IntArray
    nodes: IntArray
    rotation: FloatArray
    K: Any
    M: Any
    lumped: FloatArray | None
    driven: NDArray[np.bool_]

    @property
    def size(self) -> int:
        return len(self.driven)

    @property
    def dofs(self) -> IntArray:
        """Degrees of freedom (nb, n_part)."""
        return self.first[:, None] + np.arange(self.size)


def rotated(operator: Any, rotation: FloatArray) -> Any:
    """Return T K T^T for a matrix of a part placed by `rotation`."""
    d = len(rotation)
    if np.array_equal(rotation, np.eye(d)):
        return operator
    T = sp.kron(sp.eye_array(operator.shape[0] // d), sp.csr_array(rotation), format="csr")
    return sp.csr_array(T @ operator @ T.T)


def operator_groups(layout: BodyLayout, driven_dofs: IntArray, lumped: bool) -> tuple[Group, ...]:
    """Return the groups of the deformable bodies; driven_dofs: numbers of the supported dofs; lumped or consistent mass."""
    driven = np.zeros(layout.n_dofs, dtype=bool)
    driven[driven_dofs] = True
    members: dict[tuple[int, bytes, bytes], list[int]] = {}
    for b, body in enumerate(layout.deformable):
        own = driven[layout.dof_offset[b] : layout.dof_offset[b + 1]]
        members.setdefault((id(body.part), body.rotation.tobytes(), own.tobytes()), []).append(b)
    groups = []
    for numbers in members.values():
        body = layout.deformable[numbers[0]]
        operators = elasticity.assemble(body.part)
        first = layout.dof_offset[numbers]
        groups.append(
            Group(
                part=body.part,
                first=first,
                nodes=layout.node_offset[numbers],
                rotation=body.rotation,
                K=rotated(operators.stiffness, body.rotation),
                M=sp.diags_array(operators.lumped_mass).tocsr() if lumped else rotated(operators.consistent_mass, body.rotation),
                lumped=operators.lumped_mass if lumped else None,
                driven=driven[first[0] : first[0] + len(operators.lumped_mass)],
            )
        )
    return tuple(groups)
