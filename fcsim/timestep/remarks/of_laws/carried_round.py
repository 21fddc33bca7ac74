"""What is said of bodies that friction carries round on others: sticking is a law on velocities, which lags where it turns."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.timestep.step import Step

CREPT = 0.01
"""Of the smaller body's size: the way from which on it is said."""
TURNED = 1e-3
"""[rad] Where no body has turned by more from its reference nothing has crept by CREPT of its size, unless it is far from the axis."""

_NOTHING: tuple[IntArray, FloatArray] = (np.empty(0, dtype=np.int64), np.empty((0, 0)))


class CarriedRound:
    """The remark on the bodies that have crept furthest on each other while they stuck: call it with the steps in turn.

    A contact that sticks has u_T = H_m^T v+ = 0 with H_m where the step's contacts are, in its middle. In the next step, turned by h omega,
    this v has (H_m' - H_m)^T v = h omega x (omega x r) of what turns alike, r the distance of both bodies' centres, and the bodies move by
    h / 2 times that on each other: what is carried round gains h omega / 2 of its distance from the axis a radian, whatever the scheme.
    Of a pair it is the mean of the contacts that bear in both steps, d of them at least, so that both turn alike; pairs that slide by more
    are left out, and what the step takes back of the way, see `fcsim.timestep.reactions.drift`.
    """

    def __init__(self) -> None:
        self._borne = _NOTHING
        self._way: dict[int, float] = {}

    def __call__(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark by its kind; {} where there is none, or where it is `said`."""
        if "carried round" in said or not step.scheme.timing.moving:
            return {}
        if not has_turned(step, found):
            self._borne = _NOTHING
            return {}
        pairs, crept, size = self._crept(step)
        for one, way in zip(pairs[crept > 0].tolist(), crept[crept > 0].tolist(), strict=True):
            self._way[one] = self._way.get(one, 0.0) + way
        far = np.array([self._way.get(one, 0.0) for one in pairs.tolist()]) / size
        if far.max(initial=0.0) < CREPT:
            return {}
        worst = int(np.argmax(far))
        names = [step.model.bodies[k].name for k in divmod(int(pairs[worst]), len(step.model.bodies))]
        return {
            "carried round": f"{when}: {names[0]!r} and {names[1]!r} stick to each other and turn, and have crept by "
            f"{self._way[int(pairs[worst])]:.3g} m on each other, {100 * far[worst]:.2g} % of the smaller one: what friction carries "
            "round goes outwards by h omega / 2 of its distance from the axis a radian, since it sticks by the velocities at the ends of "
            "steps. What helps: a shorter h, or a link (docs/contact_rules.md)"
        }

    def _crept(self, step: Step) -> tuple[IntArray, FloatArray, FloatArray]:
        """Pairs of bodies (n,), by how much they have crept on each other in the step and the size of the smaller body (n,) [m]."""
        contacts, meeting = step.contacts, step.encounter.meeting
        bears = np.flatnonzero(step.contact_force[:, 0] > 0)
        across = contacts.frame[bears, 1:]
        up = np.where(contacts.bodies[bears, 0] < contacts.bodies[bears, 1], 1.0, -1.0)
        local = (step.H.T @ step.state.v).reshape(contacts.frame.shape[:2])[bears, 1:]
        after = np.einsum("a,ai,aij->aj", up, local, across)
        before = np.einsum("a,ai,aij->aj", up, meeting.before[bears, 1 : contacts.dimension], across)
        identity = contacts.identity[bears]
        both, now, then = np.intersect1d(identity, self._borne[0], assume_unique=True, return_indices=True)
        last, self._borne = self._borne[1], (identity, after)
        if not len(both):
            return np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)
        bodies = contacts.bodies[bears][now]
        key = bodies.min(axis=1) * len(step.model.bodies) + bodies.max(axis=1)
        pairs, first, pair = np.unique(key, return_index=True, return_inverse=True)
        round_, slid = _means(before[now] - last[then], pair), np.linalg.norm(_means(after[now], pair), axis=1)
        turned, way = np.linalg.norm(round_, axis=1), 0.5 * step.scheme.h * round_
        if meeting.drift is not None:
            way = way - _means(np.einsum("a,ai,aij->aj", up, meeting.drift[bears, 1:], across)[now], pair)
        size = np.broadcast_to(meeting.size, len(contacts))[bears][now][first]
        alike = (slid < turned) & (np.bincount(pair) >= contacts.dimension)
        return pairs, np.where(alike, step.substeps * np.linalg.norm(way, axis=1), 0.0), size


def has_turned(step: Step, found: Deformation) -> bool:
    """Whether a body has turned by more than `TURNED` from its reference."""
    model = step.model
    rigid = model.rigid_part(step.state.x)[:, model.dimension :] if len(model.rigid) else np.zeros((0, 1))
    return max(float(found.rotation.max(initial=0.0)), float(np.linalg.norm(rigid, axis=1).max(initial=0.0))) > TURNED


def _means(values: FloatArray, group: IntArray) -> FloatArray:
    """Means (groups, d) of vectors (n, d)."""
    number = np.bincount(group)[:, None]
    return np.stack([np.bincount(group, column) for column in values.T], axis=1) / number
