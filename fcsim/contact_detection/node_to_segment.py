"""Node-to-segment detection: points of the slave surfaces on facets of the master surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.false_sides import DEEP, KnownFacets, came_another_way, known_facets, leaves_by_another_face
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.surfaces import candidates as candidate_points
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces._facet_kernels import facing_above, feet_of_points
from fcsim.contact_detection.surfaces.candidates import Candidates
from fcsim.contact_detection.surfaces.facets import FacetGeometry, Facets
from fcsim.contact_detection.surfaces.projection import closest_on_boundary, project_on_facets
from fcsim.contact_detection.surfaces.surface import OPPOSING, SurfacePair
from fcsim.contact_detection.surfaces.verlet_list import VerletList
from fcsim.ranks import World, alone, complete_rows, for_parts, held_in_common, in_common, in_parts_of_common, kept_alike, world

ROUND = 1e-9  # distances that differ by less, relative to the facet size, are equal
_PARALLEL = 0.99

SHARED_FROM, MADE_FROM = 30_000, 20_000
"""Possible pairs from which ranks share them out, and contacts."""
UNEVEN = 1.2
"""How many possible pairs one rank may have, relative to the mean, before candidates are shared out anew."""

VALLEY = 3
"""How many contacts a candidate may have with one body where that is asked for, see `valleys`."""


class Configuration(NamedTuple):
    """Candidates (point, outward direction, size of their facets) and master facets at the given positions (n_nodes, d) [m]."""

    point: FloatArray
    outward: FloatArray
    size: FloatArray
    master: FacetGeometry
    positions: FloatArray


class Feet(NamedTuple):
    """Feet of candidates on facets, one a row."""

    candidate: IntArray
    facet: IntArray
    weights: FloatArray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray
    distance: FloatArray
    scale: FloatArray

    def take(self, rows: IntArray | BoolArray) -> Feet:
        return Feet._make(array[rows] for array in self)


class NodeToSegment:
    """Contacts of candidate points (nodes, face centres, Gauss points of slave facets) with master facets; see `Detector` for the rules.

    What does not depend on positions is computed here once: candidates, facets, which edges lie inside a surface.
    identities (pairs,): how many different numbers the contacts of each pair can have; over_facets [m]: what surfaces stand out over their
    facets at most.
    """

    def __init__(self, pairs: Sequence[SurfacePair], edge_tolerance: float, penetration: float) -> None:
        self.pairs, self.edge_tolerance, self.penetration = tuple(pairs), edge_tolerance, penetration
        parts = [candidate_points.candidates(pair.slave, pair.candidates) for pair in pairs]
        counts = [len(part.bodies) for part in parts]
        self.candidates = candidate_points.join(parts)
        self.slaves = contact_facets.join([pair.slave for pair in pairs])
        self.masters = contact_facets.join([pair.master for pair in pairs], sort=True)
        self.topology = contact_facets.topology(self.masters)
        self.pair_of_candidate = np.repeat(np.arange(len(pairs)), counts)
        self._first = np.concatenate([[0], np.cumsum(counts)])
        self._near, self._near_own = ([VerletList() for _ in pairs] for _ in range(2))
        self._cuts: tuple[int, ...] = ()  # (size + 1,): which candidates each rank has, empty where they are not shared out
        self._node = np.where((self.candidates.nodes >= 0).sum(axis=1) == 1, self.candidates.nodes[:, 0], -1)
        self._n_bodies = 1 + int(self.masters.bodies.max(initial=0))
        self.over_facets = 0.0
        self._known_part: tuple[tuple[int, int], tuple[Candidates, Facets]] = (0, -1), (self.candidates, self.slaves)
        self.identities = np.array(counts) * self._n_bodies * VALLEY

    def keep_in_common(self) -> None:
        """Have ranks of one machine keep what does not depend on positions once. All ranks must ask."""
        kept = vars(self)
        for name in ("candidates", "slaves", "masters", "topology", "known", "pair_of_candidate", "_node", "_alert_of_candidate"):
            kept[name] = held_in_common(getattr(self, name))
        self._known_part = (0, -1), (self.candidates, self.slaves)

    def at(self, x: FloatArray) -> tuple[Contacts, IntArray]:
        """Contacts at positions x (n_nodes, d) [m], and their pairs."""
        ranks = world()
        if ranks is not None and len(self._cuts) == ranks.size + 1 and type(self) is NodeToSegment and x.shape[1] == 3:
            return self.of_feet(self._by_ranks(ranks, x))
        now = self.configuration(x)
        return self.contacts(now, *self.search(now))

    def contacts(self, now: Configuration, candidate: IntArray, facet: IntArray) -> tuple[Contacts, IntArray]:
        """Contacts among the possible pairs, sorted by (pair, candidate, master body), and their pairs."""
        return self.of_feet(self.feet(now, candidate, facet))

    def feet(self, now: Configuration, candidate: IntArray, facet: IntArray) -> Feet:
        """The feet of the contacts among the possible pairs, sorted by `number`."""
        shared = (ranks := world()) is not None and len(candidate) >= SHARED_FROM
        nearest = self._of_ranks(ranks, now, candidate, facet) if shared and ranks is not None else self._nearest(now, candidate, facet)
        return self._once_per_place(now, self._truly(now, nearest))

    def _nearest(self, now: Configuration, candidate: IntArray, facet: IntArray) -> Feet:
        """The nearest foot of each candidate on each master body among the possible pairs, sorted by (candidate, body)."""
        return self._once_per_body(now, *self.plausible(now, candidate, facet))

    def _of_ranks(self, ranks: World, now: Configuration, candidate: IntArray, facet: IntArray) -> Feet:
        """`_nearest`, each rank of some candidates, which do not ask of one another, and gathered: candidates of possible pairs ascend."""
        starts = candidate[len(candidate) * np.arange(1, ranks.size) // ranks.size] if len(candidate) else np.zeros(ranks.size - 1, int)
        cuts = [0, *np.searchsorted(candidate, starts).tolist(), len(candidate)]
        own = slice(cuts[ranks.number], cuts[ranks.number + 1])
        with ranks.together("contacts"):
            found = self._nearest(now, candidate[own], facet[own])
        if kept_alike() and len(candidate):
            self._cuts = (0, *starts.tolist(), len(self.candidates.bodies))
        return _gathered(ranks, found, len(candidate))[0]

    def _by_ranks(self, ranks: World, x: FloatArray) -> Feet:
        """`feet` at positions x (n_nodes, 3), each rank of its own candidates, from where these are on."""
        begin, end = self._cuts[ranks.number : ranks.number + 2]
        master, count = contact_facets.geometry_by_ranks(self.masters, x), self._cuts[-1]
        point, outward, size = for_parts((count, 3), 0), np.empty((count, 3)), for_parts((count,), 0)
        with ranks.together("contacts"), alone():
            if self._known_part[0] != (begin, end):
                self._known_part = (begin, end), candidate_points.some(self.candidates, self.slaves, begin, end)
            point[begin:end], outward[begin:end], size[begin:end] = candidate_points.placed(*self._known_part[1], x)
            now = Configuration(point, outward, size, master, x)  # what follows for all ranks' feet does not ask for `outward`
            possible = self._sought(now, self._near_own, begin, end)
            found = self._nearest(now, *possible)
        nearest, pairs = _gathered(ranks, found, len(possible[0]))
        complete_rows(ranks, self._cuts, *(array for array in (point, size) if not in_common(array)))
        if pairs.max() * ranks.size > UNEVEN * pairs.sum():
            self._cuts = ()
        return self._once_per_place(now, self._truly(now, nearest))

    def of_feet(self, feet: Feet) -> tuple[Contacts, IntArray]:
        """The contacts of feet that are sorted by `number`, those of one number in a row, and their pairs."""
        return self._contacts(feet), self.pair_of_candidate[feet.candidate]

    def configuration(self, x: FloatArray) -> Configuration:
        """The candidates and facets at positions x (n_nodes, d) [m]."""
        return Configuration(*candidate_points.placed(self.candidates, self.slaves, x), contact_facets.geometry(self.masters, x), x)

    def search(self, now: Configuration) -> tuple[IntArray, IntArray]:
        """Possible pairs (candidate, facet)."""
        return self._sought(now, self._near, 0, len(self.candidates.bodies))

    def _sought(self, now: Configuration, near: list[VerletList], begin: int, end: int) -> tuple[IntArray, IntArray]:
        """The possible pairs of the candidates begin, ..., end - 1."""
        found = []
        for number, pair in enumerate(self.pairs):
            ours = slice(max(begin, self._first[number]), min(end, self._first[number + 1]))
            theirs = slice(self.masters.offsets[number], self.masters.offsets[number + 1])
            size = now.master.size[theirs]
            depth = np.minimum(size, now.size[ours].max(initial=0.0))
            reach = now.master.radius[theirs] + np.maximum(pair.alert, self.penetration * depth) + self.edge_tolerance * depth
            reach += self.over_facets
            candidate, facet = near[number](now.point[ours], now.master.centre[theirs], reach)
            found.append((candidate + ours.start, facet + theirs.start))
        candidate, facet = (np.concatenate(part) for part in zip(*found, strict=True))
        other = self.candidates.bodies[candidate] != self.masters.bodies[facet]
        return (candidate, facet) if other.all() else (candidate[other], facet[other])

    @cached_property
    def known(self) -> KnownFacets:
        """The facets of both surfaces, by bodies: few rules ever have a point so deep that it is asked where it came from."""
        return known_facets(self.slaves, self.masters)

    @cached_property
    def _alert_of_candidate(self) -> FloatArray:
        return np.array([pair.alert for pair in self.pairs])[self.pair_of_candidate]

    def _alert(self, candidate: IntArray) -> FloatArray:
        return self._alert_of_candidate[candidate]

    def plausible(self, now: Configuration, candidate: IntArray, facet: IntArray) -> tuple[IntArray, IntArray]:
        """Pairs that face each other with the point above or just beside the facet: few are left to project."""
        if now.point.shape[1] == 3:
            given = now.point, now.outward, np.ascontiguousarray(now.size), self._alert_of_candidate + self.over_facets, tuple(now.master)
            found: tuple[IntArray, IntArray]
            found = facing_above(candidate, facet, *given, OPPOSING, self.edge_tolerance, self.penetration)
            return found
        facing = np.einsum("nd,nd->n", now.outward[candidate], now.master.normal[facet]) < OPPOSING
        candidate, facet = candidate[facing], facet[facing]
        normal, size = now.master.normal[facet], np.minimum(now.size[candidate], now.master.size[facet])
        arm = now.point[candidate] - now.master.centre[facet]
        height = np.einsum("nd,nd->n", arm, normal)
        aside = np.sqrt(np.maximum(np.einsum("nd,nd->n", arm, arm) - height**2, 0.0))
        warp = np.abs(np.einsum("nd,nd->n", now.master.corners[facet, 0] - now.master.centre[facet], normal))
        alert, slack = self._alert(candidate) + self.over_facets, self.edge_tolerance * size
        keep = height <= alert + warp + slack
        keep &= height >= -self.penetration * size - warp - slack
        keep &= aside <= now.master.radius[facet] + alert + np.maximum(-height, 0.0) + 2 * slack
        return candidate[keep], facet[keep]

    def at_weights(self, now: Configuration, candidate: IntArray, facet: IntArray, weights: FloatArray, normal: FloatArray) -> Feet:
        """The feet (n,) at shape functions weights (n, k) of the facets, along unit normals (n, d)."""
        if now.point.shape[1] == 3:
            foot, gap, distance = feet_of_points(now.point, candidate, now.master.corners, facet, weights, normal)
        else:
            foot = np.einsum("nk,nkd->nd", weights, now.master.corners[facet])
            arm = now.point[candidate] - foot
            gap, distance = np.einsum("nd,nd->n", arm, normal), np.sqrt(np.einsum("nd,nd->n", arm, arm))
        scale = np.minimum(now.size[candidate], now.master.size[facet])
        return Feet(candidate, facet, weights, foot, normal, gap, distance, scale)

    def _once_per_body(self, now: Configuration, candidate: IntArray, facet: IntArray) -> Feet:
        """The nearest foot of each candidate on each master body, sorted by (candidate, body)."""
        triangle = self.masters.nodes[facet, -1] < 0
        weights, normal, inside = project_on_facets(now.point[candidate], now.master.corners[facet], triangle)
        feet = self.at_weights(now, candidate, facet, weights, normal)
        if not inside.all():
            on_edges = self._on_edges(now, feet.take(~inside))
            feet = Feet._make(np.concatenate(both) for both in zip(feet.take(inside), on_edges, strict=True))
        facing = np.einsum("nd,nd->n", now.outward[feet.candidate], feet.normal) < OPPOSING
        rows = np.flatnonzero(facing & self.within(feet))
        nearest = self._nearest_of(now, feet.candidate[rows], feet.facet[rows], feet.distance[rows])
        return feet.take(rows[nearest])

    def _on_edges(self, now: Configuration, feet: Feet) -> Feet:
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
        feet = self.at_weights(now, feet.candidate, feet.facet, found.weights, feet.normal)
        aside = point - feet.point - feet.gap[:, None] * feet.normal
        accepted = found.interior | (np.einsum("nd,nd->n", aside, aside) <= (tolerance + ROUND * feet.scale) ** 2)
        # the nearest edge decides: behind the outer boundary of a body are other edges, inside its surface
        rows = self._nearest_by_body(now, feet)
        rows = rows[accepted[rows]]
        feet, ridge, away = feet.take(rows), found.interior[rows], found.away[rows]
        if not ridge.any():
            return feet
        vertices = topology.vertex[feet.facet]
        mean = np.einsum("nk,nkd->nd", feet.weights, contact_facets.mean_normals(topology, now.master)[vertices])
        mean /= np.maximum(np.sqrt(np.einsum("nd,nd->n", mean, mean)), 1e-300)[:, None]
        length = np.sqrt(np.einsum("nd,nd->n", away, away))
        length[length <= 1e-6 * feet.scale] = np.inf  # too near: the direction is round-off
        side = np.where(np.einsum("nd,nd->n", away, mean) < 0.0, -1.0, 1.0)
        fan = np.where(np.isinf(length)[:, None], mean, (side / length)[:, None] * away)
        normal = np.where(ridge[:, None], fan, feet.normal)
        return feet._replace(normal=normal, gap=np.einsum("nd,nd->n", now.point[feet.candidate] - feet.point, normal))

    def _truly(self, now: Configuration, feet: Feet) -> Feet:
        """The feet without those of side faces that a candidate does not touch, see `false_sides`."""
        if not (feet.gap < -ROUND * feet.scale).any():
            return feet
        body, least = self.masters.bodies[feet.facet], ROUND * feet.scale
        drop = leaves_by_another_face(self._node[feet.candidate], body, feet.gap, feet.normal, now.master.centre[feet.facet], least)
        if (-feet.gap > DEEP * feet.scale).any():
            drop |= came_another_way(now.point[feet.candidate], body, feet.gap, feet.normal, feet.scale, self.known, now.positions)
        return feet.take(~drop) if drop.any() else feet

    def within(self, feet: Feet) -> BoolArray:
        """Whether gaps (n,) are those of contacts."""
        return (feet.gap <= self._alert(feet.candidate)) & (feet.gap >= -self.penetration * feet.scale)

    def number(self, feet: Feet) -> IntArray:
        """A number for each candidate and master body."""
        return feet.candidate * self._n_bodies + self.masters.bodies[feet.facet]

    def _nearest_by_body(self, now: Configuration, feet: Feet, last: BoolArray | None = None) -> IntArray:
        """Row of the nearest foot for each (candidate, body), sorted by these; of equal ones the first facet; those marked `last` only
        where there is no other."""
        return self._nearest_of(now, feet.candidate, feet.facet, feet.distance, last)

    def _nearest_of(
        self, now: Configuration, candidate: IntArray, facet: IntArray, distance: FloatArray, last: BoolArray | None = None
    ) -> IntArray:
        """`_nearest_by_body` of feet at those distances."""
        identity = candidate * self._n_bodies + self.masters.bodies[facet]
        rounded = np.round(distance / (ROUND * now.size[candidate]))
        order = np.lexsort((facet, rounded, identity) if last is None else (facet, rounded, last, identity))
        identity = identity[order]
        return order[np.append(True, identity[1:] != identity[:-1])[: len(order)]]

    def _once_per_place(self, now: Configuration, feet: Feet) -> Feet:
        """Leave one of the feet of a candidate that coincide on several bodies."""
        candidate = feet.candidate
        if not (candidate[1:] == candidate[:-1]).any():
            return feet
        size = now.size[candidate]
        order = np.lexsort((self.masters.bodies[feet.facet], np.round(feet.gap / (ROUND * size)), candidate))
        candidate, point, normal = candidate[order], feet.point[order], feet.normal[order]
        near = (2.0 + 1e-3) * self.edge_tolerance * feet.scale[order] + ROUND * size[order]
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

    def _contacts(self, feet: Feet) -> Contacts:
        candidate, number = feet.candidate, self.number(feet)
        first, pair = self._first * self._n_bodies, self.pair_of_candidate[candidate]
        again = 0 if np.all(number[1:] > number[:-1]) else np.arange(len(number)) - np.searchsorted(number, number)  # in a valley
        k, d = self.candidates.nodes.shape[1], feet.normal.shape[1]
        frame = for_parts((len(number), d, d), MADE_FROM)
        nodes, weights = (for_parts((len(number), k + self.masters.nodes.shape[1]), MADE_FROM, kind) for kind in (np.int64, np.float64))

        def make(begin: int, end: int) -> None:
            some = slice(begin, end)
            frame[some] = frames(feet.normal[some])
            nodes[some, :k], nodes[some, k:] = self.candidates.nodes[candidate[some]], self.masters.nodes[feet.facet[some]]
            weights[some, :k], weights[some, k:] = self.candidates.weights[candidate[some]], -feet.weights[some]

        in_parts_of_common("contacts", len(number), make, frame, nodes, weights)
        return Contacts(
            point=feet.point,
            frame=frame,
            gap=feet.gap,
            mu=np.array([pair.mu for pair in self.pairs])[pair],
            nodes=nodes,
            weights=weights,
            bodies=np.stack([self.candidates.bodies[candidate], self.masters.bodies[feet.facet]], axis=1),
            identity=number - first[pair] + again * np.diff(first)[pair],
        )


def _gathered(ranks: World, found: Feet, number: int) -> tuple[Feet, IntArray]:
    """The feet that the ranks have found, in their order, and every rank's number."""
    counts, numbers = ranks.gathered(np.array([len(found.candidate), number]), [2] * ranks.size).reshape(-1, 2).T
    ends, every = [0, *np.cumsum(counts).tolist()], []
    for array in found:
        whole = for_parts((ends[-1], *array.shape[1:]), 0, array.dtype)
        whole[ends[ranks.number] : ends[ranks.number + 1]] = array
        every.append(whole)
    complete_rows(ranks, ends, *every)
    return Feet._make(every), numbers
