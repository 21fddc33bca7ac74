"""What is said of cohesive joints between rigid bodies on more points than hold them."""

from __future__ import annotations

import numpy as np

from fcsim.contact_law import Cohesive
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

ALIKE = 1e-6
"""Of the shear strength: how near mu f_t is the same."""


def rigid_joints(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first two rigid bodies that a cohesive joint without springs holds on more points than statics determines.

    How they share the normal force is open then, so that some may be drawn while others press. A drawn point loses c / f_t of what draws
    it, a pressed one wins mu of it: where c = mu f_t the sum is c A + mu N whatever the shares, else it is not. Three points of a plane
    joint determine their forces, two in 2D.
    """
    contacts, terms = step.contacts, step.encounter.terms
    if "rigid joints" in said or terms.adhesion is None or not len(contacts):
        return {}
    laws = [law for law in single_laws(step.scheme.law) if isinstance(law, Cohesive) and law.springs is None and law.shear is not None]
    if not laws:
        return {}
    mu = step.encounter.meeting.contacts.mu
    unlike = np.zeros(len(contacts), dtype=bool)
    for law in laws:
        assert law.shear is not None
        unlike |= np.abs(mu * law.tension - law.shear) > ALIKE * law.shear
    held = unlike & (terms.adhesion[:, 0] > 0) & step.encounter.meeting.between_rigid
    pairs, number = np.unique(np.sort(contacts.bodies[held], axis=1), axis=0, return_counts=True)
    many = np.flatnonzero(number > contacts.dimension)
    if not many.size:
        return {}
    one, other = (step.model.bodies[int(k)].name for k in pairs[many[0]])
    return {
        "rigid joints": f"{when}: rigid bodies {one!r} and {other!r} are bonded on {number[many[0]]} points, which may share the pressure "
        "in many ways, some drawn while others press: the joint may take less shear than c A + mu N (0.84 of it was found at a pressure of "
        "0.6 f_t and c = 1.5 f_t). What helps: Cohesive(springs=...), which shares it evenly, or deformable bodies"
    }
