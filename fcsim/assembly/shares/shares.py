"""Whose body is whose in a model that ranks share.

Each rank knows the whole model, its state and its contacts. A body's factor, compliance, inner forces and share of W are made by its owner
alone; what is as long as a vector is then gathered, so that every rank goes on with the numbers that one process would have. A factor that
several bodies of linear material share is made, and solved with, by one rank for all of them: solutions depend in their last bits on how
many right sides are solved together. Where that would be one rank for nearly all bodies, as in a wall of equal bricks, each rank has the
factor and solves for all of them: the others would wait, and then for what is exchanged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol
from weakref import WeakKeyDictionary

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.layout import BodyLayout
from fcsim.mesh.material.by_region import is_linear
from fcsim.ranks import World, world
from fcsim.ranks.partition import partition

RIGID, NONLINEAR = 10.0, 30.0
"""Cost of a rigid body, and of a node of nonlinear material, in nodes of linear ones."""

MOST, EVERYONES_UP_TO = 0.75, 3000
"""Share of the work of solutions with which a rank is not worth waiting for; unknowns of a body up to which each rank may have its
factor, of some megabytes."""


class SolvedBodies(Protocol):
    """Bodies of a group as a `SystemFactor` has them: members (nb,) their numbers, dofs (nb, n_part), free: those of the part that are
    solved for."""

    @property
    def members(self) -> IntArray: ...

    @property
    def dofs(self) -> IntArray: ...

    @property
    def free(self) -> IntArray: ...


@dataclass(frozen=True, eq=False)
class Shares:
    """owner (nbodies,): the rank of each body among those of `world`."""

    world: World
    owner: IntArray

    def mine(self, members: IntArray) -> BoolArray:
        """Which of the bodies (nb,) are this rank's."""
        own: BoolArray = self.owner[members] == self.world.number
        return own

    def solver(self, members: IntArray) -> int:
        """The rank that has the most of the bodies; of equals the first."""
        return int(np.argmax(np.bincount(self.owner[members], minlength=self.world.size)))

    def each_solves(self, groups: Sequence[IntArray], sizes: Sequence[int]) -> list[bool]:
        """Of groups of bodies (members, unknowns of a body) that have one `solver` each, which every rank solves for: those of up to
        EVERYONES_UP_TO unknowns, where one rank has MOST of the work, as their squares, or more."""
        work = np.zeros(self.world.size)
        for members, size in zip(groups, sizes, strict=True):
            work[self.solver(members)] += float(size) ** 2 * len(members)
        return [bool(work.max() >= MOST * work.sum()) and size <= EVERYONES_UP_TO for size in sizes]

    def gathered_bodies(self, members: IntArray, own: FloatArray) -> FloatArray:
        """Rows (nb, k) of all bodies from this rank's `own` (number of `mine`, k); inside a section that all ranks have agreed on."""
        owner = self.owner[members]
        counts = np.bincount(owner, minlength=self.world.size)
        width = own.shape[1]
        rows = np.empty((len(members), width))
        rows[np.argsort(owner, kind="stable")] = self.world.gathered(own.ravel(), counts * width).reshape(-1, width)
        return rows

    def solved_where(self, groups: Sequence[SolvedBodies], by_group: Sequence[bool]) -> tuple[IntArray, IntArray]:
        """The dofs (n,) that are solved for, in the order of the ranks that do it, and how many each does (size,); by_group: which groups
        one rank solves as a whole."""
        dofs, ranks = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for group, whole in zip(groups, by_group, strict=True):
            own = group.dofs[:, group.free]
            owner = np.full(len(own), self.solver(group.members)) if whole else self.owner[group.members]
            dofs.append(own.ravel())
            ranks.append(np.repeat(owner, own.shape[1]))
        rank = np.concatenate(ranks)
        return np.concatenate(dofs)[np.argsort(rank, kind="stable")], np.bincount(rank, minlength=self.world.size)


def shares_of(layout: BodyLayout) -> Shares | None:
    """The shares of the ranks that share what is computed now, found once for a model; None where this process computes alone."""
    ranks = world()
    if ranks is None:
        return None
    found = _known.get(layout)
    if found is None or found.world is not ranks:
        found = _known[layout] = _shares(layout, ranks)
    return found


_known: WeakKeyDictionary[BodyLayout, Shares] = WeakKeyDictionary()


def _shares(layout: BodyLayout, ranks: World) -> Shares:
    """The shares of the ranks, by the bodies' places and costs."""
    offset = layout.node_offset
    nodes = np.diff(offset)
    centres = np.add.reduceat(layout.reference, offset[:-1]) / nodes[:, None]
    weight = [1.0 if is_linear(body.part.material) else NONLINEAR for body in layout.deformable]
    costs = np.concatenate([weight * nodes[: len(weight)], np.full(len(layout.rigid), RIGID)])
    return Shares(ranks, partition(centres, costs, ranks.size))


def runs(begin: int, C: FloatArray, kind: IntArray) -> Iterator[tuple[int, FloatArray, IntArray]]:
    """Bodies one after the other whose kind (nb,) is not -1, as `SystemFactor.compliances` yields them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kind >= 0, [False]])))
    for first, last in edges.reshape(-1, 2).tolist():
        yield begin + first, C, kind[first:last]
