"""What laws ask of the bodies beside their contacts: sizes, round-off, and the area that a contact stands for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.brief import brief
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_law.areas.flat_faces import Patches, patches_of_flat_faces
from fcsim.contact_law.areas.overlaps import areas_of_overlaps
from fcsim.contact_law.areas.points_within import areas_of_flat_faces
from fcsim.errors import InputError
from fcsim.mesh.part import Body, RigidBody

FLAT = 1e-3
"""Below this share of the largest a principal extent is none: a floor that is one facet has the size of what lies on it."""
ROUND_OFF = 16 * np.finfo(np.float64).eps
"""Of positions, relative to the largest coordinate."""


AT_A_NODE = 0.98
"""The master's weight from which on a contact is where two nodes meet."""


@dataclass(frozen=True, eq=False)
class Proportions:
    """Of a model's bodies.

    size      (nbodies,) [m] the smallest of a body's extents along its principal axes that is not flat, an exact shape's own; inf: planes
    facets    (nf, k) node numbers of all named surfaces, each facet once, -1 = none
    thickness (nbodies,) [m] of deformable bodies in 2D; nan: rigid ones, which have none of their own, and in 3D
    rigid     (nbodies,) whether a body is
    reference (n_nodes, d) [m] of the nodes, and first (nbodies,) node of each body
    both_ways whether either body's nodes have contacts wherever they are near the other one: those without have what is open
    """

    size: FloatArray
    facets: IntArray
    thickness: FloatArray
    rigid: BoolArray
    reference: FloatArray
    first: IntArray
    both_ways: bool = False
    _latest: list[tuple[Contacts, FloatArray, FloatArray]] = field(init=False, repr=False, default_factory=list)

    __repr__ = brief

    def size_at(self, contacts: Contacts) -> FloatArray:
        """Size (nc,) [m] of the smaller of the two bodies."""
        return self.size[contacts.bodies].min(axis=1)

    def between_rigid(self, contacts: Contacts) -> BoolArray:
        """Whether both bodies are rigid (nc,)."""
        return self.rigid[contacts.bodies].all(axis=1)

    def round_off_at(self, contacts: Contacts) -> FloatArray:
        """Round-off (nc,) [m] of the gaps."""
        return ROUND_OFF * np.abs(contacts.point).max(axis=1, initial=0.0)

    def rotations(self, positions: FloatArray) -> FloatArray:
        """R (nbodies, d, d) that leaves the least of x - c - R (X - C) of a body's nodes, at positions x (n_nodes, d) [m]; of rigid bodies
        theirs. The unit matrix where all nodes of a body in space are on one line.

        Source: W. Kabsch, "A discussion of the solution for the best rotation to relate two sets of vectors", Acta Cryst. A34, 1978.
        """
        count = np.diff(np.append(self.first, len(positions)))
        moved, still = (x - np.repeat(np.add.reduceat(x, self.first) / count[:, None], count, axis=0) for x in (positions, self.reference))
        left, size, right = np.linalg.svd(np.add.reduceat(moved[:, :, None] * still[:, None, :], self.first))
        left[:, :, -1] *= np.sign(np.linalg.det(left @ right))[:, None]
        on_a_line = size[:, -2] <= FLAT**2 * size[:, 0]
        return np.where(on_a_line[:, None, None], np.eye(positions.shape[1]), left @ right)

    def area_at(self, contacts: Contacts, positions: FloatArray) -> FloatArray:
        """Area (nc,) [m^2] that each contact stands for, at positions (n_nodes, d) [m]; its sum over a joint is the joint's area, that of
        the overlap of both bodies' facets, see `fcsim.contact_law.areas.overlaps`. In 2D areas are lengths times the thickness that both
        bodies share: the smaller of two, the deformable one's beside a rigid body, 1 between rigid ones. Points of "segments" have that of
        their rule, with the overlap's second moments, too.

        Where no facets overlap (a body on its edge), and where a body folds on itself: A_k = sum over the facets at node k of n area /
        (nodes of the facet), S_k = sum_b w_bk N_b over the contacts b with the weight w_bk > 0 on k; area_a = sum_k w_ak (-A_k . N_a) /
        (S_k . N_a): a node's area towards N_a, shared by its contacts of that side.
        """
        for known, place, area in self._latest:  # loops within a step ask again for the same contacts
            if np.array_equal(place, positions) and all(
                np.array_equal(getattr(known, name), getattr(contacts, name))
                for name in ("identity", "nodes", "weights", "frame", "bodies")
            ):
                return area
        given = _given(contacts)
        area = np.zeros(len(contacts)) if contacts.area is None else contacts.area * self._shared_thickness(contacts)
        within = contacts.within_faces
        rest = ~given & ~within
        found = self._area_at(contacts if rest.all() else contacts.take(rest), contacts.identity[within], positions)
        area[rest], area[within] = found
        area.setflags(write=False)
        self._latest[:] = [(contacts, positions.copy(), area)]
        return area

    def _area_at(self, contacts: Contacts, within: IntArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The areas, worked out, and those of points within faces of that identity (k,)."""
        nc, d = len(contacts), contacts.dimension
        if not nc:
            return np.zeros(0), np.zeros(len(within))
        normal = contacts.frame[:, 0]
        weight = np.where(contacts.nodes >= 0, np.maximum(contacts.weights, 0.0), 0.0)
        row, column = np.nonzero(weight)
        node, w = contacts.nodes[row, column], weight[row, column]
        outward = self._nodal_areas(positions)
        towards = np.zeros((len(positions), d))
        np.add.at(towards, node, w[:, None] * normal[row])
        share = -np.einsum("ei,ei->e", outward[node], normal[row]) / np.einsum("ei,ei->e", towards[node], normal[row])
        thickness = self._shared_thickness(contacts)
        area = np.bincount(row, w * share, minlength=nc) * thickness
        if not np.all(area > 0):
            bad = int(np.argmin(area))
            raise InputError(
                f"contact law: expected a slave surface of named facets at every contact, to know its area; contact {bad} of the bodies "
                f"{tuple(contacts.bodies[bad].tolist())} at {contacts.point[bad].tolist()} m has none"
            )
        met = np.einsum("ai,ai->a", outward[(k := _met_node(contacts))], normal) * thickness
        area, of_points = self._of_two_bodies(contacts, within, _of_two_passes(contacts, area, met, k) / thickness, positions)
        return area * thickness, of_points

    def _of_two_bodies(
        self, contacts: Contacts, within: IntArray, area: FloatArray, positions: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Areas (nc,) [m^2; 2D: m] by the overlaps of the two bodies' facets; `area` where there are none, and of bodies that fold. And
        those of points within faces (k,)."""
        one_way, back = _codes(contacts)
        chosen = one_way != back
        if not chosen.any() or not len(self.facets):
            return area, np.zeros(len(within))
        shares = np.zeros(len(contacts), dtype=bool) if contacts.area is None else contacts.area == 0
        flat, of_points = areas_of_flat_faces(self.flat_patches(contacts, chosen, positions), len(contacts), shares, within)
        if (chosen := chosen & np.isnan(flat)).any():
            slaves = np.unique(one_way[(one_way != back) & ~_crossing(contacts)])
            given = self._weights(contacts), slaves, area, positions, self.facets, self._facet_bodies
            area = areas_of_overlaps(contacts, chosen, *given)
        return np.where(np.isnan(flat), area, flat), of_points

    def flat_patches(self, contacts: Contacts, chosen: BoolArray, positions: FloatArray) -> Patches | None:
        """Where flat faces of rigid bodies meet at the chosen contacts (nc,), see `fcsim.contact_law.areas.flat_faces`."""
        one_way, back = _codes(contacts)
        chosen = chosen & (one_way != back)
        slaves = None if self.both_ways else np.unique(one_way[chosen & ~_crossing(contacts)])
        given = self._weights(contacts), slaves, positions, self.facets, self._facet_bodies
        return patches_of_flat_faces(contacts, chosen & self.between_rigid(contacts), *given)

    def _weights(self, contacts: Contacts) -> FloatArray:
        """Weights (nc, k) >= 0 with which contacts have their nodes' areas."""
        one_way, back = _codes(contacts)
        weights = np.where(_crossing(contacts)[:, None], np.abs(contacts.weights), np.maximum(contacts.weights, 0.0))
        node, n = _met_node(contacts), len(self.reference)
        row, column = np.nonzero((contacts.nodes >= 0) & (contacts.weights > 0))
        own = np.isin(back * n + node, one_way[row] * n + contacts.nodes[row, column])
        met = np.flatnonzero((contacts.weights.min(axis=1) < -AT_A_NODE) & ~own)
        weights[met, np.argmin(contacts.weights[met], axis=1)] = 1.0
        weights[contacts.nodes < 0] = 0.0
        return np.asarray(weights)

    @cached_property
    def _facet_bodies(self) -> IntArray:
        return np.asarray(np.searchsorted(self.first, self.facets[:, 0], side="right") - 1)

    def _shared_thickness(self, contacts: Contacts) -> FloatArray:
        """(nc,) [m]; 1 in 3D."""
        shared = np.fmin(*self.thickness[contacts.bodies].T)
        return np.where(np.isnan(shared), 1.0, shared)

    def _nodal_areas(self, positions: FloatArray) -> FloatArray:
        """Vectors A_k (n_nodes, d) [m^2] outwards; in 2D of the thickness 1."""
        d = positions.shape[1]
        areas = np.zeros((len(positions), d))
        if not len(self.facets):  # bodies of exact shape alone
            return areas
        if d == 2:
            tangent = positions[self.facets[:, 1]] - positions[self.facets[:, 0]]
            vector = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
        else:  # half the cross product of the diagonals; of a triangle a, b, c with d = a: (c - a) x (a - b)
            a, b, c = (positions[self.facets[:, i]] for i in range(3))
            last = positions[np.where(self.facets[:, 3] < 0, self.facets[:, 0], self.facets[:, 3])] if self.facets.shape[1] == 4 else a
            vector = 0.5 * np.cross(c - a, last - b)
        real = self.facets >= 0
        for corner in range(self.facets.shape[1]):
            own = real[:, corner]
            np.add.at(areas, self.facets[own, corner], (vector / real.sum(axis=1)[:, None])[own])
        return areas


def _given(contacts: Contacts) -> BoolArray:
    """Which (nc,) have the area of their rule: not where both bodies are slaves of each other, and share it."""
    if contacts.area is None:
        return np.zeros(len(contacts), dtype=bool)
    one_way, back = _codes(contacts)
    return np.asarray((contacts.area > 0) & ~contacts.within_faces & ~np.isin(one_way, back))


def _met_node(contacts: Contacts) -> IntArray:
    """The node (nc,) of the master with the greatest share in each contact."""
    return contacts.nodes[np.arange(len(contacts)), np.argmin(contacts.weights, axis=1)]


def _codes(contacts: Contacts) -> tuple[IntArray, IntArray]:
    """Numbers (nc,) of the two bodies in their order, and in the other one."""
    count = 1 + int(contacts.bodies.max())
    return contacts.bodies[:, 0] * count + contacts.bodies[:, 1], contacts.bodies[:, 1] * count + contacts.bodies[:, 0]


def _crossing(contacts: Contacts) -> BoolArray:
    """Which contacts (nc,) are of two edges: they are of either body alike."""
    crossing: BoolArray = (contacts.dimension == 3) & (np.count_nonzero(contacts.weights > 0, axis=1) == 2)
    return crossing


def _of_two_passes(contacts: Contacts, area: FloatArray, met: FloatArray, node: IntArray) -> FloatArray:
    """Areas (nc,) where two bodies are slaves of each other: half of `area`, that of either's nodes, so that all are the joint's together.

    A contact where two nodes meet, which only one pass has, stands for both: met (nc,) is the area of the master's `node`. Nodes near the
    rim of the other body stand for what overhangs it, or are missing, by a part of a facet: the body with more of them tells the area of
    the joint, to which all its areas are scaled. Of as many it is the mean of both.
    """
    one_way, back = _codes(contacts)
    two = np.isin(back, one_way)
    if not two.any():
        return area
    own = np.unique(contacts.nodes[(contacts.nodes >= 0) & (contacts.weights > 0)])
    merged = two & (contacts.weights.min(axis=1) < -AT_A_NODE) & (met > 0) & ~np.isin(node, own)
    _, which, of_node = np.unique(node, return_inverse=True, return_counts=True)
    other = np.where(merged, met / of_node[which], 0.0)
    codes, place = np.unique(np.concatenate([one_way, back]), return_inverse=True)
    n = len(area)
    there, here = place[n:], place[:n]
    total = np.bincount(place, np.concatenate([area, other]), len(codes))
    nodes = np.bincount(place, np.concatenate([~_crossing(contacts), merged]), len(codes))
    mean = 0.5 * (total[here] + total[there])
    joint = np.where(nodes[here] > nodes[there], total[here], np.where(nodes[here] < nodes[there], total[there], mean))
    scale = np.where(np.abs(joint - mean) > 1e-9 * mean, joint / mean, 1.0)
    return np.where(two, 0.5 * (area + other) * scale, area)


def proportions(model: Model, both_ways: bool = False) -> Proportions:
    """Return the proportions of a model's bodies; both_ways: see `Proportions`."""
    size = np.array([_size_of(body) for body in model.bodies])
    facets: list[IntArray] = []
    for body, first in zip(model.bodies, model.node_offset, strict=False):
        own = _different(body.surfaces.values())
        facets.append(np.where(own >= 0, own + first, -1))
    width = max((array.shape[1] for array in facets), default=2)
    padded = [np.pad(array, ((0, 0), (0, width - array.shape[1])), constant_values=-1) for array in facets]
    rigid = np.array([not isinstance(body, Body) for body in model.bodies])
    thickness = np.array([np.nan if not isinstance(body, Body) or model.dimension == 3 else body.part.thickness for body in model.bodies])
    return Proportions(
        size, np.concatenate(padded), thickness, rigid, model.reference, np.asarray(model.node_offset[: len(rigid)]), both_ways
    )


def _size_of(body: Body | RigidBody) -> float:
    """The points of an exact shape are its centre and one along each axis: they say nothing of its extent."""
    shape = None if isinstance(body, Body) else body.shape
    return _size(body.points) if shape is None else float(shape.size)


def _size(points: FloatArray) -> float:
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    extents = np.ptp(centred @ axes, axis=0)
    largest = float(extents.max(initial=0.0))
    return float(extents[extents > FLAT * largest].min()) if largest else 0.0


def _different(surfaces: Iterable[IntArray]) -> IntArray:
    """The facets of all surfaces, each once, as one array (nf, k)."""
    arrays = [np.asarray(surface, dtype=np.int64) for surface in surfaces]
    width = max((array.shape[1] for array in arrays), default=2)
    if not arrays:
        return np.empty((0, width), dtype=np.int64)
    stacked = np.concatenate([np.pad(array, ((0, 0), (0, width - array.shape[1])), constant_values=-1) for array in arrays])
    _, first = np.unique(np.sort(stacked, axis=1), axis=0, return_index=True)
    return stacked[np.sort(first)]
