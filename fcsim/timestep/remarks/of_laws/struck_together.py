"""What is said of impacts that go on through bodies which touch: restitution answers them at once, nature in turn."""

from __future__ import annotations

import numpy as np

from fcsim.contact_law import Velocity
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

PASSED_ON = 0.1
"""Of the impulse at the contact that is struck: what another one bears of it."""
ALONG = 0.5
"""Cosine between both normals from which one contact passes on what strikes the other."""
LEAST = 1e-5
"""Of the smaller body's size: the way of a step at the speed of a blow. What rests approaches by round-off."""
SLOWER = 0.1
"""Of the speed at which a contact is struck: contacts that approach by less are not struck themselves."""
LOOKED = 20
"""Contacts of a step that are looked at, the fastest ones."""


def struck_together(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first body that is struck while it touches another one, on which it passes the blow, under `Velocity` with e > 0.

    Moreau's law gives every contact of the step u_N = -e u_N^-, those at rest u_N = 0: the balls of a cradle that touch leave together at
    2 / n of the first one's velocity, and it comes back, with momentum and energy as they are to be. One impact after the other gives the
    last one all of it. Contact a strikes where u_N^- < 0 < r_N; b, of the same free body and another pair, bears `PASSED_ON` of r_a
    without an approach of its own, along the same line.
    """
    contacts, met, model = step.contacts, step.encounter, step.model
    if "struck together" in said or len(contacts) < 2:
        return {}
    if not any(isinstance(law, Velocity) and law.restitution > 0 for law in single_laws(step.scheme.law)):
        return {}
    approach, force = -met.meeting.before[:, 0], step.contact_force[:, 0]
    struck = np.flatnonzero((met.meeting.timing.h * approach > LEAST * met.meeting.size) & (force > 0))
    for a in struck[np.argsort(-approach[struck], kind="stable")][:LOOKED]:
        shared = (contacts.bodies[:, :, None] == contacts.bodies[a]).any(axis=1)
        other = shared.any(axis=1) & ~shared.all(axis=1)  # one body in common
        along = np.abs(contacts.frame[:, 0] @ contacts.frame[a, 0]) > ALONG
        bears = other & along & (approach <= SLOWER * approach[a]) & (force > PASSED_ON * force[a])
        for b in np.flatnonzero(bears):
            body = int(np.intersect1d(contacts.bodies[a], contacts.bodies[b])[0])
            dofs = np.arange(model.dof_offset[body], model.dof_offset[body + 1])
            if np.isin(dofs, model.driven_dofs).all():
                continue
            one, two = (next(model.bodies[int(k)].name for k in contacts.bodies[c] if k != body) for c in (a, b))
            return {
                "struck together": f"{when}: {model.bodies[body].name!r} is struck by {one!r} while it touches {two!r}: the law Velocity "
                "answers all contacts of a step at once, so that momentum and energy are right, but not who leaves how fast where impacts "
                "follow each other (touching balls of a cradle leave together). What helps: a little air between the bodies, some steps' "
                "way wide, so that impacts are one after the other"
            }
    return {}
