"""What contacts give back as one body is drawn off the other: a pin out of its hole, a plug out of a slot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.timestep.step import Step

AT_ONCE = 1 / 4
"""Share of the most that two bodies ever pressed each other with: what lets go of more in one step (a hook) snaps."""


class _Bearing(NamedTuple):
    """The contacts that end a step: H (n_dofs, d nc), forces (nc, d) [N], identities (nc,), each one's pair of bodies as a number (nc,)."""

    H: sp.csc_array
    force: FloatArray
    identity: IntArray
    pair: IntArray

    @classmethod
    def of(cls, step: Step) -> _Bearing:
        low, high = np.sort(step.contacts.bodies, axis=1).T
        pair = low.astype(np.int64) * len(step.model.bodies) + high
        return cls(step.H, step.contact_force, step.contacts.identity, pair)

    def over(self, dx: FloatArray) -> FloatArray:
        """Relative displacements (nc, d) [m] of the points that touch, dx (n_dofs,) those of all."""
        u: FloatArray = (self.H.T @ dx).reshape(self.force.shape)
        return u

    def pressing(self, identity: IntArray) -> FloatArray:
        """The normal forces [N] of the contacts that are named, 0 of those that are not there."""
        if not len(self.identity):
            return np.zeros(len(identity))
        place = np.minimum(np.searchsorted(self.identity, identity), len(self.identity) - 1)
        return np.where(self.identity[place] == identity, self.force[place, 0], 0.0)


class DrawnOut:
    """Call it with the steps of a run in turn; it returns what contacts give back in the step as they leave over an edge [J].

    Along one path of equilibria contacts do no work but against friction, and what is left of (r_0 . u_0 + r_1 . u_1) / 2, u the relative
    displacements of the points that touch at either end of the step, is of third order in it. A point that slides over the edge of what it
    bore on presses with r_0 at the beginning and not at the end, and moves to where the other body's face would be, u_N < 0: half of r_0 .
    u_0 is what it gives back, with what friction took on the way to the edge, however short the step. What opens moves the other way. No
    motion follows from it where others of the same two bodies bear, or did before: points leave one after the other.
    """

    def __init__(self) -> None:
        self._before: _Bearing | None = None
        self._pairs: IntArray = np.zeros(0, dtype=np.int64)
        self._most: FloatArray = np.zeros(0)

    def __call__(self, step: Step, dx: FloatArray | None) -> float:
        """dx (n_dofs,): the displacements of the step; None where it does not follow the one before."""
        before, now = self._before, _Bearing.of(step)
        self._know(now)
        back = 0.0 if before is None or dx is None else self._given_back(before, now, dx)
        self._before, self._most = now, np.maximum(self._most, self._borne(now))
        return back

    def _given_back(self, before: _Bearing, now: _Bearing, dx: FloatArray) -> float:
        u, end = before.over(dx), now.over(dx)
        pressed, left = before.force[:, 0], now.pressing(before.identity)
        off = (pressed > 0) & (u[:, 0] < 0)
        lost = np.where(off, np.clip(pressed - left, 0.0, pressed), 0.0)
        gradual = self._borne(before) - self._borne(now) <= AT_ONCE * self._most
        off &= gradual[np.searchsorted(self._pairs, before.pair)]
        friction = np.sum(before.force[off, 1:] * u[off, 1:], axis=1) * lost[off] / pressed[off]
        back = -0.5 * float(pressed[off] @ u[off, 0] + friction.sum())
        still = (now.force[:, 0] > 0) & (end[:, 0] < 0) & (before.pressing(now.identity) > 0)
        still[still] = gradual[np.searchsorted(self._pairs, now.pair[still])]
        return max(back, 0.0) - 0.5 * float(now.force[still, 0] @ end[still, 0])

    def _borne(self, contacts: _Bearing) -> FloatArray:
        """What presses the bodies of each known pair together [N]."""
        pressing = np.maximum(contacts.force[:, 0], 0.0)
        return np.bincount(np.searchsorted(self._pairs, contacts.pair), pressing, len(self._pairs))

    def _know(self, now: _Bearing) -> None:
        """Add the pairs of bodies that meet."""
        pairs = np.union1d(self._pairs, now.pair)
        most = np.zeros(len(pairs))
        most[np.searchsorted(pairs, self._pairs)] = self._most
        self._pairs, self._most = pairs, most
