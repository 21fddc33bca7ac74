"""Bodies that share their operators: K and M of a part are assembled and turned once for all its like copies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly import elasticity
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.nonlinear.part import NonlinearPart, nonlinear_part
from fcsim.assembly.over_ranks.pieces import spread_operators, spread_over
from fcsim.assembly.supports import HeldDofs
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.linear.over_ranks.rows import RowsOverRanks
from fcsim.linear.sparse._vectors_kernels import put_rows, rows_of
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Kinematics, Part
from fcsim.ranks import World

PARALLEL = 1e-12
"""1 less the cosine of axes that are one."""


@dataclass(frozen=True, eq=False)
class Group:
    """Deformable bodies that share their operators: one part, one orientation, the same supported degrees of freedom.

    members (nb,) their numbers; first (nb,) first dof, nodes (nb,) first node of each; turning: whether they stand in floating frames
    laws: of a part whose material is not linear; K is then its tangent at the beginning
    nodal_volume (nn,) [m^3]; rotation (d, d) of all of them; K, M (n_part, n_part) in world axes; driven (n_part,) bool along the
    supports' axes, the rows of `axes` (nn, d, d), None = the world's. Of a part that ranks have together K, and a consistent M, are rows of
    theirs
    """

    part: Part
    turning: bool
    members: IntArray
    first: IntArray
    nodes: IntArray
    rotation: FloatArray
    K: sp.csr_array | RowsOverRanks
    M: sp.csr_array | RowsOverRanks
    lumped: FloatArray | None
    nodal_volume: FloatArray
    driven: NDArray[np.bool_]
    axes: FloatArray | None = None
    laws: NonlinearPart | None = None

    __repr__ = brief

    @property
    def over_ranks(self) -> bool:
        """Whether ranks have the group's operators and its factor together."""
        return isinstance(self.K, RowsOverRanks)

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
    def axes_matrix(self) -> sp.csr_array | None:
        """T (n_part, n_part): along the supports' axes from world axes; None where all are the world's."""
        if self.axes is None:
            return None
        count = len(self.axes)
        blocks = sp.bsr_array((self.axes, np.arange(count), np.arange(count + 1)), shape=(self.size, self.size))
        return with_short_indices(sp.csr_array(blocks))

    @cached_property
    def turnable(self) -> FloatArray | None:
        """About which axes the system matrix can turn with the bodies although some directions are driven: (3, 3), all, where each node
        is driven in all directions or none; (1, 3), 3D: the one along or across which all driven directions are; None: about none."""
        d = len(self.rotation)
        driven = self.driven.reshape(-1, d)
        some = driven.any(axis=1) & ~driven.all(axis=1)
        if not some.any():
            return np.eye(3)
        if d == 2:
            return None
        frames = np.broadcast_to(np.eye(3), (len(driven), 3, 3)) if self.axes is None else self.axes
        kinds = driven[some]
        single = np.where((kinds.sum(axis=1) == 1)[:, None], kinds, ~kinds)  # the one driven direction, or the one that is left free
        axes = frames[some][single]
        return axes[:1] if np.all(np.abs(np.abs(axes @ axes[0]) - 1) < PARALLEL) else None

    @property
    def places(self) -> FloatArray:
        """Where each degree of freedom stands in the part (n_part, d) [m]."""
        return np.repeat(self.part.points, len(self.rotation), axis=0)

    @cached_property
    def dofs(self) -> IntArray:
        """Degrees of freedom (nb, n_part)."""
        return self.first[:, None] + np.arange(self.size)

    def between(self, begin: int, end: int) -> IntArray:
        """First dofs (k,) of the bodies whose dofs are among begin, ..., end - 1."""
        i, j = np.searchsorted(self.first, (begin, end))
        return self.first[i:j]

    def rows(self, x: FloatArray, first: IntArray | None = None) -> FloatArray:
        """x[dofs] (nb, n_part) of x (n_dofs,); first (k,): of some bodies alone."""
        first = self.first if first is None else first
        own = np.empty((len(first), self.size))
        rows_of(first, x, own)
        return own

    def put(self, x: FloatArray, rows: FloatArray, first: IntArray | None = None) -> None:
        """x[dofs] = rows (nb, n_part), x (n_dofs,); first (k,): of some bodies alone."""
        put_rows(self.first if first is None else first, rows, x)


