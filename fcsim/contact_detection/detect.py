"""Detection: from positions to contacts, for all surface pairs at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fcsim.contact_detection import candidates as candidate_points
from fcsim.contact_detection import facets as contact_facets
from fcsim.contact_detection.broad_phase import PairList, near_pairs
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.facets import FacetGeometry
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.node_to_segment import closest_on_boundary, project_on_facets
from fcsim.contact_detection.surface import SurfacePair
from fcsim.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

OPPOSING = -0.1  # a candidate's outward direction n and the master's normal N face each other while n . N < OPPOSING
_ROUND = 1e-9  # distances that differ by less, relative to the facet size, are equal
_PARALLEL = 0.99


class _Configuration(NamedTuple):
    """Candidates (point, outward direction, size of their facets) and master facets at the given positions."""

    point: FloatArray
    outward: FloatArray
    size: FloatArray
    master: FacetGeometry


class _Feet(NamedTuple):
    """Feet of candidates on facets, one a row."""

    candidate: IntArray
    facet: IntArray
    weights: FloatArray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray
    distance: FloatArray
    scale: FloatArray

    def take(self, rows: IntArray | BoolArray) -> _Feet:
        return _Feet._make(array[rows] for array in self)


@dataclass(frozen=True, eq=False)
class Detector:
    """Node-to-segment (3D: node-to-facet) detection between the surfaces of `pairs`, in a model of n_nodes nodes.

    What does not depend on positions is computed here once: candidates, facets, which edges lie inside a surface.
    `detector(positions)` returns the Contacts at positions (n_nodes, d) [m], sorted by (pair, candidate, master body):

    * A candidate has at most one contact per master body: its nearest foot on facets that face it. A foot outside a facet by
      less than edge_tolerance (relative to the smaller of the two facets' sizes), beyond the outer boundary, is moved onto it; farther
      out there is no contact.
    * On an edge or vertex shared by facets, above a convex one (or below a concave one), the normal is along the line to the
      candidate; where they coincide it is the mean of the facets' normals.
    * Feet on several bodies that coincide, with parallel normals (a node above the joint of two blocks), are one contact: the
      smallest gap, then the lowest body number. Feet count as one within twice the distance that edge_tolerance allows.
    * Contacts are kept while -penetration * size <= gap <= alert, size the square root (2D: itself) of the smaller of the
      two facets: deeper is another side of the body.

    `search` makes a list of possible pairs that can be passed again while `PairList.covers(positions)`; the contacts are the same.
    InputError: no pairs, 2D with 3D, node numbers not below n_nodes, positions of wrong shape or not finite, facets without area.
    """

    pairs: Sequence[SurfacePair]
    n_nodes: int
    edge_tolerance: float = 1e-2
    penetration: float = 0.5
    candidates: candidate_points.Candidates = field(init=False, repr=False)
    slaves: contact_facets.Facets = field(init=False, repr=False)
    masters: contact_facets.Facets = field(init=False, repr=False)
    topology: contact_facets.Topology = field(init=False, repr=False)
    pair_of_candidate: IntArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        pairs = tuple(self.pairs)
        if not pairs or len({pair.slave.dimension for pair in pairs}) > 1:
            raise InputError(f"Detector: expected one or more surface pairs, all 2D or all 3D, got {len(pairs)} pairs")
        for pair in pairs:
            for role, surface in (("slave", pair.slave), ("master", pair.master)):
                if surface.facets.max(initial=-1) >= self.n_nodes:
                    raise InputError(
                        f"Detector, pair {pair.name!r}, {role}: expected node numbers below n_nodes = {self.n_nodes}, "
                        f"got {surface.facets.max()}"
                    )
        for name in ("edge_tolerance", "penetration"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"Detector, {name}: expected a number >= 0, relative to the facet size, got {getattr(self, name)}")
        parts = [candidate_points.candidates(pair.slave, pair.candidates) for pair in pairs]
        masters = contact_facets.join([pair.master for pair in pairs], sort=True)
        constant = {
            "pairs": pairs,
            "candidates": candidate_points.join(parts),
            "slaves": contact_facets.join([pair.slave for pair in pairs]),
            "masters": masters,
            "topology": contact_facets.topology(masters),
            "pair_of_candidate": np.repeat(np.arange(len(pairs)), [len(part.bodies) for part in parts]),
        }
        for name, value in constant.items():
            object.__setattr__(self, name, value)

    @property
    def dimension(self) -> int:
        return self.pairs[0].slave.dimension

    def __call__(self, positions: FloatArray, near: PairList | None = None) -> Contacts:
        """Contacts at `positions` (n_nodes, d) [m]; `near` is used instead of a new search where it covers them."""
        x = self._checked(positions)
        now = self._configuration(x)
        if near is None or not near.covers(x):
            near = self._search(x, now, 0.0)
        feet = self._once_per_place(now, self._once_per_body(now, *self._plausible(now, near.candidate, near.facet)))
        return self._contacts(feet)

    def search(self, positions: FloatArray, skin: float = 0.0) -> PairList:
        """Possible pairs at `positions` (n_nodes, d) [m], with `skin` [m] to spare for later positions."""
        if not (np.isfinite(skin) and skin >= 0):
            raise InputError(f"Detector.search, skin: expected a distance >= 0 in m, got {skin}")
        x = self._checked(positions)
        return self._search(x, self._configuration(x), skin)

    def _checked(self, positions: FloatArray) -> FloatArray:
        x = np.asarray(positions, dtype=np.float64)
        if x.shape != (self.n_nodes, self.dimension):
            raise InputError(f"Detector, positions: expected shape {(self.n_nodes, self.dimension)}, got {x.shape}")
        if not np.isfinite(x).all():
            raise InputError("Detector, positions: expected finite numbers, got NaN or infinity")
        return x

    def _configuration(self, x: FloatArray) -> _Configuration:
        slave = contact_facets.geometry(self.slaves, x)
        point = np.einsum("nk,nkd->nd", self.candidates.weights, x[self.candidates.nodes])
        mean = self.candidates.averaging @ np.column_stack([slave.normal, slave.size])
        length = np.sqrt(np.einsum("nd,nd->n", mean[:, :-1], mean[:, :-1]))
        outward = mean[:, :-1] / np.maximum(length, 1e-300)[:, None]
        return _Configuration(point, outward, mean[:, -1], contact_facets.geometry(self.masters, x))

    def _search(self, x: FloatArray, now: _Configuration, skin: float) -> PairList:
        starts = np.searchsorted(self.pair_of_candidate, np.arange(len(self.pairs) + 1))
        found = []
        for number, pair in enumerate(self.pairs):
            ours = slice(starts[number], starts[number + 1])
            theirs = slice(self.masters.offsets[number], self.masters.offsets[number + 1])
            size = now.master.size[theirs]
            depth = np.minimum(size, now.size[ours].max(initial=0.0))
            reach = now.master.radius[theirs] + np.maximum(pair.alert, self.penetration * depth) + self.edge_tolerance * depth + skin
            candidate, facet = near_pairs(now.point[ours], now.master.centre[theirs], reach)
            found.append((candidate + ours.start, facet + theirs.start))
        candidate, facet = (np.concatenate(part) for part in zip(*found, strict=True))
        other = self.candidates.bodies[candidate] != self.masters.bodies[facet]
        return PairList(candidate[other], facet[other], x.copy(), skin)

    def _alert(self, candidate: IntArray) -> FloatArray:
        return np.array([pair.alert for pair in self.pairs])[self.pair_of_candidate[candidate]]

    def _plausible(self, now: _Configuration, candidate: IntArray, facet: IntArray) -> tuple[IntArray, IntArray]:
        """Pairs that face each other with the point above or just beside the facet: few are left to project."""
        facing = np.einsum("nd,nd->n", now.outward[candidate], now.master.normal[facet]) < OPPOSING
        candidate, facet = candidate[facing], facet[facing]
        normal, size = now.master.normal[facet], np.minimum(now.size[candidate], now.master.size[facet])
        arm = now.point[candidate] - now.master.centre[facet]
        height = np.einsum("nd,nd->n", arm, normal)
        aside = np.sqrt(np.maximum(np.einsum("nd,nd->n", arm, arm) - height**2, 0.0))
        warp = np.abs(np.einsum("nd,nd->n", now.master.corners[facet, 0] - now.master.centre[facet], normal))
        alert, slack = self._alert(candidate), self.edge_tolerance * size
        keep = height <= alert + warp + slack
        keep &= height >= -self.penetration * size - warp - slack
        keep &= aside <= now.master.radius[facet] + alert + np.maximum(-height, 0.0) + 2 * slack
        return candidate[keep], facet[keep]

    def _feet(self, now: _Configuration, candidate: IntArray, facet: IntArray, weights: FloatArray, normal: FloatArray) -> _Feet:
        foot = np.einsum("nk,nkd->nd", weights, now.master.corners[facet])
        arm = now.point[candidate] - foot
        gap, distance = np.einsum("nd,nd->n", arm, normal), np.sqrt(np.einsum("nd,nd->n", arm, arm))
        scale = np.minimum(now.size[candidate], now.master.size[facet])
        return _Feet(candidate, facet, weights, foot, normal, gap, distance, scale)

    def _once_per_body(self, now: _Configuration, candidate: IntArray, facet: IntArray) -> _Feet:
        """The nearest foot of each candidate on each master body, sorted by (candidate, body)."""
        triangle = self.masters.nodes[facet, -1] < 0
        weights, normal, inside = project_on_facets(now.point[candidate], now.master.corners[facet], triangle)
        feet = self._feet(now, candidate, facet, weights, normal)
        if not inside.all():
            on_edges = self._on_edges(now, feet.take(~inside))
            feet = _Feet._make(np.concatenate(both) for both in zip(feet.take(inside), on_edges, strict=True))
        facing = np.einsum("nd,nd->n", now.outward[feet.candidate], feet.normal) < OPPOSING
        feet = feet.take(facing & (feet.gap <= self._alert(feet.candidate)) & (feet.gap >= -self.penetration * feet.scale))
        return feet.take(self._nearest_by_body(now, feet))

    def _on_edges(self, now: _Configuration, feet: _Feet) -> _Feet:
        """Feet on edges and vertices of candidates that do not project inside the facet: one a body, none far beyond its boundary."""
        point, tolerance = now.point[feet.candidate], self.edge_tolerance * feet.scale
        topology = self.topology
        found = closest_on_boundary(
            point,
            now.master.corners[feet.facet],
            topology.interior_edge[feet.facet],
            topology.interior_vertex[feet.facet],
            tolerance,
        )
        feet = self._feet(now, feet.candidate, feet.facet, found.weights, feet.normal)
        aside = point - feet.point - feet.gap[:, None] * feet.normal
        accepted = found.interior | (np.einsum("nd,nd->n", aside, aside) <= (tolerance + _ROUND * feet.scale) ** 2)
        # the nearest edge decides: behind the outer boundary of a body are other edges, inside its surface
        rows = self._nearest_by_body(now, feet)
        rows = rows[accepted[rows]]
        feet, ridge, away = feet.take(rows), found.interior[rows], found.away[rows]
        if not ridge.any():
            return feet
        vertices = topology.vertex[feet.facet]
        mean = np.einsum("nk,nkd->nd", feet.weights, (topology.averaging @ now.master.normal)[vertices])
        mean /= np.maximum(np.sqrt(np.einsum("nd,nd->n", mean, mean)), 1e-300)[:, None]
        length = np.sqrt(np.einsum("nd,nd->n", away, away))
        length[length <= 1e-6 * feet.scale] = np.inf  # too near: the direction is round-off
        side = np.where(np.einsum("nd,nd->n", away, mean) < 0.0, -1.0, 1.0)
        fan = np.where(np.isinf(length)[:, None], mean, (side / length)[:, None] * away)
        normal = np.where(ridge[:, None], fan, feet.normal)
        return feet._replace(normal=normal, gap=np.einsum("nd,nd->n", now.point[feet.candidate] - feet.point, normal))

    def _identity(self, feet: _Feet) -> IntArray:
        bodies = 1 + self.masters.bodies.max(initial=0)
        return feet.candidate * bodies + self.masters.bodies[feet.facet]

    def _nearest_by_body(self, now: _Configuration, feet: _Feet) -> IntArray:
        """Row of the nearest foot for each (candidate, body), sorted by these; of equal ones the first facet."""
        identity = self._identity(feet)
        rounded = np.round(feet.distance / (_ROUND * now.size[feet.candidate]))
        order = np.lexsort((feet.facet, rounded, identity))
        identity = identity[order]
        return order[np.append(True, identity[1:] != identity[:-1])[: len(order)]]

    def _once_per_place(self, now: _Configuration, feet: _Feet) -> _Feet:
        """Leave one of the feet of a candidate that coincide on several bodies."""
        candidate = feet.candidate
        if not (candidate[1:] == candidate[:-1]).any():
            return feet
        size = now.size[candidate]
        order = np.lexsort((self.masters.bodies[feet.facet], np.round(feet.gap / (_ROUND * size)), candidate))
        candidate, point, normal = candidate[order], feet.point[order], feet.normal[order]
        near = (2.0 + 1e-3) * self.edge_tolerance * feet.scale[order] + _ROUND * size[order]
        drop = np.zeros(len(order), dtype=bool)
        for shift in range(1, len(order)):
            same = np.flatnonzero(candidate[shift:] == candidate[:-shift])
            if not len(same):
                break
            apart = point[same + shift] - point[same]
            coincide = np.einsum("nd,nd->n", apart, apart) <= np.minimum(near[same], near[same + shift]) ** 2
            coincide &= np.einsum("nd,nd->n", normal[same + shift], normal[same]) > _PARALLEL
            drop[same[coincide] + shift] = True
        return feet.take(np.sort(order[~drop]))

    def _contacts(self, feet: _Feet) -> Contacts:
        candidate, master = feet.candidate, self.masters.nodes[feet.facet]
        mu = np.array([pair.mu for pair in self.pairs])
        return Contacts(
            point=feet.point,
            frame=frames(feet.normal),
            gap=feet.gap,
            mu=mu[self.pair_of_candidate[candidate]],
            nodes=np.concatenate([self.candidates.nodes[candidate], master], axis=1),
            weights=np.concatenate([self.candidates.weights[candidate], -feet.weights], axis=1),
            bodies=np.stack([self.candidates.bodies[candidate], self.masters.bodies[feet.facet]], axis=1),
            identity=self._identity(feet),
        )
