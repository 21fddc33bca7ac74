"""What is said where friction gives energy to what rolls: sticking is a law on velocities, at a place that rolling has left."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.contact_law import Velocity
from fcsim.timestep.remarks.of_laws.carried_round import has_turned
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

GIVEN = 5e-3
"""Of the energy that the run began with and was supplied with: less is not said."""

_NOTHING: tuple[IntArray, FloatArray] = (np.empty(0, dtype=np.int64), np.empty((0, 0)))


class RolledOn:
    """The remark on energy that friction has given where it sticks: call it with the steps in turn.

    A contact that sticks has u_T = H_m^T v+ = 0 where the bodies touch in the middle of the step. In the next step they touch elsewhere,
    where this v has u_T^- = h a_T, with a_T [m/s^2] the tangential acceleration of the material point that touches; the reaction does
    the work r_T . u_T^- (1 - theta), which no law of friction takes or gives. A wheel that rolls straight on has a_T = 0; a disk that
    rolls inclined has not, and its r_T grows with its distance from the steady motion, with h: the energy that comes so in a given time
    falls with h^2. What is counted is this work of the contacts that bear in both steps; with restitution see `turned_slip`.
    """

    def __init__(self) -> None:
        self._borne, self._given = _NOTHING, 0.0

    def __call__(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark by its kind; {} where there is none, or where it is `said`."""
        if "rolled on" in said or not step.scheme.timing.moving:
            return {}
        if not has_turned(step, found):
            self._borne = _NOTHING
            return {}
        given, pairs = self._work(step)
        self._given += float(given.sum())
        created = step.ledger.created
        if created <= GIVEN * step.ledger.supplied or self._given <= 0.5 * created or not len(given):
            return {}
        if any(isinstance(law, Velocity) and law.restitution > 0 for law in single_laws(step.scheme.law)):
            return {}
        found_pairs, which = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        worst = found_pairs[int(np.argmax(np.bincount(which.reshape(-1), given)))]
        one, other = (step.model.bodies[int(k)].name for k in worst)
        return {
            "rolled on": f"{when}: friction has given {self._given:.3g} J, {100 * self._given / step.ledger.supplied:.2g} % of the energy "
            f"there, to what rolls, in this step most to {one!r} and {other!r}: bodies stick by the velocities at the ends of steps where "
            "they touch in the middle of them, and have rolled on when the next one begins. What helps: a shorter h, half of which leaves "
            "about a quarter (docs/contact_rules.md)"
        }

    def _work(self, step: Step) -> tuple[FloatArray, IntArray]:
        """(1 - theta) r_T . u_T^- [J] (n,) by what turning has made of u_T since the step before, and the contacts' bodies (n, 2)."""
        contacts, met = step.contacts, step.encounter
        bears = np.flatnonzero(step.contact_force[:, 0] > 0)
        across = contacts.frame[bears, 1:]
        up = np.where(contacts.bodies[bears, 0] < contacts.bodies[bears, 1], 1.0, -1.0)

        def in_space(local: FloatArray) -> FloatArray:
            return np.einsum("a,ai,aij->aj", up, local[bears, 1 : contacts.dimension], across)

        after = in_space(met.relative(step.state.v).reshape(contacts.frame.shape[:2]))
        turned, reaction = in_space(met.meeting.before), in_space(met.forces(met.reaction(step.result.r)))
        identity = contacts.identity[bears]
        _, now, then = np.intersect1d(identity, self._borne[0], assume_unique=True, return_indices=True)
        last, self._borne = self._borne[1], (identity, after)
        if not len(now):
            return np.empty(0), np.empty((0, 2), dtype=np.int64)
        given = (1.0 - met.meeting.timing.theta) * np.einsum("ai,ai->a", reaction[now], turned[now] - last[then])
        return given, contacts.bodies[bears][now]
