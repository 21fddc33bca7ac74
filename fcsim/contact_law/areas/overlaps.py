"""Areas of contacts between the nodes and edges of two meshed bodies: those of the overlaps of their facets.

The facets of both bodies are clipped by each other (`fcsim.contact_detection.integral`): polygons p, in 2D intervals, with the shape
functions phi of one facet and psi of the other. Overlapping facets that hang together are a patch. The slave gives a patch's area, or each
body half of it where both are slaves (two passes), or all contacts are of edges:

    A_k = sum_p int_p phi_k [/ 2] of its node k,   area_a = sum_k w_ak A_k / sum_b w_bk over the contacts b of the patch at k

A node that overhangs the other body, and has no contact, leaves its share to the other nodes of the two facets. What a node that is over
the other body has is left out where it is too far away for a contact: a joint that opens loses the area of what is open. Where nothing is
left out, the areas are tilted, area_a (1 + b . (x_a - mean of x)), so that their centre too is that of the overlap: their springs carry a
uniform pressure without a moment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.integral.segment_to_segment import THREE_POINTS, Configuration, Segments, intervals, polygons
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.broad_phase import near_facets
from fcsim.contact_detection.surfaces.facets import FacetGeometry, Facets

_ALIGNED = 0.5
"""Facets overlap, and are a contact's, whose normals are within 60 degrees of each other's, and of the contact's."""
_SMOOTH = np.sqrt(0.5)
"""Neighbours whose normals meet at less than 45 degrees are of one patch."""
FLUSH = 0.999
"""Facets lean whose normals are more than 2.6 degrees from each other's."""
_REACH = 2.0
"""Facets overlap whose distance is not larger than so many times the largest gap of the two bodies' contacts,"""
_FLAT = 1e-3
"""or this part of the smaller facet's size."""
_BESIDE = 1e-6
"""A node is over a facet also where it is outside its edges by no more than this part of the facet's size."""
_LEAST_TILT = 0.1
"""Of an area that is left where areas are tilted."""
_ARM = 1e-3
"""Of a patch's size: areas are not tilted along a direction in which its contacts are less apart (one contact alone by round-off)."""
_LEAST = 1e-6
"""Of the area of whole facets that a contact keeps at least."""


class Shares(NamedTuple):
    """Areas of corners of overlapping facets, a corner a row: facet pair, node's key, area [m^2; 2D: m], node, the other facet."""

    pair: IntArray
    key: IntArray
    area: FloatArray
    node: IntArray
    other: IntArray


