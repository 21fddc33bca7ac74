"""Detection: from positions to contacts, for all surface pairs at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import brief, shown
from fcsim.contact_detection.concave.valleys import InValleys
from fcsim.contact_detection.contacts import Contacts, join
from fcsim.contact_detection.integral.mortar import FaceMortar, Mortar
from fcsim.contact_detection.integral.segment_points import SegmentPoints
from fcsim.contact_detection.node_to_segment import NodeToSegment
from fcsim.contact_detection.smoothed_normals import SmoothedNodeToSegment
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.surface import SurfacePair
from fcsim.contact_detection.sweep import samples, with_swept
from fcsim.errors import InputError, expect

Method = NodeToSegment | Mortar | SegmentPoints


def method_of(pair: SurfacePair) -> type[Method]:
    """The class that detects the contacts of a pair."""
    integral: dict[str, type[Method]] = {"mortar": Mortar, "mortar-faces": FaceMortar, "segments": SegmentPoints}
    if pair.candidates in integral:
        return integral[pair.candidates]
    return SmoothedNodeToSegment if pair.normals == "smooth" else NodeToSegment


@dataclass(frozen=True, eq=False)
class Detector:
    """Contact detection between the surfaces of `pairs`, in a model of n_nodes nodes.

    What does not depend on positions is computed here once. `detector(positions)` returns the Contacts at positions (n_nodes, d) [m],
    sorted by pair. Pairs with candidates "nodes", "faces" or "gauss" are node-to-segment (3D: node-to-facet), sorted by (candidate,
    master body):

    * A candidate has at most one contact per master body: its nearest foot on facets that face it. A foot outside a facet by
      less than edge_tolerance (relative to the smaller of the two facets' sizes), beyond the outer boundary, is moved onto it; farther
      out there is no contact.
    * On an edge or vertex shared by facets, above a convex one (or below a concave one), the normal is along the line to the
      candidate; where they coincide it is the mean of the facets' normals.
    * Feet on several bodies that coincide, with parallel normals (a node above the joint of two blocks), are one contact: the
      smallest gap, then the lowest body number. Feet count as one within twice the distance that edge_tolerance allows.
    * Contacts are kept while -penetration * size <= gap <= alert, size the square root (2D: itself) of the smaller of the
      two facets: deeper is another side of the body.

    With normals "smooth" the second rule does not apply: the foot is along the interpolated normal, which is continuous (see
    `smoothed_normals`). Pairs with candidates "mortar", "mortar-faces" or "segments" are integrated over the overlaps of the two
    surfaces: see `mortar` and `segment_points`.

    InputError: no pairs, 2D with 3D, the same pair twice, node numbers not below n_nodes, positions of wrong shape or not finite,
    facets without area.
    """

    pairs: Sequence[SurfacePair]
    n_nodes: int
    edge_tolerance: float = 1e-2
    penetration: float = 0.5
    methods: tuple[Method | InValleys, ...] = field(init=False, repr=False)
    numbers: tuple[IntArray, ...] = field(init=False, repr=False)
    first_identity: IntArray = field(init=False, repr=False)

    __repr__ = brief

    def __post_init__(self) -> None:
        expect(self.pairs, Iterable, "Detector, pairs", "surface pairs in a list, [SurfacePair(...), ...]")
        pairs = tuple(self.pairs)
        for pair in pairs:
            expect(pair, SurfacePair, "Detector, pairs", "SurfacePair(...) and nothing else")
        if not pairs or len({pair.slave.dimension for pair in pairs}) > 1:
            raise InputError(f"Detector: expected one or more surface pairs, all 2D or all 3D, got {len(pairs)} pairs")
        if not is_number(self.n_nodes):
            raise InputError(f"Detector, n_nodes: expected the number of the model's nodes, model.n_nodes, got {shown(self.n_nodes)}")
        for pair in pairs:
            for role, surface in (("slave", pair.slave), ("master", pair.master)):
                if surface.facets.max(initial=-1) >= self.n_nodes:
                    raise InputError(
                        f"Detector, pair {pair.name!r}, {role}: expected node numbers below n_nodes = {self.n_nodes}, "
                        f"got {surface.facets.max()}"
                    )
        _refuse_twice(pairs)
        for name in ("edge_tolerance", "penetration"):
            if not (is_number(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"Detector, {name}: expected a number >= 0, relative to the facet size, got {shown(getattr(self, name))}")
        wanted = [method_of(pair) for pair in pairs]
        methods, numbers, identities = [], [], np.zeros(len(pairs), dtype=np.int64)
        for method in dict.fromkeys(wanted):
            numbers.append(np.array([k for k, its in enumerate(wanted) if its is method]))
            methods.append(method([pairs[k] for k in numbers[-1]], self.edge_tolerance, self.penetration))
            identities[numbers[-1]] = methods[-1].identities
        first = np.concatenate([[0], np.cumsum(identities)[:-1]])
        values = {"pairs": pairs, "methods": tuple(methods), "numbers": tuple(numbers), "first_identity": first}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @cached_property
    def in_valleys(self) -> Detector | None:
        """The same detector with a contact for each facet of a valley that a point is in, see `valleys`; None where no pair has facets'
        own normals. Of identities both give the same contact the same one."""
        if all(type(method) is not NodeToSegment for method in self.methods):
            return None
        with_valleys = tuple(InValleys(method) if type(method) is NodeToSegment else method for method in self.methods)
        other = copy(self)
        object.__setattr__(other, "methods", with_valleys)
        return other

    def keep_in_common(self) -> None:
        """Have ranks of one machine keep what does not depend on positions once. All ranks must ask."""
        for method in self.methods:
            if isinstance(method, NodeToSegment):
                method.keep_in_common()

    @property
    def dimension(self) -> int:
        return self.pairs[0].slave.dimension

    @cached_property
    def nodes(self) -> IntArray:
        """Sorted numbers of the nodes that contacts can touch."""
        touched = np.unique(np.concatenate([surface.facets.ravel() for pair in self.pairs for surface in (pair.slave, pair.master)]))
        return touched[touched >= 0]

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        """Contacts at `positions` (n_nodes, d) [m].

        displacement (n_nodes, d) [m]: of the step to come, see `Detection`. Surfaces that approach each other by more than half the
        penetration window are looked at as often along their way as leaves less between two looks (see `sweep`).
        """
        x = self._checked(positions)
        now = self._at(x)
        if displacement is None:
            return now
        way = self._checked(displacement)
        if not (count := self._looks(x, way)):
            return now
        times, alert = np.arange(1, count + 1) / count, max(pair.alert for pair in self.pairs)
        return with_swept(now, lambda t: self._at(x + t * way), x, way, times, alert, self._body_of)

    @cached_property
    def _body_of(self) -> IntArray:
        """The body (n_nodes,) of each node that contacts can touch, -1 of others."""
        found = np.full(self.n_nodes, -1)
        for surface in (surface for pair in self.pairs for surface in (pair.slave, pair.master)):
            row, column = np.nonzero(surface.facets >= 0)
            found[surface.facets[row, column]] = surface.bodies[row]
        return found

    @cached_property
    def _nodes_of_pairs(self) -> list[tuple[IntArray, ...]]:
        """Nodes of slave and master."""
        return [tuple(np.unique(s.facets[s.facets >= 0]) for s in (pair.slave, pair.master)) for pair in self.pairs]

    def _looks(self, x: FloatArray, way: FloatArray) -> int:
        """How often to look along the way: 0 where no pair of surfaces that may meet moves by more than its alert distance."""
        count, fastest = 0, float(np.abs(way).max(initial=0.0))
        if 2 * np.sqrt(self.dimension) * fastest <= (1 - 1e-6) * min(pair.alert for pair in self.pairs):
            return 0  # nothing moves as far
        for pair, nodes in zip(self.pairs, self._nodes_of_pairs, strict=True):
            if not all(map(len, nodes)):
                continue
            slave, master = (_bounds(way[k]) for k in nodes)
            motion = np.maximum(slave[1] - master[0], master[1] - slave[0])
            distance = float(np.sqrt(motion @ motion))
            if distance <= pair.alert:
                continue
            slave, master = (_bounds(np.concatenate([x[k], x[k] + way[k]])) for k in nodes)
            if np.any(slave[0] > master[1] + pair.alert) or np.any(master[0] > slave[1] + pair.alert):
                continue
            size = min(float(contact_facets.geometry(contact_facets.join([s]), x).size.min()) for s in (pair.slave, pair.master))
            count = max(count, samples(distance, max(0.5 * self.penetration * size, pair.alert)))
        return count

    def _at(self, x: FloatArray) -> Contacts:
        found, pair_of_contact = [], []
        for method, numbers in zip(self.methods, self.numbers, strict=True):
            contacts, pair = method.at(x)
            pair_of_contact.append(numbers[pair])
            found.append(replace(contacts, identity=contacts.identity + self.first_identity[numbers[pair]]))
        if len(found) == 1 and not isinstance(self.methods[0], InValleys):
            return found[0]
        together = join(found)
        return together.take(np.lexsort((together.identity, np.concatenate(pair_of_contact))))

    def _checked(self, positions: FloatArray) -> FloatArray:
        x = np.asarray(positions, dtype=np.float64)
        if x.shape != (self.n_nodes, self.dimension):
            raise InputError(f"Detector, positions: expected shape {(self.n_nodes, self.dimension)}, got {x.shape}")
        if not np.isfinite(x).all():
            raise InputError("Detector, positions: expected finite numbers, got NaN or infinity")
        return x


def _refuse_twice(pairs: Sequence[SurfacePair]) -> None:
    """InputError where two pairs have the same surfaces and candidates: each contact would be there twice, its springs too."""
    seen: dict[tuple[object, ...], int] = {}
    for k, pair in enumerate(pairs):
        facets = (np.sort(surface.facets, axis=1) for surface in (pair.slave, pair.master))
        key = (*(array[np.lexsort(array.T)].tobytes() for array in facets), pair.candidates)
        if (first := seen.setdefault(key, k)) != k:
            raise InputError(
                f"Detector: expected each pair of surfaces once, got {pairs[first].name!r} (pair {first}) again as pair {k}: every "
                "contact would be there twice"
            )


def _bounds(points: FloatArray) -> FloatArray:
    """Lowest and highest coordinates (2, d)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])
