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
scaled down where an area would still come near zero. What has a contact changes none of this: as a joint opens each contact keeps its
area.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.integral.segment_to_segment import Configuration, Segments
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.broad_phase import near_facets
from fcsim.contact_detection.surfaces.facets import Facets
from fcsim.contact_detection.surfaces.ragged import of_same_key
from fcsim.contact_law.areas.overlaps import FLUSH, Shares, centres_of, clipped, over_facets, shares_of

_ALIGNED = 0.5
"""Faces meet whose normals are within 60 degrees of each other's, and of the contact's."""
_FLAT = 0.999
"""Facets are of one face whose normals are within 2.6 degrees of each other's, and of their mean."""
_BESIDE = 1e-3
"""Of a facet's size: how far apart facets may be beside what the faces lean."""
_KNOWN = 1e-3
"""Of a patch's area: moments are none of its points' below it."""
_LEAST = 0.05
"""Of f_0: what f keeps at least."""
_ROUNDS = 8
"""Of Newton's method for f = exp(...) in place of a polynomial that would be negative."""


class _Faces(NamedTuple):
    """Facets near contacts, their geometry, the face of each (nf,), and of faces: normal (n, d), a point (n, d), whether flat (n,)."""

    facets: Facets
    now: Configuration
    face: IntArray
    normal: FloatArray
    point: FloatArray
    flat: BoolArray


class _Points(NamedTuple):
    """Points (n, d) of patches, their shares (n,) [m^2; 2D: m] and patch (n,)."""

    place: FloatArray
    share: FloatArray
    patch: IntArray


def areas_of_flat_faces(
    contacts: Contacts,
    chosen: BoolArray,
    weights: FloatArray,
    slaves: IntArray | None,
    positions: FloatArray,
    facets: IntArray,
    bodies: IntArray,
) -> FloatArray:
    """Areas (nc,) [m^2; 2D: m] of the chosen contacts (nc,) of rigid bodies that are between two flat faces; nan of all others.

    weights (nc, k) >= 0 with which contacts have their nodes' areas; slaves: numbers slave * (1 + highest body) + master of bodies whose
    nodes may have contacts, None = all; facets (nf, k) of all bodies, -1 = none, and their bodies (nf,).
    """
    area = np.full(len(contacts), np.nan)
    if not chosen.any():
        return area
    faces = _faces(contacts, chosen, positions, facets, bodies)
    own, couple = _couples(contacts, chosen, faces, len(positions))
    if not len(own):
        return area
    code = couple[:, 0] * len(faces.flat) + couple[:, 1]
    codes, patch_of_contact = np.unique(code, return_inverse=True)
    found = _overlaps(codes, faces)
    if not len(found.row):
        return area
    pair = np.searchsorted(codes, faces.face[found.slave] * len(faces.flat) + faces.face[found.master])
    points = _points(contacts, own, weights, patch_of_contact, found, faces, pair, slaves)
    fitted = _fitted(points, found, faces.now, pair, len(codes))
    area[own] = np.where(fitted[: len(own)] > 0, fitted[: len(own)], np.nan)
    return area


