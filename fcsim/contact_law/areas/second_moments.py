"""How stiffly joints turn: second moments of their contacts' areas beside those of the overlaps of facets that they stand for."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.areas.overlaps import centres_of, overlaps_of, patches_of

_WHOLE = 1e-3
"""Of an overlap's area: what its contacts may miss."""
_FLAT = 1e-6
"""Of the largest second moment: below it there is none."""


def second_moment_ratios(
    contacts: Contacts, area: FloatArray, positions: FloatArray, facets: IntArray, bodies: IntArray
) -> tuple[FloatArray, IntArray]:
    """sum_a area_a (t . (x_a - c))^2 / int (t . (x - c))^2 dA of each patch (n,), along that of its principal axes t for which it is
    farthest from 1, and one of the contacts (n,) there: of patches whose contacts have all the area of the overlap.

    area (nc,) [m^2; 2D: m]; facets (nf, k) of all bodies, -1 = none, and their bodies (nf,).
    """
    chosen = contacts.bodies[:, 0] != contacts.bodies[:, 1]
    none = np.empty(0), np.empty(0, dtype=np.int64)
    if not chosen.any() or not len(facets):
        return none
    count, d = 1 + int(contacts.bodies.max()), contacts.dimension
    both = np.sort(contacts.bodies, axis=1)
    code = both[:, 0] * count + both[:, 1]
    found, now, kept = overlaps_of(contacts, chosen, code, positions, facets, bodies)
    if not len(found.row):
        return none
    pair_code = kept.bodies[found.slave] * count + kept.bodies[found.master]
    patch_of_pair, patch = patches_of(contacts, chosen, code, pair_code, found, now, kept.closed, len(positions))
    n, at = 1 + int(patch_of_pair.max()), patch_of_pair[found.row]
    points, centre = centres_of(found, now, patch_of_pair, n)
    own = np.flatnonzero(patch >= 0)
    moments = np.zeros((2, n, d, d))
    for sums, place, weight, where in zip(moments, (points, contacts.point[own]), (found.weight, area[own]), (at, patch[own]), strict=True):
        arm = place - centre[where]
        np.add.at(sums, where, weight[:, None, None] * arm[:, :, None] * arm[:, None, :])
    whole = np.bincount(at, found.weight, n)
    first = np.full(n, -1)
    first[patch[own][::-1]] = own[::-1]
    known = (first >= 0) & (np.abs(np.bincount(patch[own], area[own], n) - whole) <= _WHOLE * whole)
    size, axes = np.linalg.eigh(moments[0, known])
    theirs = np.einsum("pik,pij,pjk->pk", axes, moments[1, known], axes)
    ratio = np.where(size > _FLAT * size[:, -1:], theirs / np.maximum(size, 1e-300), 1.0)
    worst = np.argmax(np.abs(np.log(np.maximum(ratio, 1e-3))), axis=1)
    return ratio[np.arange(len(ratio)), worst], first[known]
