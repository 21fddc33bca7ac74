"""How far joints have opened and slid since the beginning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Contacts
from fcsim.masonry.problem import MasonryProblem

OPEN = 1e-7
"""Of the structure's extent: joints that are open by more are called so; less is round-off."""


@dataclass(frozen=True)
class Opening:
    """A joint of the structure as it was built: its largest opening and slip [m] of a contact point, and its ends (2, d) [m] now."""

    between: tuple[str, str]
    opening: float
    slip: float
    ends: tuple[tuple[float, ...], tuple[float, ...]]


def in_mm(way: float, problem: MasonryProblem) -> float:
    """[mm] How far a joint has opened or slid, [m], as tables tell it: 0 where that is round-off."""
    return 1e3 * way if way > OPEN * problem.size else 0.0


def openings(contacts: Contacts, model: Model, x: FloatArray) -> tuple[Opening, ...]:
    """Return what has become, in the configuration x (n_dofs,), of the joints whose contacts were those of the reference configuration.

    The change of (sum_k weights_k x_nodes_k), along the normal and across it, of the points that touched; the normals are those of
    then, so that rotations should be small. Joints are known however far they have opened, also where detection sees no contact any more.
    """
    moved = model.positions(x)
    arms = np.einsum("ak,akd->ad", contacts.weights, np.where((contacts.nodes >= 0)[:, :, None], moved[contacts.nodes], 0.0))
    local = np.einsum("aci,ai->ac", contacts.frame, arms)
    start = np.einsum("ak,akd->ad", contacts.weights, np.where((contacts.nodes >= 0)[:, :, None], model.reference[contacts.nodes], 0.0))
    local -= np.einsum("aci,ai->ac", contacts.frame, start)
    positive = np.maximum(contacts.weights, 0.0)
    place = np.einsum("ak,akd->ad", positive, np.where((contacts.nodes >= 0)[:, :, None], moved[contacts.nodes], 0.0))
    pairs = np.sort(contacts.bodies, axis=1)
    different, joint = np.unique(pairs, axis=0, return_inverse=True)
    found = []
    for k, (a, b) in enumerate(different.tolist()):
        of = np.flatnonzero(joint.ravel() == k)
        along = np.linalg.norm(place[of] - place[of].mean(axis=0), axis=1)
        first = of[int(np.argmax(along))]
        last = of[int(np.argmax(np.linalg.norm(place[of] - place[first], axis=1)))]
        ends = (tuple(map(float, place[first])), tuple(map(float, place[last])))
        slip = float(np.linalg.norm(local[of, 1:], axis=1).max())
        found.append(Opening((model.bodies[a].name, model.bodies[b].name), max(float(local[of, 0].max()), 0.0), slip, ends))
    return tuple(found)
