"""What a simulation asks of contact detection, whichever rules find the contacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts


class Detection(Protocol):
    """Contacts from positions. `Detector` (explicit pairs) and `Everything` (all bodies) are two; a rule of one's own is a third.

    To add a rule, write a class with these members and pass it to `Simulation`. It owes the simulation four things:

    * `Contacts` as they are documented: normals from the master to the slave, weights that sum to zero (so that H r has no resultant and
      a common translation gives u = 0), the gap equal to (sum_k weights_k x_nodes_k) . N.
    * `identity` ascending, without repetition, and the same from step to step for what is physically the same contact: reactions and the
      variables of contact laws are carried over by it.
    * A value, not a state: the same positions and displacement give the same contacts, bit by bit, whatever was asked before.
    * `nodes` holds every node that a contact may ever name; the compliance of deformable bodies is computed for these.
    """

    @property
    def n_nodes(self) -> int:
        """Number of nodes of the model."""
        ...

    @property
    def nodes(self) -> IntArray:
        """Sorted numbers of the nodes that contacts can touch."""
        ...

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        """Return the contacts at `positions` (n_nodes, d) [m].

        displacement (n_nodes, d) [m]: how far the nodes would move over the step from there, h times their velocity, if there were no
        contacts; what is farther off than the alert distance but is met on that way is found too. None: nothing moves.
        """
        ...


@dataclass(frozen=True)
class Around:
    """What is put around a detection, whose nodes it has."""

    detection: Detection

    @property
    def n_nodes(self) -> int:
        return self.detection.n_nodes

    @property
    def nodes(self) -> IntArray:
        return self.detection.nodes


def left_out(detection: object) -> IntArray:
    """Pairs (n, 2) of different bodies, the lower number first, whose contact the user has taken out of a detection, or of one within it:
    by `exclude`, or as links stand for it. What a rule of one's own leaves out counts where it has such an attribute `left_out`."""
    found, within = [np.empty((0, 2), dtype=np.int64)], detection
    while within is not None:
        found.append(np.asarray(getattr(within, "left_out", found[0]), dtype=np.int64).reshape(-1, 2))
        within = getattr(within, "detection", None)
    pairs: IntArray = np.unique(np.sort(np.concatenate(found), axis=1), axis=0)
    return pairs[pairs[:, 0] != pairs[:, 1]]


def innermost(detection: Detection) -> Detection:
    """The detection that finds contacts of bodies, within what is put around it: cables, pairs that are left out, a rule of one's own with
    an attribute `detection`."""
    within: object = getattr(detection, "detection", None)
    return detection if within is None else innermost(within)  # type: ignore[arg-type] # an attribute of any class
