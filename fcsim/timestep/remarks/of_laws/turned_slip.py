"""What is said of impacts with restitution to which friction gives energy."""

from __future__ import annotations

import numpy as np

from fcsim.contact_law import Velocity
from fcsim.timestep.creation import REST, energy_at_rest
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

GIVEN = 1e-3
"""Of the energy that the run began with and was supplied with: less is not said."""
RESTS = 1e-3
"""Of the speed that gravity gives in a step: what is slower rests, and what impacts give it is the solver's error."""


def turned_slip(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the first two bodies whose impact gives energy under `Velocity` with e > 0 and friction.

    The normal reaction alone takes (1 - e^2) of what an inelastic impact takes. Friction has the direction of the slip after the impact:
    where the impact turns the slip round, or stops it, r_T . (u_T + u_T^-) / 2 may be positive, and more than the normal reaction takes.
    That is Newton's restitution, not the step: it is the same for every h (T. R. Kane and D. A. Levinson, Dynamics: theory and
    applications, 1985; W. J. Stronge, Proc. R. Soc. A 431, 1990).
    """
    contacts, met = step.contacts, step.encounter
    if "turned slip" in said or not len(contacts):
        return {}
    laws = [law for law in single_laws(step.scheme.law) if isinstance(law, Velocity) and law.restitution > 0]
    if not laws:
        return {}
    before = met.meeting.before
    mean = 0.5 * (met.forces(met.velocity(step.result.u - met.w)) + before)  # whatever theta: what a scheme takes beside is no impact's
    reaction = met.forces(met.reaction(step.result.r))
    pairs, which = np.unique(np.sort(contacts.bodies, axis=1), axis=0, return_inverse=True)
    struck = np.bincount(which, (before[:, 0] < 0) & (reaction[:, 0] > 0)) > 0
    given = np.where(struck, np.bincount(which, np.einsum("ai,ai->a", reaction, mean)), 0.0)
    most = int(np.argmax(given))
    if given[most] <= GIVEN * step.ledger.supplied:
        return {}
    if given[most] <= _at_rest(step):
        return {}
    one, other = (step.model.bodies[int(k)].name for k in pairs[most])
    gift = f"{given[most]:.3g} J, {100 * given[most] / step.ledger.supplied:.2g} % of the energy there"
    e = max(law.restitution for law in laws)
    return {
        "turned slip": f"{when}: the impact of {one!r} and {other!r} gives {gift}: friction turns or stops the slip within it, and "
        f"restitution on the normal velocity (e up to {e:.3g}) then gives more than was taken, whatever the step (Kane's paradox). What "
        "helps: a smaller restitution, or less friction"
    }


def _at_rest(step: Step) -> float:
    """Kinetic energy [J] that counts as none."""
    model, h = step.model, step.scheme.h
    fall = h * float(np.linalg.norm(model.gravity_at(step.state.t)))
    return energy_at_rest(model, max(RESTS * fall, REST * float(np.ptp(model.reference, axis=0).max()) / h))
