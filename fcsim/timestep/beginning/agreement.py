"""Velocities that links forbid, before a run's first step: which they are, and the rows that they are to agree with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.assembly.model import Model
from fcsim.linkage import Linkage
from fcsim.linkage.linkage import Rows
from fcsim.timestep.encounter import Encounter, asked_again
from fcsim.timestep.links.linked import Linked
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

AGREE = 1e-9
"""Of the fastest node: relative velocities of links below are round-off."""


def held_at_once(linkage: Linkage | None, state: State) -> Linked | None:
    """The rows of links that are kept exactly and not driven, with b = 0, in the configuration of the state itself; None where there are
    none. Springs give way, and what drives points acts from the first step on."""
    if linkage is None:
        return None
    kept = np.flatnonzero(np.isinf(linkage.stiffness) & ~linkage.driven)
    if not len(kept):
        return None
    rows = linkage.rows(state.x)
    G = sp.csr_array(linkage.matrix(rows, state.x)[:, kept])
    own = Rows(sp.csr_array(rows.weights[kept]), rows.direction[kept], rows.gap[kept])
    return Linked(linkage, own, G, np.zeros(len(kept)), np.zeros(len(kept)), np.zeros(len(kept)))


def forbids(rows: Linked, model: Model, state: State) -> bool:
    """Whether the velocities of the state do not keep the rows."""
    fastest = float(np.abs(model.node_velocity(state.v, state.x)).max(initial=0.0))
    return float(np.abs(rows.G.T @ state.v).max(initial=0.0)) > AGREE * fastest


def without_contacts(model: Model, scheme: Scheme, state: State, met: Encounter) -> Encounter:
    """Another encounter's step without its contacts."""
    contacts = met.meeting.contacts
    return replace(asked_again(model, scheme, state, met, contacts.take(np.zeros(len(contacts), dtype=bool))), left=None)
