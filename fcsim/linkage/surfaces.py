"""Tied and bonded surfaces as weights of nodes, found once in the reference configuration."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, is_number
from fcsim.assembly.model import Model
from fcsim.brief import shown
from fcsim.contact_detection.integral.mortar import Mortar
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_detection.surfaces.surface import SurfacePair
from fcsim.errors import InputError
from fcsim.linkage.links import Bonded, Tied

DISTANCE = 1e-3
"""Of the smaller body's size: how far apart tied surfaces may stand."""
SAME = 1e-6
"""Of the smaller body's size: nodes nearer than this are at one place."""


def tied_weights(model: Model, link: Tied, what: str) -> csr_array:
    """Weights (rows, n_nodes) of the vectors that stay as they are: one for each node of the first surface that the second covers."""
    for body, surface in (link.first, link.second):
        model.facets(body, surface)  # refuses unknown names
    bodies = [model.number[body] for body, _ in (link.first, link.second)]
    if bodies[0] == bodies[1]:
        raise InputError(f"{what}: expected surfaces of two bodies, got two of {link.first[0]!r}")
    size = min(float(np.ptp(model.bodies[b].points, axis=0).max()) for b in bodies)
    reach = DISTANCE * size if link.distance is None else link.distance
    if not (is_number(reach) and reach > 0):
        raise InputError(f"{what}: expected a distance > 0 in m, got {shown(link.distance)}")
    pair = SurfacePair(contact_surface(model, [link.first]), contact_surface(model, [link.second]), 0.0, reach, "mortar")
    mortar = Mortar([pair], 1e-2, 0.0)
    now = mortar.configuration(model.reference)
    contacts, _ = mortar.contacts(now, *mortar.search(now))
    if not len(contacts):
        raise InputError(
            f"{what}: expected surfaces that face each other within {reach:.3g} m, got {link.first} and {link.second}, which do not; "
            "distance= allows more"
        )
    rows = np.repeat(np.arange(len(contacts)), contacts.nodes.shape[1])
    real = contacts.nodes.ravel() >= 0
    weights = csr_array((contacts.weights.ravel()[real], (rows[real], contacts.nodes.ravel()[real])), shape=(len(contacts), model.n_nodes))
    weights.sum_duplicates()
    return weights


def bonded_weights(model: Model, link: Bonded, what: str) -> csr_array:
    """Weights (rows, n_nodes), +1 and -1 on the two nodes of each pair at one place."""
    first, second = (model.body_number(name) for name in (link.first, link.second))
    if first == second:
        raise InputError(f"{what}: expected two bodies, got {link.first!r} twice")
    here, there = (model.bodies[b].points for b in (first, second))
    size = min(float(np.ptp(points, axis=0).max()) for points in (here, there))
    distance, nearest = cKDTree(there).query(here)
    paired = np.flatnonzero(distance <= SAME * size)
    if not len(paired):
        raise InputError(
            f"{what}: expected nodes of {link.first!r} and {link.second!r} at the same places, got none; their nearest are "
            f"{distance.min():.3g} m apart. Tied holds surfaces of meshes that do not match"
        )
    count = len(paired)
    columns = np.concatenate([model.node_offset[first] + paired, model.node_offset[second] + nearest[paired]])
    signs = np.repeat([1.0, -1.0], count)
    return csr_array((signs, (np.tile(np.arange(count), 2), columns)), shape=(count, model.n_nodes))


def offsets(weights: csr_array, reference: FloatArray) -> FloatArray:
    """The vectors (rows, d) [m] as they stand in the reference."""
    found: FloatArray = weights @ reference
    return found
