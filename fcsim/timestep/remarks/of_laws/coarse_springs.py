"""What is said of springs per area on few points: they turn more stiffly than the area that they stand for."""

from __future__ import annotations

import numpy as np

from fcsim.contact_law import Cohesive, Compliant
from fcsim.contact_law.areas.second_moments import second_moment_ratios
from fcsim.timestep.remarks.of_laws.known_laws import single_laws
from fcsim.timestep.step import Step

OFF = 0.1
"""By how much a second moment may be off."""


def coarse_springs(step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the joint whose second moment is farthest from that of its area, as a run begins.

    Points at the nodes of n facets over the length l have l^3 / 12 (1 + 2 / n^2): a box turns by less for the same moment, and lifts later.
    Of flat faces of rigid bodies they are corrected (`fcsim.contact_law.areas.flat_faces`), n = 1 under `Everything` (`within_faces`).
    """
    contacts = step.contacts
    if "coarse springs" in said or step.number > 1 or not len(contacts):
        return {}
    springs = [law.springs if isinstance(law, Compliant | Cohesive) else None for law in single_laws(step.scheme.law)]
    if all(one is None or one.each for one in springs):
        return {}
    meeting = step.encounter.meeting
    sizes, positions = meeting.proportions, meeting.positions
    if np.isfinite(sizes.thickness).any():  # areas of the plane are lengths times these
        return {}
    bodies = np.searchsorted(sizes.first, sizes.facets[:, 0], side="right") - 1
    ratio, one = second_moment_ratios(meeting.contacts, meeting.area, positions, sizes.facets, bodies)
    if not len(ratio):
        return {}
    worst = int(np.argmax(np.abs(ratio - 1)))
    if abs(ratio[worst] - 1) <= OFF:
        return {}
    first, other = (step.model.bodies[int(k)].name for k in meeting.contacts.bodies[one[worst]])
    return {
        "coarse springs": f"{when}: the springs between {first!r} and {other!r} stand at so few points that their second moment is "
        f"{ratio[worst]:.3g} times that of the area: what is pressed out of its middle turns by {1 / ratio[worst]:.2g} of what it should. "
        "What helps: of rigid bodies Everything(model, ...), or finer facets, of boxes two a side; else candidates='segments' "
        "(docs/contact_laws.md)"
    }
