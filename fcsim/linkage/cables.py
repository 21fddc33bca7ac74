"""Detections that know of links: cables as contacts that pull, and bodies whose contact a link stands for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import CABLES, Contacts, join
from fcsim.contact_detection.detection import Detection
from fcsim.contact_detection.frames import frames
from fcsim.errors import MODEL, InputError, expect
from fcsim.linkage.linkage import Linkage
from fcsim.linkage.links import Cable


@dataclass(frozen=True)
class WithCables:
    """A detection and the cables of a linkage: 0 <= length - |p_1 - p_2| ⊥ r_N >= 0, without friction.

    N points from the first end to the second, so that r_N > 0 draws them together. Laws that ask for the area of contacts do not take
    cables.
    """

    detection: Detection
    linkage: Linkage

    @property
    def n_nodes(self) -> int:
        return self.detection.n_nodes

    @property
    def nodes(self) -> IntArray:
        return np.union1d(self.detection.nodes, self.linkage.nodes)

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        found = self.detection(positions, displacement)
        cables = [self._contact(k, positions) for k in range(len(self.linkage.cables))]
        return join([found, *cables])

    def _contact(self, k: int, positions: FloatArray) -> Contacts:
        piece, model = self.linkage.cables[k], self.linkage.model
        ends = piece.weights @ positions + piece.ground
        arm = ends[1] - ends[0]
        length = float(np.linalg.norm(arm))
        normal = arm / length if length > 0 else np.eye(len(arm))[0]
        W = piece.weights.tocoo()
        row, node = W.coords
        assert isinstance(piece.link, Cable)
        first, second = (None if body is None else model.number[body] for body in (piece.link.first, piece.link.second))
        slave = 0 if first is None else first
        return Contacts(
            point=ends[1:],
            frame=frames(normal[None]),
            gap=np.array([piece.rest - length]),
            mu=np.zeros(1),
            nodes=np.asarray(node, dtype=np.int64)[None],
            weights=np.where(row == 0, W.data, -W.data)[None],
            bodies=np.array([[slave, slave if second is None else second]]),
            identity=np.array([CABLES + k]),
        )


@dataclass(frozen=True)
class _Without:
    detection: Detection
    pairs: frozenset[tuple[int, int]]

    @property
    def n_nodes(self) -> int:
        return self.detection.n_nodes

    @property
    def nodes(self) -> IntArray:
        return self.detection.nodes

    @property
    def left_out(self) -> IntArray:
        return np.array(sorted(self.pairs), dtype=np.int64).reshape(-1, 2)

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        found = self.detection(positions, displacement)
        low, high = found.bodies.min(axis=1, initial=1 << 30), found.bodies.max(axis=1, initial=-1)
        dropped = np.zeros(len(found), dtype=bool)
        for a, b in self.pairs:
            dropped |= (low == a) & (high == b)
        return found.take(~dropped)


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
