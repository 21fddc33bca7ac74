"""Contacts that are met on the way: detection along the motion of a step, brought back to its beginning.

A contact found at x + t dx, 0 < t <= 1, with weights c_k on nodes k and normal N holds at x with the gap g = N . sum_k c_k x_k. The law
0 <= g + h u_N then stops the bodies where they meet, in the one step in which they would have passed each other. (The idea is that of
speculative contacts, E. Catto, "Continuous collision", Game Developers Conference 2013; here what is speculated on is found by sampling
the motion, so that the facet is the one that is hit and not the one that is nearest before.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.errors import InputError

_MOST = 1000  # samples of one step: more means a step that is far too long for its bodies


def samples(distance: float, spacing: float) -> int:
    """How many positions of a motion of `distance` [m] leave no more than `spacing` [m] between two.

    InputError where they are more than a thousand.
    """
    count = int(np.ceil(distance / spacing)) if distance > 0 else 0
    if count > _MOST:
        raise InputError(
            f"contact detection: expected bodies that may meet to approach by less than {_MOST} facets in one step, got {distance:.3g} m "
            f"for facets of {spacing:.3g} m: shorten the step"
        )
    return count


def with_swept(
    now: Contacts, detect: Callable[[FloatArray], Contacts], positions: FloatArray, displacement: FloatArray, count: int, alert: float
) -> Contacts:
    """Return the contacts `now` and those that `detect` finds at `count` positions along the way, sorted by identity.

    Of one identity that counts which was found nearest to where it closes; what is in contact now stays as it is. One that would still be
    open by more than `alert` [m] at the end of the motion is left out.
    """
    found, off = [now], [np.full(len(now), -1.0)]
    for t in np.arange(1, count + 1) / count:
        there = detect(positions + t * displacement)
        there = there.take(~np.isin(there.identity, now.identity))
        closes = brought_back(there, positions + displacement).gap
        found.append(brought_back(there, positions).take(closes <= alert))
        off.append(np.abs(there.gap)[closes <= alert])
    every = join(found)
    order = np.lexsort((np.concatenate(off), every.identity))
    identity = every.identity[order]
    return every.take(order[np.append(True, identity[1:] != identity[:-1])[: len(order)]])


def brought_back(contacts: Contacts, positions: FloatArray) -> Contacts:
    """Return contacts found elsewhere as they stand at `positions` (n_nodes, d) [m]: same weights and normals, gap and foot from there."""
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    x = positions[contacts.nodes]
    gap = np.einsum("ad,ad->a", np.einsum("ak,akd->ad", weights, x), contacts.frame[:, 0])
    return replace(contacts, gap=gap, point=np.einsum("ak,akd->ad", contacts.on_master, x))
