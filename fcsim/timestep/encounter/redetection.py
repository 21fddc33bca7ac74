"""Contacts that are found again at the iterates of a step of statics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.skin.boundary import joined_by_facets
from fcsim.timestep.encounter.contact_side import Encounter


@dataclass(frozen=True, eq=False)
class Redetection:
    """How contacts are found at the iterates of a step of statics: met, at v (n_dofs,) and with others that are met on the way, under their
    law; detection: the bare ones, of the model's bodies; of: met with the contacts of a detection."""

    of: Callable[[Detection, FloatArray, Contacts | None], Encounter]
    detection: Detection
    model: Model

    def met(self, v: FloatArray, more: Contacts | None) -> Encounter:
        return self.of(self.detection, v, more)

    def in_valleys(self) -> Redetection:
        """The same where points in valleys have a contact for each of the facets, see `Detector.in_valleys`."""
        other = self.detection.in_valleys if isinstance(self.detection, Detector) else None
        return self if other is None else replace(self, detection=other)

    @cached_property
    def joined(self) -> sp.csr_array:
        """Which of the nodes that contacts can touch share a facet, see `joined_by_facets`."""
        return joined_by_facets(self.model, self.detection.nodes)
