"""Bodies that share their operators: K and M of a part are assembled and turned once for all its like copies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly import elasticity
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.nonlinear.part import NonlinearPart, nonlinear_part
from fcsim.errors import InputError
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Kinematics, Part


@dataclass(frozen=True, eq=False)
class Group:
    """Deformable bodies that share their operators: one part, one orientation, the same supported degrees of freedom.

    members (nb,) their numbers; first (nb,) first dof, nodes (nb,) first node of each; turning: whether they stand in floating frames
    laws: of a part whose material is not linear; K is then its tangent at the beginning
    nodal_volume (nn,) [m^3]; rotation (d, d) of all of them; K, M (n_part, n_part) in world axes; driven (n_part,) bool
    """

    part: Part
    turning: bool
    members: IntArray
    first: IntArray
    nodes: IntArray
    rotation: FloatArray
    K: Any
    M: Any
    lumped: FloatArray | None
    nodal_volume: FloatArray
    driven: NDArray[np.bool_]
    laws: NonlinearPart | None = None

    @property
    def finite(self) -> bool:
        """Whether strains may be of any size."""
        return self.laws is not None and self.laws.finite

    @property
    def rotates(self) -> bool:
        """Whether rotations of any size are no strain."""
        return self.turning if self.laws is None else self.laws.turning

    @property
    def size(self) -> int:
        return len(self.driven)

    @cached_property
    def turnable(self) -> str:
        """About which axes the system matrix can turn with the bodies although some degrees of freedom are driven: "all" where each node
        is driven in all directions or none, "x", "y" or "z" where driven directions are those along or across one axis, "none" else."""
        d = len(self.rotation)
        kinds = np.unique(self.driven.reshape(-1, d), axis=0)
        if np.all(kinds.all(axis=1) | ~kinds.any(axis=1)):
            return "all"
        if d == 3:
            for axis, name in enumerate("xyz"):
                across = np.delete(kinds, axis, axis=1)
                if np.all(across[:, 0] == across[:, 1]):
                    return name
        return "none"

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


def can_turn(points: FloatArray, driven: BoolArray) -> bool:
    """Whether some rotation of the points (nn, d) moves no driven degree of freedom (d nn,), a translation to it given."""
    d = points.shape[1]
    arm = points - points.mean(axis=0)
    size = np.abs(arm).max() or 1.0
    rotations = []
    for i, j in [(0, 1)] if d == 2 else [(0, 1), (1, 2), (0, 2)]:
        mode = np.zeros_like(arm)
        mode[:, i], mode[:, j] = -arm[:, j] / size, arm[:, i] / size
        rotations.append(mode.ravel()[driven])
    if not driven.any():
        return True
    translations = np.tile(np.eye(d), (len(points), 1))[driven]
    modes = np.column_stack([translations, *rotations])
    return bool(np.linalg.matrix_rank(modes, tol=1e-8) - np.linalg.matrix_rank(translations, tol=1e-8) < len(rotations))


def operator_groups(layout: BodyLayout, driven_dofs: IntArray, lumped: bool, kinematics: Kinematics | None) -> tuple[Group, ...]:
    """Return the groups of the deformable bodies; driven_dofs: numbers of the supported dofs; lumped or consistent mass; kinematics: of
    the bodies that do not name theirs; None: those are turning that can turn."""
    driven = np.zeros(layout.n_dofs, dtype=bool)
    driven[driven_dofs] = True
    members: dict[tuple[int, bool, bytes, bytes], list[int]] = {}
    for b, body in enumerate(layout.deformable):
        own = driven[layout.dof_offset[b] : layout.dof_offset[b + 1]]
        if body.kinematics == "linear" and not is_linear(body.part.material) and nonlinear_part(body.part)[True].finite:
            raise InputError(f"Body {body.name!r}, kinematics: expected 'turning' or None for a material of finite strain, got 'linear'")
        named = body.kinematics or kinematics
        turning = named == "turning" if named else can_turn(body.points, own)
        members.setdefault((id(body.part), turning, body.rotation.tobytes(), own.tobytes()), []).append(b)
    groups = []
    for (_, turning, _, _), numbers in members.items():
        body = layout.deformable[numbers[0]]
        linear = is_linear(body.part.material)
        laws = None if linear else nonlinear_part(body.part)[turning]
        stiffness = elasticity.stiffness(body.part) if laws is None else laws.graph.matrix(laws.first_tangent)
        lumped_mass = elasticity.lumped_mass(body.part)
        first = layout.dof_offset[numbers]
        groups.append(
            Group(
                part=body.part,
                turning=turning and linear,
                members=np.array(numbers),
                first=first,
                nodes=layout.node_offset[numbers],
                rotation=body.rotation,
                K=rotated(stiffness, body.rotation),
                M=sp.diags_array(lumped_mass).tocsr() if lumped else rotated(elasticity.consistent_mass(body.part), body.rotation),
                lumped=lumped_mass if lumped else None,
                nodal_volume=elasticity.nodal_volume(body.part),
                driven=driven[first[0] : first[0] + len(lumped_mass)],
                laws=laws,
            )
        )
    return tuple(groups)
