"""Where contact makes energy out of nothing the run ends: what it is told then."""

from __future__ import annotations

import numpy as np

from fcsim.assembly.kinematics.following import When
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import CABLES
from fcsim.errors import Unphysical
from fcsim.timestep.energy import pushing
from fcsim.timestep.step import Step


class EnergyCreated(Unphysical):
    """Contacts have created more energy than `Simulation.created` allows."""


NO_HEIGHT = 1e-6
"""Share of the model's size through which loads do work that counts as none: bodies set down with the round-off of a mesh file."""


REST = 1e-9
"""Of the model's size: what moves by less in a step is at rest."""


def energy_at_rest(model: Model, speed: float) -> float:
    """Kinetic energy [J] that counts as none: of all that no support drives, slower than `speed` [m/s]."""
    along = np.zeros(model.n_dofs)
    along[np.setdiff1d(model.dof_of_node[:, 0], -1)] = 1.0
    model.rigid_part(along)[:, 0] = 1.0
    along -= model.driven_share(along)
    return 0.5 * float(along @ model.apply_mass(along)) * speed**2


def refuse_creation(step: Step, share: float, rest: float, extent: float) -> None:
    """Raise EnergyCreated where contact has created more than `share` of what was supplied, and more than bodies at rest may have.

    rest [J]: kinetic energy that counts as none; extent [m]: size of the model.
    """
    ledger = step.ledger
    if share == np.inf or ledger.created <= share * ledger.supplied + rest:
        return
    model, state = step.model, step.state
    loads = float(np.abs(model.load(state.t, state.x) + pushing(model, state.x, When.at(state.t))).sum())
    if ledger.created <= share * ledger.supplied + rest + NO_HEIGHT * extent * loads:
        return
    part = f"{100 * ledger.created / ledger.supplied:.3g} % of the" if ledger.supplied else "and there were"
    raise EnergyCreated(
        f"step {step.number}, t = {step.state.t:.6g} s: contacts have created {ledger.created:.4g} J, {part} {ledger.supplied:.4g} J "
        f"that the run began with and that loads and supports supplied; allowed are {100 * share:g} %. {_cause(step)}. "
        "What helps: bodies that do not overlap at the start, complete detection, a smaller h, the law Gap() with a smaller recovery; "
        "Simulation(created=...) allows more (inf: all)"
    )


def _cause(step: Step) -> str:
    contacts = step.contacts
    if not len(contacts):
        return "No contact is left in this step"
    deepest = int(np.argmin(contacts.gap))
    if contacts.cables[deepest] and step.linkage is not None:
        name = step.linkage.cables[int(contacts.identity[deepest]) - CABLES].link.name
        return f"Most out of place is the cable {name!r}, longer than it is by {max(-contacts.gap[deepest], 0.0):.4g} m"
    slave, master = (step.model.bodies[k].name for k in contacts.bodies[deepest])
    where = ", ".join(f"{x:.4g}" for x in contacts.point[deepest])
    if contacts.gap[deepest] >= 0:
        return f"No contact penetrates; the nearest is {slave!r} on {master!r} at ({where}) m"
    return f"Deepest is {slave!r} in {master!r} by {-contacts.gap[deepest]:.4g} m at ({where}) m, which the law pushes out"