def rotated[A: (sp.csr_array, RowsOverRanks)](operator: A, rotation: FloatArray) -> A:
    """Return T K T^T for a matrix of a part placed by `rotation`."""
    d = len(rotation)
    if np.array_equal(rotation, np.eye(d)):
        return operator
    T = sp.kron(sp.eye_array(operator.shape[0] // d), sp.csr_array(rotation), format="csr")
    return operator.turned(T) if isinstance(operator, RowsOverRanks) else sp.csr_array(T @ operator @ T.T)


def can_turn(points: FloatArray, driven: BoolArray, axes: FloatArray | None = None) -> bool:
    """Whether some rotation of the points (nn, d) moves no driven degree of freedom (d nn,), a translation to it given; driven along the
    rows of `axes` (nn, d, d), None = the world's."""
    d = points.shape[1]
    arm = points - points.mean(axis=0)
    size = np.abs(arm).max() or 1.0
    rotations = []
    for i, j in [(0, 1)] if d == 2 else [(0, 1), (1, 2), (0, 2)]:
        mode = np.zeros_like(arm)
        mode[:, i], mode[:, j] = -arm[:, j] / size, arm[:, i] / size
        rotations.append((mode if axes is None else np.einsum("aij,aj->ai", axes, mode)).ravel()[driven])
    if not driven.any():
        return True
    translations = (np.tile(np.eye(d), (len(points), 1)) if axes is None else axes.reshape(-1, d))[driven]
    modes = np.column_stack([translations, *rotations])
    return bool(np.linalg.matrix_rank(modes, tol=1e-8) - np.linalg.matrix_rank(translations, tol=1e-8) < len(rotations))


def operator_groups(layout: BodyLayout, held: HeldDofs, lumped: bool, kinematics: Kinematics | None) -> tuple[Group, ...]:
    """Return the groups of the deformable bodies; held: what supports drive; lumped or consistent mass; kinematics: of the bodies that do
    not name theirs; None: those are turning that can turn. What a driven rotation turns is turning unless it names another itself."""
    driven = np.zeros(layout.n_dofs, dtype=bool)
    driven[held.dofs] = True
    turned = {layout.body_number(turn.source.body) for turn in held.turns}
    members: dict[tuple[int, bool, bytes, bytes, bytes], list[int]] = {}
    axes_of: dict[int, FloatArray | None] = {}
    for b, body in enumerate(layout.deformable):
        bounds = int(layout.dof_offset[b]), int(layout.dof_offset[b + 1])
        own = driven[slice(*bounds)]
        axes = axes_of[b] = None if held.axes is None else held.axes.blocks(*bounds, layout.dimension)
        if body.kinematics == "linear" and not is_linear(body.part.material) and nonlinear_part(body.part)[True].finite:
            raise InputError(f"Body {body.name!r}, kinematics: expected 'turning' or None for a material of finite strain, got 'linear'")
        named = body.kinematics or ("turning" if b in turned else kinematics)
        turning = named == "turning" if named else can_turn(body.points, own, axes)
        along = b"" if axes is None else axes.tobytes()
        members.setdefault((id(body.part), turning, body.rotation.tobytes(), own.tobytes(), along), []).append(b)
    groups, spread = [], spread_over(layout)
    for (_, turning, _, _, _), numbers in members.items():
        body = layout.deformable[numbers[0]]
        linear = is_linear(body.part.material)
        laws = None if linear else nonlinear_part(body.part)[turning]
        K, M, lumped_mass, volume = _operators(body.part, laws, lumped, spread.get(id(body.part)))
        first = layout.dof_offset[numbers]
        groups.append(
            Group(
                part=body.part,
                turning=turning and linear,
                members=np.array(numbers),
                first=first,
                nodes=layout.node_offset[numbers],
                rotation=body.rotation,
                K=rotated(K, body.rotation),
                M=M if lumped else rotated(M, body.rotation),
                lumped=lumped_mass if lumped else None,
                nodal_volume=volume,
                driven=driven[first[0] : first[0] + len(lumped_mass)],
                laws=laws,
                axes=axes_of[numbers[0]],
            )
        )
    return tuple(groups)


type Operator = sp.csr_array | RowsOverRanks


def _operators(
    part: Part, laws: NonlinearPart | None, lumped: bool, ranks: World | None
) -> tuple[Operator, Operator, FloatArray, FloatArray]:
    """K, M, the lumped mass (n_part,) and the nodes' volumes (nn,) of a part; ranks: those that have it together."""
    if ranks is not None:
        spread = spread_operators(part, ranks, lumped=lumped)
        M = spread.consistent_mass or sp.diags_array(spread.lumped_mass).tocsr()
        return spread.stiffness, M, spread.lumped_mass, spread.nodal_volume
    mass = elasticity.lumped_mass(part)
    return (
        elasticity.stiffness(part) if laws is None else laws.graph.matrix(laws.first_tangent),
        sp.diags_array(mass).tocsr() if lumped else elasticity.consistent_mass(part),
        mass,
        elasticity.nodal_volume(part),
    )
