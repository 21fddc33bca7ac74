"""The inner forces of all bodies of a model whose materials are not linear, on vectors of n_dofs in world axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.groups import Group
from fcsim.assembly.nonlinear.part import Inner, Instant, NonlinearPart
from fcsim.assembly.shares.shares import Shares


@dataclass(frozen=True, eq=False)
class InnerForces:
    """force (n_dofs,) [N]; energy stored, dissipated over dt [J], viscous [W], sums over the bodies; variables (n_variables,) at the end;
    blocks: of each group the bodies' tangents (nb, nblocks, d, d) in world axes, () where not asked for; admissible: whether all bodies'
    points are; inadmissible: number of the first body that is not, -1 = none"""

    force: FloatArray
    energy: float
    dissipated: float
    viscous: float
    variables: FloatArray
    blocks: tuple[FloatArray, ...]
    inadmissible: int

    @property
    def admissible(self) -> bool:
        return self.inadmissible < 0


class Shared(Protocol):
    """What knows whose body is whose, None where this process computes alone."""

    @property
    def shares(self) -> Shares | None: ...


class NonlinearBodies:
    """The bodies of the groups that have laws of points; beta [s]: the damping proportional to stiffness; model: that shares them."""

    def __init__(self, groups: Sequence[Group], beta: float, model: Shared) -> None:
        self.groups = tuple(group for group in groups if group.laws is not None)
        self.beta, self._model = beta, model
        sizes = [group.laws.size * len(group.members) for group in self.groups if group.laws is not None]
        self._last: tuple[tuple[object, ...], InnerForces] | None = None
        self._offset = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    def __bool__(self) -> bool:
        return bool(self.groups)

    @property
    def initial(self) -> FloatArray:
        """Internal variables (n_variables,) at the beginning."""
        values = [np.tile(group.laws.initial, len(group.members)) for group in self.groups if group.laws is not None]
        return np.concatenate([*values, np.empty(0)])

    def _own(self, x: FloatArray, group: Group) -> FloatArray:
        """The nodes' share (nb, nn, d) of x (n_dofs,) in the part's axes."""
        d = len(group.rotation)
        return x[group.dofs].reshape(len(group.members), -1, d) @ group.rotation

    def shares(self, variables: FloatArray | None) -> list[tuple[Group, NonlinearPart, FloatArray]]:
        """Of each group its part and its bodies' internal variables (nb, size); None: those at the beginning."""
        values = self.initial if variables is None else variables
        found = []
        for k, group in enumerate(self.groups):
            assert group.laws is not None
            own = values[self._offset[k] : self._offset[k + 1]]
            found.append((group, group.laws, own.reshape(len(group.members), group.laws.size)))
        return found

    def inner(
        self,
        x: FloatArray,
        variables: FloatArray | None,
        t: float,
        dt: float,
        *,
        v: FloatArray | None = None,
        rate: float = 0.0,
        start: tuple[FloatArray, float] | None = None,
        tangent: bool = False,
        earlier: FloatArray | None = None,
    ) -> InnerForces:
        """Forces at the configuration x (n_dofs,) and the time t, dt after the internal variables (None: those at the beginning).

        v (n_dofs,): velocities that are damped, with their change `rate` [1/s] for a unit change of x in the tangent.
        start = (x_0 (n_dofs,), s): x is the share s of the way from x_0 to the end of a step, see `fcsim.assembly.nonlinear.mean_strain`.
        earlier (n_dofs,): a configuration from which the tangent's stresses are linear, see `fcsim.assembly.nonlinear.foreseen`.
        What was asked for last is remembered: a step ends where its energy is measured.
        """
        arrays = (x, variables, v, None if start is None else start[0], earlier)
        key = (*(None if a is None else a.tobytes() for a in arrays), t, dt, rate, None if start is None else start[1], tangent)
        if self._last is None or self._last[0] != key:
            begin, share = (None, 1.0) if start is None else start
            self._last = key, self._computed(x, variables, Instant(t, dt, self.beta, v, rate, begin, share, earlier), tangent)
        return self._last[1]

    def _computed(self, x: FloatArray, variables: FloatArray | None, when: Instant, tangent: bool) -> InnerForces:
        """`inner` where it is not remembered; the vectors of `when` are (n_dofs,), in world axes."""
        force, energy, dissipated, viscous = np.zeros_like(x), 0.0, 0.0, 0.0
        after, blocks, bad = [np.empty(0)], [], -1
        for group, part, own in self.shares(variables):
            v, begin, earlier = (None if of_all is None else self._own(of_all, group) for of_all in (when.v, when.start, when.earlier))
            instant = replace(when, beta=0.0 if v is None else when.beta, v=v, start=begin, earlier=earlier)
            inner = self._inner(group, part, self._own(x, group), own, instant, tangent)
            force[group.dofs] = (inner.force @ group.rotation.T).reshape(len(own), -1)
            energy, dissipated = energy + float(inner.energy.sum()), dissipated + float(inner.dissipated.sum())
            viscous += float(inner.viscous.sum())
            after.append(inner.variables.ravel())
            if not inner.admissible.all() and bad < 0:
                bad = int(group.members[int(np.argmin(inner.admissible))])
            if inner.blocks is not None:
                blocks.append(group.rotation @ inner.blocks @ group.rotation.T)
        return InnerForces(force, energy, dissipated, viscous, np.concatenate(after), tuple(blocks), bad)

    def _inner(self, group: Group, part: NonlinearPart, u: FloatArray, own: FloatArray, instant: Instant, tangent: bool) -> Inner:
        """`NonlinearPart.inner` of the group's bodies, by their owners where ranks share them; the stresses of other ranks' bodies, which
        no step asks for, are nan."""
        shares = self._model.shares
        if shares is None:
            return part.inner(u, own, instant, tangent)
        mine = shares.mine(group.members)
        with shares.world.together("inner forces"):
            v, begin, earlier = (None if of_all is None else of_all[mine] for of_all in (instant.v, instant.start, instant.earlier))
            some = replace(instant, v=v, start=begin, earlier=earlier)
            inner = part.inner(u[mine], own[mine], some, tangent)
        nb, count = len(mine), int(mine.sum())
        fields = [inner.force, inner.energy, inner.dissipated, inner.viscous, inner.variables, inner.admissible]
        fields += [] if inner.blocks is None else [inner.blocks]
        shapes = [values.shape[1:] for values in fields]
        sizes = [int(np.prod(shape, dtype=np.int64)) for shape in shapes]
        rows = np.concatenate([values.reshape(count, size) for values, size in zip(fields, sizes, strict=True)], axis=1, dtype=np.float64)
        parts = np.split(shares.gathered_bodies(group.members, rows), np.cumsum(sizes)[:-1], axis=1)
        force, energy, dissipated, viscous, variables, admissible, *blocks = (
            values.reshape(nb, *shape) for values, shape in zip(parts, shapes, strict=True)
        )
        stress = np.full((nb, *inner.stress.shape[1:]), np.nan)
        stress[mine] = inner.stress
        return Inner(force, energy, dissipated, viscous, variables, blocks[0] if blocks else None, admissible, stress)

    def at_cells(self, x: FloatArray, variables: FloatArray | None, t: float) -> list[tuple[Group, Inner, dict[str, FloatArray]]]:
        """Of each group the stresses (and all else) of its bodies in their parts' axes, and their internal variables by name, (nb, nc) or
        (nb, nc, c), means of the cells' points, as they stand at x (n_dofs,)."""
        return [
            (group, part.inner(self._own(x, group), own, Instant(t, 0.0), False), part.cell_variables(own))
            for group, part, own in self.shares(variables)
        ]


def mass_blocks(group: Group) -> FloatArray:
    """The group's M as blocks (nblocks, d, d) on the graph of its nodes."""
    assert group.laws is not None
    graph, d = group.laws.graph, len(group.rotation)
    M = sp.coo_array(group.M)
    blocks = np.zeros((len(graph.indices), d, d))
    rows: IntArray = np.repeat(np.arange(len(graph.indptr) - 1), np.diff(graph.indptr))
    keys = rows * (len(graph.indptr) - 1) + graph.indices
    at = np.searchsorted(keys, (M.row // d) * (len(graph.indptr) - 1) + M.col // d)
    np.add.at(blocks, (at, M.row % d, M.col % d), M.data)
    return blocks


def changed(new: FloatArray, kept: FloatArray, share: float) -> BoolArray:
    """Of which bodies (nb,) some entry of the blocks (nb, ...) differs by more than a share of the largest."""
    axes = tuple(range(1, new.ndim))
    result: BoolArray = np.abs(new - kept).max(axis=axes, initial=0.0) > share * np.abs(new).max(axis=axes, initial=0.0)
    return result
