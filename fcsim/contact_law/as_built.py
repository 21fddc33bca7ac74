"""Non-penetration from the joints that blocks were built with: the gaps and overlaps of a drawing's round-off are none."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.contact_law.coulomb import Gap
from fcsim.contact_law.law import Meeting, Terms
from fcsim.errors import InputError


@dataclass(frozen=True)
class AsBuilt(Gap):
    """0 <= g - clip(g, -overlap, closed) + dx_N ⊥ r_N >= 0: `Gap` of statics, where a joint is closed anywhere in that range.

    closed, overlap [m] >= 0: the widest gap and the deepest overlap of joints that were given as closed; with 0 and 0 it is `Gap`.
    Files give corners to some digits, so that faces that are meant to touch leave gaps of either sign. Taken as they are, rigid blocks must
    first slide and turn by as much, where a stiff hyperstatic structure has hardly room to, before they bear; nothing that is asked
    of the structure depends on it. Positions are uncertain by that range, and forces are in equilibrium at the joints as they lie.
    """

    closed: float = 0.0
    overlap: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("closed", "overlap"):
            if not (is_number(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"{name}: expected a length in m >= 0, got {shown(getattr(self, name))}")

    def terms(self, meeting: Meeting) -> Terms:
        given = super().terms(meeting)
        w = given.w.copy()
        w[:, 0] -= np.clip(meeting.contacts.gap, -self.overlap, self.closed) / meeting.timing.length_per_u
        return replace(given, w=w)