def _points(
    contacts: Contacts,
    own: IntArray,
    weights: FloatArray,
    patch_of_contact: IntArray,
    found: Segments,
    faces: _Faces,
    pair: IntArray,
    slaves: IntArray | None,
) -> _Points:
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
    return _Points(
        np.concatenate([contacts.point[own], positions[known[away] % n]]),
        np.concatenate([given, of_node[away]]),
        np.concatenate([patch_of_contact, known[away] // n]),
    )


def _part_of_side(
    contacts: Contacts, shares: Shares, inside: BoolArray, found: Segments, faces: _Faces, pair: IntArray, slaves: IntArray | None
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


def _faces(contacts: Contacts, chosen: BoolArray, positions: FloatArray, facets: IntArray, bodies: IntArray) -> _Faces:
    """The faces of bodies with chosen contacts, near the bodies that they touch."""
    count, d = int(max(contacts.bodies.max(), bodies.max())) + 1, contacts.dimension
    met = np.zeros(count, dtype=bool)
    met[contacts.bodies[chosen]] = True
    ordered = np.sort(facets, axis=1)
    taken = met[bodies] & ~((np.diff(ordered, axis=1) == 0) & (ordered[:, 1:] >= 0)).any(axis=1)
    given, owner = facets[taken], bodies[taken]
    closed = np.where(given < 0, given[:, :1], given)
    corners = positions[closed]
    box = np.full((2, count, d), np.inf)
    np.minimum.at(box[0], owner, corners.min(axis=1))
    np.minimum.at(box[1], owner, -corners.max(axis=1))
    one, other = contacts.bodies[chosen].T
    margin = np.minimum(*((-box[1] - box[0]).max(axis=1)[side] for side in (one, other)))[:, None]
    window = np.full((2, count, d), np.inf)
    for own, theirs in ((one, other), (other, one)):
        for side in (0, 1):
            np.minimum.at(window[side], own, box[side, theirs] - margin)
    near = np.all((corners.max(axis=1) >= window[0, owner]) & (-corners.min(axis=1) >= window[1, owner]), axis=1)
    kept = Facets(given[near], closed[near], owner[near], np.array([0, int(near.sum())]))
    here = contact_facets.geometry(kept, positions)
    neighbours = coo_array((around := _around(kept, len(positions))) @ around.T)
    i, j = neighbours.coords
    alike = np.einsum("ei,ei->e", here.normal[i], here.normal[j]) > _FLAT
    _, face = connected_components(csr_array((np.ones(int(alike.sum())), (i[alike], j[alike])), shape=(len(near.nonzero()[0]),) * 2), False)
    n = 1 + int(face.max(initial=-1))
    size = here.size ** (d - 1)
    mean = np.stack([np.bincount(face, size * column, n) for column in here.normal.T], axis=1)
    mean /= np.maximum(np.sqrt(np.einsum("fi,fi->f", mean, mean)), 1e-300)[:, None]
    bent = np.einsum("fi,fi->f", here.normal, mean[face]) < _FLAT
    point = np.zeros((n, d))
    point[face] = here.centre
    return _Faces(kept, Configuration(positions, here, here), face, mean, point, np.bincount(face, bent, n) == 0)


def _around(facets: Facets, n: int) -> csr_array:
    """Which facet has which of n nodes."""
    row, column = np.nonzero(facets.nodes >= 0)
    return csr_array((np.ones(len(row)), (row, facets.nodes[row, column])), shape=(len(facets.nodes), n))


def _couples(contacts: Contacts, chosen: BoolArray, faces: _Faces, n: int) -> tuple[IntArray, IntArray]:
    """The contacts (k,) between two flat faces, and these (k, 2), that of the body of the lower number first."""
    around, sides = _around(faces.facets, n), []
    for sign in (1.0, -1.0):
        row, column = np.nonzero((contacts.nodes >= 0) & (sign * contacts.weights > 0) & chosen[:, None])
        of = csr_array((np.ones(len(row)), (row, contacts.nodes[row, column])), shape=(len(contacts), n))
        contact, facet = coo_array(of @ around.T).coords
        along = -sign * np.einsum("ei,ei->e", faces.normal[faces.face[facet]], contacts.frame[contact, 0])
        kept = along > _ALIGNED
        contact, facet, along = contact[kept], facet[kept], along[kept]
        order = np.lexsort([-facet, along, contact])
        side = np.full(len(contacts), -1)
        side[contact[order]] = faces.face[facet[order]]  # the last of each contact stays: the facet that its normal is along
        sides.append(side)
    couple = np.stack(sides, axis=1)
    couple[contacts.bodies[:, 0] > contacts.bodies[:, 1]] = couple[contacts.bodies[:, 0] > contacts.bodies[:, 1], ::-1]
    own = np.flatnonzero((couple >= 0).all(axis=1) & faces.flat[couple].all(axis=1))
    own = own[np.einsum("ai,ai->a", *(faces.normal[couple[own, k]] for k in (0, 1))) < -_ALIGNED]
    return own, couple[own]


def _overlaps(codes: IntArray, faces: _Faces) -> Segments:
    """The overlaps of the facets of faces; codes first * number of faces + second."""
    here, n = faces.now.slave, len(faces.flat)
    couple = np.stack([codes // n, codes % n])
    lean = np.zeros((2, len(codes)))
    for side in (0, 1):
        patch, facet = of_same_key(faces.face, couple[side])
        other = couple[1 - side, patch]
        arm = here.corners[facet] - faces.point[other][:, None]
        np.maximum.at(lean[side], patch, np.abs(np.einsum("pki,pi->pk", arm, faces.normal[other])).max(axis=1))
    reach = lean.min(axis=0) / _ALIGNED
    widest = np.zeros(n)
    np.maximum.at(widest, couple[1], reach)
    first, second = (np.flatnonzero(np.isin(faces.face, side)) for side in couple)
    one, other = near_facets(
        here.centre[first], here.radius[first], here.centre[second], (here.radius + widest[faces.face] + _BESIDE * here.size)[second]
    )
    one, other = first[one], second[other]
    code = faces.face[one] * n + faces.face[other]
    patch = np.minimum(np.searchsorted(codes, code), len(codes) - 1)
    wanted = codes[patch] == code
    one, other, patch = one[wanted], other[wanted], patch[wanted]
    order = np.lexsort([other, one])
    one, other, patch = one[order], other[order], patch[order]
    least = reach[patch] + _BESIDE * np.minimum(here.size[one], here.size[other])
    return _clipped_both_ways(faces, one, other, least)


def _clipped_both_ways(faces: _Faces, one: IntArray, other: IntArray, least: FloatArray) -> Segments:
    """The overlaps of pairs of facets no farther apart than `least` (np,) [m]; of those that lean to each other the mean of what they are
    in the planes of the one and the other, with the Gauss points of both."""
    sides, normal = (faces.facets.nodes >= 0).sum(axis=1), faces.now.slave.normal
    lean = np.flatnonzero(np.einsum("pi,pi->p", normal[one], normal[other]) > -FLUSH)
    found = clipped(faces.now, one, other, least, sides)
    if len(lean):
        back = clipped(faces.now, other[lean], one[lean], least[lean], sides)
        row = lean[back.row]
        both = (np.bincount(found.row, minlength=len(one)) > 0) & (np.bincount(row, minlength=len(one)) > 0)
        weights = [np.where(both[at], 0.5 * weight, weight) for at, weight in ((found.row, found.weight), (row, back.weight))]
        found = found._replace(
            row=np.concatenate([found.row, row]),
            number=np.concatenate([found.number, back.number]),
            weight=np.concatenate(weights),
            gap=np.concatenate([found.gap, back.gap]),
            phi=np.concatenate([found.phi, back.psi]),
            psi=np.concatenate([found.psi, back.phi]),
        )
    touched = np.zeros(len(one), dtype=bool)
    touched[found.row] = True
    row = (np.cumsum(touched) - 1)[found.row]
    return found._replace(slave=one[touched], master=other[touched], area=found.area[touched], row=row)


def _fitted(points: _Points, found: Segments, now: Configuration, pair: IntArray, patches: int) -> FloatArray:
    """The shares (n,) times f, see the top of this file."""
    at, middle, where = points.patch, *centres_of(found, now, pair, patches)[:1], pair[found.row]
    tried, begun = points, _change(points, middle, found.weight, where, patches)
    linear, curved = begun
    for _ in range(_ROUNDS):
        low = _below(1.0 + linear + curved, at, patches)
        if not low.any():
            break
        steepest = np.ones(patches)
        np.maximum.at(steepest, at, np.abs(linear + curved))
        share = tried.share * np.where(low[at], np.exp((linear + curved) / steepest[at]), 1.0)
        tried = tried._replace(share=np.maximum(share, _LEAST * points.share))
        linear, curved = _change(tried, middle, found.weight, where, patches)
    back = _below(1.0 + linear + curved, at, patches)[at]  # there is no such exponential: the polynomial, scaled down
    linear, curved = np.where(back, begun[0], linear), np.where(back, begun[1], curved)
    tried = tried._replace(share=np.where(back, points.share, tried.share))
    first = 1.0 + linear * np.where(back, _part(np.ones(len(at)), linear, 2 * _LEAST, at, patches), 1.0)
    whole, sums = np.bincount(where, found.weight, patches), np.bincount(at, tried.share, patches)
    scale = np.divide(whole, sums, out=np.zeros(patches), where=sums > 0)[at]
    return tried.share * scale * (first + curved * np.where(back, _part(first, curved, _LEAST, at, patches), 1.0))


def _below(factor: FloatArray, patch: IntArray, patches: int) -> BoolArray:
    """Which patches have a factor below `_LEAST`."""
    low = np.zeros(patches, dtype=bool)
    low[patch[factor < _LEAST]] = True
    return low


def _change(points: _Points, middle: FloatArray, gauss: FloatArray, where: IntArray, patches: int) -> tuple[FloatArray, FloatArray]:
    """By how much f differs from f_0, over f_0, at the points (n,): b . x, and what goes with x . B x; Gauss points `middle` (nq, d) of the
    overlaps with their weights [m^2; 2D: m], of the patches `where` (nq,)."""
    at, whole, sums = points.patch, np.bincount(where, gauss, patches), np.bincount(points.patch, points.share, patches)
    share, over = points.share / np.maximum(sums, 1e-300)[at], gauss / np.maximum(whole, 1e-300)[where]
    arm = middle - _means(middle, over, where, patches)[where]
    size, axes = np.linalg.eigh(_summed(where, over, arm, arm, patches))
    size, axes = size[:, 1:], axes[:, :, 1:]  # without the normal
    scaled = axes / np.sqrt(np.maximum(size, 1e-12 * np.maximum(size[:, -1:], 1e-300)))[:, None, :]
    mean = _means(points.place, share, at, patches)
    x, y = (np.einsum("qi,qij->qj", place - mean[k], scaled[k]) for place, k in ((points.place, at), (middle, where)))
    inverse = _inverse(_summed(at, share, x, x, patches))
    linear = np.einsum("qi,qij,qj->q", x, inverse[at], _means(y, over, where, patches)[at])
    square, of_gauss = (_squares(z) for z in (x, y))
    mean, along = _means(square, share, at, patches), _summed(at, share, square, x, patches) @ inverse
    square, of_gauss = (q - mean[k] - np.einsum("qij,qj->qi", along[k], z) for q, z, k in ((square, x, at), (of_gauss, y, where)))
    inverse = _inverse(_summed(at, share, square, square, patches))
    return linear, np.einsum("qi,qij,qj->q", square, inverse[at], _means(of_gauss, over, where, patches)[at])


def _means(values: FloatArray, share: FloatArray, patch: IntArray, patches: int) -> FloatArray:
    """sum share values (patches, i), of shares whose sum is 1 in each patch."""
    return np.stack([np.bincount(patch, share * column, patches) for column in values.T], axis=1)


def _squares(x: FloatArray) -> FloatArray:
    """The products (n, 3) of coordinates (n, 2), in 2D (n, 1): sums of squares of theirs do not depend on the axes."""
    return x**2 if x.shape[1] == 1 else np.stack([x[:, 0] ** 2, np.sqrt(2) * x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1)


def _summed(patch: IntArray, weight: FloatArray, one: FloatArray, other: FloatArray, patches: int) -> FloatArray:
    """sum weight one other^T (patches, i, j)."""
    columns = [[np.bincount(patch, weight * a * b, patches) for b in other.T] for a in one.T]
    return np.moveaxis(np.array(columns), 2, 0)


def _inverse(matrices: FloatArray) -> FloatArray:
    """Pseudo-inverses of symmetric matrices (n, k, k) of the order of 1, without what is `_KNOWN` of that."""
    size, axes = np.linalg.eigh(matrices)
    return np.asarray((axes * np.where(size > _KNOWN, 1 / np.maximum(size, _KNOWN), 0.0)[:, None, :]) @ np.swapaxes(axes, 1, 2))


def _part(base: FloatArray, more: FloatArray, least: float, patch: IntArray, patches: int) -> FloatArray:
    """How much (n,) of `more` leaves at least `least` of each patch's factors."""
    part = np.ones(patches)
    down = np.flatnonzero(more < 0)
    room = (base - least)[down]
    np.minimum.at(part, patch[down], np.maximum(room, 0.0) / np.maximum(-more[down], 1e-300))
    return part[patch]
