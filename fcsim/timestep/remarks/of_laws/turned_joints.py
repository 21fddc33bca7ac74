"""What is said of joints with stiffness or adhesion that statics turn by much in a step: they have the contacts of its beginning."""

from __future__ import annotations

import numpy as np

from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.look_ahead.turned_meshes import rotations

NAMED = 0.05
"""[rad] The turn of a step, or of a part of one that is cut, from which on it is said: its sine is how much of the force acts aside."""


def turned_joints(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the two bodies whose joint bears and has turned furthest, by either of them.

    Joints remember where they began, and a step of statics has the normals of its beginning: of bodies that turn by a together the forces
    act along these, a aside of where they should; of those that turn on each other they open by R (1 - cos a).
    """
    terms, contacts = step.encounter.terms, step.contacts
    remembers = terms.compliance is not None or terms.adhesion is not None
    if "turned joints" in said or step.scheme.timing.moving or not remembers or not len(contacts):
        return {}
    bears = np.flatnonzero(np.any(step.contact_force != 0.0, axis=1) & ~contacts.cables)
    if not len(bears):
        return {}
    chord = np.linalg.norm(rotations(step.model, (step.previous, step.state)) - np.eye(step.model.dimension), axis=(1, 2)) / np.sqrt(2.0)
    turned = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
    pairs = contacts.bodies[bears]
    worst = int(np.argmax(turned[pairs].max(axis=1)))
    angle = float(turned[pairs[worst]].max())
    if angle < NAMED:
        return {}
    one, other = (step.model.bodies[int(k)].name for k in pairs[worst])
    return {
        "turned joints": f"{when}: the joint between {one!r} and {other!r} has stiffness or adhesion and turns by {angle:.2g} rad in a "
        f"step: it keeps the contacts of the step's beginning, by whose normals {100 * np.sin(angle):.2g} % of its force act aside, and "
        "what fits loses pressure. What helps: more steps, so that it turns by less in each"
    }
