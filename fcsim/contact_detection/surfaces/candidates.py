"""Candidate points of the slave surfaces: constant nodes and weights, found once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.surfaces._facet_kernels import mean_points
from fcsim.contact_detection.surfaces.facets import Facets, averaging_at_nodes, geometry
from fcsim.contact_detection.surfaces.surface import CandidateRule, ContactSurface

_g = 1.0 / np.sqrt(3.0)  # two-point Gauss-Legendre rule on [-1, 1]
_XI, _ETA = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
# shape functions (points, facet nodes), by number of facet nodes
CENTRE_WEIGHTS = {k: np.full((1, k), 1.0 / k) for k in (2, 3, 4)}
GAUSS_WEIGHTS = {
    2: 0.5 * np.array([[1 + _g, 1 - _g], [1 - _g, 1 + _g]]),
    3: np.full((3, 3), 1 / 6) + 0.5 * np.eye(3),
    4: 0.25 * (1 + _g * np.outer(_XI, _XI)) * (1 + _g * np.outer(_ETA, _ETA)),
}


class Candidates(NamedTuple):
    """nc candidate points x = sum_k weights_k x_nodes_k.

    nodes     (nc, k) global node numbers, -1 = none; weights (nc, k) >= 0, sum 1, 0 where there is no node
    bodies    (nc,)   owner
    averaging (nc, nf) mean over the slave facets the point lies on: with their unit normals it gives the point's outward direction,
              the facet's own normal for a face centre or Gauss point, the unweighted mean of the facets around it for a node
    """

    nodes: IntArray
    weights: FloatArray
    bodies: IntArray
    averaging: csr_array


def candidates(surface: ContactSurface, rule: CandidateRule) -> Candidates:
    """Candidate points of a slave surface: its nodes (sorted by number, each once), face centres or Gauss points (facet by facet)."""
    if rule == "nodes":
        nodes, vertex, averaging = averaging_at_nodes(surface.facets)
        bodies = np.zeros(len(nodes), dtype=np.int64)
        real = surface.facets >= 0
        bodies[vertex[real]] = np.broadcast_to(surface.bodies[:, None], vertex.shape)[real]
        return Candidates(nodes[:, None], np.ones((len(nodes), 1)), bodies, averaging)
    rules = CENTRE_WEIGHTS if rule == "faces" else GAUSS_WEIGHTS
    width = surface.facets.shape[1]
    corners = (surface.facets >= 0).sum(axis=1)
    facet, weights = [np.empty(0, dtype=np.int64)], [np.empty((0, width))]
    for k in range(2, width + 1):
        those = np.flatnonzero(corners == k)
        facet.append(np.repeat(those, len(rules[k])))
        weights.append(np.pad(np.tile(rules[k], (len(those), 1)), ((0, 0), (0, width - k))))
    order = np.argsort(owner := np.concatenate(facet), kind="stable")
    owner = owner[order]
    averaging = csr_array((np.ones(len(owner)), owner, np.arange(len(owner) + 1)), shape=(len(owner), len(surface.facets)))
    return Candidates(surface.facets[owner], np.concatenate(weights)[order], surface.bodies[owner], averaging)


def join(parts: list[Candidates]) -> Candidates:
    """Concatenate the candidates of several surfaces; their facets are numbered surface after surface too."""
    width = max(part.nodes.shape[1] for part in parts)

    def padded(array: NDArray, value: int) -> NDArray:
        return np.pad(array, ((0, 0), (0, width - array.shape[1])), constant_values=value)

    columns = np.cumsum([0] + [part.averaging.shape[1] for part in parts])
    averaging = [
        csr_array((a.data, a.indices + first, a.indptr), shape=(a.shape[0], columns[-1]))
        for a, first in zip((part.averaging for part in parts), columns[:-1], strict=True)
    ]
    return Candidates(
        np.concatenate([padded(part.nodes, -1) for part in parts]),
        np.concatenate([padded(part.weights, 0) for part in parts]),
        np.concatenate([part.bodies for part in parts]),
        vstack(averaging, format="csr"),
    )


def placed(candidates: Candidates, slaves: Facets, positions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (nc, d), outward directions (nc, d) and sizes (nc,) of candidates on these facets for node positions (nodes, d) [m]."""
    slave = geometry(slaves, positions)
    if positions.shape[1] == 3:
        point: FloatArray = mean_points(candidates.nodes, candidates.weights, positions)
    else:
        point = np.einsum("nk,nkd->nd", candidates.weights, positions[candidates.nodes])
    mean = candidates.averaging @ np.column_stack([slave.normal, slave.size])
    length = np.sqrt(np.einsum("nd,nd->n", mean[:, :-1], mean[:, :-1]))
    return point, mean[:, :-1] / np.maximum(length, 1e-300)[:, None], mean[:, -1]


def some(candidates: Candidates, slaves: Facets, begin: int, end: int) -> tuple[Candidates, Facets]:
    """The candidates begin, ..., end - 1, and what of their facets `placed` asks for: the entries of `averaging` stay in their order."""
    nodes, weights, bodies, averaging = candidates
    first, last = averaging.indptr[begin], averaging.indptr[end]
    on = averaging.indices[first:last]
    low, high = (int(on.min()), int(on.max()) + 1) if len(on) else (0, 0)
    mean = csr_array((averaging.data[first:last], on - low, averaging.indptr[begin : end + 1] - first), shape=(end - begin, high - low))
    around = slaves._replace(nodes=slaves.nodes[low:high], closed=slaves.closed[low:high])
    return Candidates(nodes[begin:end], weights[begin:end], bodies[begin:end], mean), around
