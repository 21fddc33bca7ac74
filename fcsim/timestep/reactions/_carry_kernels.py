"""Reactions of a step at the contacts of another one, compiled: four past steps are looked at in each."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def carry(identity, frame, r, wanted, wanted_frame, carried):
    """Write to `carried` (nc, >= d) the forces r (n, >= d) of the contacts `identity` (n,), ascending, as vectors in space at the same
    contacts among `wanted` (nc,), in their frames (nc, d, d). Returns their places (nc,) in `identity`, -1 where a contact is new."""
    place = np.full(len(wanted), -1)
    d = frame.shape[1]
    force = np.empty(d)
    at = -1
    for a in range(len(wanted)):
        at += 1  # most contacts are those of the step before, in the same order
        if at >= len(identity) or identity[at] != wanted[a]:
            at = np.searchsorted(identity, wanted[a])
        if at == len(identity) or identity[at] != wanted[a]:
            continue
        place[a] = at
        for j in range(d):
            s = 0.0
            for k in range(d):
                s += frame[at, k, j] * r[at, k]
            force[j] = s
        for i in range(d):
            s = 0.0
            for j in range(d):
                s += wanted_frame[a, i, j] * force[j]
            carried[a, i] = s
    return place
