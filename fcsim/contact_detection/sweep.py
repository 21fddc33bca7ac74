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

    Of one identity the earliest counts. One that would still be open by more than `alert` [m] at the end of the motion is left out.
    """
    found, known = [now], now.identity
    for t in np.arange(1, count + 1) / count:
        there = detect(positions + t * displacement)
        there = there.take(~np.isin(there.identity, known))
        known = np.concatenate([known, there.identity])
        found.append(brought_back(there, positions, displacement, alert))
    every = join(found)
    return every.take(np.argsort(every.identity, kind="stable"))


def brought_back(contacts: Contacts, positions: FloatArray, displacement: FloatArray, alert: float) -> Contacts:
    """Return contacts found elsewhere with their gaps and points at `positions`, those that close to less than `alert` [m]."""
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    arm, moved = (np.einsum("ak,akd->ad", weights, field[contacts.nodes]) for field in (positions, displacement))
    normal = contacts.frame[:, 0]
    gap, approach = np.einsum("ad,ad->a", arm, normal), np.einsum("ad,ad->a", moved, normal)
    foot = -np.einsum("ak,akd->ad", np.minimum(weights, 0.0), positions[contacts.nodes])
    return replace(contacts, gap=gap, point=foot).take(gap + approach <= alert)
