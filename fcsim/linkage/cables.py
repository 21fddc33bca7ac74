"""Detections that know of links: cables as contacts that pull, and bodies whose contact a link stands for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import CABLES, Contacts, join
from fcsim.contact_detection.detection import Around, Detection
from fcsim.contact_detection.frames import frames
from fcsim.errors import MODEL, InputError, expect
from fcsim.linkage.linkage import Linkage
from fcsim.linkage.links import Cable
from fcsim.linkage.rows import Jointed

_BODIES = 1 << 31  # more than there are


@dataclass(frozen=True)
class WithCables(Around):
    """A detection and the cables of a linkage: 0 <= length - |p_1 - p_2| ⊥ r_N >= 0, without friction.

    N points from the first end to the second, so that r_N > 0 draws them together. Laws that ask for the area of contacts do not take
    cables.
    """

    linkage: Linkage

    @property
    def nodes(self) -> IntArray:
        return np.union1d(self.detection.nodes, self.linkage.nodes)

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        found = self.detection(positions, displacement)
        return join([found, self._contacts(positions)]) if self.linkage.cables else found

    @cached_property
    def _cables(self) -> _Cables:
        pieces, number = self.linkage.cables, self.linkage.model.number
        count = np.array([piece.weights.nnz for piece in pieces])
        nodes = np.full((len(pieces), count.max()), -1, dtype=np.int64)
        weights = np.zeros(nodes.shape)
        own = np.arange(nodes.shape[1]) < count[:, None]
        ends = vstack([piece.weights for piece in pieces], format="csr")
        of_end = np.repeat(np.arange(ends.shape[0]), np.diff(ends.indptr))
        nodes[own], weights[own] = ends.indices, np.where(of_end % 2 == 0, ends.data, -ends.data)
        named = [[None if body is None else number[body] for body in _bodies(piece.link)] for piece in pieces]
        bodies = [(0 if first is None else first, second) for first, second in named]
        return _Cables(
            ends,
            np.concatenate([piece.ground for piece in pieces]),
            np.array([piece.rest for piece in pieces]),
            nodes,
            weights,
            np.array([(first, first if second is None else second) for first, second in bodies]),
        )

    def _contacts(self, positions: FloatArray) -> Contacts:
        """The cables at positions (n_nodes, d) [m], open ones too."""
        cables = self._cables
        ends = (cables.ends @ positions + cables.ground).reshape(len(cables.rest), 2, -1)
        arm = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(arm, axis=1)
        normal = np.where(length[:, None] > 0, arm, np.eye(arm.shape[1])[0]) / np.where(length > 0, length, 1.0)[:, None]
        return Contacts(
            point=ends[:, 1],
            frame=frames(normal),
            gap=cables.rest - length,
            mu=np.zeros(len(length)),
            nodes=cables.nodes,
            weights=cables.weights,
            bodies=cables.bodies,
            identity=CABLES + np.arange(len(length)),
        )


class _Cables(NamedTuple):
    """What cables are in every configuration: ends (2 nc, n_nodes), the first and the second of each as weights of nodes, ground
    (2 nc, d) [m] where they stand still; rest (nc,) [m]; nodes, weights (nc, k) and bodies (nc, 2) of `Contacts`."""

    ends: csr_array
    ground: FloatArray
    rest: FloatArray
    nodes: IntArray
    weights: FloatArray
    bodies: IntArray


def _bodies(link: Jointed) -> tuple[str | None, str | None]:
    assert isinstance(link, Cable)
    return link.first, link.second


@dataclass(frozen=True)
class _Without(Around):
    pairs: frozenset[tuple[int, int]]

    @property
    def left_out(self) -> IntArray:
        return np.array(sorted(self.pairs), dtype=np.int64).reshape(-1, 2)

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        found = self.detection(positions, displacement)
        own, dropped = (bodies[:, 0] * _BODIES + bodies[:, 1] for bodies in (np.sort(found.bodies, axis=1), self.left_out))
        return found.take(~np.isin(own, dropped))


def without_contact_of(detection: Detection, model: Model, pairs: Iterable[tuple[str, str]]) -> Detection:
    """The detection without contacts between these pairs of bodies (names): links that hold them stand for what happens there.

    The witness does not measure their overlap either.
    """
    expect(model, Model, "without_contact_of, model", MODEL)
    numbers = set()
    for one, other in pairs:
        a, b = model.body_number(one), model.body_number(other)
        if a == b:
            raise InputError(f"without_contact_of: expected pairs of two bodies, got {one!r} twice")
        numbers.add((min(a, b), max(a, b)))
    return _Without(detection, frozenset(numbers))
