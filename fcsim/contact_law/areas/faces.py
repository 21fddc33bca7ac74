"""Flat faces of rigid bodies, which of them meet at contacts, and the overlaps of their facets."""

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
from fcsim.contact_law.areas.overlaps import FLUSH, clipped
from fcsim.mesh.curves.ragged import of_same_key

_ALIGNED = 0.5
"""Faces meet whose normals are within 60 degrees of each other's, and of the contact's."""
_FLAT = 0.999
"""Facets are of one face whose normals are within 2.6 degrees of each other's, and of their mean."""
_BESIDE = 1e-3
"""Of a facet's size: how far apart facets may be beside what the faces lean."""


class Faces(NamedTuple):
    """Facets near contacts, their geometry, number (nf,) among the `every` facets of all bodies, face (nf,), and of faces: normal (n, d),
    a point (n, d), whether flat (n,)."""

    facets: Facets
    now: Configuration
    number: IntArray
    face: IntArray
    normal: FloatArray
    point: FloatArray
    flat: BoolArray
    every: int


def faces_of(contacts: Contacts, chosen: BoolArray, positions: FloatArray, facets: IntArray, bodies: IntArray) -> Faces:
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
    number = np.flatnonzero(taken)[near]
    return Faces(kept, Configuration(positions, here, here), number, face, mean, point, np.bincount(face, bent, n) == 0, len(facets))


def _around(facets: Facets, n: int) -> csr_array:
    """Which facet has which of n nodes."""
    row, column = np.nonzero(facets.nodes >= 0)
    return csr_array((np.ones(len(row)), (row, facets.nodes[row, column])), shape=(len(facets.nodes), n))


def couples_of(contacts: Contacts, chosen: BoolArray, faces: Faces, n: int) -> tuple[IntArray, IntArray]:
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


def overlaps_between(codes: IntArray, faces: Faces) -> Segments:
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


def _clipped_both_ways(faces: Faces, one: IntArray, other: IntArray, least: FloatArray) -> Segments:
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