def areas_of_overlaps(
    contacts: Contacts,
    chosen: BoolArray,
    weights: FloatArray,
    slaves: IntArray,
    whole: FloatArray,
    positions: FloatArray,
    facets: IntArray,
    bodies: IntArray,
) -> FloatArray:
    """Areas (nc,) [m^2; 2D: m] of the chosen contacts (nc,), whose overlap is found; `whole` (nc,) of all others.

    weights (nc, k) >= 0 with which contacts have their nodes' areas; slaves: numbers slave * (1 + highest body) + master of the bodies that
    meet by nodes of the slave; facets (nf, k) of all bodies, -1 = none, and their bodies (nf,).
    """
    count = 1 + int(contacts.bodies.max())
    both = np.sort(contacts.bodies, axis=1)
    code = both[:, 0] * count + both[:, 1]
    found, now, sorted_facets = overlaps_of(contacts, chosen, code, positions, facets, bodies)
    if not len(found.row):
        return whole
    nodes, n = sorted_facets.closed, len(positions)
    pair_code = sorted_facets.bodies[found.slave] * count + sorted_facets.bodies[found.master]
    patch_of_pair, patch_of_contact = patches_of(contacts, chosen, code, pair_code, found, now, nodes, n)
    parts = np.isin([pair_code, pair_code % count * count + pair_code // count], slaves).astype(np.float64)
    parts /= np.where(parts.sum(axis=0) > 0, parts.sum(axis=0), 1.0)
    parts[:, ~parts.any(axis=0)] = 0.5  # all contacts are of edges
    shares = shares_of(found, sorted_facets, patch_of_pair, parts, n)
    a, place = np.nonzero((weights > 0) & (patch_of_contact >= 0)[:, None])
    key, w = patch_of_contact[a] * n + contacts.nodes[a, place], weights[a, place]
    area, free, missing = _given(shares, now, key, w, a, len(contacts), len(found.area))
    patches = 1 + int(patch_of_pair.max())
    own = patch_of_contact >= 0
    a, patch = np.flatnonzero(own), patch_of_contact[own]
    sums = np.bincount(patch, area[own], patches)
    lost = np.bincount(patch_of_pair, missing, patches) > 0
    target = sums + np.bincount(patch_of_pair, free, patches)
    factor = np.divide(target, sums, out=np.ones(patches), where=sums > 0)
    area[a] *= factor[patch]
    area[a] *= _tilt(contacts.point[a], area[a], patch, centres_of(found, now, patch_of_pair, patches)[1], lost)
    return np.where(own, np.maximum(area, _LEAST * whole), whole)


def overlaps_of(
    contacts: Contacts, chosen: BoolArray, code: IntArray, positions: FloatArray, facets: IntArray, bodies: IntArray
) -> tuple[Segments, Configuration, Facets]:
    """The overlaps among the facets of bodies with chosen contacts, those of the body of the lower number as slaves; the facets near
    contacts and their places."""
    count, d = 1 + int(contacts.bodies.max()), contacts.dimension
    codes, which = np.unique(code[chosen], return_inverse=True)
    widest_gap = np.zeros(len(codes))
    np.maximum.at(widest_gap, which, np.abs(contacts.gap[chosen]))
    low, high = np.full((count, d), np.inf), np.full((count, d), -np.inf)
    widest = np.zeros(count)
    for side in (0, 1):
        body = contacts.bodies[chosen, side]
        np.minimum.at(low, body, contacts.point[chosen])
        np.maximum.at(high, body, contacts.point[chosen])
        np.maximum.at(widest, body, widest_gap[which])
    of_these = bodies < count
    of_these[of_these] = np.isfinite(low[bodies[of_these], 0])
    repeated = (np.diff(np.sort(facets, axis=1), axis=1) == 0) & (np.sort(facets, axis=1)[:, 1:] >= 0)
    of_these &= ~repeated.any(axis=1)  # points that are named as surfaces
    given, owner = facets[of_these], bodies[of_these]
    closed = np.where(given < 0, given[:, :1], given)
    corners, reach = positions[closed], (_REACH * widest[owner])[:, None]
    size = np.ptp(corners, axis=1).max(axis=1)[:, None]
    near = np.all((corners.min(axis=1) - reach - size <= high[owner]) & (corners.max(axis=1) + reach + size >= low[owner]), axis=1)
    kept = Facets(given[near], closed[near], owner[near], np.array([0, int(near.sum())]))
    here = contact_facets.geometry(kept, positions)
    now = Configuration(positions, here, here)
    one, other = near_facets(here.centre, here.radius, here.centre, here.radius + _REACH * widest[kept.bodies] + _FLAT * here.size)
    between = kept.bodies[one] * count + kept.bodies[other]
    facing = np.einsum("pi,pi->p", here.normal[one], here.normal[other]) < -_ALIGNED
    wanted = (kept.bodies[one] < kept.bodies[other]) & facing & np.isin(between, codes)
    one, other, between = one[wanted], other[wanted], between[wanted]
    order = np.lexsort([other, one])
    one, other, between = one[order], other[order], between[order]
    least = _REACH * widest_gap[np.searchsorted(codes, between)] + _FLAT * np.minimum(here.size[one], here.size[other])
    sides = (kept.nodes >= 0).sum(axis=1)
    found = clipped(now, one, other, least, sides)
    lean = np.flatnonzero(np.einsum("pi,pi->p", here.normal[one], here.normal[other]) > -FLUSH)
    if len(lean):  # measured in the planes of the one or the other: the mean, whichever body is first
        back = clipped(now, other[lean], one[lean], least[lean], sides)
        there, first = (np.bincount(by.row, by.weight, n) for by, n in ((back, len(lean)), (found, len(one))))
        factor, both = np.ones(len(one)), (there > 0) & (first[lean] > 0)
        factor[lean[both]] = 0.5 * (1 + there[both] / first[lean[both]])
        found = found._replace(weight=found.weight * factor[found.row])
    touched = np.zeros(len(one), dtype=bool)
    touched[found.row] = True
    row = (np.cumsum(touched) - 1)[found.row]
    return found._replace(slave=one[touched], master=other[touched], area=found.area[touched], row=row), now, kept


def clipped(now: Configuration, one: IntArray, other: IntArray, least: FloatArray, sides: IntArray) -> Segments:
    """The overlaps of facets that are no farther apart than `least` (np,) [m], measured in the planes of the first; sides (nf,)."""
    if now.x.shape[1] == 3:
        return polygons(now, one, other, least, (sides, sides), THREE_POINTS)
    found = intervals(now, one, other)
    close = (np.bincount(found.row, np.abs(found.gap) <= least[found.row], len(one)) > 0)[found.row]
    gap, weight, phi, psi = found.gap[close], found.weight[close], found.phi[close], found.psi[close]
    return Segments(one, other, found.area, found.row[close], found.number[close], weight, gap, phi, psi)


def patches_of(
    contacts: Contacts,
    chosen: BoolArray,
    code: IntArray,
    pair_code: IntArray,
    found: Segments,
    now: Configuration,
    nodes: IntArray,
    n: int,
) -> tuple[IntArray, IntArray]:
    """The patch of each pair of facets, and of each contact (nc,), -1 = none."""
    facet = np.concatenate([found.slave, found.master])
    _, joint_of = np.unique(np.concatenate([pair_code, code[chosen]]), return_inverse=True)
    keys, where = np.unique(np.tile(joint_of[: len(pair_code)], 2) * len(nodes) + facet, return_inverse=True)
    its_joint, its_facet = keys // len(nodes), keys % len(nodes)
    normal = now.slave.normal[its_facet]
    ids = its_joint[:, None] * n + nodes[its_facet]
    rows, places = np.nonzero((contacts.nodes >= 0) & (contacts.weights != 0) & chosen[:, None])
    joint_of_contact = np.full(len(contacts), -1)
    joint_of_contact[chosen] = joint_of[len(pair_code) :]
    known, compact = np.unique(
        np.concatenate([ids.ravel(), joint_of_contact[rows] * n + contacts.nodes[rows, places]]), return_inverse=True
    )
    own, theirs = compact[: ids.size], compact[ids.size :]
    corner_of = np.repeat(np.arange(len(keys)), nodes.shape[1])
    around = csr_array((np.ones(ids.size), (corner_of, own)), shape=(len(keys), len(known)))
    neighbours = coo_array(around @ around.T)
    i, j = neighbours.coords
    alike = np.einsum("ei,ei->e", normal[i], normal[j]) > _SMOOTH
    i, j = np.concatenate([i[alike], where[: len(pair_code)]]), np.concatenate([j[alike], where[len(pair_code) :]])
    _, patch = connected_components(csr_array((np.ones(len(i)), (i, j)), shape=(len(keys),) * 2), directed=False)
    at = coo_array(csr_array((np.ones(len(rows)), (np.arange(len(rows)), theirs)), shape=(len(rows), len(known))) @ around.T)
    entry, key = at.coords
    a = rows[entry]
    outwards = np.where(contacts.weights[a, places[entry]] > 0, -1.0, 1.0)
    along = outwards * np.einsum("ei,ei->e", normal[key], contacts.frame[a, 0])
    kept = along > _ALIGNED
    a, key, along = a[kept], key[kept], along[kept]
    order = np.lexsort([-key, along, a])
    of_contact = np.full(len(contacts), -1)
    of_contact[a[order]] = patch[key[order]]  # the last of each contact stays: the facet that its normal is along
    return patch[where[: len(pair_code)]], of_contact


def shares_of(found: Segments, facets: Facets, patch: IntArray, parts: FloatArray, n: int) -> Shares:
    """What the corners of either body's facets have of the overlaps' areas; parts (2, np) of them are the bodies'."""
    columns: list[tuple[IntArray, IntArray, FloatArray, IntArray, IntArray]] = []
    sides = ((found.slave, found.master, found.phi), (found.master, found.slave, found.psi))
    for (facet, other, shape), part in zip(sides, parts, strict=True):
        for corner in range(shape.shape[1]):
            node = facets.nodes[facet, corner]
            real: IntArray = np.flatnonzero((node >= 0) & (part > 0))
            area = part * np.bincount(found.row, found.weight * shape[:, corner], len(facet))
            columns.append((real, patch[real] * n + node[real], area[real], node[real], other[real]))
    return Shares(*(np.concatenate(column) for column in zip(*columns, strict=True)))


def over_facets(points: FloatArray, geometry: FacetGeometry, facet: IntArray) -> BoolArray:
    """Whether points (np, d) are over facets (np,), along their normals."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    corners, normal, size = geometry.corners[facet], geometry.normal[facet], geometry.size[facet]
    if points.shape[1] == 2:
        place = np.einsum("pi,pi->p", points - corners[:, 0], (corners[:, 1] - corners[:, 0]) / size[:, None])
        return (place > -_BESIDE * size) & (place < (1 + _BESIDE) * size)
    over = np.ones(len(points), dtype=bool)
    for k in range(corners.shape[1]):
        edge = corners[:, (k + 1) % corners.shape[1]] - corners[:, k]
        length = np.sqrt(np.einsum("pi,pi->p", edge, edge))
        inwards = np.einsum("pi,pi->p", np.cross(normal, edge), points - corners[:, k])
        over &= (length == 0) | (inwards > -_BESIDE * size * length)
    return over


def _given(
    shares: Shares, now: Configuration, key: IntArray, weight: FloatArray, contact: IntArray, count: int, pairs: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Areas (count,) of the contacts; and, by pairs of facets (pairs,), what no contact of theirs takes, and what is left out."""
    known, at = np.unique(np.concatenate([shares.key, key]), return_inverse=True)
    share_at, entry_at = at[: len(shares.key)], at[len(shares.key) :]
    total = np.bincount(entry_at, weight, len(known))
    taken = total[share_at] > 0
    without = np.flatnonzero(~taken)
    inside = over_facets(now.x[shares.node[without]], now.slave, shares.other[without])
    away = ~taken & (np.bincount(share_at[without], inside, len(known)) > 0)[share_at]
    orphan = ~taken & ~away
    held, left = (np.bincount(shares.pair, np.where(which, shares.area, 0.0), pairs) for which in (taken, orphan))
    missing = np.bincount(shares.pair, np.where(away, shares.area, 0.0), pairs)
    more = np.divide(left, held, out=np.zeros(pairs), where=held > 0)
    of_node = np.bincount(share_at, np.where(taken, shares.area * (1 + more[shares.pair]), 0.0), len(known))
    area = np.bincount(contact, weight * of_node[entry_at] / total[entry_at], count)
    return area, np.where((held > 0) | (missing > 0), 0.0, left), missing


def centres_of(found: Segments, now: Configuration, patch: IntArray, patches: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points (nq, d) and centres (patches, d) [m] of the overlaps, midway between both bodies."""
    ours, theirs = now.slave.corners[found.slave[found.row]], now.slave.corners[found.master[found.row]]
    points = 0.5 * (np.einsum("qk,qkd->qd", found.phi, ours) + np.einsum("qk,qkd->qd", found.psi, theirs))
    return points, _means(points, found.weight, patch[found.row], patches)


def _means(points: FloatArray, weight: FloatArray, patch: IntArray, patches: int) -> FloatArray:
    """Weighted means (patches, d) of points."""
    total = np.bincount(patch, weight, patches)
    sums = np.stack([np.bincount(patch, weight * column, patches) for column in points.T], axis=1)
    return np.divide(sums, total[:, None], out=np.zeros_like(sums), where=total[:, None] > 0)


def _tilt(points: FloatArray, area: FloatArray, patch: IntArray, centres: FloatArray, lost: BoolArray) -> FloatArray:
    """Factors (nc,) on the areas, of mean 1 in each patch, that move their centre to that of the overlap; 1 where some is lost."""
    patches, d = centres.shape
    mean = _means(points, area, patch, patches)
    arm = points - mean[patch]
    second = np.zeros((patches, d, d))
    np.add.at(second, patch, area[:, None, None] * arm[:, :, None] * arm[:, None, :])
    total = np.bincount(patch, area, patches)
    least_known = _ARM**2 * total * total ** (2 / (d - 1))
    most = np.trace(second, axis1=1, axis2=2)
    cut = np.maximum(1e-4, np.divide(least_known, most, out=np.ones(patches), where=most > least_known))
    slope = np.einsum("pij,pj->pi", np.linalg.pinv(second, rcond=cut, hermitian=True), total[:, None] * (centres - mean))
    slope[lost] = 0.0
    by = np.einsum("ai,ai->a", arm, slope[patch])
    least = np.zeros(patches)
    np.minimum.at(least, patch, by)
    return 1.0 + by * np.minimum(1.0, (1 - _LEAST_TILT) / np.maximum(-least, 1e-300))[patch]
