"""All supports together: the degrees of freedom that they drive, along which axes, and their motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.supports.axes import DofAxes
from fcsim.assembly.supports.holds import Hold, Turn, holds_of
from fcsim.assembly.supports.support import DrivenRotation, Support
from fcsim.errors import InputError

DEPENDENT = 1e-8
"""Sine below which a direction is one that is held already."""
AGREE = 1e-9
"""Of the largest: values in directions that depend on each other agree up to this."""


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Groups of dofs that the same supports hold: nodes, mostly.

    holds: (number of the hold, places (k,) of the groups in it); at (k, driven) their places among the driven dofs
    solve (driven, r): the driven values from those of all directions; given (r, driven): back
    """

    holds: tuple[tuple[int, IntArray], ...]
    at: IntArray
    solve: FloatArray
    given: FloatArray


@dataclass(frozen=True, eq=False)
class HeldDofs:
    """dofs: ascending numbers of the driven dofs along the supports' axes; axes None: all are the world's; turns: driven rotations."""

    dofs: IntArray
    axes: DofAxes | None
    turns: tuple[Turn, ...]
    _holds: tuple[Hold | Turn, ...]
    _patterns: tuple[_Pattern, ...]

    def some_of(self, first: IntArray) -> BoolArray:
        """Of which of the bodies (nb,), the first of whose dofs are ascending, some are driven."""
        driven = np.zeros(len(first), dtype=bool)
        driven[np.searchsorted(first, self.dofs, side="right") - 1] = True
        return driven

    def velocity(self, t: float, h: float) -> FloatArray:
        """Velocities (n_driven,) [m/s, rad/s] at time t; h [s] the step."""
        return self._of([hold.velocity(t, h) for hold in self._holds], t)

    def increment(self, t: float, h: float) -> FloatArray:
        """Increments (n_driven,) [m, rad] of the step from t to t + h."""
        return self._of([hold.increment(t, h) for hold in self._holds], t)

    def _of(self, values: Sequence[FloatArray], t: float) -> FloatArray:
        driven = np.zeros(len(self.dofs))
        for pattern in self._patterns:
            count = len(pattern.at)
            told = np.concatenate(
                [
                    values[k][places] if values[k].ndim == 2 else np.broadcast_to(values[k], (count, len(values[k])))
                    for k, places in pattern.holds
                ],
                axis=1,
            )
            v = told @ pattern.solve.T
            if told.shape[1] > v.shape[1] and np.abs(told - v @ pattern.given.T).max() > AGREE * np.abs(told).max():
                numbers = sorted({self._holds[k].number for k, _ in pattern.holds})
                raise InputError(
                    f"supports {', '.join(map(str, numbers))} of body {self._holds[pattern.holds[0][0]].source.body!r}: expected the same "
                    f"motion where they hold one node, they differ at t = {t:.6g} s"
                )
            driven[pattern.at] = v
        return driven

    def placed(self, x: FloatArray, t: float) -> FloatArray:
        """x (n_dofs,) in world axes with all that driven rotations turn where it stands at time t; x itself where there are none."""
        if not self.turns:
            return x
        x = x.copy()
        for turn in self.turns:
            x[turn.first[:, None] + np.arange(turn.rows.shape[1])] = turn.displacement(t)
        return x


