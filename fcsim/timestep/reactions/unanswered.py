"""Why no reactions answer a step's problem, in the names of the bodies."""

from __future__ import annotations

import numpy as np

from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.problem.infeasible import certificate
from fcsim.problem.problem import LocalProblem

ENORMOUS = 1e6
"""Times the usual reactions: bodies that only such would keep apart are squeezed. Bodies that have come to rest between others stand askew
by what solvers leave, so that their contacts lie opposite each other to 1e-10 of their size only, and no proof can ask for more."""
MANY = 2000
"""Contacts up to which a proof is looked for: its linear programme takes a second there."""
PAIRS = 3
"""So many pairs of bodies are named."""
OVERLAP = 1e-9
"""Of the model's size: gaps beyond it are more than what solvers leave."""
FITS = "Is a body too large for its place? What helps: bodies that fit, less friction, or what gives way, deformable bodies or springs"


def unanswered(problem: LocalProblem, contacts: Contacts, model: Model, driven: bool) -> str:
    """Which bodies are squeezed by what is held or driven, or meet as Coulomb's law has no answer to, and whether they overlap there; ""
    where neither is proved. driven: whether supports move."""
    if not 0 < problem.nc <= MANY or problem.nc != len(contacts):
        return ""
    found = certificate(problem, ENORMOUS)
    if found is None:
        return ""
    pairs = np.unique(np.sort(contacts.bodies[found.contacts], axis=1), axis=0).tolist()
    named = ", ".join(f"{model.bodies[a].name!r} and {model.bodies[b].name!r}" for a, b in pairs[:PAIRS])
    named += f" and {len(pairs) - PAIRS} more pairs" if len(pairs) > PAIRS else ""
    if found.direction is None:
        neither = "so that their contacts can neither open nor stick nor slide: Coulomb's law has no answer there"
        deep = -float(contacts.gap[found.contacts].min())
        if not driven and deep <= OVERLAP * float(np.ptp(model.reference, axis=0).max()):
            return f"{named} meet {neither}"
        how = "are driven into each other" if driven else f"lie up to {deep:.3g} m in each other, squeezed between what holds them"
        return f"{named} {how}, and friction locks them {neither}. {FITS}"
    return f"what is held or driven squeezes {named}: {found.needed} would keep them apart"
