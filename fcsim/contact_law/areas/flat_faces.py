"""Areas of contacts between flat faces of rigid bodies: with the sum, the centre and the second moments of the faces' overlap.

Two faces (facets that hang together in one plane) with a contact between them are a patch, whole: their facets are clipped by each other
however far they have turned from each other. Its points are the contacts and, without one now, the nodes of either face that are over the
other one. Their shares m_k are those of shape functions (`overlaps`), half of the area by the nodes of each face; nodes that overhang leave
theirs to the points of the same two facets. The areas are

    area_k = m_k f(x_k),   f(x) = f_0 + b . x + x . B x   with   sum_k area_k (1, x_k, x_k x_k^T) = int (1, x, x x^T) dA

over all points, x in the overlap's plane from its centre along its principal axes, each over its radius of gyration: the least change of
the shares in sum_k m_k (f - f_0)^2; where that would be negative, f is the exponential of such a polynomial, the least change in relative
entropy. On n facets in a row they are Simpson's rules, 1/6, 4/6, 1/6 and 1/8, 3/8, 3/8, 1/8 for two and three: joints of rigid bodies turn
under a moment as their area does. What the points cannot have (corners alone are all at the overlap's rim) stays as it is, and b and B are
scaled down where an area would still come near zero: there `points_within` has more points for it, with m_k their weights. Areas
go over to those with such points by degrees: springs of new points have no force, and would take it off a joint that slides by a hair. What
has a contact changes none of this: as a joint opens each contact keeps its area.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.integral.segment_to_segment import Segments
from fcsim.contact_law.areas.faces import Faces, couples_of, faces_of, overlaps_between
from fcsim.contact_law.areas.moments import LEAST, Points, factors, lowest, misses
from fcsim.contact_law.areas.overlaps import Shares, centres_of, over_facets, shares_of

_OFF = 0.02
"""Of an overlap's second moments: patches whose points miss more of them are coarse."""
_LOW = 0.2
"""Of f_0: f at a point from which on patches go over to points within them; where it is `LEAST` they have."""
_FEWEST = 1e-3
"""Of their areas: what points within patches that hardly need them have at least."""


class Patches(NamedTuple):
    """Pairs of flat faces that meet: the contacts between them (k,) and their patch (k,); codes (n,), first face * number of faces +
    second; the overlaps of their facets, and the patch (np,) of each; points: the contacts, then nodes; Gauss points of the overlaps."""

    faces: Faces
    own: IntArray
    patch: IntArray
    codes: IntArray
    found: Segments
    pair: IntArray
    points: Points
    gauss: Points

    def areas(self, more: Points | None = None) -> FloatArray:
        """The area (n,) of each of the points, and of more that share the overlaps with them."""
        points = self.points if more is None else Points(*(np.concatenate(both) for both in zip(self.points, more, strict=True)))
        return points.share * factors(points, self.gauss, len(self.codes))

    def coarse(self, area: FloatArray) -> FloatArray:
        """How coarse (n,) patches are: 1 where points of these `areas` miss the overlap's second moments, or have them by another f
        than the polynomial; between 0 and 1 where they are about to."""
        n = len(self.codes)
        low = (_LOW - lowest(self.points, self.gauss, n)) / (_LOW - LEAST)
        degree = np.where(low > 0, np.clip(low, _FEWEST, 1.0), 0.0)
        return np.where(misses(self.points._replace(share=area), self.gauss, n) > _OFF, 1.0, degree)


def patches_of_flat_faces(
    contacts: Contacts,
    chosen: BoolArray,
    weights: FloatArray,
    slaves: IntArray | None,
    positions: FloatArray,
    facets: IntArray,
    bodies: IntArray,
) -> Patches | None:
    """The patches of the chosen contacts (nc,) of rigid bodies that are between two flat faces; None where there are none.

    weights (nc, k) >= 0 with which contacts have their nodes' areas; slaves: numbers slave * (1 + highest body) + master of bodies whose
    nodes may have contacts, None = all; facets (nf, k) of all bodies, -1 = none, and their bodies (nf,).
    """
    if not chosen.any():
        return None
    faces = faces_of(contacts, chosen, positions, facets, bodies)
    own, couple = couples_of(contacts, chosen, faces, len(positions))
    if not len(own):
        return None
    codes, patch = np.unique(couple[:, 0] * len(faces.flat) + couple[:, 1], return_inverse=True)
    found = overlaps_between(codes, faces)
    if not len(found.row):
        return None
    pair = np.searchsorted(codes, faces.face[found.slave] * len(faces.flat) + faces.face[found.master])
    middle, _ = centres_of(found, faces.now, pair, len(codes))
    points = _points(contacts, own, weights, patch, found, faces, pair, slaves)
    return Patches(faces, own, patch, codes, found, pair, points, Points(middle, found.weight, pair[found.row]))


def _points(
    contacts: Contacts,
    own: IntArray,
    weights: FloatArray,
    patch_of_contact: IntArray,
    found: Segments,
    faces: Faces,
    pair: IntArray,
    slaves: IntArray | None,
) -> Points:
    """The contacts `own` (k,), of the patches (k,), then nodes over the other face that have none; pair (np,): overlaps' patches."""
    positions = faces.now.x
    n = len(positions)
    shares = shares_of(found, faces.facets, pair, np.ones((2, len(pair))), n)
    inside = over_facets(positions[shares.node], faces.now.slave, shares.other)
    share = shares.area * _part_of_side(contacts, shares, inside, found, faces, pair, slaves)
    entry, column = np.nonzero(weights[own] > 0)
    key, weight = patch_of_contact[entry] * n + contacts.nodes[own[entry], column], weights[own[entry], column]
    known, at = np.unique(np.concatenate([shares.key, key]), return_inverse=True)
    of_share, of_entry = at[: len(share)], at[len(share) :]
    total = np.bincount(of_entry, weight, len(known))
    has = (total > 0) | (np.bincount(of_share, inside, len(known)) > 0)
    held, left = (np.bincount(shares.pair, np.where(which, share, 0.0), len(pair)) for which in (has[of_share], ~has[of_share]))
    more = np.divide(left, held, out=np.zeros(len(pair)), where=held > 0)
    of_node = np.bincount(of_share, np.where(has[of_share], share * (1 + more[shares.pair]), 0.0), len(known))
    given = np.bincount(entry, weight * of_node[of_entry] / total[of_entry], len(own))
    away = np.flatnonzero(has & (total == 0) & (of_node > 0))
    return Points(
        np.concatenate([contacts.point[own], positions[known[away] % n]]),
        np.concatenate([given, of_node[away]]),
        np.concatenate([patch_of_contact, known[away] // n]),
    )


def _part_of_side(
    contacts: Contacts, shares: Shares, inside: BoolArray, found: Segments, faces: Faces, pair: IntArray, slaves: IntArray | None
) -> FloatArray:
    """The part (n,) of an overlap that the nodes of a share's side stand for: half, or all where one side's alone may have contacts."""
    first, second = (faces.facets.bodies[side] for side in (found.slave, found.master))
    side = (faces.facets.bodies[shares.other] == first[shares.pair]).astype(np.int64)
    may = np.zeros((2, int(pair.max()) + 1), dtype=bool)
    if slaves is None:
        may[side[inside], pair[shares.pair[inside]]] = True
    else:
        both = np.stack([first, second])
        may[:, pair] = np.isin(both * (1 + int(contacts.bodies.max())) + both[::-1], slaves)
    part = np.where(may.any(axis=0), may / np.maximum(may.sum(axis=0), 1), 0.5)
    return np.asarray(part[side, pair[shares.pair]])