def held_dofs(layout: BodyLayout, supports: Sequence[Support | DrivenRotation]) -> HeldDofs:
    """Return what the supports hold together; InputError where they contradict each other whatever the time."""
    holds = holds_of(layout, supports)
    first = np.concatenate([*(hold.first for hold in holds), np.empty(0, dtype=np.int64)]).astype(np.int64)
    number = np.repeat(np.arange(len(holds)), [len(hold.first) for hold in holds]).astype(np.int64)
    place = np.concatenate([*(np.arange(len(hold.first)) for hold in holds), np.empty(0, dtype=np.int64)]).astype(np.int64)
    order = np.lexsort((number, first))
    first, number, place = first[order], number[order], place[order]
    groups, begin, count = np.unique(first, return_index=True, return_counts=True)
    which = np.full((len(groups), count.max(initial=0)), -1)
    column = np.arange(len(first)) - np.repeat(begin, count)
    row = np.repeat(np.arange(len(groups)), count)
    which[row, column] = number
    places = np.zeros_like(which)
    places[row, column] = place
    kinds, kind_of = np.unique(which, axis=0, return_inverse=True) if len(groups) else (which, np.empty(0, dtype=np.int64))
    groups_of = np.split(np.argsort(kind_of.ravel(), kind="stable"), np.cumsum(np.bincount(kind_of.ravel(), minlength=len(kinds)))[:-1])
    parts, turned, frames = [], [], []
    for kind, own in zip(kinds, groups_of, strict=False):
        present = kind[kind >= 0]
        told = [holds[j] for j in present]
        _refuse_contradictions(told)
        rows = np.concatenate([hold.rows for hold in told])
        frame, held = _frame(rows)
        dofs = groups[own][:, None] + held
        if not np.array_equal(frame, np.eye(len(frame))):
            turned.append(groups[own])
            frames.append(np.broadcast_to(frame, (len(own), *frame.shape)))
        given = rows @ frame[held].T
        parts.append((tuple((int(j), places[own, i]) for i, j in enumerate(present)), dofs, np.linalg.pinv(given), given))
    driven = np.sort(np.concatenate([*(dofs.ravel() for _, dofs, _, _ in parts), np.empty(0, dtype=np.int64)]))
    patterns = tuple(_Pattern(members, np.searchsorted(driven, dofs), solve, given) for members, dofs, solve, given in parts)
    turns = tuple(hold for hold in holds if isinstance(hold, Turn))
    return HeldDofs(driven, _axes(turned, frames), turns, tuple(holds), patterns)


def _axes(first: list[IntArray], frames: list[FloatArray]) -> DofAxes | None:
    if not first:
        return None
    groups, frame = np.concatenate(first), np.concatenate(frames)
    order = np.argsort(groups)
    return DofAxes(groups[order], frame[order])


def _frame(rows: FloatArray) -> tuple[FloatArray, IntArray]:
    """Axes (s, s) of which some span what unit vectors (r, s) hold, and which: the world's where these do, or where all is held."""
    s = rows.shape[1]
    basis: list[FloatArray] = []
    for row in (*rows, *np.eye(s)):
        rest = row - sum(((b @ row) * b for b in basis), np.zeros(s))
        rest = rest - sum(((b @ rest) * b for b in basis), np.zeros(s))
        if np.linalg.norm(rest) > DEPENDENT:
            basis.append(rest / np.linalg.norm(rest))
        if len(basis) == s:
            break
    held = int(np.linalg.matrix_rank(rows, tol=DEPENDENT))
    world = np.abs(rows).max(axis=0) > 0
    if held == s or np.count_nonzero(world) == held:
        return np.eye(s), np.flatnonzero(world)
    return np.array(basis), np.arange(held)


def _refuse_contradictions(holds: Sequence[Hold | Turn]) -> None:
    """Two supports may name one direction only if both say the same."""
    plain = [hold for hold in holds if isinstance(hold, Hold)]
    for i, one in enumerate(plain):
        for other in plain[:i]:
            same = np.abs(np.abs(one.rows @ other.rows.T) - 1) < DEPENDENT
            motions = [(hold.source.velocity, hold.source.displacement) for hold in (one, other)]
            if same.any() and motions[0] != motions[1]:
                raise InputError(
                    f"supports: degree of freedom {_dof(one, other, same)} of body {one.source.body!r} is driven twice and "
                    f"differently, by the supports {other.number} and {one.number}"
                )


def _dof(one: Hold, other: Hold, same: BoolArray) -> int:
    """The first dof that both drive, of inclined directions the nearest."""
    shared = np.intersect1d(one.first, other.first)
    return int(shared[0] + np.argmax(np.abs(one.rows[int(np.argmax(same.any(axis=1)))])))
