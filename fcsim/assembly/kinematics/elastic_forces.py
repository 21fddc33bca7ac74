"""Elastic and viscous forces of all deformable bodies of linear materials, of small rotation and in floating frames. Bodies of other
materials have none here: see `fcsim.assembly.nonlinear`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.forms.rotations import polar_rotation
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.frames import FloatingGroup, Frames, Turned
from fcsim.assembly.kinematics.ranges import BodyRanges
from fcsim.linear.sparse._vectors_kernels import blended
from fcsim.linear.sparse.each import times_each

KEPT = 3
"""Configurations that are kept."""


@dataclass(frozen=True, eq=False)
class Configuration:
    """A configuration x (n_dofs,) and the frames of each group's bodies there, None for a group of linear bodies."""

    x: FloatArray
    frames: tuple[Frames | None, ...]


class ElasticForces:
    """The groups' forces on vectors of n_dofs; beta [s] the stiffness-proportional damping."""

    def __init__(self, groups: Sequence[Group], count: int, dimension: int, beta: float) -> None:
        """count: number of deformable bodies; `ranges`: what each rank has of work on them."""
        self.groups, self.beta = tuple(group for group in groups if group.laws is None), beta
        self._all, self._elastic = tuple(groups), sum(group.dofs.size for group in groups)
        self._shape = count, dimension
        self._last: tuple[tuple[bytes, Configuration], ...] = ()
        self._floating = tuple(FloatingGroup(group) if group.turning else None for group in self.groups)
        self.ranges = BodyRanges(groups)

    @cached_property
    def turning(self) -> bool:
        """Whether any body stands in a floating frame."""
        return any(group.turning for group in self.groups)

    @cached_property
    def largest_force(self) -> FloatArray:
        """Largest diagonal entry of K times the size of each body (n_deformable,) [N]: what round-off is relative to."""
        force = np.zeros(self._shape[0])
        for group in self._all:
            count = group.size // self._shape[1]
            size = float(np.ptp(group.part.points, axis=0).max())
            force[group.members] = np.sqrt(count) * abs(group.K.diagonal()).max() * size
        return force

    def at(self, x: FloatArray) -> Configuration:
        """The configuration x (n_dofs,) with the frames of its bodies; of the last ones asked for, which end a step and begin the next,
        what is there."""
        if not self.turning:
            return Configuration(x, (None,) * len(self.groups))
        key = x.tobytes()
        for known, configuration in self._last:
            if known == key:  # the first byte that differs ends it; a hash would read all
                return configuration
        frames = tuple(None if floating is None else floating.frames(x) for floating in self._floating)
        configuration = Configuration(x.copy(), frames)
        self._last = (*self._last, (key, configuration))[-KEPT:]
        return configuration

    def rotation(self, configuration: Configuration) -> FloatArray:
        """Rotations R (n_deformable, d, d) of the frames, the identity for linear bodies."""
        count, d = self._shape
        R = np.tile(np.eye(d), (count, 1, 1))
        for group, frames in zip(self.groups, configuration.frames, strict=True):
            if frames is not None:
                R[group.members] = frames.rotation
        return R

    def strained(self, configuration: Configuration) -> FloatArray:
        """Displacement y (n_elastic,) [m] without the frames' motion in the axes of the reference; of linear bodies x itself."""
        y = configuration.x[: self._elastic].copy()
        for group, frames in zip(self.groups, configuration.frames, strict=True):
            if frames is not None:
                y[group.dofs] = frames.strained.reshape(len(frames.strained), -1)
        return y

    def energy(self, configuration: Configuration) -> float:
        """y . K y / 2 [J] of all bodies."""
        return self.energies(configuration, configuration)[0][0]

    def energies(self, first: Configuration, last: Configuration) -> tuple[tuple[float, float], float]:
        """(y_0 . K y_0 / 2, y_1 . K y_1 / 2) and dy . K dy [J] of all bodies with the change dy from the first to the last."""
        return energies_of(self.of_first(first), self.of_change(first, last))

    def of_first(self, first: Configuration) -> FloatArray:
        """y_0 . K y_0 / 2 [J] of all bodies (1,)."""
        energy = 0.0
        for group, a in zip(self.groups, first.frames, strict=True):
            y = group.rows(first.x) if a is None else a.strained.reshape(len(a.strained), -1)
            energy += 0.5 * float(np.sum(y * times_each(group.K, y)))
        return np.array([energy])

    def of_change(self, first: Configuration, last: Configuration) -> FloatArray:
        """y_0 . K dy and dy . K dy [J] of all bodies (2,)."""
        change = loss = 0.0
        for group, a, b in zip(self.groups, first.frames, last.frames, strict=True):
            if a is None or b is None:
                y = group.rows(first.x)
                dy = group.rows(last.x)
                dy -= y
            else:
                y = a.strained.reshape(len(a.strained), -1)
                dy = b.strained.reshape(y.shape) - y
            of_dy = times_each(group.K, dy)
            change += float(np.sum(y * of_dy))
            loss += float(np.sum(dy * of_dy))
        return np.array([change, loss])

    def force(
        self, first: Configuration, last: Configuration, share: float, v: FloatArray | None = None, less: Turned | None = None
    ) -> FloatArray:
        """Forces F (n_dofs,) [N] = D^T K (share y_1 + (1 - share) y_0 + beta D v) between two configurations, see `frames`;
        K (share x_1 + ...) of linear bodies. v (n_dofs,) [m/s], None: without damping. less: w F - s T K T^T x instead."""
        total = self._blank(first.x)
        for floating, a, b in zip(self._floating, first.frames, last.frames, strict=True):
            if floating is not None and a is not None and b is not None:
                floating.force((a, b), share, self.beta, v, less, total)

        def between(group: Group, some: IntArray) -> None:
            x = np.empty((len(some), group.size))
            blended(some, first.x, last.x, share, x)
            if self.beta and v is not None:
                x += self.beta * group.rows(v, some)
            if less is not None:
                x = less.weight * x - less.factor * group.rows(less.x, some)
            group.put(total, times_each(group.K, x), some)

        self._of_linear("elastic forces", between, total)
        return total

    def _blank(self, x: FloatArray) -> FloatArray:
        """What groups of linear materials write to, like x (n_dofs,): zero where none of them does."""
        if len(self.groups) < len(self._all):
            return np.zeros_like(x)
        by_runs = all(floating is None and not group.over_ranks for group, floating in zip(self.groups, self._floating, strict=True))
        total = self.ranges.vector(len(x)) if by_runs else np.empty_like(x)
        total[self._elastic :] = 0.0
        return total

    def _of_linear(self, what: str, work: Callable[[Group, IntArray], None], total: FloatArray) -> None:
        """Have work(group, first) write to total (n_dofs,) what belongs to the bodies `first` (k,) of each group of linear bodies, of
        those that ranks do not have together some by each rank; all ranks must ask."""
        linear = [group for group, floating in zip(self.groups, self._floating, strict=True) if floating is None]
        for group in linear:
            if group.over_ranks:
                work(group, group.first)

        def between(edges: IntArray) -> None:
            for group in linear:
                if not group.over_ranks:
                    work(group, group.between(edges[0], edges[-1]))

        if any(not group.over_ranks for group in linear):
            self.ranges.share(what, between, total)

    def stiffness_times(self, x: FloatArray) -> FloatArray:
        """K x (n_dofs,) of all deformable bodies in the reference configuration, of nonlinear materials their tangents' there."""
        total = self._blank(x)

        def between(edges: IntArray) -> None:
            for group in self._all:
                if not group.over_ranks:
                    some = group.between(edges[0], edges[-1])
                    group.put(total, times_each(group.K, group.rows(x, some)), some)

        for group in self._all:
            if group.over_ranks:
                group.put(total, times_each(group.K, group.rows(x)))
        self.ranges.share("K x", between, total)
        return total

    def turned_stiffness(self, Q: FloatArray, x: FloatArray) -> FloatArray:
        """T K T^T x (n_dofs,) with the rotation Q (n_deformable, d, d) of each body's nodes in T."""
        total = np.zeros_like(x)
        for group, floating in zip(self.groups, self._floating, strict=True):
            if floating is None:
                group.put(total, times_each(group.K, group.rows(x)))
            else:
                floating.turned_stiffness(Q, x, total)
        return total

    def system_rotation(self, R: FloatArray) -> FloatArray:
        """The rotations Q (n_deformable, d, d) with which the system matrix T (a M + b K) T^T can follow the frames' R: R itself, or as far
        as it turns about the axis that driven degrees of freedom allow, see `Group.turnable`."""
        Q = R.copy()
        for group in self.groups:
            turnable = group.turnable
            if turnable is not None and len(turnable) == 3:
                continue
            Q[group.members] = np.eye(R.shape[-1])
            if turnable is not None:
                axis = turnable[0]
                across = np.linalg.svd(turnable)[2][1:]  # (2, 3): the plane that turns
                plane = polar_rotation(across @ R[group.members] @ across.T)
                Q[group.members] = np.outer(axis, axis) + across.T @ plane @ across
        return Q


def energies_of(first: FloatArray, change: FloatArray) -> tuple[tuple[float, float], float]:
    """`ElasticForces.energies` from `of_first` and `of_change`."""
    start, (product, loss) = float(first[0]), change.tolist()
    return (start, start + product + 0.5 * loss), loss
